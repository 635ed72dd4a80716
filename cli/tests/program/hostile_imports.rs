//! Elevation files and pictures made to do harm, given to the real program: how it ends, what it says, what it takes.

use crate::support::{Bench, text};
use crate::tiff::{
    DATA_AT, PACK_BITS, RAW, Tag, claimed, heights, longs, reals, shorts, text as text_tag, tiff,
};
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

/// Runs the program and watches the memory it has in use at most, in MiB; 0 where the system does not tell.
fn watched(bench: &Bench, args: &[&str]) -> (Output, u64) {
    let mut child = bench.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    while child.try_wait().unwrap().is_none() {
        let told = std::fs::read_to_string(&status).unwrap_or_default();
        let peak = told
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse().ok());
        most = most.max(peak.unwrap_or(0) / 1024);
        std::thread::sleep(Duration::from_millis(2));
    }
    (child.wait_with_output().unwrap(), most)
}

/// As [`Bench::bad`] with code 1, within a minute and little more than the program itself.
fn refused(bench: &Bench, args: &[&str]) -> String {
    let start = Instant::now();
    let (output, mib) = watched(bench, args);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
    assert!(said.starts_with("error: ") && said.matches('\n').count() == 1, "{args:?}: {said}");
    assert!(!said.trim_end().contains(|c: char| c.is_control()), "{said:?}");
    assert!(mib < 128, "{args:?}: {mib} MiB");
    assert!(start.elapsed() < Duration::from_secs(60), "{args:?}: {:?}", start.elapsed());
    said
}

fn with_tags(other: Vec<Tag>) -> Vec<u8> {
    let tags = heights([4, 4], RAW, 4, &[DATA_AT], &[32]);
    tiff(false, tags.into_iter().chain(other).collect(), &[0; 32])
}

