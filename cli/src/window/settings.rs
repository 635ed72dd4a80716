//! What the window remembers from one run to the next: a TOML file in the user's folder for settings.
//!
//! **A file that cannot be understood never keeps the window from opening**: this is reported and defaults are used. Values out of range are brought into it, and
//! unknown names count as unset. The file appears when it is complete.

use anyhow::{Context, Result};
use etcetera::{BaseStrategy, choose_base_strategy};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};
use terrasoar::refine::Culling;
use terrasoar::sink::FileSink;
use terrasoar::view::ErrorMetric;
use terrasoar_render::ramps::Ramp;
use terrasoar_render::{Capabilities, Haze, LOOKS, Look, Surface};

/// Everything that is remembered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Settings {
    /// Largest error on the screen in pixels, 0.1 to 50; without it what suits the adapter.
    pub tolerance_px: Option<f64>,
    /// Name of the way errors are measured.
    pub metric: String,
    /// Tolerance where none is set.
    #[serde(skip)]
    pub suited_tolerance_px: f64,
    /// Factor on heights, 0.1 to 20.
    pub exaggeration: f64,
    /// Direction of the sun, clockwise from north.
    pub sun_azimuth_deg: f32,
    /// Height of the sun above the horizon.
    pub sun_elevation_deg: f32,
    /// Name of a prepared look.
    pub style: String,
    /// Name of a ramp; without it the style's own.
    pub ramp: Option<String>,
    /// How much of the terrain's image shows, 0 to 1.
    pub image: f32,
    /// Whether contour lines are drawn.
    pub contours: bool,
    /// Metres from contour line to contour line.
    pub contour_interval_m: f32,
    /// Whether edges of triangles are drawn.
    pub wireframe: bool,
    /// Whether vertices move into place.
    pub morph: bool,
    /// Whether far ground is hazy.
    pub haze: bool,
    /// Whether edges are smoothed by four samples a pixel.
    pub smooth_edges: bool,
    /// Name of the way of culling.
    pub culling: String,
    /// Whether the panel is shown.
    pub panel: bool,
    /// Whether the figures are shown.
    pub figures: bool,
    /// Size of the window in points.
    pub window: [u32; 2],
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            tolerance_px: None,
            metric: ErrorMetric::default().name().to_owned(),
            suited_tolerance_px: 1.0,
            exaggeration: 1.0,
            sun_azimuth_deg: 312.0,
            sun_elevation_deg: 38.0,
            style: LOOKS[0].0.to_owned(),
            ramp: None,
            image: 1.0,
            contours: false,
            contour_interval_m: 100.0,
            wireframe: false,
            morph: true,
            haze: true,
            smooth_edges: false,
            culling: Culling::default().name().to_owned(),
            panel: true,
            figures: true,
            window: [1280, 800],
        }
    }
}

impl Settings {
    /// Largest error on the screen in pixels.
    pub(crate) fn tolerance_px(&self) -> f64 {
        self.tolerance_px.unwrap_or(self.suited_tolerance_px)
    }

    /// Suits what is not set to an adapter; says what that means where it is worth saying.
    pub(crate) fn suit(&mut self, adapter: &Capabilities) -> Option<String> {
        let before = self.suited_tolerance_px;
        self.suited_tolerance_px =
            if adapter.software { SOFTWARE_TOLERANCE_PX } else { Self::default().suited_tolerance_px };
        // It is said once, not by every device of a kind.
        let is_news = adapter.software && before != self.suited_tolerance_px;
        (is_news && self.tolerance_px.is_none()).then(|| {
            format!(
                "Drawn in software ({}), so the tolerance is {SOFTWARE_TOLERANCE_PX} px instead of 1 until you set it.",
                adapter.adapter
            )
        })
    }

    /// Size of the window in points, no larger than the screen with room for bars around it.
    pub(crate) fn window_on(&self, screen: Option<[f64; 2]>) -> [f64; 2] {
        let most = screen.unwrap_or([f64::INFINITY; 2]);
        [0, 1].map(|i| f64::from(self.window[i]).min((SHARE_OF_SCREEN * most[i]).floor()))
    }

    /// Takes a style with everything that belongs to it.
    pub(crate) fn set_style(&mut self, name: &str) {
        let Some(look) = Look::named(name) else { return };
        self.style = name.to_owned();
        self.ramp = None;
        self.contours = look.contours.is_some();
        self.wireframe = look.wireframe.is_some();
        self.haze = look.haze != Haze::Off;
    }

