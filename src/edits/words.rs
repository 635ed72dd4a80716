//! The words of a script's line. They are split at white space, stand in quotation marks where they hold any, and are asked for by the name before them.

use crate::flight::format::{excerpt, is_decimal};

/// One line's words, unquoted; `Err` says what is wrong.
pub(super) fn split(line: &str) -> Result<Vec<String>, String> {
    let mut words = Vec::new();
    let mut rest = line.trim_matches([' ', '\t']);
    while !rest.is_empty() {
        let (word, after) = match rest.strip_prefix('"') {
            Some(quoted) => {
                let (word, after) =
                    quoted.split_once('"').ok_or("a quotation mark is open; close the name with another")?;
                if !after.is_empty() && !after.starts_with([' ', '\t']) {
                    return Err("a quoted name ends within a word; put a space behind it".into());
                }
                (word, after)
            }
            None => rest.split_at(rest.find([' ', '\t']).unwrap_or(rest.len())),
        };
        words.push(word.to_owned());
        rest = after.trim_start_matches([' ', '\t']);
    }
    Ok(words)
}

/// A name as a word, quoted where it must be; `None` where no word can be it.
pub(super) fn quoted(name: &str) -> Option<String> {
    if name.contains(['"', '\n', '\r']) {
        return None;
    }
    let is_plain = !name.is_empty() && !name.contains([' ', '\t']) && !name.starts_with('#');
    Some(if is_plain { name.to_owned() } else { format!("\"{name}\"") })
}

/// A decimal as the format has it.
pub(super) fn number(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(value) if is_decimal(word) && value.is_finite() => Ok(value),
        Ok(value) if is_decimal(word) && !value.is_finite() => {
            Err(format!("{} is too large a number", excerpt(word)))
        }
        _ => Err(format!("{} is not a number; write a decimal such as 12.5 or -3e4", excerpt(word))),
    }
}

/// A whole number.
pub(super) fn whole<T: std::str::FromStr>(word: &str) -> Result<T, String> {
    let digits = word.strip_prefix('-').unwrap_or(word);
    let is_whole = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    let value = if is_whole { word.parse().ok() } else { None };
    value.ok_or_else(|| format!("{} is not a whole number that can stand here", excerpt(word)))
}

/// `N` values of a word, separated by commas; `example` is what it should look like.
pub(super) fn list<const N: usize, T: Copy + Default>(
    word: &str,
    example: &str,
    one: impl Fn(&str) -> Result<T, String>,
) -> Result<[T; N], String> {
    let mut values = [T::default(); N];
    let mut parts = word.split(',');
    for value in &mut values {
        let part = parts.next().ok_or_else(|| format!("{} is not such as {example}", excerpt(word)))?;
        *value = one(part)?;
    }
    match parts.next() {
        None => Ok(values),
        Some(_) => Err(format!("{} is not such as {example}", excerpt(word))),
    }
}

/// The words behind an edit's name: pairs of a field's name and its value, in any order.
pub(super) struct Fields<'a> {
    words: Vec<Option<&'a str>>,
    /// How the whole line should look.
    form: &'static str,
}

impl<'a> Fields<'a> {
    pub(super) fn new(words: &'a [String], form: &'static str) -> Self {
        Self { words: words.iter().map(|word| Some(word.as_str())).collect(), form }
    }

    /// The value of a field, parsed; `None` if the line has it not.
    pub(super) fn optional<T>(
        &mut self,
        name: &str,
        parse: impl FnOnce(&'a str) -> Result<T, String>,
    ) -> Result<Option<T>, String> {
        let Some(at) = (0..self.words.len()).step_by(2).find(|&i| self.words[i] == Some(name)) else {
            return Ok(None);
        };
        self.words[at] = None;
        match self.words.get_mut(at + 1).and_then(Option::take) {
            Some(value) => parse(value).map(Some).map_err(|e| format!("{name}: {e}; write `{}`", self.form)),
            None => Err(format!("`{name}` has no value; write `{}`", self.form)),
        }
    }

    /// The value of a field that must be there.
    pub(super) fn required<T>(
        &mut self,
        name: &str,
        parse: impl FnOnce(&'a str) -> Result<T, String>,
    ) -> Result<T, String> {
        let form = self.form;
        self.optional(name, parse)?.ok_or_else(|| format!("`{name}` is missing; write `{form}`"))
    }

    /// Refuses words that were not used.
    pub(super) fn finish(self) -> Result<(), String> {
        match self.words.into_iter().flatten().next() {
            None => Ok(()),
            Some(word) => Err(format!(
                "{} does not belong here, or stands here twice; write `{}`",
                excerpt(word),
                self.form
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_and_quoted() {
        assert_eq!(split("  a\t\"b c\"  d ").unwrap(), ["a", "b c", "d"]);
        assert_eq!(split("").unwrap(), Vec::<String>::new());
        assert!(split("a \"b").unwrap_err().contains("open"));
        assert!(split("a \"b\"c").unwrap_err().contains("space"));
        assert_eq!(quoted("a b").unwrap(), "\"a b\"");
        assert_eq!(quoted("a.tif").unwrap(), "a.tif");
        assert_eq!(quoted("a\"b"), None);
    }

    #[test]
    fn numbers_are_decimals() {
        assert_eq!(number("-3e4").unwrap(), -3e4);
        assert!(number("nan").is_err() && number("1e999").is_err() && number("0x1").is_err());
        assert_eq!(list::<2, f64>("1,-2.5", "1,2", number).unwrap(), [1.0, -2.5]);
        assert!(
            list::<2, f64>("1", "1,2", number).is_err() && list::<2, f64>("1,2,3", "1,2", number).is_err()
        );
        assert_eq!(whole::<u32>("12").unwrap(), 12);
        assert!(whole::<u32>("-1").is_err() && whole::<u32>("+1").is_err() && whole::<i64>("-1").is_ok());
    }
}
