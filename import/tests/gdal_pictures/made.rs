//! Files that GDAL writes from bands of plain numbers.

use super::tools;
use std::path::{Path, PathBuf};

/// A band: what VRT says of it, and its numbers as bytes, the lowest first.
pub(crate) struct Band {
    pub(crate) said: String,
    pub(crate) numbers: Vec<u8>,
}

/// Writes `name` with the options of `arguments`: of so many texels, and of numbers of `kind`, as GDAL calls them, of so many bytes.
pub(crate) fn make(
    folder: &Path,
    size: [usize; 2],
    (kind, bytes): (&str, usize),
    bands: &[Band],
    (name, arguments): (&str, &[&str]),
) -> Result<PathBuf, String> {
    let mut vrt = format!("<VRTDataset rasterXSize=\"{}\" rasterYSize=\"{}\">\n", size[0], size[1]);
    for (number, band) in (1..).zip(bands) {
        std::fs::write(folder.join(format!("{number}.raw")), &band.numbers)
            .map_err(|error| error.to_string())?;
        vrt += &format!(
            "<VRTRasterBand dataType=\"{kind}\" band=\"{number}\" subClass=\"VRTRawRasterBand\">{}<SourceFilename relativetoVRT=\"1\">{number}.raw</SourceFilename>\
             <ImageOffset>0</ImageOffset><PixelOffset>{bytes}</PixelOffset><LineOffset>{}</LineOffset><ByteOrder>LSB</ByteOrder></VRTRasterBand>\n",
            band.said,
            bytes * size[0]
        );
    }
    std::fs::write(folder.join("source.vrt"), vrt + "</VRTDataset>").map_err(|error| error.to_string())?;
    tools::try_run(folder, "gdal_translate", &[&["-q"], arguments, &["source.vrt", name]].concat(), true)?;
    Ok(folder.join(name))
}
