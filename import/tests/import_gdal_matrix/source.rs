//! Files made by GDAL: raw samples and a virtual raster that says what they are, brought into the format by `gdal_translate`.

use super::combination::{Combination, Kind, Unit, Void};
use super::tools;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Runs one of GDAL's tools with its files beside in force, for these are what is tried.
pub(crate) fn run(folder: &Path, tool: &str, arguments: &[&str]) -> Result<String, String> {
    tools::try_run(folder, tool, arguments, true)
}

/// Makes the file of a combination in `folder`.
pub(crate) fn make(folder: &Path, combination: &Combination) -> Result<PathBuf, String> {
    let Combination { kind, void, samples: [wide, high], .. } = *combination;
    let io = |error: std::io::Error| error.to_string();
    let mut samples = Vec::new();
    let mut shown = Vec::new();
    for row in 0..high {
        for col in 0..wide {
            let is_void = combination.is_void(col, row);
            let mark = void.mark(kind).filter(|_| is_void);
            samples.extend(kind.bytes(mark.unwrap_or_else(|| kind.number(col as f64, row as f64))));
            let full = if kind == Kind::UInt16 { 65_535.0 } else { 255.0 };
            shown.extend(if void == Void::Alpha { kind } else { Kind::Byte }.bytes(if is_void {
                0.0
            } else {
                full
            }));
        }
    }
    std::fs::write(folder.join("samples.raw"), samples).map_err(io)?;
    std::fs::write(folder.join("shown.raw"), shown).map_err(io)?;
    std::fs::write(folder.join("source.vrt"), label(combination)).map_err(io)?;
    // The name of a tile says where it lies.
    let stem = if combination.format.driver == "SRTMHGT" { "N46E008" } else { "made" };
    let name = format!("{stem}.{}", combination.format.ending);
    let mut arguments = vec!["-q", "-of", combination.format.driver];
    if kind == Kind::Float16 {
        arguments.extend(["-co", "NBITS=16"]);
    }
    if kind == Kind::UInt12 {
        arguments.extend(["-co", "NBITS=12"]);
    }
    if kind == Kind::Int8 {
        arguments.extend(["-co", "PIXELTYPE=SIGNEDBYTE"]);
    }
    for option in &combination.creation {
        arguments.extend(["-co", option]);
    }
    let inside = if void == Void::InsideMask { "YES" } else { "NO" };
    // A virtual raster is one of a file that is none.
    let mut source = "source.vrt";
    if combination.format.driver == "VRT" {
        source = "between.tif";
        let between = ["-q", "--config", "GDAL_TIFF_INTERNAL_MASK", inside, "source.vrt", source];
        run(folder, "gdal_translate", &between)?;
    }
    arguments.extend(["--config", "GDAL_TIFF_INTERNAL_MASK", inside, source, &name]);
    run(folder, "gdal_translate", &arguments)?;
    if let (Void::AuxXml, Some(mark)) = (void, void.mark(kind)) {
        let beside = format!(
            "<PAMDataset>\n  <PAMRasterBand band=\"1\">\n    <NoDataValue>{mark:e}</NoDataValue>\n  </PAMRasterBand>\n</PAMDataset>\n"
        );
        std::fs::write(folder.join(format!("{name}.aux.xml")), beside).map_err(io)?;
    }
    Ok(folder.join(name))
}

/// The virtual raster of a combination.
fn label(combination: &Combination) -> String {
    let Combination { kind, void, samples: [wide, high], meaning, .. } = combination;
    let mut text = format!("<VRTDataset rasterXSize=\"{wide}\" rasterYSize=\"{high}\">\n");
    if !combination.system.text.is_empty() {
        let escaped = combination.system.text.replace('"', "&quot;");
        let _ = writeln!(text, "<SRS dataAxisToSRSAxisMapping=\"{}\">{escaped}</SRS>", axes(combination));
    }
    let map = combination.map().map(|number| format!("{number:.17e}")).join(", ");
    let _ = writeln!(text, "<GeoTransform>{map}</GeoTransform>");
    if combination.is_point {
        text.push_str("<Metadata><MDI key=\"AREA_OR_POINT\">Point</MDI></Metadata>\n");
    }
    let band = |kind: Kind, number: u32, file: &str, inner: &str| {
        let bytes = kind.bytes(0.0).len();
        format!(
            "<VRTRasterBand dataType=\"{}\" band=\"{number}\" subClass=\"VRTRawRasterBand\">\n{inner}<SourceFilename relativetoVRT=\"1\">{file}</SourceFilename>\n\
             <ImageOffset>0</ImageOffset><PixelOffset>{bytes}</PixelOffset><LineOffset>{}</LineOffset><ByteOrder>LSB</ByteOrder>\n</VRTRasterBand>\n",
            kind.gdal(),
            bytes * wide,
        )
    };
    let mut inner = String::new();
    // A mark beside the file is written later; not-a-number needs no word.
    if matches!(void, Void::Declared | Void::Lowest)
        && let Some(mark) = void.mark(*kind)
    {
        let mark = if kind.is_real() { format!("{mark:.17e}") } else { mark.to_string() };
        let _ = writeln!(inner, "<NoDataValue>{mark}</NoDataValue>");
    }
    if !meaning.unit.is_empty() {
        let _ = writeln!(inner, "<UnitType>{}</UnitType>", meaning.unit);
    }
    if meaning.scale != 1.0 || meaning.offset != 0.0 {
        let _ = writeln!(inner, "<Offset>{}</Offset><Scale>{}</Scale>", meaning.offset, meaning.scale);
    }
    text.push_str(&band(*kind, 1, "samples.raw", &inner));
    match void {
        Void::Alpha => {
            text.push_str(&band(*kind, 2, "shown.raw", "<ColorInterp>Alpha</ColorInterp>\n"));
        }
        Void::InsideMask | Void::MaskFile => {
            let mask = band(Kind::Byte, 1, "shown.raw", "").replace(" band=\"1\"", "");
            let _ = write!(text, "<MaskBand>\n{mask}</MaskBand>\n");
        }
        _ => {}
    }
    text + "</VRTDataset>\n"
}

/// East before north, whichever comes first in the registry.
fn axes(combination: &Combination) -> &'static str {
    let text = combination.system.text;
    match (combination.system.unit == Unit::Degrees, text.contains('+') && text.starts_with("EPSG")) {
        (true, true) => "2,1,3",
        (true, false) => "2,1",
        (false, true) => "1,2,3",
        (false, false) => "1,2",
    }
}
