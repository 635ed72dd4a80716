//! Bytes to vertices and back: the three record kinds of FORMAT.md, section 3.
//!
//! Decoding is total: any bytes give some vertex. Encoding rounds errors and radii up, so that what holds for the
//! numbers holds for the records. A codec is a few kilobytes of tables and is copied into whoever decodes.
//! Cost: about two table lookups a vertex for compact records.

use crate::grid::{Grid, MAX_K};
use crate::octave::OctaveTable;

/// Which of the record kinds a file uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordKind {
    /// 4 bytes: 16-bit height, logarithmic error and radius.
    Compact,
    /// 8 bytes: single-precision height, 16-bit error and radius.
    Exact8,
    /// 16 bytes: double-precision height, single-precision error and radius.
    Exact16,
}

impl RecordKind {
    /// Bytes a record.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Compact => 4,
            Self::Exact8 => 8,
            Self::Exact16 => 16,
        }
    }

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compact => "compact",
            Self::Exact8 | Self::Exact16 => "exact",
        }
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
    /// Error in metres that the largest plain code of compact records stands for.
    pub error_top_m: f64,
    /// Radius codes an octave: 8, 16, 32 or 64.
    pub radius_steps_per_octave: u32,
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

    /// A raw height rounded to what the record keeps.
    fn round_height(value: f64) -> f64;
}

/// First of the error codes of fringe vertices.
const FRINGE: u8 = 248;
/// First of the error codes of fringe vertices whose sample is void.
const FRINGE_VOID: u8 = 252;
/// Factors of edge length that fringe codes stand for.
const FRINGE_FACTORS: [f64; 4] = [1.0, 16.0, 256.0, f64::INFINITY];
/// Plain error codes an octave.
const ERROR_STEPS: u32 = 16;
/// Fringe radius codes an octave.
const FRINGE_RADIUS_STEPS: u32 = 8;

/// Makes a rounded quotient a lower bound; comparing products then decides.
const BELOW: f64 = 1.0 - 1e-12;

/// The first code from `guess` on that stands for at least `value`.
#[inline(always)]
fn first_at_least(guess: u8, value: f64, stands_for: impl Fn(u8) -> f64) -> Option<u8> {
    // The guess came from a product rounded down: it is the answer or the code before it.
    if stands_for(guess) >= value {
        Some(guess)
    } else {
        guess.checked_add(1).filter(|c| stands_for(*c) >= value)
    }
}

/// Codec of 4-byte records.
#[derive(Debug, Clone)]
pub struct Compact {
    height_base_m: f64,
    height_step_m: f64,
    per_least_error: f64,
    errors: [f64; 256],
    radii: [f64; 256],
    flat_radius_m: [f64; 2 * MAX_K as usize],
    per_flat_radius: [f64; 2 * MAX_K as usize],
    edge_m: [f64; 2 * MAX_K as usize],
    error_steps: OctaveTable,
    radius_steps: OctaveTable,
    fringe_radius_steps: OctaveTable,
}

impl Compact {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let error_steps = OctaveTable::new(ERROR_STEPS);
        let radius_steps = OctaveTable::new(scale.radius_steps_per_octave);
        let bottom = scale.error_top_m / error_steps.power(FRINGE - 2);
        let per_level = |f: &dyn Fn(u32) -> f64| {
            std::array::from_fn(|l| if (l as u32) < grid.levels() { f(l as u32) } else { 0.0 })
        };
        Self {
            height_base_m: scale.height_base_m,
            height_step_m: scale.height_step_m,
            per_least_error: BELOW / bottom,
            errors: std::array::from_fn(|i| match i as u8 {
                0 => 0.0,
                code => bottom * error_steps.power(code - 1),
            }),
            radii: std::array::from_fn(|i| if i == 255 { 0.0 } else { radius_steps.power(i as u8) }),
            flat_radius_m: per_level(&|l| grid.flat_radius_m(l)),
            per_flat_radius: per_level(&|l| BELOW / grid.flat_radius_m(l)),
            edge_m: per_level(&|l| grid.edge_m(l)),
            error_steps,
            radius_steps,
            fringe_radius_steps: OctaveTable::new(FRINGE_RADIUS_STEPS),
        }
    }

    #[cold]
    fn decode_fringe(&self, height_m: f64, error_code: u8, radius_code: u8, level: u32) -> Vertex {
        Vertex {
            height_m,
            error_m: self.edge_m[level as usize] * FRINGE_FACTORS[usize::from(error_code & 3)],
            radius_m: self.flat_radius_m[level as usize] * self.fringe_radius_steps.power(radius_code),
            class: if error_code < FRINGE_VOID { VertexClass::Fringe } else { VertexClass::FringeVoid },
        }
    }
}

