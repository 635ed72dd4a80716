//! Tiles of exact records through the coder and back.

use super::{Form, Rules, Scratch, walk};
use crate::grid::Grid;
use crate::grid::record::{Compact, RadiusCodes, RecordScale};
use crate::mix::Random;
use crate::packed::coder::Decoder;
use crate::packed::encoder::{Encoder, PlainEncoder};
use crate::packed::model::{CONTEXTS, DecodeTables, Model};
use crate::packed::shape::{SEGMENTS, TileShape};
use crate::packed::symbols::EncodeTables;
use crate::packed::tests::{finished, spoil};
use crate::packed::tile::TileRecords;
use crate::packed::token::TOKENS;
use crate::packed::wide::Width;
use proptest::prelude::*;

fn rules(form: Form) -> Rules {
    let grid = Grid::new([1025, 1025], [10.0, 12.0]).unwrap();
    let scale = RecordScale {
        height_base_m: 0.0,
        height_step_m: 1.0,
        error_top_m: 3000.0,
        radius_codes: match form {
            Form::Fine => RadiusCodes::Excess { first_octave: -4 },
            _ => RadiusCodes::Octaves(64),
        },
    };
    Rules::new(form, &grid, &scale)
}

/// Smooth heights, voids, fringe, and records of which anything may be true, by `wildness`.
fn records(form: Form, shape: &TileShape, seed: u64, wildness: u64) -> TileRecords {
    let mut random = Random::new(seed);
    let [a, b] = [random.below(50) as f64, random.below(40) as f64];
    TileRecords::gathered(shape, form.inert_words(), |[x, y], words| {
        let is_void = wildness > 0 && (x / 9 + y / 7) % 4 == 0;
        let (x, y) = (f64::from(x), f64::from(y));
        let height =
            20.0 + 0.3 * a * x - 0.17 * b * y + x * y / 41.0 + random.below(1 + wildness) as f64 / 977.0;
        let any = random.below(12);
        if is_void {
            return;
        }
        if any == 0 && wildness > 100 {
            words.iter_mut().for_each(|word| *word = random.below(1 << 32) as u32);
            return;
        }
        let mut codes = [40.0f32 + random.below(9) as f32, random.below(5) as f32];
        if any == 1 && wildness > 0 {
            codes = [-codes[0], if random.below(2) == 0 { codes[1] } else { -codes[1] }];
        }
        let [error, radius] = codes.map(f32::to_bits);
        match words {
            // An error and a radius, or fringe, whose void bit is the third of its eight codes.
            [word] => {
                let [error, radius] = codes.map(|code| code.abs() as u32);
                let upper = match codes.map(f32::is_sign_negative) {
                    [false, _] => Compact::of_fine_codes(error as u16 * 9, radius as u8) >> 16,
                    [true, is_void] => 248 + u32::from(is_void) * 4 + error % 4 + radius * 256,
                };
                *word = height as u32 & 0xffff | upper << 16;
            }
            [value, both] => {
                (*value, *both) = ((height as f32).to_bits(), error >> 16 | radius & 0xffff_0000)
            }
            [low, high, of_error, of_radius] => {
                (*low, *high) = (height.to_bits() as u32, (height.to_bits() >> 32) as u32);
                (*of_error, *of_radius) = (error, radius);
            }
            _ => unreachable!(),
        }
    })
}

/// What a tile of this shape gives, down to an octave.
fn given(shape: &TileShape, records: &TileRecords, finest: u32) -> Vec<([u32; 2], Vec<u32>)> {
    let last = 1u32 << shape.tile_log;
    let all = (0..=last).flat_map(|y| (0..=last).map(move |x| [x, y]));
    all.filter(|[x, y]| {
        if x % last == 0 && y % last == 0 {
            return shape.is_top;
        }
        (finest..shape.delivered()).contains(&(x | y).trailing_zeros())
            && (*x < last || shape.is_last[0])
            && (*y < last || shape.is_last[1])
    })
    .map(|at| (at, records.words_at(at).to_vec()))
    .collect()
}

