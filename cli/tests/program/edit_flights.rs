//! Flights replayed over ground that is edited on the way, by the real program.

use crate::edit::{read, write};
use crate::support::{Bench, text};

#[test]
fn a_flight_is_replayed_over_ground_that_changes() {
    let bench = Bench::with_flight();
    write(
        &bench,
        "a.edits",
        "set rect 40,40,60,60 to 90\n\nframe 10\nraise at 1280,1280 radius 300 by 20\n\nframe 30\nrestore rect 0,0,128,128\n\nframe 40\nset rect 0,0,128,128 to 1\n",
    );
    let before = read(&bench, "land.iqt");
    let fly = ["replay", "land.iqt", "--flight", "land.flight", "--json", "--tolerance-px", "0.5"];
    let plain = bench.json(&fly);
    let run = |engine: &str| bench.run(&[&fly[..], &["--edits", "a.edits", "--engine", engine]].concat());
    let edited: serde_json::Value = serde_json::from_slice(&run("kinetic").stdout).unwrap();
    assert!(plain["mesh_hash"] != edited["mesh_hash"] && plain["edited_records_total"] == 0);
    assert!(edited["edited_records_total"].as_u64() > Some(1000), "{edited}");
    let soar = run("soar");
    let told: serde_json::Value = serde_json::from_slice(&soar.stdout).unwrap();
    assert_eq!(told["mesh_hash"], edited["mesh_hash"]);
    assert!(text(&soar.stderr).contains("1 of 4 batches"), "{}", text(&soar.stderr));
    assert!(read(&bench, "land.iqt") == before, "a replay writes nothing");

    let mesh = |out: &str, more: &[&str]| {
        bench.good(
            &[
                &[
                    "mesh",
                    "land.iqt",
                    "--flight",
                    "land.flight",
                    "--frame",
                    "35",
                    "--engine",
                    "soar",
                    "-o",
                    out,
                ],
                more,
            ]
            .concat(),
        );
        read(&bench, out)
    };
    assert!(mesh("a.ply", &[]) == mesh("b.ply", &["--edits", "a.edits"]), "all is restored by then");
    write(&bench, "b.edits", "at 0\nset rect 40,40,60,60 to 90\n");
    assert!(mesh("a.ply", &[]) != mesh("b.ply", &["--edits", "b.edits"]));

    write(&bench, "c.edits", "set rect 40,40,60,60 to 9000\n");
    let message = bench.bad(1, &[&fly[..], &["--edits", "c.edits"]].concat());
    assert!(
        message.contains("c.edits cannot be replayed over land.iqt") && message.contains("9000"),
        "{message}"
    );
    let message = bench.bad(1, &[&fly[..], &["--edits", "land.flight"]].concat());
    assert!(message.contains("not a script of edits"), "{message}");
}
