//! Elevation data of which no terrain can come: words before anything is published, at best before anything is read; and inputs that are no files.

#[path = "import_support/packing.rs"]
mod packing;
#[path = "import_support/peak.rs"]
mod peak;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use packing::packed;
use peak::{alone, peak};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemInfo, DemSource, MemoryDem, SampleSink, SampleType};
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::progress::{Progress, Silent};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::{LayoutError, Remedy};
use tiff::{DATA_AT, DEFLATE, RAW, Tag, ZSTD, heights, one_strip, reals, shorts, text, tiff};

/// Counts the samples that were read.
#[derive(Default)]
struct Reading(AtomicU64);

impl Progress for Reading {
    fn stage(&self, _: &'static str, _: u64) {}
    fn advance(&self, samples: u64) {
        self.0.fetch_add(samples, Ordering::Relaxed);
    }
}

/// Builds, and opens what was built; a refusal must leave nothing behind.
fn built(dem: &dyn DemSource, options: &BuildOptions) -> Result<Terrain, (LayoutError, u64)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.iqt");
    let reading = Reading::default();
    match build(dem, &path, options, &reading) {
        Ok(_) => Ok(Terrain::open_unmapped(&path).expect("what was built opens")),
        Err(error) => {
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{error}");
            Err((error, reading.0.into_inner()))
        }
    }
}

/// A grid of 4 x 4 heights with some tags set otherwise.
fn grid(height: u16, other: Vec<Tag>) -> (tempfile::TempDir, Box<dyn DemSource>) {
    let data = height.to_le_bytes().repeat(16);
    let tags = heights([4; 2], RAW, 4, &[DATA_AT], &[data.len() as u32]).into_iter().chain(other).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    std::fs::write(&path, tiff(false, tags, &data)).unwrap();
    let dem = terrasoar_import::open(&[path]).unwrap();
    (folder, dem)
}

/// Degrees on a body of such a radius.
fn body(radius_m: f64) -> Vec<Tag> {
    let keys = [1, 1, 0, 4, 1024, 0, 1, 2, 2048, 0, 1, 32767, 2057, 34736, 1, 0, 2054, 0, 1, 9102];
    vec![shorts(34735, &keys), reals(34736, &[radius_m]), reals(33550, &[0.001, 0.001, 0.0])]
}

fn metadata(scale: &str, offset: &str) -> Vec<Tag> {
    vec![text(
        42112,
        &format!(
            "<GDALMetadata><Item name=\"SCALE\" sample=\"0\" role=\"scale\">{scale}</Item>\
             <Item name=\"OFFSET\" sample=\"0\" role=\"offset\">{offset}</Item></GDALMetadata>"
        ),
    )]
}

#[test]
fn numbers_that_no_header_holds_are_refused_before_a_sample_is_read() {
    let stated = BuildOptions::default().spacing_m([10.0; 2]);
    let scaled = stated.clone().z_scale(1e13);
    for (other, options, words) in [
        (body(1e13), &stated, "radius of 1e13 m"),
        (body(f64::MAX), &stated, "e308 m"),
        (vec![reals(33550, &[1e308, 1e308, 0.0])], &stated, "coordinates beyond all numbers"),
        (
            vec![reals(33922, &[0.0, 0.0, 0.0, f64::MAX, f64::MAX, 0.0]), reals(33550, &[1e300, 1e300, 0.0])],
            &stated,
            "",
        ),
        (metadata("1e13", "0"), &stated, "factor on heights"),
        // Depths counted downward.
        (metadata("-1", "0"), &stated, ""),
        (vec![], &scaled, "factor on heights"),
        (metadata("1e300", "1e300"), &scaled, "factor on heights"),
    ] {
        let (_folder, dem) = grid(0, other);
        match built(&*dem, options) {
            Ok(_) => assert_eq!(words, "", "it was built"),
            Err((error, read)) => {
                let said = error.to_string();
                assert!(said.contains(words) && said.len() < 300, "{words}: {said}");
                assert_eq!(read, 0, "{said}");
            }
        }
    }
}

/// What only the heights themselves tell is told once they are read, and before any work on them.
#[test]
fn heights_that_no_header_holds_are_refused_when_they_are_read() {
    let far = |offset_m: f64, raw: f64| {
        let mut dem = MemoryDem::from_fn([5, 5], SampleType::F64, |x, _| raw + f64::from(x) * 2.0);
        dem.info_mut().height_offset_m = offset_m;
        dem
    };
    let exact = BuildOptions::default().spacing_m([10.0; 2]).record(RecordKind::Exact16);
    // Heights near zero over a base that is too far away.
    let (error, read) = built(&far(1e13, -1e13), &exact).unwrap_err();
    assert!(error.to_string().contains("heights from 1"), "{error}");
    assert_eq!((error.remedy(), read), (Some(Remedy::HeightFactor), 50));
    assert!(built(&far(1e8, -1e8), &exact).is_ok());
    let (error, _) = built(&far(0.0, 1e300), &exact).unwrap_err();
    assert!(error.to_string().contains("1e300") && error.remedy() == Some(Remedy::Nodata), "{error}");
}

