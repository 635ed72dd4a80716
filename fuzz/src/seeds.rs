//! Seeds from the fixtures of other tests and small ones made here; findings from `regressions`.

use std::path::{Path, PathBuf};
use terrasoar_layout::testing::Seed;

/// Inputs with their names.
pub type Inputs = Vec<(String, Vec<u8>)>;

/// Largest file of a folder that is taken as a seed.
const MOST_BYTES: u64 = 16 << 10;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The small files of a folder of the repository that have one of these extensions.
pub(crate) fn folder(name: &str, extensions: &[&str]) -> Inputs {
    let entries = std::fs::read_dir(root().join(name)).into_iter().flatten().flatten();
    let is_wanted = |path: &Path| {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        extensions.contains(&extension) && path.metadata().is_ok_and(|meta| meta.len() <= MOST_BYTES)
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_wanted(path)).collect();
    paths.sort();
    let read = |path: PathBuf| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        Some((name, std::fs::read(&path).ok()?))
    };
    paths.into_iter().filter_map(read).collect()
}

/// Every finding of a target so far.
pub(crate) fn regressions(target: &str) -> Inputs {
    let entries =
        std::fs::read_dir(root().join("fuzz/regressions").join(target)).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    paths.sort();
    let read =
        |path: PathBuf| Some((path.file_name()?.to_string_lossy().into_owned(), std::fs::read(&path).ok()?));
    paths.into_iter().filter_map(read).collect()
}

/// Elevation data of the formats that are no TIFF.
pub(crate) fn elevation() -> Inputs {
    let mut bt = vec![0; 256];
    bt[..10].copy_from_slice(b"binterr1.3");
    bt[10..14].copy_from_slice(&20i32.to_le_bytes());
    bt[14..18].copy_from_slice(&15i32.to_le_bytes());
    bt[18..20].copy_from_slice(&2i16.to_le_bytes());
    bt[22..24].copy_from_slice(&1i16.to_le_bytes());
    bt[24..26].copy_from_slice(&10i16.to_le_bytes());
    for (i, side) in [1000.0f64, 1200.0, 4000.0, 4150.0].iter().enumerate() {
        bt[28 + 8 * i..36 + 8 * i].copy_from_slice(&side.to_le_bytes());
    }
    bt[62..66].copy_from_slice(&1.0f32.to_le_bytes());
    bt.extend((0..300i16).flat_map(|i| (i % 37 * 3).to_le_bytes()));
    let hgt = (0..144i16).flat_map(|i| (i % 12 * (i / 12)).to_be_bytes()).collect();
    vec![("small.bt".into(), bt), ("N10E010.hgt".into(), hgt), ("grey-16.png".into(), grey_png())]
}

/// A PNG of 6 x 5 samples of 16 bits, its data stored and not packed.
fn grey_png() -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8; 4], data: &[u8]| {
        png.extend((data.len() as u32).to_be_bytes());
        png.extend(name);
        png.extend(data);
        png.extend([0; 4]);
    };
    chunk(b"IHDR", &[0, 0, 0, 6, 0, 0, 0, 5, 16, 0, 0, 0, 0]);
    let rows: Vec<u8> = (0..5u8)
        .flat_map(|y| std::iter::once(0).chain((0..6u8).flat_map(move |x| [1, x * 20 + y])))
        .collect();
    let length = rows.len() as u16;
    let mut packed = vec![0x78, 0x01, 1];
    packed.extend(length.to_le_bytes());
    packed.extend((!length).to_le_bytes());
    packed.extend(&rows);
    let (a, b) = rows.iter().fold((1u32, 0u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65_521;
        (a, (b + a) % 65_521)
    });
    packed.extend((b << 16 | a).to_be_bytes());
    chunk(b"IDAT", &packed);
    chunk(b"IEND", &[]);
    with_png_sums(&png)
}

/// A PNG's chunks with sums that match, so that what is behind the sums is reached; anything else as it is.
pub(crate) fn with_png_sums(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        return bytes;
    }
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let Some(end) = at.checked_add(8 + length).filter(|end| end + 4 <= bytes.len()) else { break };
        let sum = crc32fast::hash(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
    bytes
}

