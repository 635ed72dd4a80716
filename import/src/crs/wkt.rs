//! Well-known text as a tree: keywords with values in brackets (WKT 1 of OGC and ESRI, WKT 2: ISO 19162).
//!
//! Only the shape is read here; [`super::from_wkt`] knows what keywords mean. The text is not trusted: its length and depth are bounded. Cost: one pass.

/// Longest text read; the longest systems have some 10 KB.
pub(super) const MAX_BYTES: usize = 1 << 18;
const MAX_DEPTH: usize = 32;

/// A keyword and what stands in its brackets.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    /// In capitals.
    pub(super) key: String,
    pub(super) values: Vec<Value>,
}

/// One value in brackets.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Text(String),
    Number(f64),
    /// A bare word, such as EAST, or a keyword with brackets.
    Node(Node),
}

impl Node {
    /// The children with one of these keywords.
    pub(super) fn children<'a>(&'a self, keys: &'a [&str]) -> impl Iterator<Item = &'a Node> {
        self.values.iter().filter_map(move |value| match value {
            Value::Node(node) if keys.contains(&node.key.as_str()) => Some(node),
            _ => None,
        })
    }

    /// The first of them.
    pub(super) fn child<'a>(&'a self, keys: &'a [&str]) -> Option<&'a Node> {
        self.children(keys).next()
    }

    /// The first descendant with one of these keywords, itself included, in the order of the text.
    pub(super) fn find(&self, keys: &[&str]) -> Option<&Node> {
        if keys.contains(&self.key.as_str()) {
            return Some(self);
        }
        self.values.iter().find_map(|value| match value {
            Value::Node(node) => node.find(keys),
            _ => None,
        })
    }

    /// The text at a place.
    pub(super) fn text(&self, at: usize) -> Option<&str> {
        match self.values.get(at)? {
            Value::Text(text) => Some(text),
            Value::Node(node) if node.values.is_empty() => Some(&node.key),
            _ => None,
        }
    }

    /// The number at a place; some writers put it in quotes.
    pub(super) fn number(&self, at: usize) -> Option<f64> {
        match self.values.get(at)? {
            Value::Number(number) => Some(*number),
            Value::Text(text) => text.parse().ok().filter(|number: &f64| number.is_finite()),
            Value::Node(_) => None,
        }
    }
}

/// The nodes of a text: one, or several with commas between, as ESRI writes a vertical system after a horizontal one. `None` if this is no such text.
pub(super) fn parse(text: &str) -> Option<Vec<Node>> {
    if text.len() > MAX_BYTES {
        return None;
    }
    let mut parser = Parser { rest: text.trim_start_matches('\u{feff}').trim() };
    let mut nodes = Vec::new();
    loop {
        match parser.value(0)? {
            Value::Node(node) if !node.values.is_empty() => nodes.push(node),
            _ => return None,
        }
        parser.skip_space();
        if parser.rest.is_empty() {
            return Some(nodes);
        }
        if !parser.take(',') {
            return None;
        }
    }
}

struct Parser<'t> {
    rest: &'t str,
}

impl Parser<'_> {
    fn skip_space(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, sign: char) -> bool {
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn value(&mut self, depth: usize) -> Option<Value> {
        if depth > MAX_DEPTH {
            return None;
        }
        self.skip_space();
        if self.take('"') {
            return self.quoted().map(Value::Text);
        }
        let end =
            self.rest.find(|c: char| "[](),\"".contains(c) || c.is_whitespace()).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        if word.is_empty() {
            return None;
        }
        self.skip_space();
        let close = match self.rest.chars().next() {
            Some('[') => ']',
            Some('(') => ')',
            _ => {
                return Some(match word.parse::<f64>() {
                    Ok(number) if number.is_finite() => Value::Number(number),
                    _ => Value::Node(Node { key: word.to_ascii_uppercase(), values: Vec::new() }),
                });
            }
        };
        self.rest = &self.rest[1..];
        let mut values = Vec::new();
        loop {
            values.push(self.value(depth + 1)?);
            self.skip_space();
            if self.take(close) {
                return Some(Value::Node(Node { key: word.to_ascii_uppercase(), values }));
            }
            if !self.take(',') {
                return None;
            }
        }
    }

    /// The rest of a quoted text; a quote in it is doubled.
    fn quoted(&mut self) -> Option<String> {
        let mut text = String::new();
        loop {
            let end = self.rest.find('"')?;
            text.push_str(&self.rest[..end]);
            self.rest = &self.rest[end + 1..];
            if !self.take('"') {
                return Some(text);
            }
            text.push('"');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_are_read_and_nonsense_is_not() {
        let nodes = parse(
            "PROJCS[\"a \"\"b\"\"\", UNIT(\"Foot\",0.3048) , AXIS[\"X\",EAST]],VERTCS[\"v\",UNIT[\"m\",1]]",
        )
        .unwrap();
        assert_eq!(nodes.len(), 2);
        assert_eq!(nodes[0].text(0), Some("a \"b\""));
        assert_eq!(nodes[0].child(&["UNIT"]).unwrap().number(1), Some(0.3048));
        assert_eq!(nodes[0].child(&["AXIS"]).unwrap().text(1), Some("EAST"));
        assert_eq!(nodes[1].find(&["UNIT"]).unwrap().text(0), Some("m"));
        let deep = "A[".repeat(100);
        for wrong in [
            "",
            "PROJCS",
            "PROJCS[",
            "PROJCS[\"a\"",
            "PROJCS[\"a\"]]",
            "PROJCS[,]",
            "\"a\"",
            "+proj=utm",
            deep.as_str(),
        ] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
