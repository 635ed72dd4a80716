//! The 4-byte record: heights in steps, errors and radii as logarithms (FORMAT.md, section 3.1).

use super::{RecordCodec, RecordScale, Vertex, VertexClass};
use crate::grid::octave::OctaveTable;
use crate::grid::{Grid, MAX_K};

/// First of the error codes of fringe vertices.
const FRINGE: u8 = 248;
/// First of the error codes of fringe vertices whose sample is void.
const FRINGE_VOID: u8 = 252;
/// Factors of edge length that fringe codes stand for.
const FRINGE_FACTORS: [f64; 4] = [1.0, 16.0, 256.0, f64::INFINITY];
/// Levels that a grid may have.
const PER_LEVEL: usize = 2 * MAX_K as usize;
/// Plain error codes an octave.
const ERROR_STEPS: u32 = 16;
/// Fringe radius codes an octave.
const FRINGE_RADIUS_STEPS: u32 = 8;

/// Makes a rounded quotient a lower bound; comparing products then decides.
const BELOW: f64 = 1.0 - 1e-12;

/// Parts of an octave that plain errors are looked up by; a part holds one error at most.
const PARTS_BITS: u32 = 6;
/// Bits of a double behind those parts.
const SHIFT: u32 = 52 - PARTS_BITS;
/// Parts of all plain errors, and one to look ahead.
const PARTS: usize = (FRINGE as usize / ERROR_STEPS as usize + 2) << PARTS_BITS;

/// Codes of errors by the leading bits of a number.
#[derive(Debug, Clone)]
struct ErrorCodes {
    /// Leading bits of the least error.
    first: u64,
    /// For each part, the first code that stands for at least where it begins.
    codes: Box<[u8; PARTS]>,
}

impl ErrorCodes {
    fn new(errors: &[f64; 256]) -> Self {
        let first = errors[1].to_bits() >> SHIFT;
        let mut codes = Box::new([FRINGE; PARTS]);
        let mut code = 1;
        for (part, place) in (0..).zip(codes.iter_mut()) {
            let begins = f64::from_bits((first + part) << SHIFT);
            while code < FRINGE && errors[usize::from(code)] < begins {
                code += 1;
            }
            *place = code;
        }
        Self { first, codes }
    }

    /// The first code that stands for at least `error_m`, more than 0; [`FRINGE`] or more if none does.
    #[inline(always)]
    fn at_least(&self, errors: &[f64; 256], error_m: f64) -> u8 {
        if error_m <= errors[1] {
            return 1;
        }
        // Infinity and what is not a number lie behind all parts.
        let part = (error_m.to_bits() >> SHIFT).wrapping_sub(self.first) as usize;
        let code = self.codes.get(part).copied().unwrap_or(FRINGE);
        code + u8::from(errors[usize::from(code)] < error_m)
    }
}

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
    error_codes: ErrorCodes,
    errors: [f64; 256],
    radii: [f64; 256],
    flat_radius_m: [f64; PER_LEVEL],
    per_flat_radius: [f64; PER_LEVEL],
    edge_m: [f64; PER_LEVEL],
    radius_steps: OctaveTable,
    fringe_radius_steps: OctaveTable,
}

impl Compact {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let error_steps = OctaveTable::new(ERROR_STEPS);
        let radius_steps = OctaveTable::new(scale.radius_steps_per_octave);
        let bottom = scale.error_top_m / error_steps.power(FRINGE - 2);
        let errors = std::array::from_fn(|i| match i as u8 {
            0 => 0.0,
            code => bottom * error_steps.power(code - 1),
        });
        let per_level = |f: &dyn Fn(u32) -> f64| {
            std::array::from_fn(|l| if (l as u32) < grid.levels() { f(l as u32) } else { 0.0 })
        };
        Self {
            height_base_m: scale.height_base_m,
            height_step_m: scale.height_step_m,
            error_codes: ErrorCodes::new(&errors),
            errors,
            radii: std::array::from_fn(|i| if i == 255 { 0.0 } else { radius_steps.power(i as u8) }),
            flat_radius_m: per_level(&|l| grid.flat_radius_m(l)),
            per_flat_radius: per_level(&|l| BELOW / grid.flat_radius_m(l)),
            edge_m: per_level(&|l| grid.edge_m(l)),
            radius_steps,
            fringe_radius_steps: OctaveTable::new(FRINGE_RADIUS_STEPS),
        }
    }

    /// Error and radius of a fringe vertex, metres. A pair of numbers, so that it comes back in registers.
    #[cold]
    #[inline(never)]
    fn fringe_m(&self, error_code: u8, radius_code: u8, level: u32) -> (f64, f64) {
        let level = level as usize % PER_LEVEL;
        (
            self.edge_m[level] * FRINGE_FACTORS[usize::from(error_code & 3)],
            self.flat_radius_m[level] * self.fringe_radius_steps.power(radius_code),
        )
    }
}