/// A flight over the sound terrains and the other ways to write one.
pub(crate) fn flights() -> Inputs {
    let head = "terrasoar-flight 1\nunits metres degrees seconds\n";
    let inputs = [
        (
            "plain",
            format!(
                "{head}# terrain: land\n0 100 100 400 0 -15 0 45\n0.1 110 105 390 3 -16 1 45\n0.2 120 110 380 6 -17 2 45\n"
            ),
        ),
        ("far", format!("{head}0 -1e9 1e9 1e9 1e9 -90 -1e9 179.999\n1e9 0 0 -1e9 0 90 0 1e-300\n")),
        ("inside", format!("\u{feff}{head}0 200 200 150 90 0 0 60\r\n\n# a remark\n0 200 200 150 90 0 0 60")),
        ("at-a-sample", format!("{head}0 200 200 150 0 -90 0 90\n0 10 10 152 0 0 0 90\n")),
    ];
    inputs.into_iter().map(|(name, text)| (name.to_owned(), text.into_bytes())).collect()
}

/// Scripts of edits with everything that a script may have.
pub(crate) fn scripts() -> Inputs {
    let head = "terrasoar-edits 1\nunits metres degrees\n";
    let inputs = [
        (
            "all",
            format!(
                "{head}\nbatch dam across\nflatten at 150,182 radius 60 to 112.5 strength 1 falloff smooth\nraise at 150,182 radius 25 by 14 falloff \
                 linear\nset rect 7,3,8,4 to 130\nend\n\n# a remark\ncrater at 90,140.5 radius 40 depth 9 direction 135\n\nstamp \"a b.hgt\" sample 5,6 mode max\n\
                 smooth at 110,130 radius 80 strength 0.5 falloff smooth\nframe 1\nlower at 300,300 radius 50 by 3 falloff hard\nrestore disc 150,182 radius 200\n"
            ),
        ),
        (
            "beyond",
            format!(
                "{head}set rect 0,0,60,50 to 1e7\n\nset rect 0,0,9,9 to -1e7\n\nrestore rect 0,0,4294967295,4294967295\n"
            ),
        ),
        (
            "seconds",
            format!(
                "{head}raise at 200,200 radius 1e7 by 1e-300\nat 0.1\nlower at -1e9,1e9 radius 1e-300 by 1e7\nat 1e9\nflatten at 1,1 radius 30\n"
            ),
        ),
        (
            "stamps",
            format!(
                "{head}stamp x sample -3,-4 mode add\nstamp x sample 1048576,1048576\nstamp x sample 55,45 mode min\n"
            ),
        ),
    ];
    inputs.into_iter().map(|(name, text)| (name.to_owned(), text.into_bytes())).collect()
}

/// World files.
pub(crate) fn world_files() -> Inputs {
    let inputs = [
        ("plain", "10\n0\n0\n-10\n1005\n4480\n"),
        ("south-up", "10\n0\n0\n10\n1005\n4005\n"),
        ("turned", "0\n10\n10\n0\n1005\n4480\n"),
        ("fine", "1e-5 0 0 -1e-5 1100 4200"),
        ("huge", "1e300\n0\n0\n-1e300\n-1e300\n1e300\n"),
    ];
    inputs.into_iter().map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec())).collect()
}

/// Writes a file of a run.
pub(crate) fn write(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}

/// The sound files themselves, and each with one mutation of every kind.
pub(crate) fn recipes(lands: &[Seed]) -> Inputs {
    let mut inputs = Inputs::new();
    for (number, land) in (0u8..).zip(lands) {
        inputs.push((land.name.into(), vec![number, 0]));
        for kind in 0..16u8 {
            let recipe = [number, kind & 1, kind, kind.wrapping_mul(37), 0, number, 0, kind, 1, 0];
            inputs.push((format!("{}, {kind}", land.name), recipe.to_vec()));
        }
    }
    inputs
}
