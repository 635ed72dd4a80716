//! Commands run as a reader would: by the shell, in a folder, with the program in the path.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use terrasoar_render::Gpu;

/// A command that ended.
pub struct Ended {
    pub is_good: bool,
    /// What it printed, standard output and standard error as they came.
    pub said: String,
}

/// Runs a script in `folder`; a line that fails ends it.
pub fn run(script: &str, folder: &Path) -> Ended {
    let program = Path::new(env!("CARGO_BIN_EXE_terrasoar"));
    let mut path = vec![program.parent().unwrap().to_owned()];
    path.extend(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()));
    let output = Command::new("sh")
        .args(["-e", "-c", &format!("exec 2>&1\n{script}")])
        .env("PATH", std::env::join_paths(path).unwrap())
        .env("XDG_CACHE_HOME", folder.join(".cache"))
        .env("XDG_CONFIG_HOME", folder.join(".config"))
        // Where this is not set drivers in software complain, unless they are kept from it.
        .env_remove("XDG_RUNTIME_DIR")
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Ended { is_good: output.status.success(), said: String::from_utf8_lossy(&output.stdout).into_owned() }
}

/// The program's own word; it must succeed.
pub fn help(arguments: &str) -> String {
    let folder = std::env::temp_dir();
    let ended = run(&format!("terrasoar {arguments} --help"), &folder);
    assert!(ended.is_good, "{}", ended.said);
    ended.said
}

/// Whether there is a graphics adapter.
pub fn can_draw() -> bool {
    static CAN: OnceLock<bool> = OnceLock::new();
    *CAN.get_or_init(|| Gpu::headless_blocking().is_ok())
}

/// Whether there has to be one.
pub fn must_draw() -> bool {
    std::env::var_os("TERRASOAR_NEED_ADAPTER").is_some_and(|value| value == "1")
}

/// Whether a command needs one.
pub fn draws(command: &str) -> bool {
    ["terrasoar snapshot ", "terrasoar movie "].iter().any(|verb| command.contains(verb))
}

/// A new folder with the files of `from`, the folders in it left out.
pub fn copy_of(from: Option<&Path>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in from.iter().flat_map(|from| std::fs::read_dir(from).unwrap()) {
        let path: PathBuf = entry.unwrap().path();
        if path.is_file() {
            std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
        }
    }
    folder
}
