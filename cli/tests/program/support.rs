//! A folder with a small terrain in it, and the program run there.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A temporary folder that the program runs in.
pub struct Bench {
    folder: tempfile::TempDir,
    cache: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap(), cache: tempfile::tempdir().unwrap() }
    }

    /// With `land.tif`, `land.iqt` and `land.flight` of 40 frames in it.
    pub fn with_flight() -> Self {
        let bench = Self::with_terrain();
        bench.good(&[
            "flight",
            "straight",
            "land.iqt",
            "-o",
            "land.flight",
            "--frames",
            "40",
            "--speed",
            "15",
        ]);
        bench
    }

    /// With `land.tif` and `land.iqt` in it: 129 x 129 samples 20 m apart.
    pub fn with_terrain() -> Self {
        let bench = Self::new();
        bench.good(&["synth", "--size", "129", "--seed", "5", "-o", "land.tif"]);
        bench.good(&["build", "land.tif", "-o", "land.iqt"]);
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The folder for caches.
    pub fn cache(&self) -> &Path {
        self.cache.path()
    }

    /// Names of everything in the folder, sorted.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// A CSV file: the remarks before it, and the table.
    pub fn table(&self, name: &str) -> (String, String) {
        let text = std::fs::read_to_string(self.path(name)).unwrap();
        let remarks = text.lines().take_while(|line| line.starts_with("# ")).map(|line| line.len() + 1).sum();
        let (remarks, table) = text.split_at(remarks);
        (remarks.into(), table.into())
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrasoar"));
        // Where this is not set drivers in software complain on standard error, unless they are kept from it.
        command.env_remove("XDG_RUNTIME_DIR");
        command.env("XDG_CACHE_HOME", self.cache.path());
        command.args(args).current_dir(self.folder()).stdin(Stdio::null());
        command
    }

    pub fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Runs what must succeed; gives standard output.
    pub fn good(&self, args: &[&str]) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// Runs what must succeed and print one JSON object and nothing else.
    pub fn json(&self, args: &[&str]) -> Value {
        let value: Value = serde_json::from_str(&self.good(args)).unwrap();
        assert!(value.is_object());
        value
    }

    /// Runs what must end with `code`, say why on standard error in one message, and print nothing; gives the message.
    pub fn bad(&self, code: i32, args: &[&str]) -> String {
        let output = self.run(args);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
        assert!(output.stdout.is_empty(), "{args:?} printed {}", text(&output.stdout));
        assert!(message.starts_with("error: "), "{args:?}: {message}");
        assert_eq!(message.matches("error: ").count(), 1, "{args:?}: {message}");
        message
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The names of an object's fields, in order.
pub fn fields(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}
