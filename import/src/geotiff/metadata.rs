//! Scale, offset and unit of band 0 in the metadata GDAL keeps in tag 42112.
//!
//! The tag is a little XML, always of the shape
//! `<Item name="SCALE" sample="0" role="scale">0.1</Item>`; only items with a role are looked at.
//! Cost: one pass over the text.

/// What a raw value is in metres: `(value * scale + offset) * unit_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Heights {
    pub(super) scale: f64,
    pub(super) offset: f64,
    /// Metres a unit, if the file names it.
    pub(super) unit_m: Option<f64>,
}

/// Reads the items of band 0; what is absent or no number keeps its default.
pub(super) fn heights(xml: &str) -> Heights {
    let mut heights = Heights { scale: 1.0, offset: 0.0, unit_m: None };
    for item in xml.split("<Item").skip(1) {
        let Some((attributes, rest)) = item.split_once('>') else { continue };
        let Some((text, _)) = rest.split_once("</Item") else { continue };
        let text = text.trim();
        let number = text.parse::<f64>().ok().filter(|value| value.is_finite());
        if attribute(attributes, "sample").is_some_and(|band| band != "0") {
            continue;
        }
        match (attribute(attributes, "role"), number) {
            (Some("scale"), Some(scale)) if scale != 0.0 => heights.scale = scale,
            (Some("offset"), Some(offset)) => heights.offset = offset,
            (Some("unittype"), _) => heights.unit_m = unit_m(text),
            _ => {}
        }
    }
    heights
}

fn attribute<'a>(attributes: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = attributes.split_once(&format!(" {name}=\""))?;
    rest.split_once('"').map(|(value, _)| value)
}

/// Metres in a unit by the names in use.
fn unit_m(name: &str) -> Option<f64> {
    match name.to_ascii_lowercase().as_str() {
        "m" | "metre" | "meter" | "metres" | "meters" => Some(1.0),
        "ft" | "foot" | "feet" => Some(0.3048),
        "sft" | "us survey foot" | "us-ft" | "ftus" => Some(1200.0 / 3937.0),
        "cm" => Some(0.01),
        "dm" => Some(0.1),
        "km" => Some(1000.0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_of_band_0_count() {
        let xml = r#"<GDALMetadata>
            <Item name="scale">7</Item>
            <Item name="OFFSET" sample="0" role="offset">-10000</Item>
            <Item name="SCALE" sample="0" role="scale">0.5</Item>
            <Item name="SCALE" sample="1" role="scale">3</Item>
            <Item name="UNITTYPE" sample="0" role="unittype">ft</Item>
        </GDALMetadata>"#;
        assert_eq!(heights(xml), Heights { scale: 0.5, offset: -10000.0, unit_m: Some(0.3048) });
        let plain = Heights { scale: 1.0, offset: 0.0, unit_m: None };
        for damaged in [
            "",
            "<Item",
            "<Item role=\"scale\" sample=\"0\">",
            "<Item sample=\"0\" role=\"scale\">nan</Item>",
        ] {
            assert_eq!(heights(damaged), plain, "{damaged}");
        }
    }
}
