//! GDAL's `.aux.xml` beside a file (PAM): place, reference system, and for each band "no data", scale, offset, unit and name.
//!
//! The text is read by crate `roxmltree`. A file that is no such text is ignored. Cost: one pass.

use crate::reader::{Declared, Said, VerticalUnit};
use crate::xml::{self, number_of, text_of};

/// Longest text read; histograms of many bands take some hundred KB.
pub(super) const MAX_BYTES: u64 = 8 << 20;

/// Memory that its tree may take: an attribute table of 65,536 rows takes half of it.
const MAX_TREE_BYTES: u64 = 256 << 20;

/// What is said of one band.
#[derive(Debug, Clone, PartialEq, Default)]
struct Band {
    nodata: Option<String>,
    scale: Option<f64>,
    offset: Option<f64>,
    unit: Option<String>,
}

/// What the file says.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Aux {
    /// From corners of samples to coordinates.
    corners: Option<[f64; 6]>,
    system: Option<String>,
    bands: Vec<(u32, Band)>,
}

impl Aux {
    /// Reads the text.
    pub(super) fn parse(text: &str) -> Self {
        let Some(document) = xml::tree(text, MAX_TREE_BYTES) else { return Self::default() };
        let root = document.root_element();
        if !root.has_tag_name("PAMDataset") {
            return Self::default();
        }
        let text = |node, name| text_of(node, name).map(str::to_owned);
        let corners = text_of(root, "GeoTransform").and_then(xml::transform);
        let bands = root.children().filter(|child| child.has_tag_name("PAMRasterBand")).map(|band| {
            let number = band.attribute("band").and_then(|number| number.parse().ok()).unwrap_or(1);
            let said = Band {
                nodata: text(band, "NoDataValue"),
                scale: number_of(band, "Scale"),
                offset: number_of(band, "Offset"),
                unit: text(band, "UnitType"),
            };
            (number, said)
        });
        Self { corners, system: text(root, "SRS"), bands: bands.collect() }
    }

    /// Adds it to what the file itself says, except for the place.
    pub(super) fn apply(&mut self, name: &str, declared: &mut Declared) {
        let corrects = declared.corrects;
        let has_system = declared.crs.text.is_some() || declared.crs.code.is_some();
        if let Some(system) = self.system.take().filter(|_| corrects.system || !has_system) {
            declared.crs.text = Some(Said::new(system, name));
            declared.crs.code = None;
            declared.crs.vertical_code = None;
            declared.crs.unit = None;
        }
        let wanted = declared.band_number;
        let Some((_, band)) =
            std::mem::take(&mut self.bands).into_iter().find(|(number, _)| *number == wanted)
        else {
            return;
        };
        let value = &mut declared.value;
        if let Some(text) = band.nodata.filter(|_| corrects.nodata || value.nodata.is_empty()) {
            value.nodata = vec![Said::new(text, name)];
        }
        // A scale without an offset is whole.
        let is_scaled = value.scale.is_some() || value.offset.is_some();
        if corrects.scale || !is_scaled {
            value.scale = band.scale.map(|scale| Said::new(scale, name)).or(value.scale.take());
            value.offset = band.offset.map(|offset| Said::new(offset, name)).or(value.offset.take());
        }
        if let Some(unit) = band.unit.filter(|_| corrects.scale || value.unit.is_none()) {
            value.unit = Some(Said::new(VerticalUnit::Name(unit), name));
        }
    }

    /// Adds the place.
    pub(super) fn place(&self, name: &str, declared: &mut Declared) {
        let Some([x, a, b, y, d, e]) = self.corners else { return };
        let mut centres = [x + 0.5 * (a + b), a, b, y + 0.5 * (d + e), d, e];
        // GDAL turns some formats' rows from the south, and states places for the rows that it has then.
        if declared.rows_from_south {
            let last = f64::from(declared.samples[1] - 1);
            let [x, a, b, y, d, e] = centres;
            centres = [x + b * last, a, -b, y + e * last, d, -e];
        }
        declared.place = Some(Said::new(centres, name));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_told_apart_and_nonsense_says_nothing() {
        let text = "<PAMDataset><SRS dataAxisToSRSAxisMapping=\"1,2\">LOCAL_CS[&quot;x&quot;]</SRS><GeoTransform> 5.0e2, 10, 0, 9.0e2, 0, -10</GeoTransform>\
                    <PAMRasterBand band=\"1\"><NoDataValue le_hex_equiv=\"00\">-9.99900000000000E+03</NoDataValue><Scale>0.1</Scale><Offset>500</Offset>\
                    <UnitType>ft</UnitType></PAMRasterBand><PAMRasterBand band=\"2\"><Scale>7</Scale></PAMRasterBand></PAMDataset>";
        let aux = Aux::parse(text);
        assert_eq!(aux.corners, Some([500.0, 10.0, 0.0, 900.0, 0.0, -10.0]));
        assert_eq!(aux.system.as_deref(), Some("LOCAL_CS[\"x\"]"));
        assert_eq!(aux.bands.len(), 2);
        assert_eq!(aux.bands[0].1.nodata.as_deref(), Some("-9.99900000000000E+03"));
        assert_eq!(aux.bands[1].1.scale, Some(7.0));
        for nonsense in ["", "<", "<VRTDataset/>", "<PAMDataset>"] {
            assert_eq!(Aux::parse(nonsense), Aux::default(), "{nonsense}");
        }
    }
}
