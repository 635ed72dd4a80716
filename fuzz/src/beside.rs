//! What lies beside a sound DEM and says more about it: a reference system as text, and GDAL's `.aux.xml`. The system is also what a person names.

use crate::import::read;
use crate::seeds::Inputs;
use crate::words::told;
use terrasoar_import::OpenOptions;
use terrasoar_import::places::Crs;

/// The DEM.
const GRID: &[u8] =
    b"ncols 4\nnrows 3\nxllcorner 8\nyllcorner 46\ncellsize 0.01\n1 2 3 4\n5 6 7 8\n9 10 11 12\n";

pub(crate) mod reference_system {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        const TEXTS: [&str; 7] = [
            "EPSG:32632+5730",
            "+proj=omerc +lat_0=4 +lonc=115 +alpha=53.3 +gamma=53.1 +k=0.99984 +x_0=0 +y_0=0 +ellps=evrstSS +units=ch",
            "Projection UTM\nZone 10\nDatum NAD27\nUnits METERS\nParameters\n",
            "PROJCS[\"a\",GEOGCS[\"b\",DATUM[\"c\",SPHEROID[\"d\",6378137,298.25]],PRIMEM[\"e\",0],UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],\
             PARAMETER[\"central_meridian\",9],PARAMETER[\"scale_factor\",0.9996],UNIT[\"foot\",0.3048],AXIS[\"x\",WEST]]",
            "COMPD_CS[\"a\",GEOGCS[\"b\",DATUM[\"c\",SPHEROID[\"d\",6378137,0]],UNIT[\"grad\",0.01570796]],VERT_CS[\"v\",VERT_DATUM[\"w\",2005],UNIT[\"US survey foot\",0.3048006096],AXIS[\"d\",DOWN]]]",
            "PROJCRS[\"a\",BASEGEOGCRS[\"b\",DATUM[\"c\",ELLIPSOID[\"d\",1737400,0,LENGTHUNIT[\"metre\",1]]]],CONVERSION[\"e\",METHOD[\"Polar Stereographic (variant A)\",ID[\"EPSG\",9810]],\
             PARAMETER[\"Latitude of natural origin\",-90,ANGLEUNIT[\"degree\",0.0174532925199433]]],CS[Cartesian,2],AXIS[\"x\",north],AXIS[\"y\",north],LENGTHUNIT[\"km\",1000]]",
            "{\"type\": \"GeographicCRS\", \"name\": \"a\"}",
        ];
        TEXTS.iter().enumerate().map(|(i, text)| (format!("system {i}"), text.as_bytes().to_vec())).collect()
    }

    pub(crate) fn body(data: &[u8]) {
        let text = String::from_utf8_lossy(data);
        if let Some(crs) = told(Crs::named(&text)) {
            assert!(crs.name().chars().all(|c| !c.is_control()), "{:?}", crs.name());
        }
        read(&[("dem.asc", GRID), ("dem.prj", data)], &OpenOptions::default());
        let named = OpenOptions {
            crs: Some(text.into_owned()),
            reproject: Some("auto".into()),
            ..OpenOptions::default()
        };
        read(&[("dem.asc", GRID)], &named);
    }
}

pub(crate) mod aux_xml {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let text = "<PAMDataset>\n  <SRS dataAxisToSRSAxisMapping=\"2,1\">EPSG:4326</SRS>\n  <GeoTransform> 8, 0.01, 0.001, 47, 0, -0.01</GeoTransform>\n  \
                    <Metadata><MDI key=\"AREA_OR_POINT\">Point</MDI></Metadata>\n  <PAMRasterBand band=\"1\">\n    <NoDataValue le_hex_equiv=\"0000\">-9.99e3</NoDataValue>\n    \
                    <UnitType>ft &amp; &#x6d;</UnitType>\n    <Offset>-100</Offset>\n    <Scale>0.1</Scale>\n  </PAMRasterBand>\n</PAMDataset>\n";
        let parts = [
            "<PAMDataset><SRS>EPSG:32633</SRS></PAMDataset>",
            "<PAMDataset><GeoTransform>8,0,0.01,46,0.01,0</GeoTransform></PAMDataset>",
            "<PAMDataset><PAMRasterBand band=\"1\"><Scale>-1e-3</Scale><Offset>1e300</Offset><NoDataValue>nan</NoDataValue></PAMRasterBand></PAMDataset>",
        ];
        let parts = parts.iter().enumerate().map(|(i, text)| (format!("part {i}"), text.as_bytes().to_vec()));
        parts.chain([("all".into(), text.into())]).collect()
    }

    pub(crate) fn body(data: &[u8]) {
        read(&[("dem.asc", GRID), ("dem.asc.aux.xml", data)], &OpenOptions::default());
    }
}
