//! From the tree of a virtual raster to what it says.
//!
//! Of the bands only the one that is wanted is taken apart. What is not read here is refused when the file is opened, with the command that lets GDAL compute it. Cost: one pass.

use super::change::{Change, Power};
use super::said::{Band, Part, Source, Vrt};
use crate::options::{OpenOptions, Resampling};
use crate::value;
use crate::xml::{self, number_of, text_of};
use roxmltree::{Document, Node};
use std::path::Path;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::harmless;

/// Sources of one band, at most.
const MOST_SOURCES: usize = 1 << 16;
/// Samples of a grid, at most: 256 times those of the largest terrain, for what is thinned out.
const MOST_SAMPLES: u64 = 1 << 42;
/// Numbers of a table.
const MOST_ENTRIES: usize = 1 << 16;

/// What the virtual raster at `path` says.
///
/// # Errors
/// [`LayoutError::Damaged`] for what is missing or no number, [`LayoutError::Unsupported`] for what is not read here, [`LayoutError::Usage`] for a band that is not there.
pub(super) fn vrt(path: &Path, tree: &Document<'_>, options: &OpenOptions) -> Result<Vrt, LayoutError> {
    let root = tree.root_element();
    if !root.has_tag_name("VRTDataset") {
        return Err(LayoutError::damaged(
            path,
            "its text",
            "it is no virtual raster; write it again with gdalbuildvrt",
        ));
    }
    if let Some(kind) = root.attribute("subClass") {
        return Err(computed(path, kind));
    }
    let side = |name: &str| {
        let said = root.attribute(name).and_then(|text| text.trim().parse::<u32>().ok());
        said.filter(|side| (2..=i32::MAX as u32).contains(side)).ok_or_else(|| {
            LayoutError::damaged(
                path,
                name,
                format!(
                    "\"{}\" is no number of samples that a grid has; write the file again with gdalbuildvrt",
                    harmless(root.attribute(name).unwrap_or(""), 40)
                ),
            )
        })
    };
    let samples = [side("rasterXSize")?, side("rasterYSize")?];
    if u64::from(samples[0]) * u64::from(samples[1]) > MOST_SAMPLES {
        return Err(LayoutError::unsupported(
            path,
            format!(
                "it has {} x {} samples, and of a virtual raster at most {MOST_SAMPLES} are read; cut out what you need: gdal_translate -projwin W N E S -of VRT",
                samples[0], samples[1]
            ),
        ));
    }
    let is_alpha = |node: &Node<'_, '_>| text_of(*node, "ColorInterp") == Some("Alpha");
    let bands: Vec<Node<'_, '_>> =
        root.children().filter(|node| node.has_tag_name("VRTRasterBand")).collect();
    let names: Vec<&str> = bands.iter().map(|band| text_of(*band, "Description").unwrap_or("")).collect();
    let choices: Vec<usize> = (0..bands.len()).filter(|at| !is_alpha(&bands[*at])).collect();
    let chosen = match (&options.band, choices.as_slice()) {
        (Some(word), _) if !bands.is_empty() => value::band(path, word, bands.len(), &names)?,
        (_, [band]) => *band,
        (_, []) => {
            return Err(LayoutError::damaged(
                path,
                "its text",
                "it has no band; write it again with gdalbuildvrt",
            ));
        }
        (_, several) => {
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "it has {} bands{}, each with data of its own, as gdalbuildvrt -separate makes them; say which one holds the heights, or let one band have all files: gdalbuildvrt FILE.vrt FILES",
                    several.len(),
                    listed(&names)
                ),
            )
            .mended_by(Remedy::Band));
        }
    };
    let corners = text_of(root, "GeoTransform").map(|text| {
        xml::transform(text).ok_or_else(|| {
            LayoutError::damaged(
                path,
                "GeoTransform",
                format!(
                    "\"{}\" does not place a grid; set it again: gdal_edit.py -a_ullr W N E S FILE.vrt",
                    harmless(text, 80)
                ),
            )
        })
    });
    let has = |name: &str| root.children().any(|node| node.has_tag_name(name));
    let mask = root.children().find(|node| node.has_tag_name("MaskBand"));
    let mask = mask.and_then(|node| node.children().find(|node| node.has_tag_name("VRTRasterBand")));
    // A band of alpha hides as a mask does.
    let mask = mask.or_else(|| {
        bands.iter().enumerate().find(|(at, node)| *at != chosen && is_alpha(node)).map(|(_, node)| *node)
    });
    Ok(Vrt {
        samples,
        by_points: corners.is_none() && has("GCPList"),
        corners: corners.transpose()?,
        system: text_of(root, "SRS").map(str::to_owned),
        band: band(path, bands[chosen], chosen as u32 + 1)?,
        mask: mask.map(|node| band(path, node, 0)).transpose()?,
    })
}