/// Whatever a source says of itself, the file opens or there is none.
#[test]
fn whatever_numbers_a_source_has_the_file_opens_or_there_is_none() {
    const NUMBERS: [f64; 13] =
        [0.0, -0.0, 1.0, -1.0, 1e-300, 1e9, 1e12, 1e13, -1e13, 1e308, f64::INFINITY, f64::NAN, 5e-324];
    let mut made = 0;
    for raw in [0.0, 1.0, 1e6, 1e12] {
        for number in NUMBERS {
            for field in 0..5 {
                let mut dem = MemoryDem::from_fn([3, 4], SampleType::F64, |x, y| raw + f64::from(x * y));
                let info: &mut DemInfo = dem.info_mut();
                info.georeference.pixel_to_crs = Some([0.0, 5.0, 0.0, 0.0, 0.0, -5.0]);
                match field {
                    0 => info.height_scale = number,
                    1 => info.height_offset_m = number,
                    2 => info.georeference.body_radius_m = Some(number),
                    3 => info.georeference.pixel_to_crs = Some([number, 5.0, 0.0, number, 0.0, -5.0]),
                    _ => info.georeference.pixel_to_crs = Some([0.0, number, 0.0, 0.0, number, -5.0]),
                }
                for record in [None, Some(RecordKind::Compact), Some(RecordKind::Exact16)] {
                    let options = BuildOptions::default().record(record);
                    made += u32::from(built(&dem, &options).is_ok());
                }
            }
        }
    }
    assert!(made > 150, "only {made} were built");
}

#[test]
fn texts_in_headers_are_harmless() {
    let mut dem = MemoryDem::from_fn([3, 3], SampleType::U8, |x, _| f64::from(x));
    dem.info_mut().georeference.crs_name = "a\u{1b}[31mb\n\u{202e}c".into();
    dem.info_mut().format = "\u{7}".repeat(300) + "bell";
    let terrain = built(&dem, &BuildOptions::default()).unwrap();
    assert_eq!((&terrain.header().crs_name[..], &terrain.header().source[..]), ("a[31mbc", "bell"));
}

/// What reading takes is part of the budget.
#[test]
fn memory_that_reading_takes_is_asked_for_in_words() {
    use std::io::Write;
    let mut encoder = zstd::Encoder::new(Vec::new(), 22).unwrap();
    encoder.write_all(&vec![7u8; 20 << 20]).unwrap();
    encoder.flush().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    std::fs::write(&path, one_strip([1024, 10 * 1024], ZSTD, &encoder.finish().unwrap())).unwrap();
    let dem = terrasoar_import::open(&[path]).unwrap();
    let with = |memory_mib| built(&*dem, &BuildOptions::default().memory_mib(memory_mib));
    let (error, read) = with(64).unwrap_err();
    let Some(Remedy::Memory { enough_mib: Some(enough) }) = error.remedy() else { panic!("{error}") };
    assert!((130..200).contains(&enough) && error.to_string().contains(&enough.to_string()), "{error}");
    assert_eq!(read, 0);
    assert!(with(enough - 1).is_err() && with(enough).is_ok());
}

/// A strip that unpacks to half a gigabyte, in a budget of a tenth.
#[test]
fn a_bomb_of_one_strip_is_built_within_its_budget() {
    let _alone = alone();
    let side = 4097u32;
    let rows: Vec<u8> = (0..side * side).flat_map(|i| ((i / side) as u16).to_le_bytes()).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    std::fs::write(&path, one_strip([side; 2], DEFLATE, &packed(DEFLATE, &rows))).unwrap();
    drop(rows);
    let dem = terrasoar_import::open(&[path]).unwrap();
    let options = BuildOptions::default().memory_mib(48);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let out = folder.path().join("a.iqt");
    let (done, bytes) = peak(|| pool.install(|| build(&*dem, &out, &options, &Silent)));
    done.unwrap();
    assert!(bytes < 48 << 20, "{bytes} bytes");
}

/// Pipes, devices, folders and sockets under the names of every format.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_without_waiting_for_it() {
    use std::os::unix::fs::symlink;
    use std::os::unix::net::UnixListener;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let said = |path: &Path| match terrasoar_import::open(&[path.to_owned()]) {
        Ok(_) => panic!("{} was opened", path.display()),
        Err(error) => error.to_string(),
    };
    for end in ["tif", "png", "bt", "hgt"] {
        let pipe = at(&format!("pipe.{end}"));
        make_pipe(&pipe);
        let zero = at(&format!("N10E010.{end}"));
        symlink("/dev/zero", &zero).unwrap();
        let socket = at(&format!("socket.{end}"));
        let _listening = UnixListener::bind(&socket).unwrap();
        let inside = at(&format!("folder.{end}"));
        std::fs::create_dir(&inside).unwrap();
        for (path, words) in [(pipe, "pipe"), (zero, "device"), (socket, "socket"), (inside, "folder")] {
            assert!(said(&path).contains(words), "{}: {}", path.display(), said(&path));
            let both: Vec<PathBuf> = vec![path.clone(), path];
            assert!(terrasoar_import::open(&both).is_err());
        }
        assert!(said(&at("none")).contains("No such file"));
    }
}

#[cfg(unix)]
fn make_pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// A file that turns into something else between looking and reading, and one that is cut short.
#[test]
fn files_that_change_while_they_are_read_are_told() {
    struct Void;
    impl SampleSink for Void {
        fn put(&self, _: terrasoar_layout::dem::Window, _: &[f64]) -> Result<(), LayoutError> {
            Ok(())
        }
    }
    for compression in [RAW, DEFLATE] {
        let noise: Vec<u8> = (0..256u32 * 256).flat_map(|i| ((i * i / 7) as u16).to_le_bytes()).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        std::fs::write(&path, one_strip([256; 2], compression, &packed(compression, &noise))).unwrap();
        let dem = terrasoar_import::open(std::slice::from_ref(&path)).unwrap();
        std::fs::File::options().write(true).open(&path).unwrap().set_len(2000).unwrap();
        let said = dem.stream(&Void).unwrap_err().to_string();
        assert!(said.contains("cut short while it was read"), "{said}");
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert!(dem.stream(&Void).unwrap_err().to_string().contains("folder"));
    }
}