#[test]
fn tags_that_claim_gigabytes_take_none() {
    let bench = Bench::new();
    let length = 3u64 << 30;
    // The kind of the image, said three thousand million times.
    std::fs::write(bench.path("a.tif"), with_tags(vec![claimed(254, 1, length - 4096, 8)])).unwrap();
    std::fs::File::options().write(true).open(bench.path("a.tif")).unwrap().set_len(length).unwrap();
    let (output, mib) = watched(&bench, &["build", "a.tif", "-o", "a.iqt", "--memory", "64"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(mib < 128, "{mib} MiB");
    std::fs::write(bench.path("a.tif"), with_tags(vec![claimed(273, 4, length / 4 - 4096, 8)])).unwrap();
    std::fs::File::options().write(true).open(bench.path("a.tif")).unwrap().set_len(length).unwrap();
    let said = refused(&bench, &["build", "a.tif", "-o", "b.iqt", "--memory", "64"]);
    assert!(said.contains("1 chunks make up the image"), "{said}");
}

/// A strip that unpacks to far more than the memory allowed.
#[test]
fn a_strip_is_unpacked_within_the_memory_allowed() {
    let bench = Bench::new();
    let side = 6000u32;
    let strip = [0x81u8, 0].repeat((2 * side * side / 128) as usize);
    let tags = heights([side; 2], PACK_BITS, side, &[DATA_AT], &[strip.len() as u32]);
    std::fs::write(bench.path("a.tif"), tiff(false, tags, &strip)).unwrap();
    let (output, mib) = watched(&bench, &["build", "a.tif", "-o", "a.iqt", "--memory", "48"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(mib < 112, "{mib} MiB");
}

#[test]
fn numbers_that_no_terrain_holds_are_refused_with_the_flag_that_helps() {
    let bench = Bench::new();
    let build = |tags: Vec<Tag>, flags: &[&str]| {
        std::fs::write(bench.path("a.tif"), with_tags(tags)).unwrap();
        let said = refused(&bench, &[&["build", "a.tif", "-o", "a.iqt"], flags].concat());
        assert_eq!(bench.names(), ["a.tif"]);
        said
    };
    let said = build(vec![], &["--z-scale", "1e13"]);
    assert!(said.ends_with("(--z-scale S)\n"), "{said}");
    let far = || vec![reals(33550, &[1e308, 1e308, 0.0])];
    let said = build(far(), &[]);
    assert!(said.contains("not 1e308 x 1e308") && said.ends_with("(--spacing M)\n"), "{said}");
    assert!(build(far(), &["--spacing", "10"]).contains("coordinates beyond all numbers"));
    let keys = [1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 32767, 2057, 34736, 1, 0];
    let said = build(
        vec![shorts(34735, &keys), reals(34736, &[1e13]), reals(33550, &[0.001, 0.001, 0.0])],
        &["--spacing", "10"],
    );
    assert!(said.contains("radius"), "{said}");
    // A grid of the largest size, all of it a hole.
    let side = 65_537u32;
    let offsets = vec![8, 0];
    let mut tags = heights([side, side], RAW, 65_536, &offsets, &offsets);
    tags.push(shorts(258, &[8]));
    std::fs::write(bench.path("a.tif"), tiff(false, tags, &[])).unwrap();
    std::fs::File::options().write(true).open(bench.path("a.tif")).unwrap().set_len(5 << 30).unwrap();
    let said = refused(&bench, &["build", "a.tif", "-o", "a.iqt", "--memory", "48"]);
    let (words, flag) = said.trim_end().rsplit_once(" (--memory ").unwrap();
    assert!(words.ends_with(&format!("allow at least {}", flag.trim_end_matches(')'))), "{said}");
}

#[test]
fn a_file_without_a_chunk_is_refused_at_once() {
    let bench = Bench::new();
    let mut tags = heights([65_537; 2], RAW, 65_537, &[0], &[0]);
    std::fs::write(bench.path("a.tif"), tiff(false, tags.clone(), &[])).unwrap();
    assert!(refused(&bench, &["build", "a.tif", "-o", "a.iqt"]).contains("none is stored"));
    tags.push(text_tag(42113, "-9999"));
    std::fs::write(bench.path("a.tif"), tiff(false, tags, &[])).unwrap();
    assert!(refused(&bench, &["build", "a.tif", "-o", "a.iqt"]).contains("every sample is void"));
    assert_eq!(bench.names(), ["a.tif"]);
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_not_waited_for() {
    use std::os::unix::fs::symlink;
    let bench = Bench::with_terrain();
    let pipe = |name: &str| {
        assert!(std::process::Command::new("mkfifo").arg(bench.path(name)).status().unwrap().success());
    };
    for name in ["pipe.tif", "pipe.hgt"] {
        pipe(name);
        assert!(refused(&bench, &["build", name, "-o", "b.iqt"]).contains("this is a pipe"));
        assert!(refused(&bench, &["drape", "land.iqt", "--image", name]).contains("this is a pipe"));
    }
    symlink("/dev/zero", bench.path("zero.png")).unwrap();
    assert!(refused(&bench, &["build", "zero.png", "-o", "b.iqt"]).contains("a device"));
    assert!(refused(&bench, &["drape", "land.iqt", "--image", "zero.png"]).contains("a device"));
    let jpeg = concat!(env!("CARGO_MANIFEST_DIR"), "/../import/tests/image_fixtures/baseline.jpg");
    std::fs::copy(jpeg, bench.path("photo.jpg")).unwrap();
    symlink("/dev/zero", bench.path("photo.jgw")).unwrap();
    let said = refused(&bench, &["drape", "land.iqt", "--image", "photo.jpg"]);
    assert!(said.contains("photo.jgw") && said.contains("a device"), "{said}");
    std::fs::remove_file(bench.path("photo.jgw")).unwrap();
    pipe("photo.jgw");
    assert!(refused(&bench, &["drape", "land.iqt", "--image", "photo.jpg"]).contains("this is a pipe"));
    std::fs::remove_file(bench.path("photo.jgw")).unwrap();
    std::fs::write(bench.path("photo.jgw"), "north of here").unwrap();
    let said = refused(&bench, &["drape", "land.iqt", "--image", "photo.jpg"]);
    assert!(said.contains("six numbers") && said.ends_with("(--extent W,S,E,N)\n"), "{said}");
}

/// The library says what to change, the program by which flag.
#[test]
fn a_picture_that_needs_more_memory_says_how_much() {
    let bench = Bench::with_terrain();
    let mut tags = heights([6000, 6000], PACK_BITS, 6000, &[DATA_AT], &[64]);
    tags.extend([shorts(258, &[8]), longs(278, &[6000])]);
    std::fs::write(bench.path("a.tif"), tiff(false, tags, &[0x81; 64])).unwrap();
    let said = refused(
        &bench,
        &["drape", "land.iqt", "--image", "a.tif", "--extent", "0,0,2560,2560", "--memory", "64"],
    );
    let flag = said.trim_end().rsplit_once(" (--memory ").unwrap_or_else(|| panic!("{said}")).1;
    let enough: u64 = flag.trim_end_matches(')').parse().unwrap();
    assert!((200..1000).contains(&enough), "{said}");
}
