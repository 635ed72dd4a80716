//! One change of a file, told by eight bytes: which kind, which part, where in it, which value. Values are mostly those at which arithmetic goes wrong.
//!
//! A change whose part is not in the file changes nothing.

use super::image::Image;
use super::parts::{Part, What};
use crate::file::bytes::PAGE_BYTES;
use crate::file::entries::ENTRY_BYTES;

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    U8,
    U32,
    U64,
    F64,
    Text,
}

use Kind::{F64, Text, U8, U32, U64};

/// Fields of a header (FORMAT.md, section 4).
const HEADER: [(usize, Kind); 40] = [
    (0x008, U8),
    (0x011, U8),
    (0x012, U8),
    (0x013, U8),
    (0x014, U32),
    (0x018, U32),
    (0x01c, U32),
    (0x020, F64),
    (0x028, F64),
    (0x030, F64),
    (0x038, F64),
    (0x040, F64),
    (0x048, F64),
    (0x050, F64),
    (0x058, U32),
    (0x060, U64),
    (0x068, U64),
    (0x070, U64),
    (0x078, U32),
    (0x07c, U32),
    (0x088, U64),
    (0x090, U64),
    (0x098, U64),
    (0x0a0, F64),
    (0x0a8, F64),
    (0x0b0, F64),
    (0x0b8, F64),
    (0x0c0, F64),
    (0x0c8, F64),
    (0x0d0, U32),
    (0x0d4, U8),
    (0x0d5, U8),
    (0x0d8, F64),
    (0x0e0, F64),
    (0x0e8, U32),
    (0x0ec, U32),
    (0x0f8, U64),
    (0x200, Text),
    (0x300, Text),
    (0x400, Text),
];

/// Fields of a journal page (section 7.2): those of its own, then of two states.
const JOURNAL: [(usize, Kind); 18] = [
    (0x00c, U32),
    (0x010, U32),
    (0x018, U64),
    (0x040, U32),
    (0x048, U64),
    (0x050, F64),
    (0x058, F64),
    (0x060, F64),
    (0x068, U64),
    (0x070, U64),
    (0x080, U32),
    (0x088, U64),
    (0x090, F64),
    (0x098, F64),
    (0x0a0, F64),
    (0x0a8, U64),
    (0x0b0, U64),
    (0x200, Text),
];

/// Fields of an imagery header (section 8.2).
const SECTION: [(usize, Kind); 13] = [
    (0x00a, U8),
    (0x014, U32),
    (0x018, U32),
    (0x01c, U32),
    (0x020, F64),
    (0x028, F64),
    (0x030, F64),
    (0x038, F64),
    (0x040, U64),
    (0x048, U64),
    (0x050, U64),
    (0x058, U32),
    (0x200, Text),
];

/// Numbers to put into fields of doubles.
const DOUBLES: [f64; 18] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    1e12,
    -1e12,
    1e-12,
    1e6,
    1e-3,
    1e300,
    9_007_199_254_740_993.0,
];

/// Numbers to put into whole fields.
const WHOLES: [u64; 16] = [
    0,
    1,
    2,
    3,
    4,
    255,
    256,
    4096,
    65_537,
    1 << 22,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 32,
    u64::MAX / 2,
    u64::MAX,
];

/// Records to put in place of others, repeated as often as they fit.
const RECORDS: [[u8; 16]; 8] = [
    [0; 16],
    [0xff; 16],
    // Compact: the largest error and radius; exact: large ones.
    [0x00, 0x80, 247, 254, 0x00, 0x80, 247, 254, 0x00, 0x80, 247, 254, 0x00, 0x80, 247, 254],
    // Compact: a fringe with an endless error.
    [0x10, 0x27, 251, 254, 0x10, 0x27, 251, 254, 0x10, 0x27, 251, 254, 0x10, 0x27, 251, 254],
    // Exact, 8 bytes: infinite error and radius.
    [0, 0, 0x7f, 0x7f, 0x80, 0x7f, 0x80, 0x7f, 0, 0, 0x7f, 0x7f, 0x80, 0x7f, 0x80, 0x7f],
    // Exact, 16 bytes: the largest height, infinite error and radius.
    [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xef, 0x7f, 0, 0, 0x80, 0x7f, 0, 0, 0x80, 0x7f],
    // Exact, 16 bytes: no number for a height, errors and radii that are none.
    [0, 0, 0, 0, 0, 0, 0xf8, 0x7f, 0, 0, 0xc0, 0x7f, 0, 0, 0xc0, 0x7f],
    // Exact, 8 bytes: the lowest height, a fringe.
    [0xff, 0xff, 0x7f, 0xff, 0x01, 0x80, 0x00, 0x00, 0xff, 0xff, 0x7f, 0xff, 0x01, 0x80, 0x00, 0x00],
];

