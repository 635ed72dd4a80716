//! The records that keep floating-point heights: 8 and 16 bytes, the class in the signs of error and radius (FORMAT.md, sections 3.2 and 3.3).

use super::{RecordCodec, RecordScale, Vertex, VertexClass, f32_at_least};
use crate::grid::{Grid, MAX_K};

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

/// What both kinds need of their file.
#[derive(Debug, Clone)]
struct Scale {
    height_base_m: f64,
    height_step_m: f64,
    edge_m: [f64; 2 * MAX_K as usize],
}

impl Scale {
    fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let edge_m =
            std::array::from_fn(|l| if (l as u32) < grid.levels() { grid.edge_m(l as u32) } else { 0.0 });
        Self { height_base_m: scale.height_base_m, height_step_m: scale.height_step_m, edge_m }
    }

    /// A height that is no number, or too large for one once it is scaled, reads as the base height.
    #[inline(always)]
    fn height_m(&self, value: f64) -> f64 {
        let height_m = self.height_base_m + value * self.height_step_m;
        if height_m.is_finite() { height_m } else { self.height_base_m }
    }

    #[inline(always)]
    fn vertex(&self, value: f64, error: f32, radius: f32, inert: bool) -> Vertex {
        Vertex {
            height_m: self.height_m(value),
            error_m: magnitude(error),
            radius_m: magnitude(radius),
            class: signed_class(error, radius, inert),
        }
    }

    /// The error to store: on fringe vertices at least the length of the edge that they split.
    fn error_m(&self, level: u32, class: VertexClass, error_m: f64) -> f64 {
        if class == VertexClass::Plain { error_m } else { error_m.max(self.edge_m[level as usize]) }
    }
}

/// Codec of 8-byte records.
#[derive(Debug, Clone)]
pub struct Exact8(Scale);

impl Exact8 {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        Self(Scale::new(grid, scale))
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
        let inert = radius_bits == 0xffff && error.to_bits() == 0;
        self.0.vertex(f64::from(f32::from_bits(raw as u32)), error, f32::from_bits(radius_bits << 16), inert)
    }

    fn encode(&self, level: u32, value: f64, class: VertexClass, error_m: f64, radius_m: f64) -> Option<u64> {
        if class == VertexClass::Inert {
            return Some(Self::INERT);
        }
        let (error_sign, radius_sign) = signs(class);
        let error = half_at_least(self.0.error_m(level, class, error_m)) | u16::from(error_sign) << 15;
        let radius = half_at_least(radius_m) | u16::from(radius_sign) << 15;
        Some(u64::from((value as f32).to_bits()) | u64::from(error) << 32 | u64::from(radius) << 48)
    }

    #[inline(always)]
    fn is_void(raw: u64) -> bool {
        let (error, radius) = ((raw >> 32) as u16, (raw >> 48) as u16);
        (error >> 15 == 1 && radius >> 15 == 1) || (error == 0 && radius == 0xffff)
    }

    #[inline(always)]
    fn height_value(raw: u64) -> f64 {
        finite(f64::from(f32::from_bits(raw as u32)))
    }

    fn round_height(value: f64) -> f64 {
        f64::from(value as f32)
    }
}

/// Codec of 16-byte records.
#[derive(Debug, Clone)]
pub struct Exact16(Scale);

impl Exact16 {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        Self(Scale::new(grid, scale))
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
        let inert = radius.to_bits() == u32::MAX && error.to_bits() == 0;
        self.0.vertex(f64::from_bits(raw as u64), error, radius, inert)
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
        let (error_sign, radius_sign) = signs(class);
        let error =
            f32_at_least(self.0.error_m(level, class, error_m)).to_bits() | u32::from(error_sign) << 31;
        let radius = f32_at_least(radius_m).to_bits() | u32::from(radius_sign) << 31;
        Some(u128::from(value.to_bits()) | u128::from(error) << 64 | u128::from(radius) << 96)
    }

    #[inline(always)]
    fn is_void(raw: u128) -> bool {
        let (error, radius) = ((raw >> 64) as u32, (raw >> 96) as u32);
        (error >> 31 == 1 && radius >> 31 == 1) || (error == 0 && radius == u32::MAX)
    }

    #[inline(always)]
    fn height_value(raw: u128) -> f64 {
        finite(f64::from_bits(raw as u64))
    }

    fn round_height(value: f64) -> f64 {
        value
    }
}
