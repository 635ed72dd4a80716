//! What a pyramid says about itself: rows of MBTiles' metadata, TileJSON, the metadata of PMTiles, and `tilemapresource.xml`.
//!
//! All of it is text that anybody can write, so numbers that make no sense are passed over. Cost: one pass over some kilobytes.

use crate::reader::Said;
use crate::xml;
use serde_json::Value;
use terrasoar_layout::words::harmless;

/// Longest text that is read.
pub(super) const MAX_TEXT_BYTES: u64 = 8 << 20;

/// Memory that the tree of a `tilemapresource.xml` may take; that of a maker's has some dozens of elements.
const MAX_TREE_BYTES: u64 = 16 << 20;

/// All that is said.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct About {
    /// West, south, east, north in degrees.
    pub(super) bounds: Option<[f64; 4]>,
    /// How heights are packed: a word, or factors as [`crate::value::decode`] takes them.
    pub(super) encoding: Option<Said<String>>,
    /// Format of the tiles: "png", "pbf".
    pub(super) format: Option<String>,
    /// Whether rows are counted from the south.
    pub(super) from_south: Option<bool>,
    /// A reference system other than that of web maps.
    pub(super) other_system: Option<String>,
}

impl About {
    /// Takes a pair of MBTiles' metadata.
    #[cfg(any(test, feature = "mbtiles"))]
    pub(super) fn take_pair(&mut self, name: &str, value: &str, by: &str) {
        match name {
            "json" => {
                let json = serde_json::from_str(value).unwrap_or(Value::Null);
                self.take_json(&json, by);
            }
            _ => self.take(name, &Value::String(value.to_owned()), by),
        }
    }

    /// Takes the fields of a JSON object.
    pub(super) fn take_json(&mut self, json: &Value, by: &str) {
        let Some(fields) = json.as_object() else { return };
        for (name, value) in fields {
            self.take(name, value, by);
        }
        let number = |name: &str| fields.get(name).and_then(Value::as_f64);
        let factors = ["redFactor", "greenFactor", "blueFactor"].map(number);
        if let ([Some(red), Some(green), Some(blue)], Some("custom")) =
            (factors, fields.get("encoding").and_then(Value::as_str))
        {
            // The base is subtracted there.
            let base = -number("baseShift").unwrap_or(0.0);
            self.encoding = Some(Said::new(format!("{red},{green},{blue},{base}"), by));
        }
    }

    fn take(&mut self, name: &str, value: &Value, by: &str) {
        let text = value.as_str().map(|text| text.trim().to_ascii_lowercase());
        match (name, text) {
            ("bounds", _) => self.bounds = bounds(value).or(self.bounds),
            ("encoding", Some(text)) if !text.is_empty() => {
                self.encoding = Some(Said::new(harmless(&text, 40), by));
            }
            ("format", Some(text)) => self.format = Some(harmless(&text, 40)),
            ("scheme", Some(text)) => self.from_south = Some(text == "tms"),
            _ => {}
        }
    }

    /// Takes a `tilemapresource.xml` (TMS 1.0.0), whose rows are counted from the south.
    pub(super) fn take_tile_map(&mut self, text: &str) {
        let Some(document) = xml::tree(text, MAX_TREE_BYTES) else { return };
        let root = document.root_element();
        if !root.has_tag_name("TileMap") {
            return;
        }
        self.from_south = Some(true);
        if let Some(system) = xml::text_of(root, "SRS") {
            let system = system.to_ascii_uppercase();
            let is_web = ["EPSG:3857", "EPSG:900913", "EPSG:3785", "OSGEO:41001"].contains(&&*system);
            self.other_system = (!is_web).then(|| harmless(&system, 60));
        }
        if let Some(node) = root.children().find(|child| child.has_tag_name("BoundingBox")) {
            let side = |name: &str| node.attribute(name).and_then(|text| text.trim().parse::<f64>().ok());
            let sides = ["minx", "miny", "maxx", "maxy"].map(side);
            if let [Some(west), Some(south), Some(east), Some(north)] = sides {
                // In degrees or in metres, as its writer liked; metres are passed over.
                self.bounds = sound([west, south, east, north]).or(self.bounds);
            }
        }
    }
}

/// Bounds as four numbers of an array or of a text.
fn bounds(value: &Value) -> Option<[f64; 4]> {
    let numbers: Vec<f64> = match value {
        Value::Array(items) => items.iter().map(Value::as_f64).collect::<Option<_>>()?,
        Value::String(text) => {
            text.split(',').map(|word| word.trim().parse()).collect::<Result<_, _>>().ok()?
        }
        _ => return None,
    };
    sound(numbers.try_into().ok()?)
}

/// Bounds that can be degrees.
pub(super) fn sound(bounds: [f64; 4]) -> Option<[f64; 4]> {
    let [west, south, east, north] = bounds;
    let is_sound = west < east
        && south < north
        && west >= -180.001
        && east <= 180.001
        && south >= -90.0
        && north <= 90.0;
    is_sound.then_some(bounds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makers_write_is_understood() {
        let mut about = About::default();
        about.take_pair("bounds", "7.5, 46,8,46.5", "metadata");
        about.take_pair("format", "PNG", "metadata");
        about.take_pair("json", r#"{"encoding":"terrarium","vector_layers":[]}"#, "metadata");
        assert_eq!(about.bounds, Some([7.5, 46.0, 8.0, 46.5]));
        assert_eq!(about.encoding, Some(Said::new("terrarium".into(), "metadata")));
        about.take_pair("bounds", "-inf,nan,8,9", "metadata");
        assert_eq!(about.bounds, Some([7.5, 46.0, 8.0, 46.5]), "nonsense changes nothing");

        let mut custom = About::default();
        custom.take_json(
            &serde_json::json!({"encoding": "custom", "redFactor": 256, "greenFactor": 1, "blueFactor": 0.00390625,
                "baseShift": 32768, "scheme": "tms", "bounds": [-1, -2, 3, 4]}),
            "tiles.json",
        );
        assert_eq!(custom.encoding.unwrap().value, "256,1,0.00390625,-32768");
        assert_eq!((custom.from_south, custom.bounds), (Some(true), Some([-1.0, -2.0, 3.0, 4.0])));
    }

    #[test]
    fn tile_maps_count_rows_from_the_south() {
        let mut about = About::default();
        about.take_tile_map(
            r#"<?xml version="1.0"?><TileMap version="1.0.0"><SRS>EPSG:3857</SRS><BoundingBox minx="7" miny="46" maxx="8" maxy="47"/></TileMap>"#,
        );
        assert_eq!((about.from_south, about.bounds), (Some(true), Some([7.0, 46.0, 8.0, 47.0])));
        assert_eq!(about.other_system, None);
        about.take_tile_map("<TileMap><SRS>EPSG:4326</SRS></TileMap>");
        assert_eq!(about.other_system.as_deref(), Some("EPSG:4326"));
        about.take_tile_map("<!DOCTYPE a [<!ENTITY b \"&b;\">]><TileMap/>");
    }
}
