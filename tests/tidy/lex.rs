//! A source as words: names, `::` and single signs. Comments go, literals leave `""` behind.
//!
//! Cost: one pass over the characters.

/// The words of a source.
pub fn words(source: &str) -> Vec<String> {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let mut words = Vec::new();
    let mut i = 0;
    while i < chars.len() {
        let c = at(i);
        if c.is_whitespace() {
            i += 1;
        } else if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            i = after_comment(&chars, i);
        } else if let Some(end) = after_literal(&chars, i) {
            words.push("\"\"".into());
            i = end;
        } else if is_name(c) {
            let start = i;
            while is_name(at(i)) {
                i += 1;
            }
            words.push(chars[start..i].iter().collect());
        } else if c == ':' && at(i + 1) == ':' {
            words.push("::".into());
            i += 2;
        } else {
            words.push(c.into());
            i += 1;
        }
    }
    words
}

/// Where a comment between `/*` and `*/` ends, others within it included.
fn after_comment(chars: &[char], start: usize) -> usize {
    let (mut i, mut depth) = (start, 0);
    while i < chars.len() {
        match chars.get(i..i + 2) {
            Some(['/', '*']) => (i, depth) = (i + 2, depth + 1),
            Some(['*', '/']) => (i, depth) = (i + 2, depth - 1),
            _ => i += 1,
        }
        if depth == 0 {
            return i;
        }
    }
    i
}

/// Where the text or character that begins at `start` ends; `None` if none begins there.
fn after_literal(chars: &[char], start: usize) -> Option<usize> {
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let mut i = start;
    while matches!(at(i), 'b' | 'c' | 'r') && i < start + 2 {
        i += 1;
    }
    let is_raw = chars[start..i].contains(&'r');
    let hashes = if is_raw { (i..).take_while(|i| at(*i) == '#').count() } else { 0 };
    if at(i + hashes) == '"' {
        i += hashes + 1;
        while i < chars.len() {
            if is_raw && at(i) == '"' && (1..=hashes).all(|n| at(i + n) == '#') {
                return Some(i + hashes + 1);
            }
            if !is_raw && at(i) == '"' {
                return Some(i + 1);
            }
            i += if !is_raw && at(i) == '\\' { 2 } else { 1 };
        }
        return Some(i);
    }
    if at(i) != '\'' || i > start && at(start) != 'b' {
        return None;
    }
    if at(i + 1) == '\\' {
        return (i + 3..chars.len()).find(|end| at(*end) == '\'').map(|end| end + 1);
    }
    // Else a lifetime.
    (at(i + 2) == '\'').then_some(i + 3)
}

#[test]
fn words_are_names_and_signs() {
    let source = "use a::b; /* x /* y */ */ let s: &'a str = \"use c::d; \\\" \"; // e\nlet c = ['\\'', 'u', b'\\n']; r#\"f \" \"#; g()";
    let wanted = "use a :: b ; let s : & ' a str = \"\" ; let c = [ \"\" , \"\" , \"\" ] ; \"\" ; g ( )";
    assert_eq!(words(source).join(" "), wanted);
}
