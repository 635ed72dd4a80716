//! NetCDF, classic (CDF-1, -2, -5) and over HDF5 (netCDF-4), by COARDS and CF; and GMT's grids of before version 4.
//!
//! `netcdf-reader` knows the bytes ([`file`]); here is found which variable holds the heights ([`choose`]), where its samples lie ([`axes`], [`system`]), and they are read
//! window by window ([`stream`]). A leading dimension of one layer is taken, of more a layer must be asked for. Memory: some windows, or a chunk where the file's own are larger.
//! There is no reader of our own for the classic layout: the crate reads it piece by piece as well.

mod attributes;
mod axes;
mod bare;
mod choose;
mod file;
mod stream;
mod system;
mod units;
mod valid;

use crate::crs::{by_text, exact_metres};
use crate::options::{Direction, OpenOptions};
use crate::reader::{Declared, HorizontalSize, Reader, Said, VerticalUnit};
use crate::value::STANDARD_GRAVITY;
use attributes::{exact, is_unsigned, number, numbers, text};
use axes::Axis;
use choose::{Chosen, Grid};
use file::Purpose;
use netcdf_reader::{NcFile, NcGroup, NcType, NcVariable};
use std::path::{Path, PathBuf};
use stream::Source;
use terrasoar_layout::dem::{SampleSink, SampleType, Warning};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;
use units::{Unit, Way};

/// Whether a file begins so: classic of any version, or HDF5.
pub(crate) fn is_netcdf(head: &[u8]) -> bool {
    [&b"CDF\x01"[..], b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n"]
        .iter()
        .any(|magic| head.starts_with(magic))
}

/// A netCDF file with a grid of heights.
#[derive(Debug)]
pub(crate) struct NetcdfDem {
    path: PathBuf,
    declared: Declared,
    source: Source,
}

impl NetcdfDem {
    /// Reads the head of the file, and the coordinates of its grid.
    pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Self, LayoutError> {
        let file = file::open(path, Purpose::Look)?;
        let root = file::guarded(path, "header", || file.root_group())?;
        let grids = choose::grids(root);
        let Chosen { grid, layer } = choose::choose(path, &grids, options.band.as_deref())?;
        let about = About { path, file: &file, root, grid: &grid };
        let (mut declared, shape) = if grid.is_flat { about.flat()? } else { about.grid()? };
        about.values(&mut declared);
        if grids.len() > 1 || layer > 0 {
            let layer = if layer > 0 { format!(", layer {}", layer + 1) } else { String::new() };
            declared.notes.push(format!("heights are variable \"{}\"{layer}", harmless(&grid.place, 40)));
        }
        let source = Source::new(path, &grid, layer, shape, is_unsigned(grid.variable))?;
        Ok(Self { path: path.to_owned(), declared, source })
    }
}

impl Reader for NetcdfDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        self.source.memory_bytes()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.source.stream(&self.path, sink)
    }
}

/// Columns and rows as they are handed over, and how they lie in the variable.
#[derive(Debug, Clone, Copy)]
struct Shape {
    samples: [u32; 2],
    /// Whether the variable's last dimension runs north.
    is_transposed: bool,
}

/// What is asked about a grid.
struct About<'a> {
    path: &'a Path,
    file: &'a NcFile,
    root: &'a NcGroup,
    grid: &'a Grid<'a>,
}

