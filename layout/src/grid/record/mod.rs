//! Bytes to vertices and back: the record kinds of FORMAT.md, section 3.
//!
//! Any bytes can be decoded and give some vertex. Encoding rounds errors and radii up, so that what holds for the
//! numbers holds for the records too. A codec is a few kilobytes of tables; each decoder has a copy of its own.
//! Cost: about two table lookups a vertex for compact records.

mod any;
mod compact;
mod error_codes;
mod exact;
mod excess;

pub(crate) use any::AnyCodec;
pub use compact::Compact;
pub use exact::{Exact8, Exact16};

/// Which of the record kinds a file uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordKind {
    /// 4 bytes: 16-bit height, logarithmic error and radius.
    Compact,
    /// 4 bytes: 16-bit height, an error in four times as many steps, a radius in 63 of its own.
    Fine,
    /// 8 bytes: single-precision height, 16-bit error and radius.
    Exact8,
    /// 16 bytes: double-precision height, single-precision error and radius.
    Exact16,
}

impl RecordKind {
    /// Bytes a record.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Compact | Self::Fine => 4,
            Self::Exact8 => 8,
            Self::Exact16 => 16,
        }
    }

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compact => "compact",
            Self::Fine => "fine",
            Self::Exact8 | Self::Exact16 => "exact",
        }
    }

    /// Whether heights are 16-bit numbers of steps. Otherwise they are floating-point numbers.
    pub const fn has_height_codes(self) -> bool {
        matches!(self, Self::Compact | Self::Fine)
    }
}

/// What a record's vertex is, apart from its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VertexClass {
    /// Neither it nor any descendant is next to a void.
    Plain,
    /// A void lies at or below it; its own sample has a height.
    Fringe,
    /// A void lies at or below it, and its own sample is void.
    FringeVoid,
    /// Never refined: void throughout, or beyond the data.
    Inert,
}

impl VertexClass {
    /// Whether the sample has no height of its own. True of inert vertices as well.
    pub fn is_void(self) -> bool {
        matches!(self, Self::FringeVoid | Self::Inert)
    }

    /// Whether triangles that this vertex would split are drawn while it does not.
    pub fn is_plain(self) -> bool {
        self == Self::Plain
    }
}

/// A decoded record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// Height in metres; for a void, a filled-in one.
    pub height_m: f64,
    /// Saturated error bound in metres, 0 or more, possibly infinite.
    pub error_m: f64,
    /// Nested-sphere radius in metres, 0 or more.
    pub radius_m: f64,
    /// Plain, next to a void, or inert.
    pub class: VertexClass,
}

/// Numbers a file's header gives to its records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordScale {
    /// Metres of height at code or value 0.
    pub height_base_m: f64,
    /// Metres of height a code or value.
    pub height_step_m: f64,
    /// Error in metres that the largest plain code of compact and fine records stands for.
    pub error_top_m: f64,
    /// What radius codes stand for.
    pub radius_codes: RadiusCodes,
}

/// What the radius codes of plain vertices stand for. It is what tells the codecs of compact and of fine records apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RadiusCodes {
    /// Compact records: so many codes, 8, 16, 32 or 64, to an octave above the radius of flat ground.
    Octaves(u32),
    /// Fine records: what a radius has above that of flat ground, as a share of it, in eighths of octaves from 2^n on and in eighths of 2^n below.
    Excess {
        /// The n of the first octave, one of [`RadiusCodes::FIRST_OCTAVES`].
        first_octave: i32,
    },
}

impl RadiusCodes {
    /// First octaves that fine records may have. The least one holds slopes of 83 degrees.
    pub const FIRST_OCTAVES: std::ops::RangeInclusive<i32> = -4..=27;
}

/// Turns the bytes of one record into a vertex and back.
pub trait RecordCodec: Clone + Send + Sync + 'static {
    /// Bytes a record, a power of two.
    const BYTES: usize;
    /// The inert record.
    const INERT: Self::Raw;
    /// A record as one integer.
    type Raw: Copy + Send + Sync + PartialEq + std::fmt::Debug + 'static;

    /// The record at the start of `bytes`, which holds at least [`Self::BYTES`].
    fn read(bytes: &[u8]) -> Self::Raw;

    /// Stores `raw` at the start of `bytes`.
    fn write(raw: Self::Raw, bytes: &mut [u8]);

    /// The vertex of a record at `level` (0 for the corners).
    fn decode(&self, raw: Self::Raw, level: u32) -> Vertex;

    /// The record of a vertex with raw height `value` (metres = base + value * step), error and radius rounded up.
    /// The value is one that [`RecordCodec::round_height`] gives. `None` if the radius is beyond what a plain record can say, or the height does not fit.
    fn encode(
        &self,
        level: u32,
        value: f64,
        class: VertexClass,
        error_m: f64,
        radius_m: f64,
    ) -> Option<Self::Raw>;

    /// [`RecordCodec::encode`] of a plain vertex.
    #[inline(always)]
    fn encode_plain(&self, level: u32, value: f64, error_m: f64, radius_m: f64) -> Option<Self::Raw> {
        self.encode(level, value, VertexClass::Plain, error_m, radius_m)
    }

    /// Whether a record's sample is void, or the record inert: as [`Vertex::class`] says it, without decoding the rest.
    fn is_void(raw: Self::Raw) -> bool;

    /// Whether a record is surely a plain one's, found more quickly than by decoding it.
    #[inline(always)]
    fn is_plain(_raw: Self::Raw) -> bool {
        false
    }

    /// The raw height of a record that is not inert, as [`RecordCodec::encode`] takes it.
    fn height_value(raw: Self::Raw) -> f64;

    /// A raw height rounded to what the record keeps.
    fn round_height(value: f64) -> f64;
}

