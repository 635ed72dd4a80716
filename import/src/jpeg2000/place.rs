//! What a JP2 file says of the ground: a GeoTIFF in a box (GeoJP2), or a grid in GML (GMLJP2, OGC 08-085r8).
//!
//! The GeoTIFF counts before GML. Of GML a rectified grid is read whose system is told by its code. Cost: a parse of some kilobytes.

use crate::crs;
use crate::reader::{CrsSaid, Said};
use roxmltree::{Document, Node};

/// Longest box that is looked at.
pub(super) const MAX_BYTES: u64 = 4 << 20;
/// Boxes inside a box, at most.
const MAX_INSIDE: usize = 1024;
/// Boxes inside each other, at most.
const MAX_DEPTH: usize = 8;

/// What a file says of the ground, as it is written there.
#[derive(Debug, Default)]
pub(crate) struct Ground {
    pub(super) tiff: Option<Vec<u8>>,
    pub(super) gml: Option<String>,
}

/// The text of GML inside a box of associated ones: in a box "xml " beneath the label "gml.root-instance".
pub(super) fn gml_in(bytes: &[u8]) -> Option<String> {
    find(bytes, &mut 0, 0)
}

fn find(bytes: &[u8], seen: &mut usize, depth: usize) -> Option<String> {
    let mut at = 0;
    while let Some(head) = bytes.get(at..at + 8) {
        *seen += 1;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let length = if length == 0 { bytes.len() - at } else { length };
        if length < 8 || *seen > MAX_INSIDE {
            return None;
        }
        let content = &bytes[at + 8..bytes.len().min(at.saturating_add(length))];
        let found = match &head[4..] {
            b"asoc" if depth < MAX_DEPTH => find(content, seen, depth + 1),
            b"xml " => {
                let text = String::from_utf8_lossy(content).trim_end_matches('\0').to_owned();
                text.contains("RectifiedGrid").then_some(text)
            }
            _ => None,
        };
        if found.is_some() {
            return found;
        }
        at = at.saturating_add(length);
    }
    None
}

impl Ground {
    /// The GeoTIFF without a picture, if there is one.
    pub(crate) fn tiff(&self) -> Option<&[u8]> {
        self.tiff.as_deref()
    }

    /// The map from texel centres and the system that GML says; `Err` where it says something that is not understood.
    pub(crate) fn gml(&self) -> Option<Result<([f64; 6], CrsSaid), ()>> {
        let text = self.gml.as_deref()?;
        let said = grid(text).map(|(map, code)| {
            let crs = CrsSaid { code: Some(Said::new(code, "GML in it")), ..CrsSaid::default() };
            (map, crs)
        });
        Some(said.ok_or(()))
    }
}

fn named<'n>(node: Node<'n, 'n>, name: &str) -> Option<Node<'n, 'n>> {
    node.descendants().find(|node| node.tag_name().name() == name)
}

fn pair(node: Node<'_, '_>) -> Option<[f64; 2]> {
    let text = node.text()?;
    let mut numbers =
        text.split([' ', ',', '\n', '\t']).filter(|word| !word.is_empty()).map(str::parse::<f64>);
    let pair = [numbers.next()?.ok()?, numbers.next()?.ok()?];
    pair.iter().all(|number| number.is_finite()).then_some(pair)
}

/// The map and the code of the system of a rectified grid.
fn grid(text: &str) -> Option<([f64; 6], u32)> {
    let document = Document::parse(text).ok()?;
    let grid = named(document.root_element(), "RectifiedGrid")?;
    let origin = named(grid, "origin")?;
    let point = named(origin, "pos").or_else(|| named(origin, "coordinates"))?;
    let steps: Vec<Node<'_, '_>> =
        grid.descendants().filter(|node| node.tag_name().name() == "offsetVector").collect();
    let [across, down] = steps[..] else { return None };
    let named_system = [across, down, grid].into_iter().chain(origin.descendants());
    let system = named_system.filter_map(|node| node.attribute("srsName")).next()?;
    // urn:ogc:def:crs:EPSG::32632, urn:ogc:def:crs:EPSG:6.9:4326, EPSG:32632, http://www.opengis.net/gml/srs/epsg.xml#32632
    let is_epsg = system.to_ascii_lowercase().contains("epsg");
    let code: u32 = system.rsplit([':', '#', '/']).next()?.parse().ok().filter(|_| is_epsg)?;
    let (mut at, mut east, mut south) = (pair(point)?, pair(across)?, pair(down)?);
    // A system of the registry has its own order of axes, which a name in full asks for. Of one that is not known columns go east.
    let goes_north = || crs::is_north_first(code).unwrap_or(east[0] == 0.0 && south[1] == 0.0);
    if system.starts_with("urn:") && goes_north() {
        [&mut at, &mut east, &mut south].into_iter().for_each(|pair| pair.swap(0, 1));
    }
    Some(([at[0], east[0], south[0], at[1], east[1], south[1]], code))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gml(system: &str, at: &str, east: &str, south: &str) -> String {
        format!(
            "<gml:FeatureCollection xmlns:gml=\"http://www.opengis.net/gml\"><gml:RectifiedGrid dimension=\"2\"><gml:origin><gml:Point srsName=\"{system}\">\
             <gml:pos>{at}</gml:pos></gml:Point></gml:origin><gml:offsetVector srsName=\"{system}\">{east}</gml:offsetVector>\
             <gml:offsetVector srsName=\"{system}\">{south}</gml:offsetVector></gml:RectifiedGrid></gml:FeatureCollection>"
        )
    }

    #[test]
    fn a_grid_lies_where_its_axes_say() {
        let utm = gml("urn:ogc:def:crs:EPSG::32632", "500005 4999995", "10 0", "0 -10");
        assert_eq!(grid(&utm), Some(([500_005.0, 10.0, 0.0, 4_999_995.0, 0.0, -10.0], 32632)));
        let degrees = gml("urn:ogc:def:crs:EPSG::4326", "45.5 9.25", "0 0.5", "-0.5 0");
        assert_eq!(grid(&degrees), Some(([9.25, 0.5, 0.0, 45.5, 0.0, -0.5], 4326)));
        assert_eq!(grid(&gml("the site", "1 2", "1 0", "0 1")), None);
        assert_eq!(grid("<gml"), None);
    }

    #[test]
    fn boxes_inside_boxes_end() {
        let nest = |inner: Vec<u8>| [&((inner.len() + 8) as u32).to_be_bytes()[..], b"asoc", &inner].concat();
        let text = b"<a>RectifiedGrid</a>\0".to_vec();
        let xml = [&((text.len() + 8) as u32).to_be_bytes()[..], b"xml ", &text].concat();
        assert_eq!(gml_in(&nest(nest(xml.clone()))).as_deref(), Some("<a>RectifiedGrid</a>"));
        let deep = (0..1000).fold(xml, |inner, _| nest(inner));
        assert_eq!(gml_in(&deep), None);
        assert_eq!(gml_in(&[0, 0, 0, 1, b'x', 0, 0, 0]), None);
    }
}