impl About<'_> {
    /// Size and place of a grid with coordinate variables.
    fn grid(&self) -> Result<(Declared, Shape), LayoutError> {
        let dimensions = self.grid.variable.dimensions();
        let [rows, columns] = &dimensions[dimensions.len() - 2..] else { return Err(self.too_large()) };
        let coordinates =
            [rows, columns].map(|dimension| self.beside(&dimension.name).filter(|(_, v)| v.ndim() == 1));
        let ways =
            [0, 1].map(|at| axes::way(&[rows, columns][at].name, coordinates[at].as_ref().map(|(_, v)| *v)));
        let is_transposed = ways == [Some(Way::East), Some(Way::North)]
            || matches!(ways, [Some(Way::East), None] | [None, Some(Way::North)]);
        let sizes = [columns.size, rows.size]
            .map(|size| u32::try_from(size).ok().filter(|size| *size <= i32::MAX as u32));
        let [Some(columns), Some(rows)] = sizes else { return Err(self.too_large()) };
        let samples = if is_transposed { [rows, columns] } else { [columns, rows] };
        let shape = Shape { samples, is_transposed };
        let mut declared = Declared::new(samples, self.sample_type(), self.format());
        let [mut down, mut across] = coordinates;
        if is_transposed {
            std::mem::swap(&mut down, &mut across);
        }
        match (across, down) {
            (Some((x_at, x)), Some((y_at, y))) => {
                let x = axes::read(self.path, self.file, &x_at, x)?;
                let y = axes::read(self.path, self.file, &y_at, y)?;
                self.place(&mut declared, &x, &y);
            }
            (None, None) => self.without_axes(&mut declared)?,
            _ => {}
        }
        Ok((declared, shape))
    }

    /// The place that two axes make, and what their units say of the system.
    fn place(&self, declared: &mut Declared, x: &Axis, y: &Axis) {
        let mapping = text(self.grid.variable.attributes(), "grid_mapping");
        // More than one mapping is "name: coordinates name: coordinates"; the first counts.
        let mapping = mapping.and_then(|names| {
            let first = names.split_whitespace().next()?.trim_end_matches(':').to_owned();
            self.beside(&first)
        });
        let unit_m = match x.unit {
            Some(Unit::Metres(metres)) => metres,
            _ => 1.0,
        };
        let mut is_unread = false;
        if let Some((_, mapping)) = mapping {
            match system::of(mapping) {
                Ok(Some((found, by))) => {
                    if by == "grid_mapping_name" && unit_m != 1.0 && system::is_moved(mapping) {
                        declared.warnings.push(
                            Warning::new(format!(
                                "coordinates are not in metres, and the false easting and northing of variable \"{}\" were taken in metres, as GDAL takes them; the CF conventions count them in the unit of coordinates",
                                harmless(mapping.name(), 40)
                            ))
                            .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
                        );
                    }
                    let by = format!("attribute {by} of variable \"{}\"", harmless(mapping.name(), 40));
                    declared.crs.text = Some(Said::new(found, by));
                }
                Ok(None) => {}
                Err(what) => {
                    is_unread = true;
                    declared.warnings.push(
                        Warning::new(format!(
                            "{what} (variable \"{}\"), so where the data lie on the ground is not known",
                            harmless(mapping.name(), 40)
                        ))
                        .mended_by(Remedy::ReferenceSystem, "EPSG:n"),
                    );
                }
            }
        }
        let by = format!("variables \"{}\" and \"{}\"", harmless(&x.name, 40), harmless(&y.name, 40));
        let factors = self.units(declared, [x, y], is_unread, &by);
        let map = [x.first, x.step, 0.0, y.first, 0.0, y.step];
        let map = std::array::from_fn(|i| map[i] * factors[i / 3]);
        declared.place = Some(Said::new(map, by));
    }

    /// What brings the coordinates of two axes into one unit: that of the system, or else that of the first axis, which is stated. Angles of a system that the file names and that
    /// is not read are no longitudes and latitudes.
    fn units(&self, declared: &mut Declared, [x, y]: [&Axis; 2], is_unread: bool, by: &str) -> [f64; 2] {
        for axis in [x, y] {
            if let Some(unit) = &axis.strange_unit {
                let words = format!(
                    "the unit \"{}\" of variable \"{}\" is not known here; its numbers were taken as they are",
                    harmless(unit, 40),
                    harmless(&axis.name, 40)
                );
                declared.warnings.push(Warning::new(words).mended_by(Remedy::Spacing, "METRES"));
            }
        }
        let counts = [x.unit, y.unit].map(|unit| unit.map(|unit| matches!(unit, Unit::Degrees(_))));
        if let [Some(a), Some(b)] = counts
            && a != b
        {
            let words = format!(
                "one of {by} is in degrees and the other one is not; its numbers were taken as they are"
            );
            declared.warnings.push(Warning::new(words).mended_by(Remedy::ReferenceSystem, "EPSG:n"));
            return [1.0; 2];
        }
        let Some(text) = &declared.crs.text else {
            let Some(unit) = x.unit.or(y.unit) else { return [1.0; 2] };
            if is_unread && counts[0].or(counts[1]) == Some(true) {
                return [1.0; 2];
            }
            let size = match unit {
                Unit::Degrees(_) => HorizontalSize::Radians(1f64.to_radians()),
                Unit::Metres(metres) => HorizontalSize::Metres(metres),
            };
            declared.crs.unit = Some(Said::new(size, format!("units of {by}")));
            return match (x.unit, y.unit) {
                (Some(Unit::Metres(x)), Some(Unit::Metres(y))) => [1.0, y / x],
                _ => [1.0; 2],
            };
        };
        let of_system = by_text(&text.value).and_then(|system| system.unit).map(|unit| unit.size);
        let is_angle = counts[0].or(counts[1]);
        match (of_system, is_angle) {
            (Some(HorizontalSize::Radians(size)), Some(true)) => {
                let degree = 1f64.to_radians();
                [if size == degree { 1.0 } else { degree / size }; 2]
            }
            (Some(HorizontalSize::Radians(_)), Some(false))
            | (Some(HorizontalSize::Metres(_)), Some(true)) => {
                let [here, there] =
                    if is_angle == Some(true) { ["degrees", "lengths"] } else { ["lengths", "degrees"] };
                let words = format!(
                    "{by} count in {here}, and the reference system that the file names ({}) in {there}; their numbers were taken as they are",
                    text.by
                );
                let system = if is_angle == Some(true) { "EPSG:4326" } else { "EPSG:n" };
                declared.warnings.push(Warning::new(words).mended_by(Remedy::ReferenceSystem, system));
                [1.0; 2]
            }
            // Coordinates are counted in the unit of their system, whatever a writer found handier to list.
            (Some(HorizontalSize::Metres(size)), _) => [x.unit, y.unit].map(|unit| match unit {
                Some(Unit::Metres(metres)) => exact_metres(metres / size),
                _ => 1.0,
            }),
            _ => [1.0; 2],
        }
    }

    /// Size and place of a grid of GMT before version 4: a list of samples from the north-west, and its shape in variables beside it.
    fn flat(&self) -> Result<(Declared, Shape), LayoutError> {
        let two = |name: &str| -> Result<Option<[f64; 2]>, LayoutError> {
            let Some((place, variable)) = self.beside(name) else { return Ok(None) };
            if variable.shape() != [2] {
                return Ok(None);
            }
            let all = netcdf_reader::NcSliceInfo::all(1);
            let values = file::guarded(self.path, &format!("variable \"{}\"", harmless(name, 40)), || {
                self.file.read_variable_slice_as_f64(&place, &all)
            })?;
            Ok(values.as_slice().and_then(|values| <[f64; 2]>::try_from(values).ok()))
        };
        let damaged = |problem: &str| LayoutError::damaged(self.path, "variable \"dimension\"", problem);
        let sides = two("dimension")?
            .ok_or_else(|| damaged("it does not hold columns and rows; fetch the file again"))?;
        let is_side = |side: f64| side.fract() == 0.0 && (2.0..=f64::from(i32::MAX)).contains(&side);
        let listed = self.grid.variable.shape()[0];
        if !sides.iter().all(|side| is_side(*side)) || sides[0] * sides[1] != listed as f64 {
            return Err(damaged("it does not go with the number of samples; fetch the file again"));
        }
        // Checked just above.
        let samples = sides.map(|side| side as u32);
        let mut declared =
            Declared::new(samples, self.sample_type(), format!("{} (GMT before 4)", self.format()));
        if let (Some([west, east]), Some([south, north])) = (two("x_range")?, two("y_range")?) {
            let attributes = self.grid.variable.attributes();
            let is_area = number(attributes, "node_offset") == Some(1.0);
            let gaps = sides.map(|side| if is_area { side } else { side - 1.0 });
            let [across, down] = [(east - west) / gaps[0], (north - south) / gaps[1]];
            let half = if is_area { 0.5 } else { 0.0 };
            let units = ["x_range", "y_range"].map(|name| {
                self.beside(name)
                    .and_then(|(_, v)| text(v.attributes(), "units"))
                    .and_then(|name| units::unit(&name))
            });
            let [x, y] =
                units.map(|unit| if let Some(Unit::Degrees(degrees)) = unit { degrees } else { 1.0 });
            let map = [west + half * across, across, 0.0, north - half * down, 0.0, -down];
            if map.iter().all(|value| value.is_finite()) && across > 0.0 && down > 0.0 {
                let map = std::array::from_fn(|i| map[i] * [x, y][i / 3]);
                declared.place = Some(Said::new(map, "variables \"x_range\" and \"y_range\""));
            }
            if matches!(units[0], Some(Unit::Degrees(_))) {
                let size = HorizontalSize::Radians(1f64.to_radians());
                declared.crs.unit = Some(Said::new(size, "units of variable \"x_range\""));
            }
        }
        Ok((declared, Shape { samples, is_transposed: false }))
    }

    /// What the numbers of the variable mean.
    fn values(&self, declared: &mut Declared) {
        let attributes = self.grid.variable.attributes();
        let name = harmless(&self.grid.place, 40);
        let by = |attribute: &str| format!("attribute {attribute} of variable \"{name}\"");
        let value = &mut declared.value;
        let scale = number(attributes, "scale_factor");
        value.scale = scale.map(|scale| Said::new(scale, by("scale_factor")));
        value.offset = number(attributes, "add_offset").map(|offset| Said::new(offset, by("add_offset")));
        for attribute in ["_FillValue", "missing_value"] {
            let texts = exact(attributes, attribute).into_iter().take(16).map(|text| self.without_sign(text));
            value.nodata.extend(texts.map(|text| Said::new(text, by(attribute))));
        }
        if value.nodata.is_empty()
            && let Some(fill) = default_fill(self.grid.variable.dtype())
        {
            value.nodata.push(Said::new(fill.to_owned(), "netCDF's own fill value"));
        }
        let valid = valid::of(self.grid.variable);
        declared.warnings.extend(valid.problems.into_iter().map(Warning::new));
        if let Some([low, high]) = valid.range {
            let shown = match [low, high].map(f64::is_finite) {
                [true, false] => format!("below {low}"),
                [false, true] => format!("above {high}"),
                _ => format!("below {low} or above {high}"),
            };
            let by = by(valid.by);
            declared.notes.push(format!("numbers {shown}, as they are stored, mean \"no data\", by {by}"));
            value.valid = Some(Said::new([low, high], by));
        }
        let standard = text(attributes, "standard_name").unwrap_or_default();
        let units = text(attributes, "units").unwrap_or_default();
        let squared = units.replace(['*', '^', ' '], "");
        if matches!(squared.as_str(), "m2s-2" | "m2/s2" | "m2s−2" | "J/kg" | "Jkg-1") {
            value.unit = Some(Said::new(VerticalUnit::Metres(1.0 / STANDARD_GRAVITY), by("units")));
            declared.notes.push(format!(
                "variable \"{name}\" is a geopotential in {}; divided by {STANDARD_GRAVITY} m/s2 it is a height",
                harmless(&units, 20)
            ));
        } else if !units.is_empty() {
            value.unit = Some(Said::new(VerticalUnit::Name(units), by("units")));
        }
        let positive = text(attributes, "positive").unwrap_or_default();
        if positive.eq_ignore_ascii_case("down") {
            value.direction = Some(Said::new(Direction::Down, by("positive")));
        } else if standard.starts_with("sea_floor_depth") || standard == "depth" {
            value.direction = Some(Said::new(Direction::Down, by("standard_name")));
        }
        for attribute in ["scale_factor", "add_offset"] {
            let is_one = number(attributes, attribute).is_some() && numbers(attributes, attribute).len() == 1;
            if is_one || !attributes::has(attributes, attribute) {
                continue;
            }
            match attribute {
                "scale_factor" => value.scale = None,
                _ => value.offset = None,
            }
            let words =
                format!("{} is not one number and was left out, so heights may be wrong", by(attribute));
            declared.warnings.push(Warning::new(words).mended_by(Remedy::HeightFactor, "FACTOR"));
        }
    }

    /// A fill value that is written with a sign and meant without.
    fn without_sign(&self, text: String) -> String {
        let bits = match self.grid.variable.dtype() {
            NcType::Byte => 8,
            NcType::Short => 16,
            NcType::Int => 32,
            _ => return text,
        };
        let number = text.parse::<i64>().ok().filter(|number| *number < 0 && is_unsigned(self.grid.variable));
        number.map_or(text, |number| (number + (1i64 << bits)).to_string())
    }

    /// A variable in the grid's group, or in that above all, with its place.
    fn beside(&self, name: &str) -> Option<(String, &NcVariable)> {
        let inside = self.grid.place.rsplit_once('/').map(|(group, _)| format!("{group}/"));
        let here = self.grid.group.variables.iter().find(|variable| variable.name() == name);
        if let Some(variable) = here {
            return Some((format!("{}{name}", inside.unwrap_or_default()), variable));
        }
        let above = self.root.variables.iter().find(|variable| variable.name() == name);
        above.map(|variable| (name.to_owned(), variable))
    }

    fn sample_type(&self) -> SampleType {
        let unsigned = is_unsigned(self.grid.variable);
        match self.grid.variable.dtype() {
            NcType::Byte if unsigned => SampleType::U8,
            NcType::Byte => SampleType::I8,
            NcType::UByte => SampleType::U8,
            NcType::Short if unsigned => SampleType::U16,
            NcType::Short => SampleType::I16,
            NcType::UShort => SampleType::U16,
            NcType::Int if unsigned => SampleType::U32,
            NcType::Int => SampleType::I32,
            NcType::UInt => SampleType::U32,
            NcType::Int64 => SampleType::I64,
            NcType::UInt64 => SampleType::U64,
            NcType::Float => SampleType::F32,
            _ => SampleType::F64,
        }
    }

    fn format(&self) -> String {
        use netcdf_reader::NcFormat;
        let name = match self.file.format() {
            NcFormat::Classic => "netCDF classic",
            NcFormat::Offset64 => "netCDF 64-bit offset",
            NcFormat::Cdf5 => "netCDF CDF-5",
            NcFormat::Nc4 | NcFormat::Nc4Classic => "netCDF-4",
        };
        name.to_owned()
    }

    fn too_large(&self) -> LayoutError {
        let place = format!("variable \"{}\"", harmless(&self.grid.place, 40));
        LayoutError::damaged(self.path, place, "its size is out of range; fetch the file again")
    }
}

/// What netCDF puts where nothing was written. Bytes have none, for all their values are in use.
fn default_fill(dtype: &NcType) -> Option<&'static str> {
    Some(match dtype {
        NcType::Short => "-32767",
        NcType::Int => "-2147483647",
        NcType::UShort => "65535",
        NcType::UInt => "4294967295",
        NcType::Float => "9.969209968386869e36",
        NcType::Double => "9.969209968386869e36",
        _ => return None,
    })
}
