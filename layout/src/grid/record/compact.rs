//! The 4-byte records, compact and fine: heights in steps, errors and radii in steps that grow with them (FORMAT.md, sections 3.1 and 3.4).
//!
//! Both kinds have the same fields. Fine records lend two bits of the radius to the error. So one codec decodes both, by tables that are made for the kind.

use super::error_codes::ErrorCodes;
use super::excess::ExcessCodes;
use super::{RadiusCodes, RecordCodec, RecordScale, Vertex, VertexClass};
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
/// Fringe radius codes an octave.
const FRINGE_RADIUS_STEPS: u32 = 8;
/// Plain error codes that have the same upper bits.
const ERRORS_TOGETHER: u16 = FRINGE as u16;
/// Values of the bits that errors of fine records may have.
const ERROR_FIELDS: usize = 1 << 10;

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

/// Radius codes of plain vertices. A codec has one, in place: what it is looked up by lies beside it.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "a codec has one, beside tables that are larger")]
enum PlainRadii {
    /// Of compact records.
    Octaves(OctaveTable),
    /// Of fine ones.
    Excess(ExcessCodes),
}

/// Codec of 4-byte records, compact or fine ones as the scale's radius codes have it.
#[derive(Debug, Clone)]
pub struct Compact {
    height_base_m: f64,
    height_step_m: f64,
    error_codes: ErrorCodes,
    /// The bits above the height's that tell plain errors.
    error_mask: u32,
    /// Metres by those bits, and factors on the radius of flat ground by a record's last byte.
    errors: [f64; ERROR_FIELDS],
    radii: [f64; 256],
    flat_radius_m: [f64; PER_LEVEL],
    per_flat_radius: [f64; PER_LEVEL],
    edge_m: [f64; PER_LEVEL],
    plain_radii: PlainRadii,
    fringe_radius_steps: OctaveTable,
}

