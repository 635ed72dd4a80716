//! Scale, offset, unit and name of bands in the metadata GDAL keeps in tag 42112.
//!
//! The tag is a little XML, always of the shape
//! `<Item name="SCALE" sample="0" role="scale">0.1</Item>`; only items with a role are looked at.
//! Cost: one pass over the text.

use crate::reader::{Said, ValueSaid, VerticalUnit};

/// Bands whose names are kept.
const MOST_NAMES: usize = 4096;

/// One item that has a role.
struct Item<'x> {
    band: usize,
    role: &'x str,
    text: String,
}

fn items(xml: &str) -> impl Iterator<Item = Item<'_>> {
    xml.split("<Item").skip(1).filter_map(|item| {
        let (attributes, rest) = item.split_once('>')?;
        let (text, _) = rest.split_once("</Item")?;
        let band = attribute(attributes, "sample").unwrap_or("0").parse().ok()?;
        Some(Item { band, role: attribute(attributes, "role")?, text: plain(text.trim()) })
    })
}

/// Takes what is said of `band`, counted from 0; what is absent or no number stays as it is.
pub(super) fn heights(xml: &str, band: usize, value: &mut ValueSaid) {
    let by = "GDAL's metadata";
    for item in items(xml).filter(|item| item.band == band) {
        let number = item.text.parse::<f64>().ok().filter(|value| value.is_finite());
        match (item.role, number) {
            ("scale", Some(scale)) => value.scale = Some(Said::new(scale, by)),
            ("offset", Some(offset)) => value.offset = Some(Said::new(offset, by)),
            ("unittype", _) if !item.text.is_empty() => {
                value.unit = Some(Said::new(VerticalUnit::Name(item.text), by));
            }
            _ => {}
        }
    }
}

/// The names of bands, as far as they have some.
pub(super) fn names(xml: &str) -> Vec<Option<String>> {
    let mut names = Vec::new();
    for item in items(xml).filter(|item| item.role == "description" && item.band < MOST_NAMES) {
        if names.len() <= item.band {
            names.resize(item.band + 1, None);
        }
        names[item.band] = Some(item.text);
    }
    names
}

/// The bands that are red, green and blue, where all three are named, and the one that is alpha.
pub(super) fn colours(xml: &str) -> (Option<[usize; 3]>, Option<usize>) {
    let roles: Vec<_> = items(xml).filter(|item| item.role == "colorinterp").collect();
    let band =
        |name: &str| roles.iter().find(|item| item.text.eq_ignore_ascii_case(name)).map(|item| item.band);
    let rgb = match (band("Red"), band("Green"), band("Blue")) {
        (Some(red), Some(green), Some(blue)) => Some([red, green, blue]),
        _ => None,
    };
    (rgb, band("Alpha"))
}

fn attribute<'a>(attributes: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = attributes.split_once(&format!(" {name}=\""))?;
    rest.split_once('"').map(|(value, _)| value)
}

/// Text without XML's escapes.
fn plain(text: &str) -> String {
    let named = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&apos;", "'");
    named.replace("&amp;", "&")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_of_the_band_count() {
        let xml = r#"<GDALMetadata>
            <Item name="scale">7</Item>
            <Item name="OFFSET" sample="0" role="offset">-10000</Item>
            <Item name="SCALE" sample="0" role="scale">-0.5</Item>
            <Item name="SCALE" sample="1" role="scale">3</Item>
            <Item name="UNITTYPE" sample="0" role="unittype">Clarke&apos;s foot</Item>
            <Item name="DESCRIPTION" sample="1" role="description">a &amp; b</Item>
        </GDALMetadata>"#;
        let of = |xml: &str, band| {
            let mut value = ValueSaid::default();
            heights(xml, band, &mut value);
            value
        };
        let first = of(xml, 0);
        assert_eq!((first.scale.unwrap().value, first.offset.unwrap().value), (-0.5, -10000.0));
        assert_eq!(first.unit.unwrap().value, VerticalUnit::Name("Clarke's foot".into()));
        assert_eq!(of(xml, 1).scale.unwrap().value, 3.0);
        assert_eq!(names(xml), [None, Some("a & b".to_owned())]);
        // That it makes no heights is said where heights are made.
        let none = of("<Item sample=\"0\" role=\"scale\">0</Item>", 0);
        assert_eq!(none.scale.unwrap().value, 0.0);
        for damaged in [
            "",
            "<Item",
            "<Item role=\"scale\" sample=\"0\">",
            "<Item sample=\"0\" role=\"scale\">nan</Item>",
        ] {
            assert_eq!(of(damaged, 0), ValueSaid::default(), "{damaged}");
        }
    }
}
