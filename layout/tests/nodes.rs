//! Directories with nodes, of squares of more than 2^17 steps: few bytes are read to open them, damage of a node is an error wherever its pages are asked for, and no small file stands for a large one.

mod common;

use common::open_bytes;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemSource, MemoryDem, SampleType};
use terrasoar_layout::edit::{Edit, EditSession, SampleRect};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::testing::{Counts, reseal};
use terrasoar_layout::verify::verify;
use terrasoar_layout::with_records;

/// Two shores of a strip across a square of 2^18 steps: pages under several nodes.
fn strip() -> (MemoryDem, Vec<u8>) {
    let size = [(1 << 17) + 300, 20];
    let dem = MemoryDem::from_fn(size, SampleType::I16, |x, y| match x {
        0..40 | 131_300.. => f64::from(x * 7 % 29 + y * y),
        _ => f64::NAN,
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strip.iqt");
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
    (dem, std::fs::read(path).unwrap())
}

fn number(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Places of entries that are present among `count` at `at`, and the pages that they name.
fn entries(bytes: &[u8], at: usize, count: usize) -> Vec<(usize, usize)> {
    let all = (0..count).map(|i| (at + 16 * i, number(bytes, at + 16 * i)));
    all.filter(|(_, page)| *page > 0).collect()
}

/// Entries of the root, each with the number of its node.
fn nodes(bytes: &[u8]) -> Vec<(usize, usize, usize)> {
    let (root, count) = (number(bytes, 0x078) * PAGE_BYTES, number(bytes, 0x07c));
    entries(bytes, root, count).into_iter().map(|(at, page)| ((at - root) / 16, at, page)).collect()
}

/// What is said of a file where all of it is asked for.
fn refusal(bytes: Vec<u8>) -> String {
    open_bytes(bytes).and_then(|terrain| terrain.check_directory()).unwrap_err().to_string()
}

/// What is said where one page is asked for.
fn refusal_of(bytes: Vec<u8>, page: u64) -> String {
    open_bytes(bytes).and_then(|terrain| terrain.entry(page)).unwrap_err().to_string()
}

fn check_heights(dem: &MemoryDem, terrain: &Terrain) {
    let [wide, high] = [dem.info().samples_wide, dem.info().samples_high];
    with_records!(terrain.records().unwrap(), records => {
        for (x, y) in (0..high).flat_map(|y| (0..45).chain(wide - 150..wide).map(move |x| (x, y))) {
            let v = records.vertex_at(terrasoar_layout::grid::GridPoint::new(x, y));
            let height = Some(v.height_m).filter(|_| !v.class.is_void());
            assert_eq!(height, Some(dem.sample(x, y)).filter(|v| !v.is_nan()), "({x}, {y})");
        }
    });
}

#[test]
fn the_root_leads_to_nodes_and_these_to_leaves() {
    let (dem, bytes) = strip();
    let terrain = open_bytes(bytes.clone()).unwrap();
    let pages = terrain.page_count();
    assert_eq!(number(&bytes, 0x07c) as u64, pages.div_ceil(256).div_ceil(256));
    let nodes = nodes(&bytes);
    assert!(nodes.len() > 2, "{nodes:?}");
    let mut present = 0;
    for (node, _, page) in &nodes {
        for (leaf_at, leaf) in entries(&bytes, page * PAGE_BYTES, 256) {
            let leaf_number = 256 * node + (leaf_at - page * PAGE_BYTES) / 16;
            for (at, record_page) in entries(&bytes, leaf * PAGE_BYTES, 256) {
                let logical = 256 * leaf_number + (at - leaf * PAGE_BYTES) / 16;
                assert_eq!(terrain.entry(logical as u64).unwrap().page as usize, record_page);
                present += 1;
            }
        }
    }
    assert_eq!(present, terrain.header().stored_pages);
    assert_eq!(terrain.present_pages().unwrap().count() as u64, present);
    let report = verify(&terrain, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    check_heights(&dem, &terrain);
}

#[test]
fn damage_of_a_node_is_an_error_wherever_its_pages_are_asked_for() {
    let (_, bytes) = strip();
    let nodes = nodes(&bytes);
    for (node, _, page) in &nodes {
        for at in (0..PAGE_BYTES).step_by(509) {
            let mut damaged = bytes.clone();
            damaged[page * PAGE_BYTES + at] ^= 1 << (at % 8);
            let words = format!("directory node {node}: the checksum does not match");
            assert!(refusal(damaged.clone()).contains(&words));
            assert!(refusal_of(damaged.clone(), 65_536 * *node as u64).contains(&words));
            let terrain = open_bytes(damaged).unwrap();
            // What other nodes lead to is read all the same.
            for (other, ..) in nodes.iter().filter(|(other, ..)| other != node) {
                terrain.entry(65_536 * *other as u64 + 3).unwrap();
            }
            assert!(terrain.records().is_err() && terrain.entry(65_536 * *node as u64).is_err());
            let report = verify(&terrain, &|_| {}).unwrap();
            assert!(report.problems[0].to_string().contains(&words), "{:?}", report.problems);
        }
    }
    // Cut anywhere it is refused.
    for length in (0..bytes.len()).step_by(4001) {
        assert!(open_bytes(bytes[..length].to_vec()).is_err(), "{length}");
    }
    // An editor opens no file that it could not commit to, and leaves it as it is.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.iqt");
    let mut damaged = bytes.clone();
    damaged[nodes[0].2 * PAGE_BYTES] ^= 1;
    std::fs::write(&path, &damaged).unwrap();
    assert!(EditSession::open(&path).is_err());
    assert!(std::fs::read(&path).unwrap() == damaged);
}

/// Checksums are right, and what they are of is nonsense.
#[test]
fn nodes_that_lead_elsewhere_are_refused() {
    let (_, bytes) = strip();
    let nodes = nodes(&bytes);
    let leaves: Vec<Vec<(usize, usize)>> =
        nodes.iter().map(|(.., page)| entries(&bytes, page * PAGE_BYTES, 256)).collect();
    let with = |at: usize, page: u32| {
        let mut changed = bytes.clone();
        changed[at..at + 4].copy_from_slice(&page.to_le_bytes());
        reseal(&mut changed, Counts::Keep);
        changed
    };
    let (node, at, page) = nodes[0];
    let of_first = 65_536 * node as u64;
    // A leaf that is another's, of the same node and of another one; the node itself; the root; beyond the end.
    let several = leaves.iter().position(|leaves| leaves.len() > 1).unwrap();
    let twice = with(leaves[several][1].0, leaves[several][0].1 as u32);
    assert!(refusal(twice).contains("has another use as well"));
    let shared = with(leaves[0][0].0, leaves[1][0].1 as u32);
    assert!(refusal(shared.clone()).contains("has another use as well"));
    // The first of the two that is asked for is taken for what it says it is, the other refused.
    let terrain = open_bytes(shared).unwrap();
    terrain.entry(65_536 * nodes[1].0 as u64).unwrap();
    let said = terrain.entry(of_first).unwrap_err().to_string();
    assert!(said.contains("has another use as well"), "{said}");
    assert_eq!(terrain.entry(of_first).unwrap_err().to_string(), said, "it is said again");
    for wrong in [page as u32, number(&bytes, 0x078) as u32] {
        assert!(refusal_of(with(leaves[0][0].0, wrong), of_first).contains("has another use as well"));
    }
    for wrong in [1, 2, (bytes.len() / PAGE_BYTES) as u32, u32::MAX] {
        let said = refusal_of(with(leaves[0][0].0, wrong), of_first);
        assert!(said.contains("directory leaf") && said.contains("outside the file"), "{said}");
    }
    // Two nodes that are one are seen when the file is opened.
    let said = open_bytes(with(nodes[1].1, page as u32)).unwrap_err().to_string();
    assert!(said.contains("directory node") && said.contains("has another use as well"), "{said}");
    assert!(open_bytes(with(at, u32::MAX)).is_err());
}

/// A commit writes the nodes that lead to what it changed, and an undo leads back.
#[test]
fn edits_write_nodes() {
    let (dem, bytes) = strip();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("edited.iqt");
    std::fs::write(&path, &bytes).unwrap();
    let before = nodes(&bytes);
    let mut session = EditSession::open(&path).unwrap();
    for (i, west) in [(0, 3), (1, 131_310)] {
        let rect = SampleRect { west, south: 2, east: west + 9, north: 9 };
        session.apply(&[Edit::set(rect, 99.0 + f64::from(i))]).unwrap();
        session.commit("set").unwrap();
    }
    let changed = std::fs::read(&path).unwrap();
    assert!(changed[..0x1000] != bytes[..0x1000] || changed[0x1000..0x2000] != bytes[0x1000..0x2000]);
    assert!(changed[0x2000..bytes.len()] == bytes[0x2000..], "nothing is written over");
    let terrain = Terrain::open(&path).unwrap();
    let report = verify(&terrain, &|_| {}).unwrap();
    assert!(report.is_sound(), "{:?}", report.problems);
    for (x, height_m) in [(5, 99.0), (131_315, 100.0)] {
        assert_eq!(terrain.height_m(10.0 * f64::from(x), 50.0).unwrap(), Some(height_m));
    }
    drop(terrain);
    session.undo().unwrap().unwrap();
    assert_eq!(Terrain::open(&path).unwrap().height_m(50.0, 50.0).unwrap(), Some(99.0));
    session.undo().unwrap().unwrap();
    drop(session);
    let undone = Terrain::open(&path).unwrap();
    check_heights(&dem, &undone);
    assert!(verify(&undone, &|_| {}).unwrap().is_sound());
    assert!(before.len() > 2);
    // A damaged node of a state that the journal leads to is found by checking, and not gone to.
    drop(undone);
    let newest = changed[bytes.len()..].chunks_exact(PAGE_BYTES).rposition(|page| page[..8] == *b"IQTCOMIT");
    let root_pages = (16 * number(&bytes, 0x07c)).div_ceil(PAGE_BYTES);
    let node_at = bytes.len() + (newest.unwrap() - root_pages - 1) * PAGE_BYTES;
    let mut damaged = std::fs::read(&path).unwrap();
    damaged[node_at] ^= 4;
    std::fs::write(&path, &damaged).unwrap();
    let terrain = Terrain::open(&path).unwrap();
    let report = verify(&terrain, &|_| {}).unwrap();
    assert!(report.problems.iter().any(|problem| problem.place.contains("directory node")), "{report:?}");
    drop(terrain);
    let mut session = EditSession::open(&path).unwrap();
    session.redo().unwrap().unwrap();
    let said = session.redo().unwrap_err().to_string();
    assert!(said.contains("directory node"), "{said}");
}
