//! XYZ grids: a line a sample with east, north and height, in any order.
//!
//! The file is read twice. When it is opened, [`survey`] finds the grid that the points make and their order; when it is streamed, points go to their samples: row by row or column by
//! column where they come so, else strip by strip, with one reading for each strip of 64 MiB. A sample without a point is void; two points with two heights at one place
//! are refused. Row 0 is the northernmost whatever the order. Heights are kept in single precision, as GDAL does.

mod lattice;
mod line;
mod stream;
mod survey;

use crate::identify::Look;
use crate::input;
use crate::reader::{Declared, Reader, Said};
use line::Format;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use survey::{Order, Survey};
use terrasoar_layout::dem::{SampleSink, SampleType, Warning};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

/// Names that such files have; none has a signature.
const EXTENSIONS: [&str; 8] = ["xyz", "txt", "csv", "asc", "dat", "tsv", "gxyz", "xyzi"];
/// Bytes of the file's beginning in which its lines are understood.
const HEAD_BYTES: u64 = 1 << 14;

/// Whether a file is called as an XYZ grid may be and has lines of three numbers.
pub(crate) fn is_xyz(look: &Look<'_>) -> bool {
    EXTENSIONS.iter().any(|extension| look.is_called(extension)) && line::head(&look.head).is_some()
}

/// An XYZ grid.
#[derive(Debug)]
pub(crate) struct XyzDem {
    path: PathBuf,
    declared: Declared,
    format: Format,
    data_at: u64,
    survey: Survey,
}

impl XyzDem {
    /// Reads the whole file once, to find the grid.
    pub(crate) fn open(path: &Path) -> Result<Self, LayoutError> {
        let failed = |source| LayoutError::io(path, "cannot read the XYZ file", source);
        let mut head = Vec::new();
        let mut file = input::open(path, "cannot open the XYZ file")?;
        file.by_ref().take(HEAD_BYTES).read_to_end(&mut head).map_err(failed)?;
        let Some(head) = line::head(&head) else {
            return Err(LayoutError::not_this_format(
                path,
                "its lines are no three numbers each (east, north, height)",
            ));
        };
        let data_at = head.data_at as u64;
        file.seek(SeekFrom::Start(data_at)).map_err(failed)?;
        let survey = Survey::of(path, &mut file, head.format)?;
        let [x, y] = survey.axes;
        let mut declared = Declared::new([x.count, y.count], SampleType::F32, "XYZ grid");
        let north = y.first + f64::from(y.count - 1) * y.step;
        declared.place =
            Some(Said::new([x.first, x.step, 0.0, north, 0.0, -y.step], "the coordinates of its points"));
        if head.height_name.as_deref() == Some("depth") {
            let words = "the column of heights is named depth; its numbers were taken as heights";
            declared.warnings.push(Warning::new(words).mended_by(Remedy::Direction, "down"));
        }
        Ok(Self { path: path.to_owned(), declared, format: head.format, data_at, survey })
    }

    fn points(&self) -> Result<File, LayoutError> {
        let mut file = input::open(&self.path, "cannot open the XYZ file")?;
        file.seek(SeekFrom::Start(self.data_at))
            .map_err(|source| LayoutError::io(&self.path, "cannot read the XYZ file", source))?;
        Ok(file)
    }
}

impl Reader for XyzDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn memory_bytes(&self) -> u64 {
        stream::memory_bytes(self)
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        match self.survey.order {
            Order::Rows => stream::rows(self, sink),
            Order::Columns => stream::columns(self, sink),
            Order::Any => stream::strips(self, sink),
        }
    }
}
