//! Pictures as people have them: four quarters of colour (red, green, blue and yellow as seen from above), told in every way that was once misread.

use std::path::PathBuf;
use terrasoar_import::{open_file, open_image, open_images_on};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::header::Header;
use terrasoar_layout::imagery::{DrapeOptions, ImageSource, drape};
use terrasoar_layout::progress::Silent;

const RED: [u8; 3] = [220, 30, 30];
const GREEN: [u8; 3] = [30, 200, 30];
const BLUE: [u8; 3] = [40, 40, 220];
const YELLOW: [u8; 3] = [230, 220, 30];

fn case(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/cases").join(name)
}

fn terrain(name: &str) -> Header {
    let folder = tempfile::tempdir().unwrap();
    let dem = open_file(&case(name)).unwrap();
    build(&*dem, &folder.path().join("t.iqt"), &BuildOptions::default(), &Silent).unwrap()
}

struct Shown {
    texels: [usize; 2],
    rgba: Vec<u8>,
    map: Option<[f64; 6]>,
    notes: Vec<String>,
}

impl Shown {
    fn of(image: &dyn ImageSource) -> Self {
        let info = image.info();
        let texels = info.texels.map(|side| side as usize);
        let mut rgba = vec![0; texels[0] * texels[1] * 4];
        image.rows().unwrap().read(&mut rgba).unwrap();
        Self { texels, rgba, map: info.georeference.pixel_to_crs, notes: info.notes.clone() }
    }

    /// The texel at a share of the picture's width and height.
    fn at(&self, [x, y]: [f64; 2]) -> [u8; 4] {
        let [wide, high] = self.texels;
        let at = (y * high as f64) as usize * wide + (x * wide as f64) as usize;
        self.rgba[4 * at..4 * at + 4].try_into().unwrap()
    }

    /// Whether a texel is of a colour and seen, to what JPEG loses.
    fn is(&self, at: [f64; 2], colour: [u8; 3]) -> bool {
        let texel = self.at(at);
        texel[3] == 255 && texel.iter().zip(colour).all(|(ours, wanted)| ours.abs_diff(wanted) <= 8)
    }

    fn quarters(&self, name: &str, quarters: [Option<[u8; 3]>; 4]) {
        let places = [[0.2, 0.2], [0.8, 0.2], [0.2, 0.8], [0.8, 0.8]];
        for (at, colour) in places.into_iter().zip(quarters) {
            match colour {
                Some(colour) => assert!(self.is(at, colour), "{name} at {at:?}: {:?}", self.at(at)),
                None => assert_eq!(self.at(at)[3], 0, "{name} at {at:?} is seen"),
            }
        }
    }
}

fn shown(name: &str) -> Shown {
    Shown::of(&*open_image(&case(name)).unwrap())
}

#[test]
fn colours_are_those_of_the_picture_however_its_bands_are_called() {
    let all = [RED, GREEN, BLUE, YELLOW].map(Some);
    for name in ["d01-plain.tif", "d06-rgb8-minisblack.tif", "d06b-rgb8-minisblack-nodata.tif"] {
        shown(name).quarters(name, all);
    }
    // Of 12 bits in use the upper eight are shown: 3,080 is 192 of 256.
    let wide = shown("d05-rgb16.tif");
    let part = |eight: u8| (f64::from(eight) * 14.0 / 16.0) as u8;
    wide.quarters("d05-rgb16.tif", [RED, GREEN, BLUE, YELLOW].map(|colour| Some(colour.map(part))));
    assert!(wide.notes.iter().any(|note| note.contains("red, green and blue")), "{:?}", wide.notes);
}

#[test]
fn what_a_mask_or_a_value_hides_is_transparent() {
    let east = [None, Some(GREEN), None, Some(YELLOW)];
    for name in ["d02-jpeg-mask.tif", "d15-nodata0.tif", "d16-alpha.tif"] {
        shown(name).quarters(name, east);
    }
}

