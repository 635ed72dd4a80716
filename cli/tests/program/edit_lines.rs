//! Dams and stamps by the real program: heights against the definition, places from georeferences, and what is said of the ground.

use crate::support::{Bench, text};
use terrasoar_layout::read::terrain::Terrain;

const HEAD: &str = "terrasoar-edits 3\nunits metres degrees\n";

fn write(bench: &Bench, name: &str, lines: &str) {
    std::fs::write(bench.path(name), format!("{HEAD}{lines}")).unwrap();
}

fn height(terrain: &Terrain, column: u32, row: u32) -> f64 {
    terrain.height_m(f64::from(column) * 20.0, f64::from(row) * 20.0).unwrap().unwrap()
}

#[test]
fn a_dam_only_raises_the_ground_and_has_its_profile() {
    let bench = Bench::with_terrain();
    // Along row 60, across the whole of the terrain that lies lower.
    let line = "line from 400,1200 to 2000,1200 crest 90 width 40 slope 0.5 sides 60\n";
    write(&bench, "dam.edits", line);
    let told = bench.json(&["edit", "land.iqt", "--script", "dam.edits", "--overlay", "o.iqo", "--json"]);
    let before = Terrain::open(&bench.path("land.iqt")).unwrap();
    let after = Terrain::open_with_overlay(&bench.path("land.iqt"), &bench.path("o.iqo")).unwrap();
    let (mut raised, mut most) = (0_u64, 0.0_f64);
    for row in 0..129 {
        for column in 0..129 {
            let [x, y] = [f64::from(column) * 20.0, f64::from(row) * 20.0];
            let distance = (x - x.clamp(400.0, 2000.0)).hypot(y - 1200.0);
            let fall = 0.5 * (distance - 20.0).max(0.0);
            let old = height(&before, column, row);
            let wanted = if fall <= 60.0 { old.max(90.0 - fall) } else { old };
            let new = height(&after, column, row);
            assert!((new - wanted).abs() <= 0.051, "{column},{row}: {old} {new} {wanted}");
            raised += u64::from(new != old);
            most = most.max(new - old);
        }
    }
    assert!(raised > 100);
    assert_eq!(
        (&told["changed_samples"], &told["changed_m2"]),
        (&raised.into(), &(raised as f64 * 400.0).into())
    );
    assert_eq!(told["change_m"][0], 0.0);
    assert!((told["change_m"][1].as_f64().unwrap() - most).abs() < 1e-9);
}

#[test]
fn what_an_edit_did_is_told_in_the_words_of_the_ground() {
    let bench = Bench::with_terrain();
    write(&bench, "a.edits", "set rect 400,400,480,440 to 100\n");
    let args = ["edit", "land.iqt", "--script", "a.edits", "--overlay", "o.iqo"];
    let said = bench.good(&args);
    assert!(said.contains("changed: 6000 m2 of ground, "), "{said}");
    assert!(!said.contains("on top of") && !said.contains("records") && !said.contains("void"), "{said}");
    // The same once more: the ground is so already, and the first batch is told of.
    let said = bench.good(&args);
    assert!(said.contains("changed: nothing; samples are 20 x 20 m apart"), "{said}");
    // A batch that changes nothing is none, and the next is on top of the first.
    write(&bench, "b.edits", "raise at 440,420 radius 15 by 3\n");
    let args = ["edit", "land.iqt", "--script", "b.edits", "--overlay", "o.iqo"];
    let said = bench.good(&args);
    assert!(said.contains("changed: 400 m2 of ground, raised by up to 3 m"), "{said}");
    assert!(
        said.contains(
            "on top of 1 batch in it before; `terrasoar undo land.iqt --overlay o.iqo` takes back the last"
        ),
        "{said}"
    );
    assert!(bench.good(&args).contains("on top of 2 batches"));
    // Between samples.
    write(&bench, "c.edits", "raise at 450,430 radius 5 by 3\n");
    let said = bench.good(&["edit", "land.iqt", "--script", "c.edits", "--dry-run"]);
    assert!(
        said.contains("changed: nothing") && said.contains("1 edit reaches no sample: it lies between"),
        "{said}"
    );
    assert!(said.contains("a dry run"), "{said}");
}

#[test]
fn a_stamp_without_a_sample_lies_where_its_file_says() {
    let bench = Bench::with_terrain();
    bench.good(&["export", "land.iqt", "--window", "600,800,1000,1100", "-o", "part.tif"]);
    write(&bench, "low.edits", "set rect 500,700,1100,1200 to 10\n");
    bench.good(&["edit", "land.iqt", "--script", "low.edits", "--overlay", "o.iqo"]);
    write(&bench, "back.edits", "stamp part.tif mode max\n");
    bench.good(&["edit", "land.iqt", "--script", "back.edits", "--overlay", "o.iqo"]);
    let before = Terrain::open(&bench.path("land.iqt")).unwrap();
    let after = Terrain::open_with_overlay(&bench.path("land.iqt"), &bench.path("o.iqo")).unwrap();
    for (column, row) in (25..=55).flat_map(|x| (35..=60).map(move |y| (x, y))) {
        let old = height(&before, column, row);
        let is_in = (30..=50).contains(&column) && (40..=55).contains(&row);
        let wanted = if is_in { old.max(10.0) } else { 10.0 };
        assert!((height(&after, column, row) - wanted).abs() < 0.051, "{column},{row}");
    }
    // Over another grid it is refused, with the way there.
    bench.good(&["build", "part.tif", "-o", "part.iqt"]);
    bench.good(&["synth", "--size", "33", "--seed", "2", "--spacing", "7", "-o", "fine.tif"]);
    write(&bench, "fine.edits", "stamp fine.tif\n");
    let output = bench.run(&["edit", "part.iqt", "--script", "fine.edits"]);
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("fine.tif: its samples do not lie on the terrain's"),
        "{said}"
    );
}
