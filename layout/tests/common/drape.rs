//! Terrain files with pictures draped over them, and their tiles as texels.

use std::path::Path;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{Georeference, HorizontalUnit, MemoryDem, SampleType};
use terrasoar_layout::imagery::{
    DrapeOptions, Draped, ImageSource, Imagery, MemoryImage, TileFormat, TileId, decode_tile, drape,
};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// A terrain of 61 x 41 samples 20 m apart, its south-west sample at 1000, 4000 of EPSG 32610.
pub fn land(path: &Path) {
    let mut dem = MemoryDem::from_fn([61, 41], SampleType::I16, |x, y| f64::from(100 + x * 3 % 17 + y));
    dem.info_mut().georeference = Georeference {
        epsg: Some(32610),
        unit: HorizontalUnit::Metre,
        pixel_to_crs: Some([1000.0, 20.0, 0.0, 4800.0, 0.0, -20.0]),
        ..Georeference::default()
    };
    build(&dem, path, &BuildOptions::default(), &Silent).unwrap();
}

/// Drapes one picture over the terrain at `path`.
pub fn draped(path: &Path, image: MemoryImage, options: &DrapeOptions) -> Result<Draped, LayoutError> {
    let images: Vec<Box<dyn ImageSource>> = vec![Box::new(image)];
    drape(path, &images, options, &Silent)
}

pub fn raw() -> DrapeOptions {
    DrapeOptions::default().format(TileFormat::Rgba8)
}

/// Everything about the imagery of a file.
pub struct Opened {
    pub terrain: Terrain,
    pub imagery: Imagery,
}

impl Opened {
    pub fn new(path: &Path) -> Self {
        let terrain = Terrain::open(path).unwrap();
        let imagery = Imagery::open(&terrain).unwrap().expect("imagery");
        Self { terrain, imagery }
    }

    /// A tile of 512 x 512 texels, rows from the south; `None` if it is absent.
    pub fn tile(&self, id: TileId) -> Option<Vec<[u8; 4]>> {
        let mut bytes = Vec::new();
        if !self.imagery.read_tile(&self.terrain, id, &mut bytes).unwrap() {
            return None;
        }
        let texels = decode_tile(self.imagery.shape().format, &bytes).unwrap();
        Some(texels.as_chunks::<4>().0.to_vec())
    }
}

/// Whether two terrains show the same picture, byte by byte.
pub fn same_picture(a: &Terrain, b: &Terrain) -> bool {
    let (Some(in_a), Some(in_b)) = (Imagery::open(a).unwrap(), Imagery::open(b).unwrap()) else {
        return false;
    };
    let tile = |imagery: &Imagery, terrain: &Terrain, id| {
        let mut bytes = Vec::new();
        imagery.read_tile(terrain, id, &mut bytes).unwrap();
        (imagery.average(id), bytes)
    };
    in_a.shape() == in_b.shape() && in_a.shape().ids().all(|id| tile(&in_a, a, id) == tile(&in_b, b, id))
}