impl RecordCodec for Compact {
    const BYTES: usize = 4;
    const INERT: u32 = 0xff00_0000;
    type Raw = u32;

    #[inline(always)]
    fn read(bytes: &[u8]) -> u32 {
        u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
    }

    #[inline(always)]
    fn write(raw: u32, bytes: &mut [u8]) {
        bytes[..4].copy_from_slice(&raw.to_le_bytes());
    }

    #[inline(always)]
    fn decode(&self, raw: u32, level: u32) -> Vertex {
        let [low, high, error_code, radius_code] = raw.to_le_bytes();
        let height_m = self.height_base_m + f64::from(u16::from_le_bytes([low, high])) * self.height_step_m;
        if error_code >= FRINGE {
            return self.decode_fringe(height_m, error_code, radius_code, level);
        }
        Vertex {
            height_m,
            error_m: self.errors[usize::from(error_code)],
            radius_m: self.flat_radius_m[level as usize] * self.radii[usize::from(radius_code)],
            class: if error_code == 0 && radius_code == 255 {
                VertexClass::Inert
            } else {
                VertexClass::Plain
            },
        }
    }

    #[inline]
    fn encode(&self, level: u32, value: f64, class: VertexClass, error_m: f64, radius_m: f64) -> Option<u32> {
        if class == VertexClass::Inert {
            return Some(Self::INERT);
        }
        if !(0.0..=65535.0).contains(&value) {
            return None;
        }
        let [low, high] = (value as u16).to_le_bytes();
        let flat = self.flat_radius_m[level as usize];
        let radius_code = |table: &OctaveTable| {
            if radius_m <= flat {
                return Some(0);
            }
            let guess = table.index_at_least(radius_m * self.per_flat_radius[level as usize])?;
            first_at_least(guess, radius_m, |code| flat * table.power(code))
        };
        let (error_code, radius_code) = match class {
            VertexClass::Plain => {
                let error_code = if error_m <= 0.0 {
                    0
                } else {
                    let guess =
                        self.error_steps.index_at_least(error_m * self.per_least_error)?.checked_add(1)?;
                    first_at_least(guess, error_m, |code| self.errors[usize::from(code)])
                        .filter(|code| *code < FRINGE)?
                };
                (error_code, radius_code(&self.radius_steps).filter(|code| *code < 255)?)
            }
            fringe => {
                let edge = self.edge_m[level as usize];
                let factor = FRINGE_FACTORS.iter().position(|f| edge * f >= error_m)?;
                let first = if fringe == VertexClass::Fringe { FRINGE } else { FRINGE_VOID };
                (first + factor as u8, radius_code(&self.fringe_radius_steps)?)
            }
        };
        Some(u32::from_le_bytes([low, high, error_code, radius_code]))
    }

    fn round_height(value: f64) -> f64 {
        value.round_ties_even()
    }
}

/// Sign bits, class and magnitudes shared by the exact kinds: `error` and `radius` are singles with the class in their signs.
#[inline(always)]
fn signed_class(error: f32, radius: f32, inert: bool) -> VertexClass {
    match (inert, error.is_sign_negative(), radius.is_sign_negative()) {
        (true, ..) => VertexClass::Inert,
        (_, false, _) => VertexClass::Plain,
        (_, true, false) => VertexClass::Fringe,
        (_, true, true) => VertexClass::FringeVoid,
    }
}