impl Compact {
    /// The codec of a file with this grid and scale.
    pub fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let (count, steps, plain_radii) = match scale.radius_codes {
            RadiusCodes::Octaves(steps) => {
                (ERRORS_TOGETHER, 16, PlainRadii::Octaves(OctaveTable::new(steps)))
            }
            RadiusCodes::Excess { first_octave } => {
                (4 * ERRORS_TOGETHER, 64, PlainRadii::Excess(ExcessCodes::new(first_octave)))
            }
        };
        let error_codes = ErrorCodes::new(count, steps, scale.error_top_m);
        let mut errors = [0.0; ERROR_FIELDS];
        for code in 0..count {
            let (field, lent) = Self::error_field(&plain_radii, code);
            errors[usize::from(field) | usize::from(lent) << 8] = error_codes.metres(code);
        }
        let per_level = |f: &dyn Fn(u32) -> f64| {
            std::array::from_fn(|l| if (l as u32) < grid.levels() { f(l as u32) } else { 0.0 })
        };
        Self {
            height_base_m: scale.height_base_m,
            height_step_m: scale.height_step_m,
            error_codes,
            error_mask: match plain_radii {
                PlainRadii::Octaves(_) => 0xff,
                PlainRadii::Excess(_) => ERROR_FIELDS as u32 - 1,
            },
            errors,
            radii: std::array::from_fn(|i| match &plain_radii {
                // Those of inert vertices, and what no writer makes.
                PlainRadii::Octaves(_) if i == 255 => 0.0,
                PlainRadii::Excess(_) if i >= 252 => 0.0,
                PlainRadii::Octaves(table) => table.power(i as u8),
                PlainRadii::Excess(codes) => codes.factor(i as u8 >> 2),
            }),
            flat_radius_m: per_level(&|l| grid.flat_radius_m(l)),
            per_flat_radius: per_level(&|l| BELOW / grid.flat_radius_m(l)),
            edge_m: per_level(&|l| grid.edge_m(l)),
            plain_radii,
            fringe_radius_steps: OctaveTable::new(FRINGE_RADIUS_STEPS),
        }
    }

    /// The error byte of a plain error code, and the bits that the radius lends it. Counted down, so that an inert record's are 0 in either kind.
    #[inline(always)]
    fn error_field(radii: &PlainRadii, code: u16) -> (u8, u8) {
        match radii {
            PlainRadii::Octaves(_) => (code as u8, 0),
            PlainRadii::Excess(_) => {
                ((code % ERRORS_TOGETHER) as u8, 3u8.wrapping_sub((code / ERRORS_TOGETHER) as u8) & 3)
            }
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

    /// The last byte of a plain record, without the bits that it lends the error.
    #[inline(always)]
    fn plain_radius(&self, level: u32, radius_m: f64) -> Option<u8> {
        match &self.plain_radii {
            PlainRadii::Octaves(table) => self.radius_code(table, level, radius_m).filter(|code| *code < 255),
            PlainRadii::Excess(codes) => {
                let flat = self.flat_radius_m[level as usize];
                if radius_m <= flat {
                    return Some(0);
                }
                let share = radius_m * self.per_flat_radius[level as usize];
                Some(codes.first_at_least(share, |factor| flat * factor >= radius_m)? << 2)
            }
        }
    }

    /// Plain error code and radius code of a record, and back: numbers that grow with what they stand for.
    pub(crate) fn fine_codes(raw: u32) -> (u16, u8) {
        let [_, _, error, last] = raw.to_le_bytes();
        (u16::from(error) + ERRORS_TOGETHER * u16::from(3 - (last & 3)), last >> 2)
    }

    /// The upper half of a fine record with these codes, of which the error is a plain one.
    pub(crate) fn of_fine_codes(error: u16, radius: u8) -> u32 {
        let (field, lent) = ((error % ERRORS_TOGETHER) as u8, 3 - (error / ERRORS_TOGETHER).min(3) as u8);
        u32::from(field) << 16 | u32::from(radius << 2 | lent) << 24
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
            let field = (raw >> 16 & self.error_mask) as usize % ERROR_FIELDS;
            (self.errors[field], flat_m * self.radii[usize::from(radius_code)])
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
        let code = self.error_codes.at_least(error_m)?;
        let radius_code = self.plain_radius(level, radius_m)?;
        let [low, high] = (value as u16).to_le_bytes();
        let (error_code, lent) = Self::error_field(&self.plain_radii, code);
        Some(u32::from_le_bytes([low, high, error_code, radius_code | lent]))
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
    fn is_plain(raw: u32) -> bool {
        // An inert record's error is 0.
        (1..FRINGE).contains(&((raw >> 16) as u8))
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

    /// The first plain record that says at least as much, found by looking at all of them.
    #[test]
    fn codes_are_the_first_that_reach() {
        let grid = Grid::new([33, 33], [10.0; 2]).unwrap();
        let kinds = [RadiusCodes::Octaves(16), RadiusCodes::Excess { first_octave: -4 }];
        for (error_top_m, radius_codes) in [1e-3, 0.7, 1.0, 1000.0, 12_345.678, 9e6]
            .into_iter()
            .flat_map(|top| kinds.map(|kind| (top, kind)))
        {
            let scale = RecordScale { height_base_m: 0.0, height_step_m: 1.0, error_top_m, radius_codes };
            let codec = Compact::new(&grid, &scale);
            let plain = |raw: &u32| codec.decode(*raw, 5).class == VertexClass::Plain;
            let all: Vec<u32> = (0..=0xffff).map(|codes| codes << 16).filter(plain).collect();
            let told = |f: &dyn Fn(Vertex) -> f64| {
                let mut told: Vec<f64> = all.iter().map(|raw| f(codec.decode(*raw, 5))).collect();
                told.sort_by(f64::total_cmp);
                told.dedup();
                told
            };
            let errors = told(&|v| v.error_m);
            // The last radius code of fine records is none of a plain vertex.
            let mut radii = told(&|v| v.radius_m);
            let is_fine = matches!(radius_codes, RadiusCodes::Excess { .. });
            assert_eq!((errors.len(), radii.len()), if is_fine { (992, 64) } else { (248, 256) });
            let top_m = codec.radii[if is_fine { 4 * 62 } else { 254 }] * codec.flat_radius_m[5];
            radii.retain(|radius| (codec.flat_radius_m[5]..=top_m).contains(radius));
            let around = |told: &[f64]| -> Vec<f64> {
                told.iter().flat_map(|v| [v.next_down(), *v, v.next_up()]).filter(|v| *v >= 0.0).collect()
            };
            let first = |told: &[f64], v: f64| told.iter().copied().find(|t| *t >= v);
            let between = (0..4000).map(|i| error_top_m * 0.997f64.powi(i));
            for error_m in around(&errors).into_iter().chain(between).chain([
                error_top_m * 1.01,
                f64::INFINITY,
                f64::NAN,
            ]) {
                let made = codec.encode(5, 0.0, VertexClass::Plain, error_m, 0.0);
                let told = made.map(|raw| codec.decode(raw, 5).error_m);
                assert_eq!(told, first(&errors, error_m), "{error_m} of {error_top_m}");
            }
            let between = (0..4000).map(|i| top_m * 1.01 * 0.999f64.powi(i));
            for radius_m in around(&radii).into_iter().chain(between).chain([f64::INFINITY, f64::NAN]) {
                let made = codec.encode(5, 0.0, VertexClass::Plain, 0.0, radius_m);
                let told = made.map(|raw| codec.decode(raw, 5).radius_m);
                assert_eq!(told, first(&radii, radius_m), "{radius_m}");
            }
        }
    }

    #[test]
    fn fine_codes_come_back_and_grow() {
        let grid = Grid::new([33, 33], [10.0; 2]).unwrap();
        let scale = RecordScale {
            height_base_m: 0.0,
            height_step_m: 1.0,
            error_top_m: 100.0,
            radius_codes: RadiusCodes::Excess { first_octave: 2 },
        };
        let codec = Compact::new(&grid, &scale);
        let mut last = codec.decode(Compact::of_fine_codes(0, 0), 5);
        for (error, radius) in (1..992).map(|error| (error, (error / 16) as u8)) {
            let raw = Compact::of_fine_codes(error, radius);
            assert_eq!(Compact::fine_codes(raw), (error, radius));
            let v = codec.decode(raw, 5);
            assert!(v.error_m > last.error_m && v.radius_m >= last.radius_m, "{v:?} {last:?}");
            assert_eq!(v.class, VertexClass::Plain);
            last = v;
        }
        assert_eq!(Compact::fine_codes(Compact::INERT), (0, 63));
    }
}
