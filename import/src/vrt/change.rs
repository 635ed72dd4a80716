//! What a complex source does to numbers: scale and offset, a power, a table; and how numbers become those of the band's type.
//!
//! As GDAL has it: in single precision where both types fit into it, rounded half away from zero, and held within the type.

use terrasoar_layout::dem::SampleType;
use terrasoar_layout::portable::pow;

/// A power between two ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Power {
    pub(super) exponent: f64,
    /// Lowest and highest number of the file, and what they become.
    pub(super) from: [f64; 2],
    pub(super) to: [f64; 2],
}

/// What becomes of a source's numbers.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Change {
    /// The number that is passed over.
    pub(super) nodata: Option<String>,
    pub(super) uses_mask: bool,
    /// Factor, then offset.
    pub(super) scale: Option<[f64; 2]>,
    pub(super) power: Option<Power>,
    /// Numbers and what they become, ascending; between them straight lines.
    pub(super) table: Vec<[f64; 2]>,
}

impl Change {
    /// What a number becomes; NaN stays NaN. `single` where it is computed in single precision.
    pub(super) fn of(&self, value: f64, single: bool) -> f64 {
        let rounded = |value: f64| if single { f64::from(value as f32) } else { value };
        let mut value = value;
        if let Some([factor, offset]) = self.scale {
            value = rounded(value * factor + offset);
        }
        if let Some(Power { exponent, from: [low, high], to: [least, most] }) = self.power {
            let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
            value = rounded((most - least) * pow(share, exponent) + least);
        }
        if !self.table.is_empty() && !value.is_nan() {
            value = rounded(self.looked_up(value));
        }
        value
    }

    fn looked_up(&self, value: f64) -> f64 {
        let above = self.table.partition_point(|[number, _]| *number < value);
        match (above.checked_sub(1).map(|at| self.table[at]), self.table.get(above)) {
            (Some([a, x]), Some([b, y])) => {
                if value == *b {
                    *y
                } else {
                    x + (value - a) * ((y - x) / (b - a))
                }
            }
            (None, Some([_, y])) => *y,
            (Some([_, x]), None) => x,
            (None, None) => value,
        }
    }
}

/// A number in a type; NaN stays NaN.
pub(super) fn held(value: f64, sample_type: SampleType) -> f64 {
    let whole = |low: f64, high: f64| value.round().clamp(low, high);
    match sample_type {
        _ if value.is_nan() => value,
        SampleType::U8 => whole(0.0, 255.0),
        SampleType::I8 => whole(-128.0, 127.0),
        SampleType::U16 => whole(0.0, 65_535.0),
        SampleType::I16 => whole(-32_768.0, 32_767.0),
        SampleType::U32 => whole(0.0, f64::from(u32::MAX)),
        SampleType::I32 => whole(f64::from(i32::MIN), f64::from(i32::MAX)),
        SampleType::U64 => whole(0.0, u64::MAX as f64),
        SampleType::I64 => whole(i64::MIN as f64, i64::MAX as f64),
        SampleType::F16 | SampleType::F32 => f64::from(value as f32),
        SampleType::F64 => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_those_of_tables_scales_and_types() {
        let table = Change { table: vec![[0.0, 10.0], [100.0, 20.0], [200.0, -20.0]], ..Change::default() };
        for (value, wanted) in [
            (-5.0, 10.0),
            (0.0, 10.0),
            (50.0, 15.0),
            (100.0, 20.0),
            (150.0, 0.0),
            (200.0, -20.0),
            (1e9, -20.0),
        ] {
            assert_eq!(table.of(value, false), wanted, "{value}");
        }
        assert!(table.of(f64::NAN, false).is_nan());
        let scaled = Change { scale: Some([0.1, 5.0]), ..Change::default() };
        assert_eq!(scaled.of(3.0, true), f64::from((3.0 * 0.1 + 5.0) as f32));
        let power = Power { exponent: 2.0, from: [0.0, 10.0], to: [0.0, 100.0] };
        let powered = Change { power: Some(power), ..Change::default() };
        assert_eq!(
            [powered.of(5.0, false), powered.of(-3.0, false), powered.of(20.0, false)],
            [25.0, 0.0, 100.0]
        );
        assert_eq!(held(2.5, SampleType::I16), 3.0);
        assert_eq!(held(-2.5, SampleType::I16), -3.0);
        assert_eq!(held(-1.0, SampleType::U16), 0.0);
        assert_eq!(held(70_000.0, SampleType::U16), 65_535.0);
    }
}
