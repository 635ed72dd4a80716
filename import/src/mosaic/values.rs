//! What the numbers of a mosaic are: those of the files where all count alike, else metres.

use super::source::Source;
use crate::heights::Heights;
use terrasoar_layout::dem::{SampleType, UnitOf};

/// Integer types with their ranges, the smallest first.
const INTEGERS: [(SampleType, i128, i128); 8] = [
    (SampleType::U8, 0, u8::MAX as i128),
    (SampleType::I8, i8::MIN as i128, i8::MAX as i128),
    (SampleType::U16, 0, u16::MAX as i128),
    (SampleType::I16, i16::MIN as i128, i16::MAX as i128),
    (SampleType::U32, 0, u32::MAX as i128),
    (SampleType::I32, i32::MIN as i128, i32::MAX as i128),
    (SampleType::U64, 0, u64::MAX as i128),
    (SampleType::I64, i64::MIN as i128, i64::MAX as i128),
];

/// What numbers are.
pub(super) struct Values {
    pub(super) heights: Heights,
    /// Whether each file's numbers become metres.
    pub(super) in_metres: bool,
    /// The type that holds them, where none is made anew.
    pub(super) sample_type: SampleType,
}

impl Values {
    /// Of files, of which there is one at least.
    pub(super) fn of(sources: &[Source]) -> Self {
        let first = &sources[0];
        let in_metres = sources.iter().any(|source| source.metres != first.metres);
        let types: Vec<SampleType> = sources.iter().map(|source| source.sample_type).collect();
        let common = common(&types);
        let unit_is_known = sources.iter().all(|source| source.unit_is_known);
        if !in_metres {
            let [scale_m, offset_m] = first.metres;
            let heights = Heights {
                scale_m,
                offset_m,
                unit: first.unit.clone(),
                words: first.heights_words.clone(),
                unit_is_known,
            };
            return Self { heights, in_metres, sample_type: common };
        }
        let mut units: Vec<&str> = sources.iter().map(|source| source.unit.name.as_str()).collect();
        units.sort_unstable();
        units.dedup();
        let heights = Heights {
            scale_m: 1.0,
            offset_m: 0.0,
            unit: UnitOf { name: "metre".into(), size: 1.0, is_angle: false },
            words: format!("brought to metres from files of unlike units or scales ({})", units.join(", ")),
            unit_is_known,
        };
        Self { heights, in_metres, sample_type: real(common) }
    }
}

/// The real type that holds means of numbers of a type.
pub(super) fn real(sample_type: SampleType) -> SampleType {
    if sample_type.fits_f32() { SampleType::F32 } else { SampleType::F64 }
}

/// The smallest type that holds all numbers of some types.
fn common(types: &[SampleType]) -> SampleType {
    if let Some(first) = types.first().filter(|first| types.iter().all(|other| other == *first)) {
        return *first;
    }
    if types.iter().all(|sample_type| sample_type.is_integer()) {
        let holds = |(_, low, high): &&(SampleType, i128, i128)| {
            types.iter().all(|wanted| {
                INTEGERS.iter().any(|(known, from, to)| known == wanted && low <= from && to <= high)
            })
        };
        return INTEGERS.iter().find(holds).map_or(SampleType::F64, |(found, ..)| *found);
    }
    if types.iter().all(|sample_type| sample_type.fits_f32()) { SampleType::F32 } else { SampleType::F64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use SampleType::*;

    #[test]
    fn the_common_type_holds_all() {
        for (types, wanted) in [
            (&[I16, I16][..], I16),
            (&[I16, U8], I16),
            (&[I16, U16], I32),
            (&[U8, I8], I16),
            (&[U64, I8], F64),
            (&[F32, I16], F32),
            (&[F32, I32], F64),
            (&[F16, F16], F16),
        ] {
            assert_eq!(common(types), wanted, "{types:?}");
        }
        assert_eq!((real(I16), real(I32), real(F64)), (F32, F64, F64));
    }
}