/// Texts that no terminal should be sent.
const TEXTS: [&[u8]; 6] = [
    b"\x1b[2J\x1b]0;title\x07",
    "\u{9b}31m\u{202e}txet\u{200b}".as_bytes(),
    b"<script>alert(1)</script>,\"\n=1+1",
    b"\xff\xfe",
    b"",
    &[b'a'; 254],
];

/// A change of one part of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mutation {
    how: u8,
    part: u8,
    place: u16,
    value: u32,
}

impl Mutation {
    /// Bytes that tell one.
    pub const BYTES: usize = 8;

    /// The change that these bytes tell; every pattern is one.
    pub fn of(bytes: [u8; Self::BYTES]) -> Self {
        let [how, part, p0, p1, v0, v1, v2, v3] = bytes;
        Self { how, part, place: u16::from_le_bytes([p0, p1]), value: u32::from_le_bytes([v0, v1, v2, v3]) }
    }

    /// Changes the file, whose parts these are.
    pub(super) fn apply(self, image: &mut Image<'_>, parts: &[Part]) {
        match self.how % 16 {
            0..=3 => self.field(image, parts),
            4 => self.bytes(image, parts),
            5 => self.lead_elsewhere(image, parts),
            6 => self.copy_entry(image, parts),
            7 => self.clear_entry(image, parts),
            8..=10 => self.record(image, parts),
            11 => self.fill_pages(image, parts),
            12 => self.swap_pages(image, parts),
            13 => self.samples(image, parts),
            14 => self.whole_part(image, parts),
            _ => self.length(image),
        }
    }

    /// The part meant, of those of these kinds.
    fn part(self, parts: &[Part], of: &[What]) -> Option<Part> {
        let fitting: Vec<Part> = parts.iter().filter(|part| of.contains(&part.what)).copied().collect();
        fitting.get(usize::from(self.part) % fitting.len().max(1)).copied()
    }

    /// A whole number, most often one of those that matter.
    fn whole(self, image: &Image<'_>, old: u64) -> u64 {
        let pages = u64::from(image.pages());
        let value = u64::from(self.value >> 8);
        match self.value & 15 {
            0..=4 => WHOLES[value as usize % WHOLES.len()],
            5 => pages,
            6 => pages.saturating_sub(1),
            7 => pages * PAGE_BYTES as u64,
            8 => old.wrapping_add(1),
            9 => old.wrapping_sub(1),
            10 => old ^ 1 << (value % 64),
            11 => old.wrapping_mul(2),
            12 => value % pages.max(1),
            13 => value % pages.max(1) * PAGE_BYTES as u64,
            _ => value,
        }
    }

    fn double(self, old: f64) -> f64 {
        let value = (self.value >> 8) as usize;
        match self.value & 7 {
            0..=3 => DOUBLES[value % DOUBLES.len()],
            4 => old * 2f64.powi(value as i32 % 2000 - 1000),
            5 => f64::from_bits(old.to_bits() ^ 1 << (value % 64)),
            6 => -old,
            _ => old * (1.0 + f64::from(value as u16) / 1e6),
        }
    }

    fn field(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some(part) = self.part(parts, &[What::Header, What::Journal, What::Section]) else { return };
        let fields: &[(usize, Kind)] = match part.what {
            What::Header => &HEADER,
            What::Journal => &JOURNAL,
            _ => &SECTION,
        };
        let (offset, kind) = fields[usize::from(self.place) % fields.len()];
        let at = part.at + offset;
        match kind {
            U8 => _ = image.put(at, &[self.value as u8 % 8]),
            U32 => {
                let old = u64::from(image.u32_at(at));
                let new = self.whole(image, old) as u32;
                image.put(at, &new.to_le_bytes());
            }
            U64 => {
                let new = self.whole(image, image.u64_at(at));
                image.put(at, &new.to_le_bytes());
            }
            F64 => {
                let new = self.double(f64::from_bits(image.u64_at(at)));
                image.put(at, &new.to_le_bytes());
            }
            Text => {
                let text = TEXTS[self.value as usize % TEXTS.len()];
                image.put(at, &(text.len() as u16).to_le_bytes());
                image.put(at + 2, text);
            }
        }
    }

    /// One to four bytes anywhere.
    fn bytes(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some(part) = parts.get(usize::from(self.part) % parts.len().max(1)) else { return };
        let at = part.at + usize::from(self.place) % part.bytes;
        let count = 1 + self.how as usize / 16 % 4;
        image.put(at, &self.value.to_le_bytes()[..count]);
    }