#[test]
fn world_files_are_found_by_every_spelling() {
    for name in ["d03-tfw.tif", "d07-upper.jpg"] {
        let map = shown(name).map.unwrap();
        let corner = [map[0] - 0.5 * map[1], map[3] - 0.5 * map[5]];
        let terrain = terrain("d00-flat.tif").sample_to_crs.unwrap();
        let from_south_west = [corner[0] - terrain[0], corner[1] - 310.0 - terrain[3]];
        assert_eq!(from_south_west.map(f64::round), [200.0, -5.0], "{name}: {map:?}");
    }
}

#[test]
fn a_camera_held_sideways_shows_upright() {
    let picture = shown("d04-exif6.jpg");
    assert_eq!(picture.texels, [410, 310]);
    picture.quarters("d04-exif6.jpg", [RED, GREEN, BLUE, YELLOW].map(Some));
    // Beside a world file the rows of the file lie as they are, as programs of maps have it.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.jpg");
    std::fs::copy(case("d04-exif6.jpg"), &path).unwrap();
    std::fs::write(folder.path().join("p.jgw"), "1\n0\n0\n-1\n5,5\n3\n").unwrap();
    let placed = Shown::of(&*open_image(&path).unwrap());
    assert_eq!((placed.texels, placed.map), ([310, 410], Some([5.5, 1.0, 0.0, 3.0, 0.0, -1.0])));
}

#[test]
fn a_scan_of_tiff_that_lies_sideways_shows_upright() {
    let mut bytes = std::fs::read(case("d03-tfw.tif")).unwrap();
    assert!(bytes.starts_with(b"II*\0"));
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    // Its planar configuration, which is the usual one, becomes the tag of its orientation.
    let first = number(4);
    let count = usize::from(u16::from_le_bytes([bytes[first], bytes[first + 1]]));
    let mut entries = (0..count).map(|i| first + 2 + 12 * i);
    let entry = entries.find(|at| bytes[*at..*at + 2] == 284u16.to_le_bytes()).unwrap();
    bytes[entry..entry + 2].copy_from_slice(&274u16.to_le_bytes());
    bytes[entry + 8] = 6;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.tif");
    std::fs::write(&path, bytes).unwrap();
    let picture = Shown::of(&*open_image(&path).unwrap());
    assert_eq!(picture.texels, [310, 205]);
    // The file's rows from the top are columns from the right: green above yellow is yellow beside green.
    assert!(picture.is([0.2, 0.5], YELLOW) && picture.is([0.8, 0.5], GREEN), "{:?}", picture.at([0.2, 0.5]));
}

/// A grey PNG of 16 bits, and the world file that places it.
fn deep(path: &std::path::Path, size: [u32; 2], numbers: impl Fn(u32, u32) -> u16, world: &str) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let places = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
    let bytes: Vec<u8> = places.flat_map(|(x, y)| numbers(x, y).to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
    std::fs::write(path.with_extension("pgw"), world).unwrap();
}

