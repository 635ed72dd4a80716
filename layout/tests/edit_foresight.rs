//! What heights a script will lead to, against what it then leads to.

mod common;

use common::{MemoryDem, build_bytes, open_bytes};
use proptest::prelude::*;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::BuildOptions;
use terrasoar_layout::dem::SampleType;
use terrasoar_layout::edit::{
    Area, Brush, BrushAction, Crater, Edit, Editor, Falloff, Foresight, SampleRect, holds_heights,
};
use terrasoar_layout::grid::record::RecordKind;
use terrasoar_layout::read::terrain::Terrain;

const SAMPLES: [u32; 2] = [150, 120];

fn terrain(sample_type: SampleType, record: Option<RecordKind>) -> Arc<Terrain> {
    let dem = MemoryDem::from_fn(SAMPLES, sample_type, |x, y| {
        if (x * y) % 31 == 5 { f64::NAN } else { f64::from((x * 7 + y * 13) % 100) }
    });
    let options = BuildOptions::default().spacing_m([10.0; 2]).record(record);
    Arc::new(open_bytes(build_bytes(&dem, &options).unwrap()).unwrap())
}

fn any_edit() -> impl Strategy<Value = Edit> {
    let place = || (-50.0..1600.0f64, -50.0..1300.0f64).prop_map(|(x, y)| [x, y]);
    let disc = (place(), 5.0..400.0f64).prop_map(|(centre_m, radius_m)| Area::Disc { centre_m, radius_m });
    let action = prop_oneof![
        (0.0..90.0f64).prop_map(BrushAction::Raise),
        (0.0..1.0f64).prop_map(|strength| BrushAction::Smooth { strength }),
        (0.0..1.0f64).prop_map(|strength| BrushAction::Flatten { height_m: None, strength }),
    ];
    prop_oneof![
        (place(), 10.0..300.0f64, 0.0..60.0f64).prop_map(|(centre_m, radius_m, depth_m)| {
            Edit::Crater(Crater { centre_m, direction_deg: 30.0, radius_m, depth_m })
        }),
        (action, place(), 10.0..300.0f64).prop_map(|(action, centre_m, radius_m)| {
            Edit::Brush(Brush { action, centre_m, radius_m, falloff: Falloff::Linear })
        }),
        disc.prop_map(Edit::Restore),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn what_is_foreseen_happens(edits in prop::collection::vec(any_edit(), 1..12)) {
        // Records that keep every height, so that nothing is refused or rounded by much.
        let terrain = terrain(SampleType::F32, Some(RecordKind::Exact8));
        let whole = SampleRect { west: 0, south: 0, east: SAMPLES[0] - 1, north: SAMPLES[1] - 1 };
        let mut foresight = Foresight::new(Arc::clone(&terrain)).unwrap();
        let mut editor = Editor::new(terrain);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for edit in &edits {
            foresight.follow(edit).unwrap();
            let before = editor.heights(whole).unwrap();
            editor.apply(std::slice::from_ref(edit)).unwrap();
            for (old, new) in before.heights_m().iter().zip(editor.heights(whole).unwrap().heights_m()) {
                if old != new && !new.is_nan() {
                    (low, high) = (low.min(*new), high.max(*new));
                }
            }
        }
        // Changes smaller than records keep may be foreseen and not happen.
        match foresight.heights_m() {
            None => prop_assert!(low > high),
            Some([lowest, highest]) => prop_assert!(low > high || (lowest < low + 0.01 && highest > high - 0.01), "{lowest} {low} {high} {highest}"),
        }
    }

    #[test]
    fn what_cannot_be_held_is_known(height_m in -400.0..500.0f64) {
        let terrain = terrain(SampleType::I16, None);
        let edit = Edit::set(SampleRect { west: 3, south: 4, east: 9, north: 9 }, height_m);
        let mut foresight = Foresight::new(Arc::clone(&terrain)).unwrap();
        foresight.follow(&edit).unwrap();
        prop_assert_eq!(foresight.heights_m(), Some([height_m; 2]));
        let is_held = holds_heights(terrain.header(), [height_m.round(); 2]);
        match Editor::new(terrain).apply(&[edit]) {
            Ok(_) => prop_assert!(is_held),
            Err(LayoutError::OutOfRange { heights_m, .. }) => prop_assert!(!is_held || heights_m[0].is_nan()),
            Err(other) => panic!("{other}"),
        }
    }
}
