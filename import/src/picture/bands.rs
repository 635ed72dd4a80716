//! Bands of a picture chosen by their numbers, among its colours. A format with more bands than colours chooses by itself.

use crate::reader::{NumberRows, Numbers};
use crate::shown::chosen_bands;
use std::num::NonZero;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::RowReader;

/// Which colour becomes red, green and blue; counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Chosen([usize; 3]);

impl Chosen {
    /// Of a picture of so many colours; `None` where nothing changes.
    pub(super) fn new(
        path: &Path,
        colours: usize,
        bands: &[NonZero<u32>],
    ) -> Result<Option<Self>, LayoutError> {
        Ok(match chosen_bands(path, colours as u64, bands)?[..] {
            [grey] if colours > 1 => Some(Self([grey; 3])),
            [red, green, blue] if [red, green, blue] != [0, 1, 2] => Some(Self([red, green, blue])),
            _ => None,
        })
    }

    /// Channels of colour: 1 of a grey picture, else 3.
    pub(super) fn colours(&self) -> usize {
        if self.0 == [self.0[0]; 3] { 1 } else { 3 }
    }

    fn of<T: Copy>(&self, texel: [T; 4]) -> [T; 4] {
        let [red, green, blue] = self.0;
        [texel[red], texel[green], texel[blue], texel[3]]
    }
}

/// Bytes of the bands chosen.
pub(super) struct ChosenBytes<'p> {
    pub(super) rows: Box<dyn RowReader + 'p>,
    pub(super) chosen: &'p Chosen,
}

impl RowReader for ChosenBytes<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        self.rows.read(rgba)?;
        rgba.as_chunks_mut::<4>().0.iter_mut().for_each(|texel| *texel = self.chosen.of(*texel));
        Ok(())
    }
}

/// Numbers of the bands chosen.
pub(super) struct ChosenNumbers<'p> {
    pub(super) rows: Box<dyn NumberRows + 'p>,
    pub(super) chosen: &'p Chosen,
}

impl NumberRows for ChosenNumbers<'_> {
    fn read(&mut self, texels: &mut [Numbers]) -> Result<(), LayoutError> {
        self.rows.read(texels)?;
        texels.iter_mut().for_each(|texel| *texel = self.chosen.of(*texel));
        Ok(())
    }
}
