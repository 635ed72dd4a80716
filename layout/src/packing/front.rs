//! Sections of a packed file on their way to the disk (FORMAT.md, section 9.1).

use crate::file::bytes::checksum;
use crate::file::packed_end::FRONT;
use crate::packed::container::Section;

/// Sections behind the header.
#[derive(Default)]
pub(super) struct Front {
    pub(super) bytes: Vec<u8>,
    pub(super) sections: Vec<Section>,
}

impl Front {
    /// Appends a section; where it begins behind the header.
    pub(super) fn put(&mut self, kind: u32, bytes: &[u8]) -> usize {
        let at = self.bytes.len();
        let offset = FRONT + at as u64;
        self.bytes.extend(bytes);
        self.sections.push(Section { kind, checksum: checksum(bytes), offset, bytes: bytes.len() as u64 });
        at
    }

    /// Lists a section that lies elsewhere.
    pub(super) fn list(&mut self, kind: u32, bytes: &[u8], offset: u64) {
        self.sections.push(Section { kind, checksum: checksum(bytes), offset, bytes: bytes.len() as u64 });
    }

    /// The checksum of a section that was filled in meanwhile.
    pub(super) fn seal(&mut self, kind: u32) {
        for section in self.sections.iter_mut().filter(|section| section.kind == kind) {
            let from = (section.offset - FRONT) as usize;
            section.checksum = checksum(&self.bytes[from..from + section.bytes as usize]);
        }
    }
}
