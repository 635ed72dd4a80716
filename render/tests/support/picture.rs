//! Pictures: comparing, keeping, showing what differs.

use std::path::{Path, PathBuf};

/// A picture: four bytes a pixel.
#[derive(Clone, PartialEq)]
pub struct Picture {
    pub size_px: [u32; 2],
    pub rgba: Vec<u8>,
}

impl Picture {
    /// Root mean square difference over all colour channels, 0 to 1.
    pub fn difference(&self, other: &Self) -> f64 {
        assert_eq!(self.size_px, other.size_px);
        let squares: f64 =
            self.rgba.iter().zip(&other.rgba).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
        (squares / (0.75 * self.rgba.len() as f64)).sqrt() / 255.0
    }

    pub fn save(&self, path: &Path) {
        // Opaque pictures need no alpha, and are smaller without.
        let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|p| &p[..3]).copied().collect();
        image::save_buffer(path, &rgb, self.size_px[0], self.size_px[1], image::ColorType::Rgb8).unwrap();
    }

    fn load(path: &Path) -> Option<Self> {
        let image = image::open(path).ok()?.into_rgba8();
        Some(Self { size_px: [image.width(), image.height()], rgba: image.into_raw() })
    }
}

/// Root mean square difference that drivers may have. Never more than 0.1, which any mistake worth the name exceeds.
const TOLERANCE: f64 = 0.02;
/// Snapshots are small, so that many can be kept.
const MOST_BYTES: u64 = 64 * 1024;

/// Compares with the kept picture of that name. With TERRASOAR_BLESS=1 keeps the new one instead.
pub fn check_snapshot(name: &str, picture: &Picture) -> Result<(), String> {
    const { assert!(TOLERANCE <= 0.1) };
    let kept_path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots").join(format!("{name}.png"));
    if std::env::var_os("TERRASOAR_BLESS").is_some_and(|v| v == "1") {
        picture.save(&kept_path);
    }
    let bytes = std::fs::metadata(&kept_path).map_or(0, |m| m.len());
    if bytes > MOST_BYTES {
        return Err(format!("{} has {bytes} bytes, more than {MOST_BYTES}", kept_path.display()));
    }
    let kept = Picture::load(&kept_path);
    let difference = match &kept {
        Some(kept) if kept.size_px == picture.size_px => kept.difference(picture),
        _ => 1.0,
    };
    if difference <= TOLERANCE {
        return Ok(());
    }
    let folder = failures();
    picture.save(&folder.join(format!("{name}-actual.png")));
    if let Some(kept) = kept.filter(|k| k.size_px == picture.size_px) {
        // Four times the difference on grey.
        let mut diff = picture.clone();
        for (d, k) in diff.rgba.iter_mut().zip(&kept.rgba) {
            *d = (128 + 4 * (i32::from(*d) - i32::from(*k))).clamp(0, 255) as u8;
        }
        diff.save(&folder.join(format!("{name}-diff.png")));
    }
    Err(format!(
        "differs by {difference:.4} from {} (at most {TOLERANCE}); the new picture and the difference are in {}; \
         TERRASOAR_BLESS=1 keeps the new one",
        kept_path.display(),
        folder.display()
    ))
}

fn failures() -> PathBuf {
    let folder = std::env::temp_dir().join("terrasoar-snapshots");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}