#[test]
fn pictures_beside_each_other_are_as_bright_and_of_texels_as_fine() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("t.iqt");
    let dem = open_file(&case("d00-flat.tif")).unwrap();
    let header = build(&*dem, &out, &BuildOptions::default(), &Silent).unwrap();
    let [left, right] = ["left.png", "right.png"].map(|name| folder.path().join(name));
    // Of 10 bits in use, and of 12; the second of texels twice as large, half a texel off the first's.
    deep(&left, [40, 60], |x, y| 100 * (1 + (x + y) as u16 % 9), "2\n0\n0\n-2\n500101\n5000199\n");
    deep(&right, [20, 30], |_, _| 3600, "4\n0\n0\n-4\n500183\n5000199\n");
    let one = Shown::of(&*open_image(&left).unwrap());
    assert_eq!(one.rgba[0], (100u16 >> 2) as u8, "the upper 8 of 10 bits");
    let both = open_images_on(&[left, right], &header).unwrap();
    let shown: Vec<Shown> = both.iter().map(|image| Shown::of(&**image)).collect();
    assert_eq!(shown[0].rgba[0], (100u16 >> 4) as u8, "the upper 8 of 12 bits");
    assert_eq!(shown[1].at([0.5, 0.5]), [225, 225, 225, 255], "3,600 of 12 bits");
    let steps = shown.iter().map(|shown| shown.map.unwrap()).collect::<Vec<_>>();
    assert_eq!([steps[1][1], steps[1][5]], [2.0, -2.0]);
    let apart = [(steps[1][0] - steps[0][0]) / 2.0, (steps[1][3] - steps[0][3]) / 2.0];
    assert_eq!(apart, apart.map(f64::round), "texels of one lattice");
    assert!(
        shown[1].texels[0].abs_diff(40) <= 1 && shown[1].texels[1].abs_diff(60) <= 1,
        "{:?}",
        shown[1].texels
    );
    let draped = drape(&out, &both, &DrapeOptions::default(), &Silent).unwrap();
    assert_eq!(draped.shape.texel_m, [2.0, 2.0]);
    // What would become too fine is refused.
    let [drone, scene] = ["drone.png", "scene.png"].map(|name| folder.path().join(name));
    deep(&drone, [9, 9], |_, _| 9, "0.01\n0\n0\n-0.01\n500101\n5000199\n");
    deep(&scene, [40, 30], |_, _| 9, "10\n0\n0\n-10\n500005\n5000305\n");
    let refused = open_images_on(&[drone, scene], &header).err().unwrap().to_string();
    assert!(refused.contains("scene.png") && refused.contains("gdalwarp -tr"), "{refused}");
}

#[test]
fn a_picture_cut_at_another_longitude_covers_both_halves() {
    let header = terrain("d10-world360.tif");
    let brought = open_images_on(&[case("d10-world180-rgb.tif")], &header).unwrap();
    let picture = Shown::of(&*brought[0]);
    assert_eq!(picture.map.unwrap()[0], 1.0, "the first texel is that of 0 to 2 degrees east");
    let plain = shown("d10-world180-rgb.tif");
    for y in [0.1, 0.5, 0.9] {
        for x in [0.01, 0.2, 0.45, 0.55, 0.8, 0.99] {
            assert_eq!(picture.at([x, y]), plain.at([(x + 0.5) % 1.0, y]), "{x} {y}");
        }
    }
}

#[test]
fn what_has_no_way_to_the_terrain_is_refused_with_words() {
    let header = terrain("d00-flat.tif");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.jpg");
    std::fs::copy(case("d07-upper.jpg"), &path).unwrap();
    std::fs::write(folder.path().join("p.jgw"), "1 0 0 -1 0 0").unwrap();
    let refused = |system: &str| -> LayoutError {
        std::fs::write(folder.path().join("p.prj"), system).unwrap();
        match open_images_on(std::slice::from_ref(&path), &header) {
            Ok(_) => panic!("{system} was taken"),
            Err(error) => error,
        }
    };
    let site = refused("LOCAL_CS[\"the quarry\",UNIT[\"metre\",1]]").to_string();
    assert!(site.contains("the quarry") && site.contains("gdalwarp"), "{site}");
    let moon = refused("+proj=longlat +R=1737400 +no_defs").to_string();
    assert!(moon.contains("another body"), "{moon}");
}

/// A picture whose datum lies elsewhere by a shift that is not known is laid beside its place, which is told.
#[test]
fn a_picture_of_a_datum_that_is_not_tied_is_told() {
    let header = terrain("d00-flat.tif");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.jpg");
    std::fs::copy(case("d07-upper.jpg"), &path).unwrap();
    std::fs::write(folder.path().join("p.jgw"), "2 0 0 -2 500000 5000300").unwrap();
    let told = |system: &str| {
        std::fs::write(folder.path().join("p.prj"), system).unwrap();
        let brought = open_images_on(std::slice::from_ref(&path), &header).unwrap();
        brought[0].info().notes.iter().any(|note| note.contains("shift between the datums"))
    };
    assert!(told("+proj=utm +zone=32 +datum=NAD27") && told("+proj=utm +zone=32 +ellps=intl"));
    assert!(!told("+proj=utm +zone=32 +ellps=intl +towgs84=-87,-98,-121"));
}
