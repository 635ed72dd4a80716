//! Grids of which neither rows nor columns have coordinates: whether something else says where they lie.

use super::attributes::{numbers, text};
use super::axes::{self, Axis};
use super::{About, LayoutError, Warning, harmless};
use crate::reader::Declared;

impl About<'_> {
    /// The place that the grid mapping states as GDAL's `GeoTransform`. Says that nothing tells which way rows go where it does not.
    ///
    /// # Errors
    /// [`LayoutError::Unsupported`] for places that are listed sample by sample, and for those that only the text of a bathymetry (BAG) tells.
    pub(super) fn without_axes(&self, declared: &mut Declared) -> Result<(), LayoutError> {
        if self.grid.place.starts_with("BAG_root/") {
            return Err(LayoutError::unsupported(
                self.path,
                "it is a Bathymetric Attributed Grid (BAG), whose rows run from the south and whose place stands in a text, which is not read; convert it: gdal_translate INPUT output.tif",
            ));
        }
        self.refuse_places_apart()?;
        if let Some([x, dx, y, dy]) = self.stated_corners() {
            let axis = |first: f64, step: f64| Axis {
                name: "GeoTransform".into(),
                first: first + 0.5 * step,
                step,
                unit: None,
                strange_unit: None,
            };
            self.place(declared, &axis(x, dx), &axis(y, dy));
            return Ok(());
        }
        let words = format!(
            "neither rows nor columns of variable \"{}\" have coordinates, so nothing says on which side its first row lies; it was taken for the northernmost, where GDAL may take it for the southernmost",
            harmless(&self.grid.place, 40)
        );
        declared.warnings.push(Warning::new(words));
        Ok(())
    }

    /// Corner and step of columns and of rows by the mapping's `GeoTransform`, where it is not turned.
    fn stated_corners(&self) -> Option<[f64; 4]> {
        let name = text(self.grid.variable.attributes(), "grid_mapping")?;
        let (_, mapping) = self.beside(name.split_whitespace().next()?.trim_end_matches(':'))?;
        let attributes = mapping.attributes();
        let map: Vec<f64> = match text(attributes, "GeoTransform") {
            Some(words) => words.split_whitespace().map_while(|word| word.parse().ok()).collect(),
            None => numbers(attributes, "GeoTransform"),
        };
        let [x, dx, turn_x, y, turn_y, dy] = map[..] else { return None };
        let is_plain = turn_x == 0.0 && turn_y == 0.0 && dx.is_normal() && dy.is_normal();
        (is_plain && x.is_finite() && y.is_finite()).then_some([x, dx, y, dy])
    }

    /// Refuses a grid whose places are listed sample by sample.
    fn refuse_places_apart(&self) -> Result<(), LayoutError> {
        let Some(names) = text(self.grid.variable.attributes(), "coordinates") else { return Ok(()) };
        let two = |name: &str| {
            self.beside(name).is_some_and(|(_, v)| v.ndim() == 2 && axes::way("", Some(v)).is_some())
        };
        if names.split_whitespace().filter(|name| two(name)).count() < 2 {
            return Ok(());
        }
        Err(LayoutError::unsupported(
            self.path,
            "the places of its samples are listed one by one, not as columns and rows; make a regular grid of it: gdalwarp -geoloc INPUT output.tif",
        ))
    }
}
