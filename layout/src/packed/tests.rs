//! Tiles through the coder and back.

use super::coder::Decoder;
use super::encoder::{Encoder, PlainEncoder};
use super::model::{CONTEXTS, DecodeTables, Model};
use super::rules::Rules;
use super::shape::{SEGMENTS, TileShape};
use super::symbols::EncodeTables;
use super::tile::{INERT, TileRecords};
use super::token::TOKENS;
use super::walk::{Scratch, walk};
use super::wide::Width;
use crate::grid::Grid;
use crate::grid::record::{RadiusCodes, RecordScale};
use crate::mix::Random;
use proptest::prelude::*;

fn rules() -> Rules {
    let grid = Grid::new([1025, 1025], [10.0, 12.0]).unwrap();
    let scale = RecordScale {
        height_base_m: 100.0,
        height_step_m: 0.5,
        error_top_m: 3000.0,
        radius_codes: RadiusCodes::Octaves(32),
    };
    Rules::new(&grid, &scale)
}

/// A record as files have them: inert ones have no height.
fn sound(record: u32) -> u32 {
    if record >> 16 == INERT >> 16 { INERT } else { record }
}

/// Smooth heights, voids, fringe, and records of which anything may be true, by `wildness`.
fn records(shape: &TileShape, seed: u64, wildness: u64) -> TileRecords {
    let mut random = Random::new(seed);
    let [a, b] = [random.below(50) as i32, random.below(40) as i32];
    TileRecords::from_fn(shape, |[x, y]| {
        let (x, y) = (x as i32, y as i32);
        let height = (20_000 + a * x - b * y + x * y / 4 + random.below(1 + wildness) as i32) as u32 & 0xffff;
        if wildness > 0 && (x / 9 + y / 7) % 4 == 0 {
            return INERT;
        }
        match random.below(12) {
            0 if wildness > 100 => sound(random.below(1 << 32) as u32),
            1 if wildness > 0 => {
                height | (248 + random.below(8) as u32) << 16 | (random.below(256) as u32) << 24
            }
            _ => height | (40 + random.below(9) as u32) << 16 | (random.below(5) as u32) << 24,
        }
    })
}

fn encoded(width: Width, shape: &TileShape, rules: &Rules, truth: &TileRecords) -> [Encoder; SEGMENTS] {
    let mut encoders: [Encoder; SEGMENTS] = std::array::from_fn(|_| Encoder::new(width));
    let made = walk(width, shape, rules, &mut Scratch::default(), &mut &mut encoders[..], Some(truth));
    assert!(made.gives_same(truth, shape), "what is written is not what was made of it");
    encoders
}

/// The bytes of each segment.
pub(super) fn finished(tables: &EncodeTables, encoders: &[Encoder; SEGMENTS]) -> [Vec<u8>; SEGMENTS] {
    encoders.each_ref().map(|encoder| {
        let mut bytes = Vec::new();
        encoder.finish(tables, &mut Vec::new(), &mut bytes).unwrap();
        bytes
    })
}

/// What a tile of this shape gives, down to an octave; everything else inert.
fn given(shape: &TileShape, records: &TileRecords, finest: u32) -> Vec<([u32; 2], u32)> {
    let last = 1u32 << shape.tile_log;
    let all = (0..=last).flat_map(|y| (0..=last).map(move |x| [x, y]));
    all.filter(|[x, y]| {
        let octave = (x | y).trailing_zeros();
        let is_corner = x % last == 0 && y % last == 0;
        if is_corner {
            return shape.is_top;
        }
        (finest..shape.delivered()).contains(&octave)
            && (*x < last || shape.is_last[0])
            && (*y < last || shape.is_last[1])
    })
    .map(|at| (at, records.at(at)))
    .collect()
}

/// A tile by one way of reading, and whether its segments were used up.
fn read(
    width: Width,
    shape: &TileShape,
    rules: &Rules,
    tables: &DecodeTables,
    segments: &[Vec<u8>],
) -> (TileRecords, bool) {
    let mut decoders: Vec<_> =
        segments.iter().map(|bytes| Decoder::new(width, tables, bytes).unwrap()).collect();
    let found = walk(width, shape, rules, &mut Scratch::default(), &mut &mut decoders[..], None);
    (found, decoders.iter().all(Decoder::finish))
}

fn shapes() -> impl Strategy<Value = TileShape> {
    (prop_oneof![Just(0u32), Just(3), Just(6)], 1u32..=6, any::<bool>(), any::<[bool; 2]>()).prop_map(
        |(stride_log, tile_log, is_top, is_last)| TileShape {
            stride_log: stride_log.min(4),
            tile_log: if is_top { tile_log } else { 6 },
            is_top,
            is_last: if is_top { [true; 2] } else { is_last },
        },
    )
}

