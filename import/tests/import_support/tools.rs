//! GDAL's tools, run.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs a tool in `folder`, with or without what GDAL keeps beside files; what it printed, or what it complained about.
pub(crate) fn try_run(folder: &Path, tool: &str, arguments: &[&str], beside: bool) -> Result<String, String> {
    let output = Command::new(tool)
        .args(arguments)
        .current_dir(folder)
        .env("GDAL_PAM_ENABLED", if beside { "YES" } else { "NO" })
        .output()
        .map_err(|error| format!("{tool} is needed: install gdal-bin ({error})"))?;
    let [said, complaint] =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    if output.status.success() {
        Ok(said)
    } else {
        Err(format!("{tool} {}: {said}{complaint}", arguments.join(" ")))
    }
}

/// Runs a tool without what GDAL keeps beside files; what it printed.
pub(crate) fn run(folder: &Path, tool: &str, arguments: &[&str]) -> String {
    try_run(folder, tool, arguments, false).unwrap_or_else(|words| panic!("{words}"))
}

/// The values that GDAL reads at places (column, row) of a file.
pub(crate) fn values(path: &Path, places: &[(u32, u32)]) -> Vec<f64> {
    let mut child = Command::new("gdallocationinfo")
        .args(["-valonly", "-b", "1"])
        .arg(path)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("gdallocationinfo is needed: install gdal-bin");
    let mut input = child.stdin.take().unwrap();
    let asked = places.to_vec();
    let writer =
        std::thread::spawn(move || asked.iter().try_for_each(|(col, row)| writeln!(input, "{col} {row}")));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    let answers = String::from_utf8(output.stdout).unwrap();
    let answers: Vec<f64> = answers.lines().map(|line| line.trim().parse().unwrap()).collect();
    assert_eq!(answers.len(), places.len(), "{}", path.display());
    answers
}

/// GDAL's version: major and minor.
pub(crate) fn gdal_version() -> [u32; 2] {
    let told = Command::new("gdalinfo").arg("--version").output().expect("gdalinfo runs");
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    let numbers = told.trim_start_matches("GDAL ").split(|c: char| !c.is_ascii_digit());
    let mut numbers = numbers.map(|number| number.parse().unwrap_or(0));
    [0, 1].map(|_| numbers.next().unwrap_or(0))
}

/// Whether GDAL, as it was built here, unpacks what a fixture is packed with: few of its builds have JPEG XL.
pub(crate) fn unpacks(path: &Path) -> bool {
    let is_jpeg_xl = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("jpegxl-"));
    !is_jpeg_xl
        || try_run(
            Path::new("."),
            "gdallocationinfo",
            &["-valonly", &path.to_string_lossy(), "0", "0"],
            false,
        )
        .is_ok()
}
