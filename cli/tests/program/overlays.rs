//! Overlays whose base changes: what is told before, what is seen after, and what is refused.

use crate::edit::{read, with_script, write};
use crate::support::{Bench, text};

/// A terrain with a picture at hand, and a dam of two batches kept apart from it.
fn with_dam() -> Bench {
    let bench = with_script("set rect 10,10,20,20 to 100\n\nset rect 30,30,40,40 to 90\n");
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "8", "--seed", "2", "-o", "photo.tif"]);
    bench.good(&["edit", "land.iqt", "--script", "a.edits", "--overlay", "dam.iqo"]);
    bench
}

const THERE: [&str; 6] = ["height", "land.iqt", "--at", "300,300", "--overlay", "dam.iqo"];

/// What a run that must succeed says beside its answer.
fn noted(bench: &Bench, args: &[&str]) -> String {
    let output = bench.run(args);
    assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
    text(&output.stderr)
}

#[test]
fn a_base_that_is_draped_edited_and_undone_keeps_its_overlays() {
    let bench = with_dam();
    assert_eq!(noted(&bench, &THERE), "");
    let whole = |name: &str| {
        bench.good(&["compact", "land.iqt", "--overlay", "dam.iqo", "-o", name]);
        read(&bench, name)
    };
    let before = whole("before.iqt");
    write(&bench, "b.edits", "set rect 12,12,50,50 to 110\n");
    for (i, args) in [
        &["drape", "land.iqt", "--image", "photo.tif"][..],
        &["edit", "land.iqt", "--script", "b.edits"],
        &["crater", "land.iqt", "--at", "300,300", "--radius", "80", "--depth", "1"],
        &["undo", "land.iqt"],
        &["redo", "land.iqt"],
        &["drape", "land.iqt", "--image", "photo.tif", "--extent", "0,0,900,900"],
    ]
    .into_iter()
    .enumerate()
    {
        let said = noted(&bench, args);
        let is_told = said.contains("note: dam.iqo: edits kept apart from land.iqt");
        assert_eq!(is_told, args[0] == "drape", "{args:?}: {said}");
        assert_eq!(bench.good(&THERE), "100 m\n");
        let said = noted(&bench, &THERE);
        assert!(
            said.contains("land.iqt was edited or draped after dam.iqo was begun; it is seen as it was then"),
            "{said}"
        );
        assert!(whole(&format!("{i}.iqt")) == before, "{args:?}");
        bench.good(&["verify", "land.iqt", "--overlay", "dam.iqo"]);
    }
    // Its own edits go on, and back.
    let said = noted(&bench, &["edit", "land.iqt", "--script", "b.edits", "--overlay", "dam.iqo"]);
    assert_eq!(said.matches("seen as it was then").count(), 1, "{said}");
    assert_eq!(bench.good(&THERE), "110 m\n");
    assert_eq!(noted(&bench, &["undo", "land.iqt", "--overlay", "dam.iqo"]).matches("note:").count(), 1);
    assert_eq!(bench.good(&THERE), "100 m\n");
}

#[test]
fn a_base_is_not_written_anew_under_its_overlays_unless_forced() {
    let bench = with_dam();
    let before = read(&bench, "land.iqt");
    write(&bench, "high.edits", "set rect 5,5,9,9 to 3000\n");
    for args in [
        &["compact", "land.iqt"][..],
        &["edit", "land.iqt", "--script", "high.edits"],
        &["crater", "land.iqt", "--at", "900,900", "--radius", "200", "--depth", "9000"],
        &["build", "land.tif", "-o", "land.iqt"],
    ] {
        let message = bench.bad(1, args);
        assert!(message.contains("dam.iqo") && message.contains("--force"), "{args:?}: {message}");
        assert!(read(&bench, "land.iqt") == before);
    }
    assert_eq!(bench.good(&THERE), "100 m\n");
    // Of a copy elsewhere nothing is lost.
    bench.good(&["compact", "land.iqt", "-o", "copy.iqt"]);
    bench.good(&["edit", "copy.iqt", "--script", "high.edits", "--force"]);

    bench.good(&["edit", "land.iqt", "--script", "high.edits", "--force"]);
    let message = bench.bad(1, &THERE);
    assert!(
        message.contains("dam.iqo: land.iqt was written anew after these edits were begun")
            && message.contains("a copy of land.iqt from before"),
        "{message}"
    );
    // What is lost already stands in nobody's way.
    bench.good(&["compact", "land.iqt"]);
}