/// The names of bands, as far as there are some, for a message.
fn listed(names: &[&str]) -> String {
    let known = (1..).zip(names).filter(|(_, name)| !name.is_empty());
    let known: Vec<String> =
        known.take(12).map(|(number, name)| format!("{number} \"{}\"", harmless(name, 40))).collect();
    if known.is_empty() { String::new() } else { format!(" ({})", known.join(", ")) }
}

/// A refusal of what GDAL computes.
fn computed(path: &Path, what: &str) -> LayoutError {
    LayoutError::unsupported(
        path,
        format!(
            "its data is computed by GDAL ({}), which is not done here; let GDAL do it once and build what comes out: gdal_translate {} heights.tif",
            harmless(what, 60),
            path.file_name().unwrap_or_default().to_string_lossy()
        ),
    )
}

fn band(path: &Path, node: Node<'_, '_>, number: u32) -> Result<Band, LayoutError> {
    if let Some(kind) = node.attribute("subClass").filter(|kind| *kind != "VRTSourcedRasterBand") {
        let what = match text_of(node, "PixelFunctionType") {
            Some(function) => format!("{kind}, pixel function {function}"),
            None => kind.to_owned(),
        };
        return Err(computed(path, &what));
    }
    let sample_type = match node.attribute("dataType").unwrap_or("Byte") {
        "Byte" => SampleType::U8,
        "Int8" => SampleType::I8,
        "UInt16" => SampleType::U16,
        "Int16" => SampleType::I16,
        "UInt32" => SampleType::U32,
        "Int32" => SampleType::I32,
        "UInt64" => SampleType::U64,
        "Int64" => SampleType::I64,
        "Float16" => SampleType::F16,
        "Float32" => SampleType::F32,
        "Float64" => SampleType::F64,
        other => {
            return Err(LayoutError::unsupported(
                path,
                format!("its samples are of type \"{}\", which are no heights", harmless(other, 40)),
            ));
        }
    };
    let hides = node.children().any(|child| {
        child.has_tag_name("HideNoDataValue")
            && !matches!(child.text().map(str::trim), Some("0" | "NO" | "FALSE"))
    });
    let mut sources = Vec::new();
    for child in node.children().filter(Node::is_element) {
        match child.tag_name().name() {
            "SimpleSource" | "ComplexSource" => sources.push(source(path, child)?),
            name if name.ends_with("Source") => return Err(computed(path, name)),
            _ => {}
        }
        if sources.len() > MOST_SOURCES {
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "it lists more than {MOST_SOURCES} files; cut out what you need: gdal_translate -projwin W N E S -of VRT"
                ),
            ));
        }
    }
    Ok(Band {
        number,
        sample_type,
        nodata: text_of(node, "NoDataValue").filter(|_| !hides).map(str::to_owned),
        scale: number_of(node, "Scale"),
        offset: number_of(node, "Offset"),
        unit: text_of(node, "UnitType").map(str::to_owned),
        sources,
    })
}