fn shapes() -> impl Strategy<Value = TileShape> {
    (prop_oneof![Just(0u32), Just(3)], 1u32..=6, any::<bool>(), any::<[bool; 2]>()).prop_map(
        |(stride_log, tile_log, is_top, is_last)| TileShape {
            stride_log,
            tile_log: if is_top { tile_log } else { 6 },
            is_top,
            is_last: if is_top { [true; 2] } else { is_last },
        },
    )
}

fn forms() -> impl Strategy<Value = Form> {
    prop_oneof![Just(Form::Fine), Just(Form::Single), Just(Form::Double)]
}

fn model_of(encoders: &[Encoder]) -> Model {
    let mut counts = vec![[0; TOKENS]; CONTEXTS];
    encoders.iter().for_each(|encoder| encoder.count(&mut counts));
    Model::from_counts(&counts)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn tiles_come_back(shape in shapes(), seed: u64, form in forms(), wildness in prop_oneof![Just(0u64), Just(9), Just(60_000)]) {
        let (rules, truth, mut scratch) = (rules(form), records(form, &shape, seed, wildness), Scratch::default());
        let mut encoders: [Encoder; SEGMENTS] = std::array::from_fn(|_| Encoder::new(Width::best()));
        let made = walk(&shape, &rules, &mut scratch, &mut &mut encoders[..], Some(&truth));
        prop_assert!(made.gives_same(&truth, &shape));
        let model = model_of(&encoders);
        let segments = finished(&EncodeTables::of(&model), &encoders);
        for (encoder, segment) in encoders.iter().zip(&segments) {
            prop_assert!(encoder.is_given_by(&DecodeTables::of(&model), segment));
        }
        let mut encoders: [PlainEncoder; SEGMENTS] = std::array::from_fn(|_| PlainEncoder::default());
        walk(&shape, &rules, &mut scratch, &mut &mut encoders[..], Some(&truth));
        let plain = encoders.map(|encoder| {
            let mut bytes = Vec::new();
            encoder.finish(&mut bytes);
            bytes
        });
        let tables = DecodeTables::of(&model);
        for (segments, count) in [(&segments, 3), (&segments, 2), (&segments, 1), (&plain, 3)] {
            prop_assert!(segments.iter().all(|segment| segment.len() < 1 << 16));
            let mut decoders: Vec<Decoder<'_>> =
                segments[..count].iter().map(|bytes| Decoder::new(Width::best(), &tables, bytes).unwrap()).collect();
            let found = walk(&shape, &rules, &mut scratch, &mut &mut decoders[..], None);
            prop_assert!(decoders.iter().all(|decoder| decoder.finish()));
            let finest = ((SEGMENTS - count) as u32).min(shape.tile_log);
            prop_assert_eq!(found.finest, finest);
            prop_assert_eq!(given(&shape, &found, finest), given(&shape, &truth, finest));
        }
    }

    /// Any bytes: a tile or none.
    #[test]
    fn any_bytes_are_a_tile_or_none(shape in shapes(), seed: u64, form in forms(), bytes in prop::collection::vec(any::<u8>(), 0..900)) {
        let (rules, mut scratch) = (rules(form), Scratch::default());
        let mut encoders: [Encoder; SEGMENTS] = std::array::from_fn(|_| Encoder::new(Width::best()));
        walk(&shape, &rules, &mut scratch, &mut &mut encoders[..], Some(&records(form, &shape, seed, 9)));
        let model = model_of(&encoders);
        let tables = DecodeTables::of(&model);
        let mut segments = finished(&EncodeTables::of(&model), &encoders);
        spoil(&mut segments, seed, &bytes);
        let mut decoders: Vec<_> = segments.iter().map_while(|bytes| Decoder::new(Width::best(), &tables, bytes)).collect();
        let found = walk(&shape, &rules, &mut scratch, &mut &mut decoders[..], None);
        prop_assert!(found.finest <= shape.tile_log);
    }
}
