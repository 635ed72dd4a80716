//! A virtual display, the program in it, and hands for it.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
use terrasoar_render::Gpu;

/// Longest wait for a line; reached only when the test has failed.
const PATIENCE: Duration = Duration::from_secs(30);

/// A running Xvfb, and a folder with `puget.iqt` in it.
pub struct Display {
    server: Mutex<Child>,
    name: String,
    /// Whether the processor draws.
    pub software: bool,
    pub folder: tempfile::TempDir,
}

impl Display {
    /// Starts everything, or says what is missing.
    pub fn start() -> Result<Self, String> {
        let gpu = Gpu::headless_blocking().map_err(|e| e.to_string())?;
        println!("adapter: {} ({})", gpu.capabilities.adapter, gpu.capabilities.backend);
        let missing = |program: &str, e: std::io::Error| {
            format!("{program} cannot be started ({e}); Debian and Ubuntu: apt install xvfb xdotool")
        };
        Command::new("xdotool").arg("version").output().map_err(|e| missing("xdotool", e))?;
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| missing("Xvfb", e))?;
        let mut number = String::new();
        if let Some(out) = server.stdout.take() {
            BufReader::new(out).read_line(&mut number).map_err(|e| e.to_string())?;
        }
        let name = format!(":{}", number.trim());
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        make_terrain(&folder.path().join("puget.iqt"))?;
        Ok(Self { server: Mutex::new(server), name, software: gpu.capabilities.software, folder })
    }

    pub fn stop(&self) {
        let mut server = self.server.lock().unwrap();
        let _ = server.kill();
        let _ = server.wait();
    }

    /// The program with what it needs to know of this display. Settings are those of the display's own user.
    pub fn program(&self, arguments: &[&str]) -> Command {
        let mut command = self.in_display(Command::new(env!("CARGO_BIN_EXE_terrasoar")));
        command.args(arguments);
        command
    }

    /// A program with what it needs to know of this display.
    pub fn in_display(&self, mut command: Command) -> Command {
        command
            .current_dir(self.folder.path())
            .env("DISPLAY", &self.name)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("XDG_RUNTIME_DIR")
            .env("HOME", self.folder.path())
            .env("XDG_CONFIG_HOME", self.folder.path().join("config"))
            .stdin(Stdio::null());
        command
    }

    pub fn settings(&self) -> PathBuf {
        self.folder.path().join("config/terrasoar/view.toml")
    }

    /// Opens a window and waits for its first pictures.
    pub fn open(&self, arguments: &[&str]) -> Result<Window<'_>, String> {
        self.open_scaled(arguments, "1")
    }

    /// Opens a window on a screen with so many pixels a point.
    pub fn open_scaled(&self, arguments: &[&str], scale: &str) -> Result<Window<'_>, String> {
        self.open_file("puget.iqt", arguments, scale)
    }

    /// Opens a window with a file of the display's folder.
    pub fn open_file(&self, file: &str, arguments: &[&str], scale: &str) -> Result<Window<'_>, String> {
        let all = [&["view", file, "--narrate"], arguments].concat();
        let mut child = self
            .program(&all)
            .env("WINIT_X11_SCALE_FACTOR", scale)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| e.to_string())?;
        let (sender, lines) = channel();
        let out = child.stdout.take().ok_or("no standard output")?;
        std::thread::spawn(move || {
            for line in BufReader::new(out).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Ok(Window { display: self, child, lines, heard: Vec::new() })
    }
}

fn make_terrain(path: &Path) -> Result<(), String> {
    let input = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/puget_sound_1025.png");
    let dem = terrasoar_import::open(&[input.into()]).map_err(|e| e.to_string())?;
    let options = BuildOptions::default().spacing_m([160.0; 2]).z_scale(0.1);
    build(&*dem, path, &options, &Silent).map(drop).map_err(|e| e.to_string())
}

/// An open window.
pub struct Window<'a> {
    display: &'a Display,
    child: Child,
    lines: Receiver<String>,
    heard: Vec<String>,
}

impl Window<'_> {
    /// Waits for a line that begins so; gives the rest of it.
    pub fn hear(&mut self, beginning: &str) -> Result<String, String> {
        let until = Instant::now() + PATIENCE;
        loop {
            match self.lines.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(line) => {
                    self.heard.push(line.clone());
                    if let Some(rest) = line.strip_prefix(beginning) {
                        return Ok(rest.trim().to_owned());
                    }
                }
                Err(why) => {
                    let how = if why == RecvTimeoutError::Timeout { "nothing more came" } else { "it ended" };
                    let words = self.last_words();
                    let heard = &self.heard;
                    return Err(format!("waited for {beginning:?} and {how}; heard {heard:?}; {words}"));
                }
            }
        }
    }

    /// Waits for lines that begin with each of these, in any order.
    pub fn hear_all(&mut self, beginnings: &[&str]) -> Result<(), String> {
        let mut left = beginnings.to_vec();
        while !left.is_empty() {
            self.hear("")?;
            let line = self.heard.last().cloned().unwrap_or_default();
            left.retain(|beginning| !line.starts_with(beginning));
        }
        Ok(())
    }

    /// All that was heard so far.
    pub fn heard(&self) -> &[String] {
        &self.heard
    }

    /// Waits until nothing moves; gives east, north, up, yaw and pitch.
    pub fn rest(&mut self) -> Result<[f64; 5], String> {
        let place = self.hear("at-rest ")?;
        let numbers: Vec<f64> = place.split(' ').filter_map(|n| n.parse().ok()).collect();
        numbers.try_into().map_err(|_| format!("{place:?} is no place"))
    }

    /// Gives the window the keyboard.
    pub fn focus(&self) -> Result<String, String> {
        let id = self.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Terrasoar"])?;
        let id = id.lines().next().unwrap_or_default().to_owned();
        self.xdotool(&["windowfocus", "--sync", &id])?;
        Ok(id)
    }

    pub fn xdotool(&self, arguments: &[&str]) -> Result<String, String> {
        let output = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.display.name)
            .output()
            .map_err(|e| e.to_string())?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        Err(format!("xdotool {arguments:?}: {}", String::from_utf8_lossy(&output.stderr)))
    }

    pub fn key(&self, key: &str) -> Result<(), String> {
        self.xdotool(&["key", key]).map(drop)
    }

    /// Holds a key until the eye moves, and waits until it rests again.
    pub fn fly(&mut self, key: &str) -> Result<(), String> {
        self.xdotool(&["keydown", key])?;
        self.hear("moving true")?;
        self.xdotool(&["keyup", key])?;
        self.hear("moving false").map(drop)
    }

    /// Sends a signal to the program, such as "-TERM".
    pub fn signal(&self, name: &str) -> Result<(), String> {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        sent.map_err(|e| e.to_string()).map(|_| ())
    }

    /// Waits for the end; gives the exit code and what was said on standard error.
    pub fn end(mut self) -> Result<(Option<i32>, String, Vec<String>), String> {
        while let Ok(line) = self.lines.recv_timeout(PATIENCE) {
            self.heard.push(line);
        }
        let words = self.last_words();
        let status = self.child.wait().map_err(|e| e.to_string())?;
        Ok((status.code(), words, std::mem::take(&mut self.heard)))
    }

    fn last_words(&mut self) -> String {
        if !matches!(self.child.try_wait(), Ok(Some(_)))
            && self.lines.try_recv() != Err(std::sync::mpsc::TryRecvError::Disconnected)
        {
            let _ = self.child.kill();
        }
        let mut words = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            let _ = stderr.read_to_string(&mut words);
        }
        words
    }
}

impl Drop for Window<'_> {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