/// A damaged record's NaN reads as 0, so that no comparison downstream meets one.
#[inline(always)]
fn magnitude(value: f32) -> f64 {
    f64::from(value.abs().max(0.0))
}

/// A damaged record's infinite or NaN height reads as the base height.
#[inline(always)]
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// The smallest single that is not below `value`, which is 0 or more.
#[inline]
pub fn f32_at_least(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) < value { near.next_up() } else { near }
}

/// The bits of the smallest single with a zero lower half that is not below `value`.
#[inline]
fn half_at_least(value: f64) -> u16 {
    let bits = f32_at_least(value).to_bits();
    // Beyond the largest finite value this carries into the encoding of infinity, as it should.
    (bits.div_ceil(0x1_0000)) as u16
}

/// Puts the class into the signs of an exact record's error and radius.
fn signs(class: VertexClass) -> (bool, bool) {
    match class {
        VertexClass::Plain | VertexClass::Inert => (false, false),
        VertexClass::Fringe => (true, false),
        VertexClass::FringeVoid => (true, true),
    }
}

/// Codec of 8-byte records.
#[derive(Debug, Clone)]
pub struct Exact8 {
    height_base_m: f64,
    height_step_m: f64,
    edge_m: [f64; 2 * MAX_K as usize],
}

impl Exact8 {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let edge_m =
            std::array::from_fn(|l| if (l as u32) < grid.levels() { grid.edge_m(l as u32) } else { 0.0 });
        Self { height_base_m: scale.height_base_m, height_step_m: scale.height_step_m, edge_m }
    }
}

impl RecordCodec for Exact8 {
    const BYTES: usize = 8;
    const INERT: u64 = 0xffff_0000_0000_0000;
    type Raw = u64;

    #[inline(always)]
    fn read(bytes: &[u8]) -> u64 {
        u64::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]])
    }

    #[inline(always)]
    fn write(raw: u64, bytes: &mut [u8]) {
        bytes[..8].copy_from_slice(&raw.to_le_bytes());
    }

    #[inline(always)]
    fn decode(&self, raw: u64, _level: u32) -> Vertex {
        let error = f32::from_bits(((raw >> 32) as u32 & 0xffff) << 16);
        let radius_bits = (raw >> 48) as u32;
        let radius = f32::from_bits(radius_bits << 16);
        Vertex {
            height_m: self.height_base_m + finite(f64::from(f32::from_bits(raw as u32))) * self.height_step_m,
            error_m: magnitude(error),
            radius_m: magnitude(radius),
            class: signed_class(error, radius, radius_bits == 0xffff && error.to_bits() == 0),
        }
    }

    fn encode(&self, level: u32, value: f64, class: VertexClass, error_m: f64, radius_m: f64) -> Option<u64> {
        if class == VertexClass::Inert {
            return Some(Self::INERT);
        }
        let edge = if class == VertexClass::Plain { 0.0 } else { self.edge_m[level as usize] };
        let (error_sign, radius_sign) = signs(class);
        let error = half_at_least(error_m.max(edge)) | u16::from(error_sign) << 15;
        let radius = half_at_least(radius_m) | u16::from(radius_sign) << 15;
        Some(u64::from((value as f32).to_bits()) | u64::from(error) << 32 | u64::from(radius) << 48)
    }

    fn round_height(value: f64) -> f64 {
        f64::from(value as f32)
    }
}

/// Codec of 16-byte records.
#[derive(Debug, Clone)]
pub struct Exact16 {
    height_base_m: f64,
    height_step_m: f64,
    edge_m: [f64; 2 * MAX_K as usize],
}

impl Exact16 {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let Exact8 { height_base_m, height_step_m, edge_m } = Exact8::new(grid, scale);
        Self { height_base_m, height_step_m, edge_m }
    }
}

