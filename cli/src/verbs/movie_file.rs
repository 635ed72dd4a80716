//! Where the pictures of a movie go: a folder of PNG files, a GIF, or an MP4 that an installed ffmpeg encodes.
//!
//! Invariant: nothing that is incomplete has a name. A movie appears when its last picture has been written, and so does a folder of pictures.
//! Cost: one picture in memory; a folder takes twice its room on the disk for a moment.

use super::outputs::FILM_NOTE;
use super::picture::png_with;
use anyhow::{Context, Result, bail};
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;
use terrasoar::sink::FolderSink;
use terrasoar::view::Viewport;
use terrasoar_lab::picture;
use terrasoar_layout::file::atomic::AtomicFile;

/// What a movie is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MovieFormat {
    /// A folder of numbered PNG files.
    Folder,
    /// An animated GIF that repeats for ever.
    Gif,
    /// MP4 through ffmpeg.
    Mp4,
}

impl MovieFormat {
    /// By the name's extension; what has none is a folder.
    pub(super) fn of(path: &Path) -> Option<Self> {
        match path.extension() {
            None => Some(Self::Folder),
            Some(own) if own.eq_ignore_ascii_case("gif") => Some(Self::Gif),
            Some(own) if own.eq_ignore_ascii_case("mp4") => Some(Self::Mp4),
            Some(_) => path.is_dir().then_some(Self::Folder),
        }
    }
}

/// A movie being written.
pub(super) struct MovieFile {
    path: PathBuf,
    size: Viewport,
    /// What each picture of a folder says of itself.
    notes: Vec<(&'static str, String)>,
    sink: Sink,
}

enum Sink {
    Folder { pictures: FolderSink, next: usize },
    Gif { encoder: Box<gif::Encoder<BufWriter<File>>>, file: AtomicFile, fps: f64, shown: u64 },
    Mp4 { ffmpeg: Ffmpeg, file: AtomicFile },
}

impl MovieFile {
    /// Starts a movie of `fps` pictures a second. A folder must be new or empty, unless the movie in it may be replaced.
    pub(super) fn create(
        path: &Path,
        format: MovieFormat,
        size: Viewport,
        fps: f64,
        may_replace: bool,
    ) -> Result<Self> {
        let sink = match format {
            MovieFormat::Folder => {
                let taken = path.exists()
                    && std::fs::read_dir(path)
                        .with_context(|| format!("{}: cannot look into the folder", path.display()))?
                        .next()
                        .is_some();
                if taken && !may_replace {
                    bail!(
                        "{}: the folder is not empty, and pictures of another movie would mix with these; name a new one, or replace the movie in it with --force",
                        path.display()
                    );
                }
                Sink::Folder { pictures: FolderSink::create(path)?, next: 0 }
            }
            MovieFormat::Gif => {
                let file = AtomicFile::create(path)?;
                let out = BufWriter::new(file.file().try_clone()?);
                let side = |px: u32| u16::try_from(px).context("a GIF has at most 65535 pixels a side");
                let (width, height) = (side(size.width_px)?, side(size.height_px)?);
                let mut encoder = Box::new(gif::Encoder::new(out, width, height, &[])?);
                encoder.set_repeat(gif::Repeat::Infinite)?;
                let note = gif::AnyExtension(gif::Extension::Comment as u8);
                encoder.write_raw_extension(note, &[FILM_NOTE.as_bytes()])?;
                Sink::Gif { encoder, file, fps, shown: 0 }
            }
            MovieFormat::Mp4 => {
                let file = AtomicFile::create(path)?;
                let ffmpeg = Ffmpeg::start(&file, size, fps)?;
                Sink::Mp4 { ffmpeg, file }
            }
        };
        Ok(Self { path: path.to_owned(), size, notes: Vec::new(), sink })
    }