fn source(path: &Path, node: Node<'_, '_>) -> Result<Source, LayoutError> {
    let wrong = |what: &str, text: &str| {
        LayoutError::damaged(
            path,
            what,
            format!(
                "\"{}\" cannot be what stands there; write the file again with gdalbuildvrt",
                harmless(text, 60)
            ),
        )
    };
    let named = node.children().find(|child| child.has_tag_name("SourceFilename"));
    let name = named.and_then(|child| child.text()).map(str::trim).filter(|name| !name.is_empty());
    let (Some(named), Some(name)) = (named, name) else { return Err(wrong("SourceFilename", "")) };
    let is_relative = named.attribute("relativeToVRT").is_some_and(|text| text.trim() == "1");
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = if is_relative { folder.join(name) } else { Path::new(name).to_owned() };
    let word = text_of(node, "SourceBand").unwrap_or("1");
    let number = |word: &str| word.trim().parse::<u32>().ok().filter(|number| *number > 0);
    let part = match word.split_once(',') {
        None => number(word).map(Part::Band),
        Some((kind, band)) if kind.trim() == "mask" => number(band).map(Part::Mask),
        Some(_) => None,
    };
    let part = part.ok_or_else(|| wrong("SourceBand", word))?;
    let rectangle = |name: &str| {
        let Some(child) = node.children().find(|child| child.has_tag_name(name)) else { return Ok(None) };
        let side = |key: &str| {
            let text = child.attribute(key).unwrap_or("");
            // Far more samples than any raster has, and far from where doubles lose halves.
            let value = text.trim().parse::<f64>().ok().filter(|value| value.abs() < 1e12);
            value.ok_or_else(|| wrong(&format!("{name} {key}"), text))
        };
        let sides = [side("xOff")?, side("yOff")?, side("xSize")?, side("ySize")?];
        if sides[2] <= 0.0 || sides[3] <= 0.0 {
            return Err(wrong(name, "a size of 0 or less"));
        }
        Ok(Some(sides))
    };
    let (from, to) = (rectangle("SrcRect")?, rectangle("DstRect")?);
    let kernel = node.attribute("resampling").unwrap_or("nearest");
    let resampling = match kernel.to_ascii_lowercase().as_str() {
        "near" | "nearest" | "nearestneighbour" => Resampling::Nearest,
        "bilinear" => Resampling::Bilinear,
        "cubic" => Resampling::Cubic,
        "lanczos" => Resampling::Lanczos,
        "average" => Resampling::Average,
        other => return Err(computed(path, &format!("resampling {other}"))),
    };
    let change = node.has_tag_name("ComplexSource").then(|| change(path, node, &wrong)).transpose()?;
    Ok(Source { file, part, from, to, resampling, change })
}

fn change(
    path: &Path,
    node: Node<'_, '_>,
    wrong: &dyn Fn(&str, &str) -> LayoutError,
) -> Result<Change, LayoutError> {
    if text_of(node, "ColorTableComponent").is_some_and(|component| component != "0") {
        return Err(computed(path, "a colour table"));
    }
    let scale = match (number_of(node, "ScaleRatio"), number_of(node, "ScaleOffset")) {
        (None, None) => None,
        (ratio, offset) => Some([ratio.unwrap_or(1.0), offset.unwrap_or(0.0)]),
    };
    let power = match number_of(node, "Exponent") {
        None => None,
        Some(exponent) => {
            let limit = |name: &str| number_of(node, name).ok_or_else(|| wrong(name, ""));
            let from = [limit("SrcMin")?, limit("SrcMax")?];
            if from[0] == from[1] {
                return Err(wrong("SrcMax", "a range of one number"));
            }
            Some(Power { exponent, from, to: [limit("DstMin")?, limit("DstMax")?] })
        }
    };
    let mut table: Vec<[f64; 2]> = Vec::new();
    for entry in text_of(node, "LUT").iter().flat_map(|text| text.split(',')) {
        let numbers = entry
            .split_once(':')
            .and_then(|(a, b)| Some([a.trim().parse::<f64>().ok()?, b.trim().parse::<f64>().ok()?]));
        let ascends = |numbers: &[f64; 2]| {
            numbers.iter().all(|value| value.is_finite())
                && table.last().is_none_or(|[last, _]| *last < numbers[0])
        };
        match numbers.filter(ascends) {
            Some(numbers) if table.len() < MOST_ENTRIES => table.push(numbers),
            _ => return Err(wrong("LUT", entry)),
        }
    }
    let is_on = |text: &str| !matches!(text.to_ascii_lowercase().as_str(), "0" | "no" | "false" | "off");
    Ok(Change {
        nodata: text_of(node, "NODATA").map(str::to_owned),
        uses_mask: text_of(node, "UseMaskBand").is_some_and(is_on),
        scale,
        power,
        table,
    })
}
