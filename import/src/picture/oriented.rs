//! Pictures that a camera took sideways: the tag of their orientation (EXIF 2.32, 4.6.4, tag 274) undone.
//!
//! The first row of such a picture needs all of its rows, so all of it is held while it is read: 4 bytes a texel, which counts against the memory budget.

use crate::reader::Orientation;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, RowReader};

/// A picture that is turned as it is read.
pub(super) struct Oriented<S> {
    picture: S,
    info: ImageInfo,
    orientation: Orientation,
}

impl<S: ImageSource> Oriented<S> {
    pub(super) fn new(picture: S, orientation: Orientation) -> Self {
        let mut info = picture.info().clone();
        let [wide, high] = info.texels;
        if orientation.is_sideways() {
            info.texels = [high, wide];
        }
        info.notes.push(format!("turned as its EXIF tag says ({})", orientation.tag()));
        let held = u64::from(wide) * u64::from(high) * 4;
        info.memory_bytes = info.memory_bytes.saturating_add(held);
        Self { picture, info, orientation }
    }

    /// Column and row in the file of a texel as it is shown, whose size in the file is `wide` x `high`.
    fn source(&self, [col, row]: [usize; 2], [wide, high]: [usize; 2]) -> [usize; 2] {
        match self.orientation.tag() {
            2 => [wide - 1 - col, row],
            3 => [wide - 1 - col, high - 1 - row],
            4 => [col, high - 1 - row],
            // Sideways, and the mirror images of that.
            5 => [row, col],
            6 => [row, high - 1 - col],
            7 => [wide - 1 - row, high - 1 - col],
            8 => [wide - 1 - row, col],
            _ => [col, row],
        }
    }
}

impl<S: ImageSource> ImageSource for Oriented<S> {
    fn path(&self) -> &Path {
        self.picture.path()
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let [wide, high] = self.picture.info().texels.map(|side| side as usize);
        let mut texels = vec![0; wide * high * 4];
        let mut rows = self.picture.rows()?;
        // As readers like it: some rows at a time.
        for band in texels.chunks_mut(wide * 4 * 64) {
            rows.read(band)?;
        }
        Ok(Box::new(Rows { oriented: self, texels, y: 0 }))
    }
}

struct Rows<'p, S> {
    oriented: &'p Oriented<S>,
    texels: Vec<u8>,
    y: usize,
}

impl<S: ImageSource> RowReader for Rows<'_, S> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let size = self.oriented.picture.info().texels.map(|side| side as usize);
        let (texels, _) = self.texels.as_chunks::<4>();
        for row in rgba.chunks_exact_mut(4 * self.oriented.info.texels[0] as usize) {
            let (row, _) = row.as_chunks_mut::<4>();
            for (col, to) in row.iter_mut().enumerate() {
                let [x, y] = self.oriented.source([col, self.y], size);
                *to = texels.get(y * size[0] + x).copied().unwrap_or_default();
            }
            self.y += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::imagery::MemoryImage;

    /// The eight orientations of EXIF, by where the standard puts the file's first row and first column: (row 0 is at, column 0 is at).
    #[test]
    fn first_rows_and_columns_are_where_the_standard_puts_them() {
        let stored = MemoryImage::from_fn([3, 2], |x, y| [x as u8, y as u8, 0, 255]);
        for (tag, first_row, first_column) in [
            (1, "top", "left"),
            (2, "top", "right"),
            (3, "bottom", "right"),
            (4, "bottom", "left"),
            (5, "left", "top"),
            (6, "right", "top"),
            (7, "right", "bottom"),
            (8, "left", "bottom"),
        ] {
            let shown = Oriented::new(stored.clone(), Orientation::of_tag(tag));
            let [wide, high] = shown.info().texels.map(|side| side as usize);
            let mut rgba = vec![0; wide * high * 4];
            shown.rows().unwrap().read(&mut rgba).unwrap();
            let at = |col: usize, row: usize| &rgba[4 * (row * wide + col)..][..4];
            let side = |name: &str| -> Vec<[u8; 2]> {
                let texels: Vec<[usize; 2]> = match name {
                    "top" => (0..wide).map(|col| [col, 0]).collect(),
                    "bottom" => (0..wide).map(|col| [col, high - 1]).collect(),
                    "left" => (0..high).map(|row| [0, row]).collect(),
                    _ => (0..high).map(|row| [wide - 1, row]).collect(),
                };
                texels.into_iter().map(|[col, row]| [at(col, row)[0], at(col, row)[1]]).collect()
            };
            assert!(side(first_row).iter().all(|texel| texel[1] == 0), "{tag}: row 0 is not {first_row}");
            assert!(
                side(first_column).iter().all(|texel| texel[0] == 0),
                "{tag}: column 0 is not {first_column}"
            );
        }
    }
}
