//! XML that anybody can write: whether a tree may be made of it, and what elements hold.
//!
//! A tree takes many times its text in memory, attributes of one element are compared with each other, and elements within elements take stack. So a text is counted before ([`check`]); entities are never
//! expanded. Cost: one pass over the text.

use roxmltree::{Document, Node};

/// Bytes of the tree for an element with its text, and for an attribute.
const NODE_BYTES: u64 = 2 * 80;
const ATTRIBUTE_BYTES: u64 = 80;
/// Attributes of one element, at most.
const MOST_ATTRIBUTES: u64 = 256;
/// Elements within elements.
const DEEPEST: i64 = 64;

/// Why no tree is made of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Crowd {
    /// Its tree would take more memory than it may: how many beginnings and ends of elements it has.
    Large(u64),
    /// Its elements lie too deep in each other, or one has too many attributes.
    Steep,
}

/// Whether a tree of this text takes no more than `most` bytes, and is soon made.
///
/// # Errors
/// What there is too much of.
pub(crate) fn check(text: &[u8], most: u64) -> Result<(), Crowd> {
    let (mut nodes, mut attributes, mut depth) = (0u64, 0u64, 0i64);
    let mut rest = text;
    while let Some(begin) = rest.iter().position(|byte| *byte == b'<') {
        rest = &rest[begin..];
        nodes += 1;
        let passed = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("</", ">")];
        if let Some((mark, end)) = passed.iter().find(|(mark, _)| rest.starts_with(mark.as_bytes())) {
            depth -= i64::from(*mark == "</");
            rest = behind(&rest[mark.len()..], end.as_bytes());
            continue;
        }
        let of_one;
        let is_whole;
        (rest, of_one, is_whole) = element(rest);
        attributes += of_one;
        depth += 1;
        if of_one > MOST_ATTRIBUTES || depth > DEEPEST {
            return Err(Crowd::Steep);
        }
        depth -= i64::from(is_whole);
    }
    if nodes * NODE_BYTES + attributes * ATTRIBUTE_BYTES > most { Err(Crowd::Large(nodes)) } else { Ok(()) }
}

/// What comes behind the first `end`.
fn behind<'t>(text: &'t [u8], end: &[u8]) -> &'t [u8] {
    text.windows(end.len()).position(|part| part == end).map_or(&[], |at| &text[at + end.len()..])
}

/// What comes behind the beginning of an element, how many attributes that has, and whether it is its end as well.
fn element(text: &[u8]) -> (&[u8], u64, bool) {
    let (mut attributes, mut before, mut quote) = (0, 0, None);
    for (at, byte) in text.iter().enumerate() {
        match (quote, byte) {
            (Some(mark), byte) if mark == *byte => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(*byte),
            (None, b'=') => attributes += 1,
            (None, b'>') => return (&text[at + 1..], attributes, before == b'/'),
            (None, _) => {}
        }
        before = *byte;
    }
    (&[], attributes, false)
}

/// The tree of a text, if it is XML and takes no more than `most` bytes.
pub(crate) fn tree(text: &str, most: u64) -> Option<Document<'_>> {
    let text = text.trim_start_matches('\u{feff}');
    check(text.as_bytes(), most).ok()?;
    Document::parse(text).ok()
}

/// The text of a child.
pub(crate) fn text_of<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let found = node.children().find(|child| child.has_tag_name(name))?;
    found.text().map(str::trim).filter(|text| !text.is_empty())
}

/// The number of a child: finite.
pub(crate) fn number_of(node: Node<'_, '_>, name: &str) -> Option<f64> {
    text_of(node, name)?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// GDAL's six numbers from corners of samples to coordinates, if they place a grid.
pub(crate) fn transform(text: &str) -> Option<[f64; 6]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    let map = <[f64; 6]>::try_from(numbers?).ok()?;
    (map.iter().all(|value| value.is_finite()) && map[1] * map[5] != map[2] * map[4]).then_some(map)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_attributes_are_counted_as_attributes() {
        let most = 1 << 20;
        let sums = "a=b ".repeat(1000);
        for text in [
            format!("<a>{sums}</a>"),
            format!("<!-- it's {sums} --><a/>"),
            format!("<a><![CDATA[<{sums}\"]]></a>"),
            format!("<?note {sums}?><a b=\"{sums} > '\" c='\"'/>"),
        ] {
            assert_eq!(check(text.as_bytes(), most), Ok(()), "{}", &text[..20]);
            assert!(tree(&text, most).is_some());
        }
        let crowd: String = (0..300).map(|i| format!(" a{i}=''")).collect();
        for text in [
            format!("<a{crowd}/>"),
            format!("<a x='>'{crowd}>"),
            format!("<!-- ' --><a{crowd}"),
            format!("<![CDATA[\"]]><a{crowd}/>"),
            "<a>".repeat(65),
            "<a b='/>'>".repeat(65),
        ] {
            assert_eq!(check(text.as_bytes(), most), Err(Crowd::Steep), "{}", &text[..20]);
        }
        assert_eq!(check("<a/>".repeat(6554).as_bytes(), most), Err(Crowd::Large(6554)));
        assert_eq!(check(&[b"<a></a>".repeat(100), b"<b/>".repeat(100)].concat(), most), Ok(()));
    }

    #[test]
    fn six_numbers_place_a_grid() {
        assert_eq!(transform(" 5.0e2, 10, 0, 9.0e2, 0, -10"), Some([500.0, 10.0, 0.0, 900.0, 0.0, -10.0]));
        for wrong in ["", "1,2,3,4,5", "0,1,0,0,1,0", "0,1,0,0,0,inf", "0,1,0,0,0,x"] {
            assert_eq!(transform(wrong), None, "{wrong}");
        }
    }
}