    /// Byte of an entry of a directory.
    fn entry(self, parts: &[Part]) -> Option<(usize, usize)> {
        let part = self.part(parts, &[What::Root, What::Node, What::Leaf, What::TileDirectory])?;
        let entries = (part.bytes / ENTRY_BYTES).max(1);
        Some((part.at + usize::from(self.place) % entries * ENTRY_BYTES, entries))
    }

    /// An entry leads to a page of another part, or anywhere.
    fn lead_elsewhere(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some((at, _)) = self.entry(parts) else { return };
        let page = match parts.get((self.value >> 8) as usize % parts.len().max(1)) {
            Some(part) if self.value & 1 == 0 => (part.at / PAGE_BYTES) as u32,
            _ => self.whole(image, u64::from(image.u32_at(at))) as u32,
        };
        image.put(at, &page.to_le_bytes());
    }

    /// An entry becomes that of a neighbour, or all of them become it.
    fn copy_entry(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some((at, entries)) = self.entry(parts) else { return };
        let Some(entry) = image.get(at, ENTRY_BYTES).map(<[u8]>::to_vec) else { return };
        let first = at - usize::from(self.place) % entries * ENTRY_BYTES;
        if self.value & 3 == 0 {
            (0..entries).for_each(|i| _ = image.put(first + i * ENTRY_BYTES, &entry));
        } else {
            image.put(first + (self.value >> 8) as usize % entries * ENTRY_BYTES, &entry);
        }
    }

    fn clear_entry(self, image: &mut Image<'_>, parts: &[Part]) {
        if let Some((at, _)) = self.entry(parts) {
            image.put(at, &[0; ENTRY_BYTES]);
        }
    }

    /// A record becomes an unlikely one, or any.
    fn record(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some(part) = self.part(parts, &[What::Records]) else { return };
        let bytes = 4 << (self.value & 3).min(2);
        let at = part.at + usize::from(self.place) % (PAGE_BYTES / bytes) * bytes;
        if self.value & 4 == 0 {
            let value = self.value.wrapping_mul(0x9e37_79b9).to_le_bytes();
            image.put(at + bytes - 4, &value);
        } else {
            image.put(at, &RECORDS[(self.value >> 8) as usize % RECORDS.len()][..bytes]);
        }
    }

    /// One page, or every page, of nothing but one record.
    fn fill_pages(self, image: &mut Image<'_>, parts: &[Part]) {
        let page = RECORDS[(self.value >> 8) as usize % RECORDS.len()].repeat(PAGE_BYTES / 16);
        if self.value & 1 == 0 {
            let all = parts.iter().filter(|part| part.what == What::Records);
            all.for_each(|part| _ = image.put(part.at, &page));
        } else if let Some(part) = self.part(parts, &[What::Records]) {
            image.put(part.at, &page);
        }
    }

    fn swap_pages(self, image: &mut Image<'_>, parts: &[Part]) {
        let pages: Vec<&Part> = parts.iter().filter(|part| part.bytes == PAGE_BYTES).collect();
        let Some(one) = pages.get(usize::from(self.part) % pages.len().max(1)) else { return };
        let other = pages[self.value as usize % pages.len()];
        let (Some(a), Some(b)) = (image.get(one.at, PAGE_BYTES), image.get(other.at, PAGE_BYTES)) else {
            return;
        };
        let (a, b) = (a.to_vec(), b.to_vec());
        image.put(one.at, &b);
        image.put(other.at, &a);
    }

    /// Another size of the data, most often in the same square.
    fn samples(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some(part) = self.part(parts, &[What::Header]) else { return };
        let at = part.at + if self.place & 1 == 0 { 0x014 } else { 0x018 };
        let value = match self.value & 3 {
            0 => self.value >> 8,
            _ => 2 + (self.value >> 8) % image.u32_at(at).saturating_mul(2).max(1),
        };
        image.put(at, &value.to_le_bytes());
    }

    /// A part becomes a copy of another, as far as it goes.
    fn whole_part(self, image: &mut Image<'_>, parts: &[Part]) {
        let Some(to) = parts.get(usize::from(self.part) % parts.len().max(1)) else { return };
        let from = parts[self.value as usize % parts.len()];
        if let Some(bytes) = image.get(from.at, from.bytes.min(to.bytes)).map(<[u8]>::to_vec) {
            image.put(to.at, &bytes);
        }
    }

    /// The file is cut, or grows by at most 64 KiB.
    fn length(self, image: &mut Image<'_>) {
        let length = image.end() - image.start();
        let value = (self.value >> 2) as usize;
        image.resize(match self.value & 3 {
            0 => value % (length + 1),
            1 => value % (length / PAGE_BYTES + 1) * PAGE_BYTES,
            _ => length + value % 65_536,
        });
    }
}