    /// The style after the one that is set.
    pub(crate) fn next_style(&mut self) {
        let at = LOOKS.iter().position(|(name, _)| *name == self.style).unwrap_or(LOOKS.len() - 1);
        self.set_style(LOOKS[(at + 1) % LOOKS.len()].0);
    }

    /// What a frame looks like.
    pub(crate) fn look(&self) -> Look {
        let style = Look::named(&self.style).unwrap_or_default();
        let mut look = style;
        look.ramp = self.ramp.as_deref().and_then(Ramp::named).unwrap_or(style.ramp);
        if matches!(look.surface, Surface::Tint) {
            look.imagery = self.image;
        }
        look.sun.azimuth_rad = self.sun_azimuth_deg.to_radians();
        look.sun.elevation_rad = self.sun_elevation_deg.to_radians();
        look.contours =
            self.contours.then(|| style.contours.unwrap_or_default().interval_m(self.contour_interval_m));
        look.wireframe = self.wireframe.then(|| style.wireframe.unwrap_or_default());
        look.morph = self.morph;
        look.haze = if self.haze { Haze::Auto } else { Haze::Off };
        look.multisample = self.smooth_edges;
        look
    }

    /// How errors are measured.
    pub(crate) fn metric(&self) -> ErrorMetric {
        ErrorMetric::ALL.into_iter().find(|metric| metric.name() == self.metric).unwrap_or_default()
    }

    /// The way of culling.
    pub(crate) fn culling(&self) -> Culling {
        Culling::ALL.into_iter().find(|c| c.name() == self.culling).unwrap_or_default()
    }

    /// The file of settings; none where the user has no folder for such.
    pub(crate) fn path() -> Option<PathBuf> {
        Some(choose_base_strategy().ok()?.config_dir().join("terrasoar").join("view.toml"))
    }

    /// Reads the settings. Where there is no file they are the defaults; where it is broken they are too, with a word about it.
    pub(crate) fn load(path: &Path) -> (Self, Option<String>) {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return (Self::default(), None),
            Err(error) => return (Self::default(), Some(broken(path, &error.to_string()))),
        };
        match toml::from_str::<Self>(&text) {
            Ok(settings) => (settings.in_range(), None),
            Err(error) => (Self::default(), Some(broken(path, error.message()))),
        }
    }

    /// Writes the settings.
    pub(crate) fn save(&self, path: &Path) -> Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        let text = toml::to_string(self).context("settings do not fit TOML")?;
        let write = || -> Result<()> {
            std::fs::create_dir_all(folder)?;
            let mut file = FileSink::create(path)?;
            file.write_all(text.as_bytes())?;
            Ok(file.publish()?)
        };
        write().with_context(|| {
            format!("{}: the settings cannot be written; check the folder's permissions", path.display())
        })
    }

    fn in_range(mut self) -> Self {
        let own = Self::default();
        let keep = |value: f64, [least, most]: [f64; 2], own: f64| {
            if value.is_finite() { value.clamp(least, most) } else { own }
        };
        let keep_f32 =
            |value: f32, range: [f64; 2], own: f32| keep(f64::from(value), range, f64::from(own)) as f32;
        let [least, most] = TOLERANCE_PX;
        self.tolerance_px = self.tolerance_px.filter(|px| px.is_finite()).map(|px| px.clamp(least, most));
        self.exaggeration = keep(self.exaggeration, EXAGGERATION, own.exaggeration);
        self.sun_azimuth_deg = keep_f32(self.sun_azimuth_deg, [0.0, 360.0], own.sun_azimuth_deg);
        self.sun_elevation_deg = keep_f32(self.sun_elevation_deg, [0.0, 90.0], own.sun_elevation_deg);
        self.image = keep_f32(self.image, [0.0, 1.0], own.image);
        self.contour_interval_m =
            keep_f32(self.contour_interval_m, CONTOUR_INTERVAL_M, own.contour_interval_m);
        if Look::named(&self.style).is_none() {
            self.style = own.style;
        }
        self.ramp = self.ramp.filter(|name| Ramp::named(name).is_some());
        self.culling = self.culling().name().to_owned();
        self.metric = self.metric().name().to_owned();
        self.window = [self.window[0].clamp(320, 16_384), self.window[1].clamp(240, 16_384)];
        self
    }
}

/// Least and largest tolerance of the panel.
pub(crate) const TOLERANCE_PX: [f64; 2] = [0.1, 50.0];
/// Tolerance on a driver in software: a frame takes two thirds of what it takes at 1 px there, and hardly less at 8, where pixels cost more than triangles.
const SOFTWARE_TOLERANCE_PX: f64 = 4.0;
/// Most of the screen's width and height that a window begins with.
const SHARE_OF_SCREEN: f64 = 0.92;
/// Least and largest exaggeration of the panel.
pub(crate) const EXAGGERATION: [f64; 2] = [0.1, 20.0];
/// Least and largest distance of contour lines.
pub(crate) const CONTOUR_INTERVAL_M: [f64; 2] = [0.5, 5000.0];