/// The smallest single that is not below `value`, which is 0 or more.
#[inline]
pub fn f32_at_least(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) < value { near.next_up() } else { near }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use proptest::prelude::*;

    fn grid() -> Grid {
        Grid::new([65, 65], [10.0, 13.0]).unwrap()
    }

    const SCALE: RecordScale = RecordScale {
        height_base_m: -12.5,
        height_step_m: 0.25,
        error_top_m: 900.0,
        radius_codes: RadiusCodes::Octaves(64),
    };
    const FINE: RecordScale = RecordScale { radius_codes: RadiusCodes::Excess { first_octave: -4 }, ..SCALE };

    fn rounds_up<C: RecordCodec>(
        codec: &C,
        [error_ratio, radius_ratio]: [f64; 2],
        level: u32,
        value: f64,
        error_m: f64,
        stretch: f64,
    ) {
        let value = C::round_height(value);
        let radius_m = grid().flat_radius_m(level) * stretch;
        for class in [VertexClass::Plain, VertexClass::Fringe, VertexClass::FringeVoid] {
            let raw = codec.encode(level, value, class, error_m, radius_m).unwrap();
            let v = codec.decode(raw, level);
            assert_eq!(v.class, class);
            assert_eq!(v.height_m, -12.5 + value * 0.25);
            assert_eq!(C::height_value(raw), value);
            assert_eq!(C::is_void(raw), class.is_void());
            assert!(v.error_m >= error_m && v.radius_m >= radius_m, "{v:?} {error_m} {radius_m}");
            if class == VertexClass::Plain && error_m > 0.02 {
                assert!(v.error_m <= error_m * error_ratio, "{v:?} {error_m}");
                assert!(v.radius_m <= radius_m.max(grid().flat_radius_m(level)) * radius_ratio + 1e-9);
            }
            // Encoding what was decoded changes nothing.
            assert_eq!(codec.encode(level, value, class, v.error_m, v.radius_m), Some(raw));
        }
        assert_eq!(codec.decode(C::INERT, level).class, VertexClass::Inert);
        let inert = codec.decode(C::INERT, level);
        assert_eq!((inert.error_m, inert.radius_m), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn encoding_rounds_up_and_is_idempotent(
            level in 0u32..12, value in 0f64..65535.0, error in prop_oneof![Just(0.0), 1e-6f64..900.0], stretch in 0.5f64..15.0,
        ) {
            rounds_up(&Compact::new(&grid(), &SCALE), [1.06, 1.0175], level, value, error, stretch);
            // A radius of less than a sixteenth more than flat ground's is told to a 128th of that; eight times flat ground's is all there is.
            let gentle = stretch.min(8.0);
            rounds_up(&Compact::new(&grid(), &FINE), [1.014, 1.112], level, value, error, gentle);
            rounds_up(&Compact::new(&grid(), &FINE), [1.014, 1.008], level, value, error, 0.9 + gentle / 53.0);
            rounds_up(&Exact8::new(&grid(), &SCALE), [1.06, 1.0175], level, value, error, stretch);
            rounds_up(&Exact16::new(&grid(), &SCALE), [1.06, 1.0175], level, value, error, stretch);
        }

        #[test]
        fn decoding_is_total(raw: u128, level in 0u32..12) {
            for v in [
                Compact::new(&grid(), &SCALE).decode(raw as u32, level),
                Compact::new(&grid(), &FINE).decode(raw as u32, level),
                Exact8::new(&grid(), &SCALE).decode(raw as u64, level),
                Exact16::new(&grid(), &SCALE).decode(raw, level),
            ] {
                prop_assert!(v.height_m.is_finite() && v.error_m >= 0.0 && v.radius_m >= 0.0, "{v:?}");
            }
            let is_void = |class: VertexClass| class.is_void();
            prop_assert_eq!(Compact::is_void(raw as u32), is_void(Compact::new(&grid(), &SCALE).decode(raw as u32, level).class));
            prop_assert_eq!(Compact::is_void(raw as u32), is_void(Compact::new(&grid(), &FINE).decode(raw as u32, level).class));
            prop_assert_eq!(Exact8::is_void(raw as u64), is_void(Exact8::new(&grid(), &SCALE).decode(raw as u64, level).class));
            prop_assert_eq!(Exact16::is_void(raw), is_void(Exact16::new(&grid(), &SCALE).decode(raw, level).class));
        }
    }
}
