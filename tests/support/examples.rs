//! The programs of `examples/`, for tests that run them.

use std::path::PathBuf;
use std::process::Command;

/// The program of a package's example. It is there where all tests are built; where a test was built alone it is built now.
pub(crate) fn built(package: &str, example: &str) -> Result<PathBuf, String> {
    let here = std::env::current_exe().map_err(|e| e.to_string())?;
    let profile = here.parent().and_then(|deps| deps.parent()).ok_or("a test without a folder")?;
    let program = profile.join("examples").join(format!("{example}{}", std::env::consts::EXE_SUFFIX));
    if !program.exists() {
        let built = Command::new(env!("CARGO"))
            .args(["build", "--offline", "-p", package, "--example", example])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .status()
            .map_err(|e| e.to_string())?;
        if !built.success() {
            return Err(format!("the example {example} does not compile"));
        }
    }
    Ok(program)
}