fn broken(path: &Path, why: &str) -> String {
    format!("{}: the settings cannot be read, defaults are used instead: {why}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/view.toml");
        assert_eq!(Settings::load(&path), (Settings::default(), None), "no file, no word");
        let mut settings =
            Settings { exaggeration: 2.5, figures: false, window: [800, 600], ..Default::default() };
        settings.set_style("contours");
        settings.ramp = Some("viridis".into());
        settings.save(&path).unwrap();
        assert_eq!(Settings::load(&path), (settings, None));
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no leftovers");
    }

    #[test]
    fn a_broken_file_is_told_and_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("view.toml");
        for text in ["tolerance_px = ", "tolerance_px = 'a'", "\u{0}", "window = [1]", "panel = 3"] {
            std::fs::write(&path, text).unwrap();
            let (settings, word) = Settings::load(&path);
            assert_eq!(settings, Settings::default());
            assert!(word.unwrap().contains("view.toml"), "{text}");
        }
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(Settings::load(&path).1.is_some());
        Settings::default().save(&path).unwrap();
        assert_eq!(Settings::load(&path).1, None);
    }

    #[test]
    fn values_are_brought_into_their_range() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("view.toml");
        std::fs::write(
            &path,
            "tolerance_px = 1e9\nexaggeration = nan\nimage = -3.0\nstyle = \"cubist\"\nramp = \"none such\"\nwindow = [0, 5]\nunknown = 1\n",
        )
        .unwrap();
        let (settings, word) = Settings::load(&path);
        assert_eq!(word, None);
        assert_eq!(settings.tolerance_px, Some(50.0));
        assert_eq!((settings.exaggeration, settings.style.as_str()), (1.0, "relief"));
        assert_eq!(settings.image, 0.0);
        assert_eq!((settings.ramp, settings.window), (None, [320, 240]));
    }

    #[test]
    fn a_tolerance_that_is_set_suits_every_adapter() {
        let adapter = |software| Capabilities {
            adapter: "pipe".into(),
            backend: "Vulkan".into(),
            software,
            texture_compression_bc: false,
            timestamps: false,
            multi_draw: false,
            depth_copies: true,
            max_binding_bytes: 1 << 27,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("view.toml");
        let mut settings = Settings::default();
        assert_eq!((settings.suit(&adapter(false)), settings.tolerance_px()), (None, 1.0));
        assert!(settings.suit(&adapter(true)).unwrap().contains("pipe"));
        assert_eq!(settings.tolerance_px(), 4.0);
        assert_eq!((settings.suit(&adapter(true)), settings.tolerance_px()), (None, 4.0), "said once");
        assert_eq!(
            (settings.suit(&adapter(false)), settings.tolerance_px()),
            (None, 1.0),
            "another took over"
        );
        assert!(settings.suit(&adapter(true)).is_some());
        settings.save(&path).unwrap();
        assert_eq!(
            Settings::load(&path).0.tolerance_px(),
            1.0,
            "what suits one adapter is not kept for others"
        );
        settings.tolerance_px = Some(1.0);
        assert_eq!((settings.suit(&adapter(true)), settings.tolerance_px()), (None, 1.0));
    }

    #[test]
    fn a_window_begins_within_the_screen() {
        let settings = Settings { window: [1280, 800], ..Default::default() };
        assert_eq!(settings.window_on(None), [1280.0, 800.0]);
        assert_eq!(settings.window_on(Some([1280.0, 720.0])), [1177.0, 662.0]);
        assert_eq!(settings.window_on(Some([3840.0, 2160.0])), [1280.0, 800.0]);
    }

    #[test]
    fn a_style_brings_what_belongs_to_it() {
        let mut settings = Settings::default();
        for (name, _) in LOOKS {
            settings.set_style(name);
            let (look, style) = (settings.look(), Look::named(name).unwrap());
            assert_eq!(look.surface, style.surface, "{name}");
            assert_eq!((look.contours, look.haze), (style.contours, style.haze), "{name}");
            assert_eq!(look.wireframe, style.wireframe, "{name}");
            assert_eq!(look.ramp.name, style.ramp.name, "{name}");
        }
        settings.next_style();
        assert_eq!(settings.style, LOOKS[0].0, "round and round");
        settings.wireframe = true;
        assert!(settings.look().wireframe.is_some());
    }
}
