//! A virtual raster over sound files beside it: alone, and as one of several files.

use crate::import::{read, read_several};
use crate::seeds::Inputs;
use crate::words::told;
use terrasoar_import::{OpenOptions, Priority};

/// Files that it may name.
const GRID: &[u8] = b"ncols 6\nnrows 5\nxllcorner 500000\nyllcorner 5000000\ncellsize 10\nNODATA_value -9\n1 2 3 4 5 6\n5 6 -9 8 9 1\n9 10 11 12 2 3\n1 2 3 4 5 6\n7 7 7 7 7 7\n";
const OTHER: &[u8] =
    b"ncols 4\nnrows 3\nxllcorner 500030\nyllcorner 5000020\ncellsize 10\n1.5 2 3 4\n5 6 7 8\n9 10 11 12\n";
/// Larger ones take long, and nothing else than small ones.
const MOST_SAMPLES: u64 = 1 << 18;

pub(crate) fn seeds() -> Inputs {
    let head = "<VRTDataset rasterXSize=\"12\" rasterYSize=\"10\">\n<SRS>EPSG:32632</SRS>\n<GeoTransform>500000,10,0,5000050,0,-10</GeoTransform>\n";
    let source = |kind: &str, name: &str, rest: &str| {
        format!(
            "<{kind}><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename><SourceBand>1</SourceBand>{rest}</{}>",
            kind.split(' ').next().unwrap_or(kind)
        )
    };
    let band = |kind: &str, inside: &str| {
        format!("<VRTRasterBand dataType=\"{kind}\" band=\"1\">{inside}</VRTRasterBand>")
    };
    let to = "<SrcRect xOff=\"0.5\" yOff=\"0\" xSize=\"4\" ySize=\"5\"/><DstRect xOff=\"2\" yOff=\"1.25\" xSize=\"9\" ySize=\"7\"/>";
    let whole = format!(
        "<NoDataValue>-9</NoDataValue>{}{}",
        source("SimpleSource", "a.asc", ""),
        source("ComplexSource", "b.asc", "<NODATA>-9</NODATA>")
    );
    let pieces = [
        band("Int16", &whole),
        band(
            "Float32",
            &source(
                "ComplexSource resampling=\"bilinear\"",
                "a.asc",
                &format!("{to}<ScaleOffset>3</ScaleOffset><ScaleRatio>0.5</ScaleRatio>"),
            ),
        ),
        band(
            "Float64",
            &source(
                "SimpleSource resampling=\"average\"",
                "a.asc",
                "<SrcRect xOff=\"0\" yOff=\"0\" xSize=\"6\" ySize=\"5\"/><DstRect xOff=\"0\" yOff=\"0\" xSize=\"3\" ySize=\"2\"/>",
            ),
        ),
        band(
            "Byte",
            &source("ComplexSource", "a.asc", "<LUT>0:10,5:20,9:0</LUT><UseMaskBand>true</UseMaskBand>"),
        ),
        band(
            "Int32",
            &format!(
                "<HideNoDataValue>1</HideNoDataValue><NoDataValue>7</NoDataValue><Scale>0.1</Scale><Offset>-5</Offset><UnitType>ft</UnitType>{}",
                source(
                    "ComplexSource",
                    "a.asc",
                    "<Exponent>0.5</Exponent><SrcMin>0</SrcMin><SrcMax>12</SrcMax><DstMin>0</DstMin><DstMax>900</DstMax>"
                )
            ),
        ),
        format!(
            "<MaskBand>{}</MaskBand>{}",
            band("Byte", &source("SimpleSource", "a.asc", "").replace("<SourceBand>1", "<SourceBand>mask,1")),
            band("Int16", &source("SimpleSource", "b.asc", to))
        ),
        band(
            "Int16",
            &format!("{}{}", source("SimpleSource", "dem.vrt", ""), source("SimpleSource", "none.asc", "")),
        ),
        band("Int16\" subClass=\"VRTDerivedRasterBand", "<PixelFunctionType>sum</PixelFunctionType>"),
    ];
    let numbered = pieces.into_iter().enumerate();
    numbered
        .map(|(i, piece)| (format!("raster {i}"), format!("{head}{piece}</VRTDataset>\n").into_bytes()))
        .collect()
}

pub(crate) fn body(data: &[u8]) {
    let files = [("dem.vrt", data), ("a.asc", GRID), ("b.asc", OTHER)];
    let folder = crate::scratch::folder();
    let path = folder.path().join("dem.vrt");
    crate::seeds::write(&path, data);
    let Some(dem) = told(terrasoar_import::open_file(&path)) else { return };
    let info = dem.info();
    if u64::from(info.samples_wide) * u64::from(info.samples_high) > MOST_SAMPLES {
        return;
    }
    read(&files, &OpenOptions::default());
    for priority in [Priority::Finest, Priority::Highest] {
        read_several(&files, &OpenOptions { priority, ..OpenOptions::default() });
    }
}