impl Compact {
    /// The first code of a radius at `level` that stands for at least `radius_m`.
    #[inline(always)]
    fn radius_code(&self, table: &OctaveTable, level: u32, radius_m: f64) -> Option<u8> {
        let flat = self.flat_radius_m[level as usize];
        if radius_m <= flat {
            return Some(0);
        }
        let guess = table.index_at_least(radius_m * self.per_flat_radius[level as usize])?;
        first_at_least(guess, radius_m, |code| flat * table.power(code))
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
        debug_assert!((level as usize) < PER_LEVEL);
        let [low, high, error_code, radius_code] = raw.to_le_bytes();
        let height_m = self.height_base_m + f64::from(u16::from_le_bytes([low, high])) * self.height_step_m;
        let (error_m, radius_m) = if error_code >= FRINGE {
            self.fringe_m(error_code, radius_code, level)
        } else {
            // The remainder keeps the level inside the table without a check; every level of a grid is below it.
            let flat_m = self.flat_radius_m[level as usize % PER_LEVEL];
            (self.errors[usize::from(error_code)], flat_m * self.radii[usize::from(radius_code)])
        };
        let class = match error_code {
            FRINGE_VOID.. => VertexClass::FringeVoid,
            FRINGE.. => VertexClass::Fringe,
            0 if radius_code == 255 => VertexClass::Inert,
            _ => VertexClass::Plain,
        };
        Vertex { height_m, error_m, radius_m, class }
    }

    #[inline(never)]
    fn encode_plain(&self, level: u32, value: f64, error_m: f64, radius_m: f64) -> Option<u32> {
        if !(0.0..=65535.0).contains(&value) {
            return None;
        }
        let error_code = if error_m <= 0.0 { 0 } else { self.error_codes.at_least(&self.errors, error_m) };
        let radius_code = self.radius_code(&self.radius_steps, level, radius_m).filter(|code| *code < 255)?;
        let [low, high] = (value as u16).to_le_bytes();
        (error_code < FRINGE).then_some(u32::from_le_bytes([low, high, error_code, radius_code]))
    }

    #[inline]
    fn encode(&self, level: u32, value: f64, class: VertexClass, error_m: f64, radius_m: f64) -> Option<u32> {
        if class == VertexClass::Inert {
            return Some(Self::INERT);
        }
        if !(0.0..=65535.0).contains(&value) {
            return None;
        }
        let first = match class {
            VertexClass::Plain => return self.encode_plain(level, value, error_m, radius_m),
            VertexClass::Fringe => FRINGE,
            _ => FRINGE_VOID,
        };
        let [low, high] = (value as u16).to_le_bytes();
        let edge = self.edge_m[level as usize];
        let factor = FRINGE_FACTORS.iter().position(|f| edge * f >= error_m)?;
        let error_code = first + factor as u8;
        let radius_code = self.radius_code(&self.fringe_radius_steps, level, radius_m)?;
        Some(u32::from_le_bytes([low, high, error_code, radius_code]))
    }

    #[inline(always)]
    fn is_void(raw: u32) -> bool {
        // The codes from FRINGE_VOID on are those whose leading bits are its own. Whole words, so that the compiler can take several records at once.
        const OF_VOIDS: u32 = (FRINGE_VOID as u32) << 16;
        (raw & OF_VOIDS == OF_VOIDS) | (raw & 0xffff_0000 == Self::INERT)
    }

    #[inline(always)]
    fn height_value(raw: u32) -> f64 {
        f64::from(raw as u16)
    }

    #[inline(always)]
    fn round_height(value: f64) -> f64 {
        // Beside this number lie whole numbers only, so that the sum is rounded to one, ties to even: without a call where processors have no instruction for it.
        const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
        if value.abs() < (1u64 << 51) as f64 { (value + WHOLE) - WHOLE } else { value.round_ties_even() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_of_an_error_is_the_first_that_reaches_it() {
        let grid = Grid::new([33, 33], [10.0; 2]).unwrap();
        for error_top_m in [1e-3, 0.7, 1.0, 1000.0, 12_345.678, 9e6] {
            let scale = RecordScale {
                height_base_m: 0.0,
                height_step_m: 1.0,
                error_top_m,
                radius_steps_per_octave: 16,
            };
            let codec = Compact::new(&grid, &scale);
            let exact = (1..FRINGE).map(|code| codec.errors[usize::from(code)]);
            let around = exact.flat_map(|error_m| [error_m.next_down(), error_m, error_m.next_up()]);
            let between = (0..4000).map(|i| error_top_m * 0.997f64.powi(i));
            for error_m in around.chain(between).chain([error_top_m * 1.01, f64::INFINITY, f64::NAN]) {
                let naive = (1..FRINGE).find(|code| codec.errors[usize::from(*code)] >= error_m);
                let made = codec.encode(0, 0.0, VertexClass::Plain, error_m, 0.0);
                assert_eq!(made.map(|raw| (raw >> 16) as u8), naive, "{error_m} of {error_top_m}");
            }
        }
    }
}