impl RecordCodec for Exact16 {
    const BYTES: usize = 16;
    const INERT: u128 = 0xffff_ffff_0000_0000_0000_0000_0000_0000;
    type Raw = u128;

    #[inline(always)]
    fn read(bytes: &[u8]) -> u128 {
        let mut raw = [0; 16];
        raw.copy_from_slice(&bytes[..16]);
        u128::from_le_bytes(raw)
    }

    #[inline(always)]
    fn write(raw: u128, bytes: &mut [u8]) {
        bytes[..16].copy_from_slice(&raw.to_le_bytes());
    }

    #[inline(always)]
    fn decode(&self, raw: u128, _level: u32) -> Vertex {
        let error = f32::from_bits((raw >> 64) as u32);
        let radius = f32::from_bits((raw >> 96) as u32);
        Vertex {
            height_m: self.height_base_m + finite(f64::from_bits(raw as u64)) * self.height_step_m,
            error_m: magnitude(error),
            radius_m: magnitude(radius),
            class: signed_class(error, radius, radius.to_bits() == u32::MAX && error.to_bits() == 0),
        }
    }

    fn encode(
        &self,
        level: u32,
        value: f64,
        class: VertexClass,
        error_m: f64,
        radius_m: f64,
    ) -> Option<u128> {
        if class == VertexClass::Inert {
            return Some(Self::INERT);
        }
        let edge = if class == VertexClass::Plain { 0.0 } else { self.edge_m[level as usize] };
        let (error_sign, radius_sign) = signs(class);
        let error = f32_at_least(error_m.max(edge)).to_bits() | u32::from(error_sign) << 31;
        let radius = f32_at_least(radius_m).to_bits() | u32::from(radius_sign) << 31;
        Some(u128::from(value.to_bits()) | u128::from(error) << 64 | u128::from(radius) << 96)
    }

    fn round_height(value: f64) -> f64 {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid() -> Grid {
        Grid::new([65, 65], [10.0, 13.0]).unwrap()
    }

    const SCALE: RecordScale = RecordScale {
        height_base_m: -12.5,
        height_step_m: 0.25,
        error_top_m: 900.0,
        radius_steps_per_octave: 64,
    };

    fn rounds_up<C: RecordCodec>(codec: &C, level: u32, value: f64, error_m: f64, stretch: f64) {
        let value = C::round_height(value);
        let radius_m = grid().flat_radius_m(level) * stretch;
        for class in [VertexClass::Plain, VertexClass::Fringe, VertexClass::FringeVoid] {
            let raw = codec.encode(level, value, class, error_m, radius_m).unwrap();
            let v = codec.decode(raw, level);
            assert_eq!(v.class, class);
            assert_eq!(v.height_m, -12.5 + value * 0.25);
            assert!(v.error_m >= error_m && v.radius_m >= radius_m, "{v:?} {error_m} {radius_m}");
            if class == VertexClass::Plain && error_m > 0.02 {
                assert!(v.error_m <= error_m * 1.06, "{v:?} {error_m}");
                assert!(v.radius_m <= radius_m.max(grid().flat_radius_m(level)) * 1.0175 + 1e-9);
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
            rounds_up(&Compact::new(&grid(), &SCALE), level, value, error, stretch);
            rounds_up(&Exact8::new(&grid(), &SCALE), level, value, error, stretch);
            rounds_up(&Exact16::new(&grid(), &SCALE), level, value, error, stretch);
        }

        #[test]
        fn decoding_is_total(raw: u128, level in 0u32..12) {
            for v in [
                Compact::new(&grid(), &SCALE).decode(raw as u32, level),
                Exact8::new(&grid(), &SCALE).decode(raw as u64, level),
                Exact16::new(&grid(), &SCALE).decode(raw, level),
            ] {
                prop_assert!(v.height_m.is_finite() && v.error_m >= 0.0 && v.radius_m >= 0.0, "{v:?}");
            }
        }
    }
}
