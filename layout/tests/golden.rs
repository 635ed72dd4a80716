//! FORMAT.md and the code hold together: a tiny terrain's file, byte for byte, and records decoded by hand from the text alone.

mod common;

use common::{MemoryDem, build_bytes, open_bytes};
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::{About, Georeference, HorizontalUnit, SampleType, UnitOf};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::VertexClass;

/// Heights in metres, north at the top as on a map; the void is the pit of a quarry.
const HEIGHTS: [[f64; 5]; 4] = [
    [300.0, 310.0, 325.0, 345.0, 370.0],
    [290.0, 301.0, 318.0, 339.0, 366.0],
    [285.0, 293.0, 311.0, 330.0, f64::NAN],
    [280.0, 288.0, 305.0, 322.0, 350.0],
];

fn dem() -> MemoryDem {
    let mut dem = MemoryDem::from_fn([5, 4], SampleType::I16, |x, y| HEIGHTS[3 - y as usize][x as usize]);
    let info = dem.info_mut();
    info.format = "golden".into();
    info.georeference = Georeference {
        epsg: Some(32610),
        crs_name: "WGS 84 / UTM zone 10N".into(),
        unit: HorizontalUnit::Metre,
        pixel_to_crs: Some([500_000.0, 10.0, 0.0, 4_000_060.0, 0.0, -20.0]),
        ..Georeference::default()
    };
    dem
}

/// Bytes as the fixture states them: `length N`, `OFFSET: bytes in hex`, `OFFSET..END repeat bytes`; `#` begins a comment. What is not stated is zero.
fn stated(text: &str) -> Vec<u8> {
    stated_over(Vec::new(), text)
}

/// As [`stated`], with what is not stated as it was.
fn stated_over(mut bytes: Vec<u8>, text: &str) -> Vec<u8> {
    let hex = |words: &str| -> Vec<u8> {
        words.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    };
    let offset = |word: &str| usize::from_str_radix(word.trim(), 16).unwrap();
    for line in text.lines() {
        let line = line.split('#').next().unwrap().trim();
        if line.is_empty() {
            continue;
        }
        if let Some(length) = line.strip_prefix("length ") {
            bytes = vec![0; offset(length)];
        } else if let Some((range, pattern)) = line.split_once(" repeat ") {
            let (start, end) = range.split_once("..").unwrap();
            let pattern = hex(pattern);
            for (i, byte) in bytes[offset(start)..offset(end)].iter_mut().enumerate() {
                *byte = pattern[i % pattern.len()];
            }
        } else {
            let (start, words) = line.split_once(':').unwrap();
            let (start, words) = (offset(start), hex(words));
            bytes[start..start + words.len()].copy_from_slice(&words);
        }
    }
    bytes
}

#[test]
fn the_file_is_as_stated_byte_for_byte() {
    compare(&dem(), stated(include_str!("fixtures/golden.txt")));
}

#[test]
fn what_is_said_about_a_dem_stands_in_the_header() {
    let mut dem = dem();
    dem.info_mut().about = About {
        crs_text: "EPSG:32610".into(),
        horizontal_unit: Some(UnitOf { name: "metre".into(), size: 1.0, is_angle: false }),
        vertical_name: "NAVD88 height (ft)".into(),
        vertical_epsg: Some(8228),
        vertical_unit: Some(UnitOf { name: "ft".into(), size: 0.3048, is_angle: false }),
        origins: vec![("heights".into(), "unit ft".into())],
        warnings: vec!["a pit".into()],
    };
    let plain = stated(include_str!("fixtures/golden.txt"));
    compare(&dem, stated_over(plain, include_str!("fixtures/golden-about.txt")));
    let terrain = open_bytes(build_bytes(&dem, &BuildOptions::default()).unwrap()).unwrap();
    assert_eq!(terrain.header().about, dem.info_mut().about);
}

fn compare(dem: &MemoryDem, stated: Vec<u8>) {
    let built = build_bytes(dem, &BuildOptions::default().head_room(false)).unwrap();
    if let Some(path) = std::env::var_os("TERRASOAR_GOLDEN_DUMP") {
        std::fs::write(path, &built).unwrap();
    }
    assert_eq!(built.len(), stated.len(), "length");
    let differs = built.iter().zip(&stated).position(|(a, b)| a != b);
    if let Some(at) = differs {
        let line = at / 16 * 16;
        panic!(
            "byte {at:#x} differs: built {:02x?}, stated {:02x?}",
            &built[line..line + 16],
            &stated[line..line + 16]
        );
    }
}