    /// Has each picture of a folder say this of itself.
    pub(super) fn with_notes(self, notes: Vec<(&'static str, String)>) -> Self {
        Self { notes, ..self }
    }

    /// Adds a picture, three bytes a pixel.
    pub(super) fn add(&mut self, rgb: &[u8]) -> Result<()> {
        match &mut self.sink {
            Sink::Folder { pictures, next } => {
                let file = png_with(rgb, self.size, &self.notes, None)?;
                pictures.add(&frame_name(*next), |out| out.write_all(&file))?;
                *next += 1;
                Ok(())
            }
            Sink::Gif { encoder, fps, shown, .. } => {
                let (width, height) = (self.size.width_px as u16, self.size.height_px as u16);
                let mut frame = gif::Frame::from_rgb_speed(width, height, rgb, 10);
                // In whole hundredths of a second, the rest carried on, so that the whole is as long as it should be. Viewers take less than two for ten.
                let until_cs = |pictures: u64| (100.0 * pictures as f64 / *fps).round();
                frame.delay = (until_cs(*shown + 1) - until_cs(*shown)).clamp(2.0, 65_535.0) as u16;
                *shown += 1;
                encoder
                    .write_frame(&frame)
                    .with_context(|| format!("{}: cannot write the picture", self.path.display()))
            }
            Sink::Mp4 { ffmpeg, .. } => ffmpeg.add(rgb),
        }
    }

    /// Completes the movie and gives it its name.
    pub(super) fn finish(self) -> Result<()> {
        match self.sink {
            Sink::Folder { pictures, next } => {
                pictures.publish()?;
                remove_from(&self.path, next);
                Ok(())
            }
            Sink::Gif { encoder, file, .. } => {
                // The trailer is written by giving up the encoder.
                encoder.into_inner()?.flush()?;
                Ok(file.publish()?)
            }
            Sink::Mp4 { ffmpeg, file } => {
                ffmpeg.finish()?;
                Ok(file.publish()?)
            }
        }
    }
}

/// What a picture of a folder is called.
fn frame_name(number: usize) -> String {
    format!("frame-{number:05}.png")
}

/// Removes the pictures from a number on, which a longer movie left there. What is not a picture of ours stays.
fn remove_from(folder: &Path, first: usize) {
    let is_ours = |path: &Path| {
        let mut start = [0; 100];
        File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok()) && picture::is_ours(&start)
    };
    for path in (first..).map(|number| folder.join(frame_name(number))).take_while(|path| is_ours(path)) {
        // One that does not go shows after the last; nothing else depends on it.
        let _ = std::fs::remove_file(path);
    }
}

/// An ffmpeg that is fed raw pictures and whose film is read from its standard output.
struct Ffmpeg {
    child: Child,
    pictures: Option<ChildStdin>,
    film: Option<JoinHandle<io::Result<u64>>>,
    complaints: Option<JoinHandle<String>>,
}

impl Ffmpeg {
    fn start(file: &AtomicFile, size: Viewport, fps: f64) -> Result<Self> {
        let picture = format!("{}x{}", size.width_px, size.height_px);
        let rate = format!("{fps}");
        let mut command = Command::new("ffmpeg");
        command
            .args(["-hide_banner", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &picture, "-r", &rate, "-i", "pipe:0", "-an"])
            // Players want even sides and halved colours.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-crf", "18"])
            .args(["-metadata", &format!("comment={FILM_NOTE}")])
            // In fragments, for what is written to a pipe cannot be gone back to.
            .args(["-movflags", "frag_keyframe+empty_moov+default_base_moof", "-f", "mp4", "pipe:1"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = match command.spawn() {
            Ok(child) => child,
            Err(error) if error.kind() == io::ErrorKind::NotFound => bail!(
                "MP4 needs the program ffmpeg, which is not installed. Install it (Debian and Ubuntu: apt install ffmpeg; \
                 Fedora: dnf install ffmpeg-free; macOS: brew install ffmpeg), or name a .gif or a folder of pictures"
            ),
            Err(error) => return Err(error).context("cannot start ffmpeg"),
        };
        let (pictures, film, complaints) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let mut out = file.file().try_clone()?;
        let film = film.map(|mut film| std::thread::spawn(move || io::copy(&mut film, &mut out)));
        let complaints = complaints.map(|mut said| {
            std::thread::spawn(move || {
                let mut text = Vec::new();
                // What cannot be read is not told; the exit status still is.
                let _ = io::Read::read_to_end(&mut said, &mut text);
                String::from_utf8_lossy(&text).trim().to_owned()
            })
        });
        Ok(Self { child, pictures, film, complaints })
    }

    fn add(&mut self, rgb: &[u8]) -> Result<()> {
        let Some(pictures) = &mut self.pictures else { return Ok(()) };
        match pictures.write_all(rgb) {
            // It has gone, and finishing says why.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => self.end(),
            done => done.context("cannot pass a picture to ffmpeg"),
        }
    }

    fn finish(mut self) -> Result<()> {
        self.end()
    }

    /// Waits for its end and says what it said if that was a failure.
    fn end(&mut self) -> Result<()> {
        drop(self.pictures.take());
        let status = self.child.wait().context("cannot wait for ffmpeg")?;
        let film = self.film.take().map(|thread| thread.join().unwrap_or(Ok(0))).transpose();
        let said = self.complaints.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        if !status.success() {
            bail!("ffmpeg failed ({status}): {said}");
        }
        film.context("cannot write the film")?;
        Ok(())
    }
}

impl Drop for Ffmpeg {
    /// A movie given up leaves no process behind.
    fn drop(&mut self) {
        if self.pictures.is_some() {
            // Where it cannot be ended it has ended.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