/// Does to each segment what damage may: cuts it, flips a bit, puts other bytes in its place or behind it.
pub(super) fn spoil(segments: &mut [Vec<u8>], seed: u64, bytes: &[u8]) {
    let mut random = Random::new(seed);
    for segment in segments {
        let at = random.below(segment.len() as u64) as usize;
        match random.below(4) {
            0 => segment.truncate(at),
            1 => segment[at] ^= 1 << random.below(8),
            2 => *segment = bytes.to_vec(),
            _ => segment.extend(bytes),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn tiles_come_back(shape in shapes(), seed: u64, wildness in prop_oneof![Just(0u64), Just(9), Just(60_000)]) {
        let (rules, truth) = (rules(), records(&shape, seed, wildness));
        let encoders = encoded(Width::PORTABLE, &shape, &rules, &truth);
        let mut counts = vec![[0; TOKENS]; CONTEXTS];
        encoders.iter().for_each(|encoder| encoder.count(&mut counts));
        let model = Model::from_counts(&counts);
        let model = Model::parse(&model.to_bytes()).unwrap();
        let encode = EncodeTables::of(&model);
        let segments = finished(&encode, &encoders);
        let tables = DecodeTables::of(&model);
        for width in Width::all() {
            let same = encoded(width, &shape, &rules, &truth);
            prop_assert!(finished(&encode, &same) == segments, "{width:?}");
            let mut pairs = same.iter().zip(&segments);
            prop_assert!(pairs.all(|(encoder, segment)| encoder.is_given_by(&tables, segment)));
        }
        let mut scratch = Scratch::default();
        for count in (1..=SEGMENTS).rev() {
            let mut decoders: Vec<Decoder<'_>> =
                segments[..count].iter().map(|bytes| Decoder::new(Width::PORTABLE, &tables, bytes).unwrap()).collect();
            let found = walk(Width::PORTABLE, &shape, &rules, &mut scratch, &mut &mut decoders[..], None);
            prop_assert!(decoders.iter().all(|decoder| decoder.finish()));
            for width in Width::all() {
                let (other, is_whole) = read(width, &shape, &rules, &tables, &segments[..count]);
                prop_assert!(is_whole && other.finest == found.finest);
                prop_assert_eq!(given(&shape, &other, found.finest), given(&shape, &found, found.finest));
            }
            let finest = ((SEGMENTS - count) as u32).min(shape.tile_log);
            prop_assert_eq!(found.finest, finest);
            prop_assert_eq!(given(&shape, &found, finest), given(&shape, &truth, finest));
        }
        // Without tables.
        let mut encoders: [PlainEncoder; SEGMENTS] = std::array::from_fn(|_| PlainEncoder::default());
        walk(Width::PORTABLE, &shape, &rules, &mut scratch, &mut &mut encoders[..], Some(&truth));
        let segments = encoders.map(|encoder| {
            let mut bytes = Vec::new();
            encoder.finish(&mut bytes);
            bytes
        });
        let mut decoders = segments.each_ref().map(|bytes| Decoder::new(Width::PORTABLE, &tables, bytes).unwrap());
        let found = walk(Width::PORTABLE, &shape, &rules, &mut scratch, &mut &mut decoders[..], None);
        prop_assert!(decoders.iter().all(|decoder| decoder.finish()));
        prop_assert_eq!(given(&shape, &found, 0), given(&shape, &truth, 0));
    }

    /// Any bytes: a tile or none, and never one that passes for whole when a byte of it was changed without the last check noticing what that led to.
    #[test]
    fn any_bytes_are_a_tile_or_none(shape in shapes(), seed: u64, bytes in prop::collection::vec(any::<u8>(), 0..900)) {
        let rules = rules();
        let encoders = encoded(Width::best(), &shape, &rules, &records(&shape, seed, 9));
        let mut counts = vec![[0; TOKENS]; CONTEXTS];
        encoders.iter().for_each(|encoder| encoder.count(&mut counts));
        let model = Model::from_counts(&counts);
        let tables = DecodeTables::of(&model);
        let whole = finished(&EncodeTables::of(&model), &encoders);
        let mut segments = whole.clone();
        spoil(&mut segments, seed, &bytes);
        for width in Width::all() {
            let encoders = encoded(width, &shape, &rules, &records(&shape, seed, 9));
            for ((encoder, segment), whole) in encoders.iter().zip(&segments).zip(&whole) {
                prop_assert!(segment == whole || !encoder.is_given_by(&tables, segment));
            }
        }
        let segments: Vec<_> = segments.into_iter().take_while(|bytes| Decoder::new(Width::PORTABLE, &tables, bytes).is_some()).collect();
        if !segments.is_empty() {
            let found = Width::all().into_iter().map(|width| read(width, &shape, &rules, &tables, &segments));
            let found: Vec<_> = found.collect();
            prop_assert!(found.iter().all(|other| *other == found[0]));
        }
    }
}