/// Section 2 of FORMAT.md with plain loops: the slot of a vertex that is no corner, in a square of 2^k steps.
fn slot_by_the_text(k: u32, x: u64, y: u64) -> u64 {
    let spread = |v: u64| (0..32).map(|bit| (v >> bit & 1) << (2 * bit)).sum::<u64>();
    let zeros = |v: u64| if v == 0 { k } else { v.trailing_zeros() };
    let t = zeros(x).min(zeros(y));
    let d = k - 1 - t;
    let four_to_d = 4u64.pow(d);
    if zeros(x) == zeros(y) {
        let (cx, cy) = (x >> (t + 1), y >> (t + 1));
        (5 * four_to_d + 7) / 3 + 2 * spread(cy) + spread(cx ^ cy)
    } else {
        let (u, w) = (x >> t, y >> t);
        let (a, b) = ((u + w - 1) / 2, (w + 2u64.pow(d + 1) - u - 1) / 2);
        (8 * four_to_d + 7) / 3 + 2 * spread(a ^ (2u64.pow(d) - 1)) + spread(a ^ b ^ 2u64.pow(d))
    }
}

/// Section 3.1 with powers from the standard library: r_flat of a level.
fn flat_radius_by_the_text(dx: f64, dy: f64, level: u32) -> f64 {
    (1..=level)
        .map(|l| {
            let s = f64::from(1u32 << (l / 2));
            if l % 2 == 1 { s * dx.max(dy) } else { s / 2.0 * dx.hypot(dy) }
        })
        .sum()
}

#[test]
fn every_record_decodes_by_hand() {
    let bytes = build_bytes(&dem(), &BuildOptions::default()).unwrap();
    let f64_at = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let k = u32::from(bytes[0x010]);
    assert_eq!((k, bytes[0x011], bytes[0x012]), (2, 1, 1), "compact records of a bounded error");
    let (dx, dy) = (f64_at(0x020), f64_at(0x028));
    assert_eq!((dx, dy), (10.0, 20.0));
    // Header, root, leaf, record page: each leads to the next.
    let leaf = u32_at(u32_at(0x078) as usize * 4096) as usize * 4096;
    let records = u32_at(leaf) as usize * 4096;
    assert_eq!(crc32fast::hash(&bytes[records..records + 4096]), u32_at(leaf + 4));

    let terrain = open_bytes(bytes.clone()).unwrap();
    let mut seen = [0; 3];
    for y in 0..=4u64 {
        for x in 0..=4u64 {
            if x % 4 == 0 && y % 4 == 0 {
                continue;
            }
            let zeros = |v: u64| if v == 0 { k } else { v.trailing_zeros() };
            let level = 2 * zeros(x).min(zeros(y)) + u32::from(zeros(x) == zeros(y));
            let at = records + slot_by_the_text(k, x, y) as usize * 4;
            let [low, high, e, r] = bytes[at..at + 4].try_into().unwrap();
            let v = terrain.checked_vertex(GridPoint::new(x as u32, y as u32)).unwrap();
            if (e, r) == (0, 255) {
                assert_eq!(v.class, VertexClass::Inert);
                seen[2] += 1;
                continue;
            }
            let height = f64_at(0x030) + f64::from(u16::from_le_bytes([low, high])) * f64_at(0x038);
            assert_eq!(v.height_m, height);
            let sample = HEIGHTS[3 - y.min(3) as usize][x as usize];
            assert!(sample.is_nan() || height == sample, "({x}, {y}): {height}");
            let s = f64::from(1u32 << (level / 2));
            let (error, radius, class) = if e >= 248 {
                let edge = 2.0 * s * if level % 2 == 1 { dx.hypot(dy) } else { dx.max(dy) };
                let m = i32::from(e & 3);
                let error = if m == 3 { f64::INFINITY } else { edge * 16f64.powi(m) };
                let class = if e < 252 { VertexClass::Fringe } else { VertexClass::FringeVoid };
                seen[1] += 1;
                (error, 2f64.powf(f64::from(r) / 8.0), class)
            } else {
                let error =
                    if e == 0 { 0.0 } else { f64_at(0x050) * 2f64.powf((f64::from(e) - 247.0) / 16.0) };
                seen[0] += 1;
                (error, 2f64.powf(f64::from(r) / f64::from(u32_at(0x058))), VertexClass::Plain)
            };
            let radius = flat_radius_by_the_text(dx, dy, level) * radius;
            let close = |a: f64, b: f64| a == b || (a - b).abs() <= 1e-12 * b.abs();
            assert!(
                close(v.error_m, error) && close(v.radius_m, radius),
                "({x}, {y}): {v:?} {error} {radius}"
            );
            assert_eq!(v.class, class, "({x}, {y})");
        }
    }
    assert!(seen.iter().all(|count| *count > 0), "plain, fringe and inert records: {seen:?}");
}
