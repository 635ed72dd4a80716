//! Scripts as text: the specification's example, refusals at their lines, round trips, damage.

use super::format::{self, Line as Read};
use super::*;
use proptest::prelude::*;
use std::path::Path;
use terrasoar_layout::edit::{Area, Brush, BrushAction, Crater, Crest, Falloff, Limit, Line, SampleRect};

const HEAD: &str = "terrasoar-edits 1\nunits metres degrees\n";

const HEAD3: &str = "terrasoar-edits 3\nunits metres degrees\n";

fn parse(text: &str) -> Result<Script, ScriptError> {
    Script::parse(text.as_bytes(), Path::new("a.edits"))
}

fn example() -> String {
    let lines = include_str!("EDITS.md").lines().skip_while(|l| !l.starts_with("    terrasoar-edits"));
    let lines = lines.take_while(|l| l.is_empty() || l.starts_with("    "));
    lines.map(|l| format!("{}\n", l.strip_prefix("    ").unwrap_or(l))).collect()
}

#[test]
fn the_specifications_example_is_read() {
    let script = parse(&example()).unwrap();
    let labels: Vec<String> = script.batches.iter().map(Batch::label).collect();
    assert_eq!(labels, ["dam across the valley", "2 x crater", "2 edits", "2 edits"]);
    let lines: Vec<u64> = script.batches.iter().map(|b| b.line).collect();
    assert_eq!(lines, [6, 12, 15, 20]);
    assert_eq!(script.batches[2].moment, None);
    assert_eq!(script.batches[3].moment, Some(Moment::Frame(120)));
    assert_eq!(
        script.batches[1].steps[0],
        Step::Edit(Edit::Crater(Crater {
            centre_m: [900.0, 1400.5],
            direction_deg: 135.0,
            radius_m: 40.0,
            depth_m: 9.0
        }))
    );
    assert_eq!(
        script.batches[2].steps[0],
        Step::Stamp(StampFile { file: "old castle.tif".into(), at: Some([52, 61]), mode: StampMode::Max })
    );
    assert_eq!(script.edits(), 9);
    assert_eq!(parse(&script.to_text(Path::new("x")).unwrap()).unwrap(), script);
    // Every line of the example is as the writer writes it.
    let written = script.to_text(Path::new("x")).unwrap();
    for line in example().lines().filter(|l| !l.starts_with('#')) {
        assert!(written.contains(line), "{line}");
    }
}

#[test]
fn fields_come_in_any_order_and_have_defaults() {
    let script =
        parse(&format!("{HEAD}crater depth 2 radius 3 at 1,2\r\n\tflatten  radius 3 at 1,2")).unwrap();
    assert_eq!(script.batches.len(), 1);
    let crater = Crater { centre_m: [1.0, 2.0], direction_deg: 0.0, radius_m: 3.0, depth_m: 2.0 };
    let action = BrushAction::Flatten { height_m: None, strength: 1.0 };
    let flatten = Brush { action, centre_m: [1.0, 2.0], radius_m: 3.0, falloff: Falloff::Smooth };
    assert_eq!(script.batches[0], Batch::of([Edit::Crater(crater), Edit::Brush(flatten)]));
}

#[test]
fn what_is_wrong_is_said_at_its_line() {
    let good = "crater at 1,2 radius 3 depth 2";
    for (text, says) in [
        (String::new(), "a.edits:1: not a script of edits: it starts with nothing"),
        (
            "terrasoar-flight 1\n".into(),
            "a.edits:1: not a script of edits: it starts with `terrasoar-flight 1`",
        ),
        ("terrasoar-edits 0\n".into(), "a.edits:1: not a script"),
        ("terrasoar-edits 4\n".into(), "a.edits:1: this is version `4`"),
        ("terrasoar-edits 1\nunits feet\n".into(), "a.edits:2: found `units feet`; the second line must be"),
        (HEAD.into(), "a.edits: the script has no edits"),
        (format!("{HEAD}dig at 1,2\n"), "a.edits:3: `dig` is nothing that can be done; write crater, raise"),
        (
            format!("{HEAD}\ncrater at 1,2 depth 2\n"),
            "a.edits:4: `radius` is missing; write `crater at X,Y radius M",
        ),
        (format!("{HEAD}crater at 1 radius 3 depth 2\n"), "a.edits:3: at: `1` is not such as 1500,820.5"),
        (format!("{HEAD}crater at 1,x radius 3 depth 2\n"), "`x` is not a number"),
        (format!("{HEAD}crater at 1,1e999 radius 3 depth 2\n"), "too large a number"),
        (format!("{HEAD}{good} deep 3\n"), "`deep` does not belong here"),
        (format!("{HEAD}{good} depth 3\n"), "`depth` does not belong here, or stands here twice"),
        (format!("{HEAD}{good} direction\n"), "`direction` has no value"),
        (format!("{HEAD}crater at 1,2 radius 0 depth 2\n"), "crater: the radius is 0; give metres above 0"),
        (format!("{HEAD}crater at 1,2 radius 3 depth -2\n"), "crater: the depth is -2"),
        (format!("{HEAD}raise at 1,2 radius 3 by -2\n"), "raise: the strength is -2"),
        (format!("{HEAD}smooth at 1,2 radius 3 strength 2\n"), "a number from 0 to 1"),
        (format!("{HEAD}smooth at 1,2 radius 3 falloff steep\n"), "`steep` is none of hard, linear, smooth"),
        (format!("{HEAD}set rect 1,2,3 to 4\n"), "rect: `1,2,3` is not such as 10,10,20,20"),
        (format!("{HEAD}set rect 1,2,0,4 to 4\n"), "inside out"),
        (format!("{HEAD}set to 4\n"), "where is not said"),
        (format!("{HEAD}set rect 1,2,3,4 disc 1,2 radius 5 to 4\n"), "said twice"),
        (format!("{HEAD}set rect -1,2,3,4 to 4\n"), "`-1` is not a whole number"),
        (
            format!("{HEAD}line from 1,2 to 3,4 crest 5 width 6\n"),
            "a line takes version 3; write `terrasoar-edits 3`",
        ),
        (format!("{HEAD}set disc 1,2 radius 5 to 4 mode max\n"), "`mode` does not belong here"),
        (format!("{HEAD3}set disc 1,2 radius 5 to 4 mode up\n"), "mode: `up` is none of set, max, min"),
        (
            format!("{HEAD3}line from 1,2 crest 5 width 6\n"),
            "`to` is missing; write `line from X,Y via X,Y to",
        ),
        (format!("{HEAD3}line from 1,2 to 3,4 width 6\n"), "give `crest` or `by`, and not both"),
        (format!("{HEAD3}line from 1,2 to 3,4 width 6 crest 1 by 1\n"), "give `crest` or `by`, and not both"),
        (format!("{HEAD3}line from 1,2 to 3,4 width 6 by 1 mode set\n"), "`by` raises (mode max) or lowers"),
        (format!("{HEAD3}line from 1,2 to 3,4 width 6 by 1 sides 4\n"), "leave `sides` out"),
        (format!("{HEAD3}line from 1,2 to 3,4 width 6 by -1\n"), "line: the height is -1"),
        (format!("{HEAD3}line from 1,2 to 3,4 width -6 crest 1\n"), "line: the width is -6"),
        (
            format!("{HEAD3}line from 1,2 to 3,4 width 6 crest 1 slope 0\n"),
            "line: the slope is 0; give metres of fall",
        ),
        (
            format!("{HEAD3}line from 1,2 {}to 3,4 width 6 crest 1\n", "via 5,6 ".repeat(127)),
            "line: the path has 129 places; give 2 to 128, or several lines",
        ),
        (format!("{HEAD}stamp\n"), "the file is missing"),
        (format!("{HEAD}stamp \"a b\n"), "quotation mark is open"),
        (format!("{HEAD}stamp a sample 1\n"), "sample: `1` is not such as 120,-4"),
        (format!("{HEAD}batch\n"), "the batch has no name"),
        (format!("{HEAD}batch a\n{good}\n"), "a.edits:4: the batch `a` has no end"),
        (format!("{HEAD}batch a\nend\n"), "a.edits:4: the batch has no edits"),
        (format!("{HEAD}batch a\n{good}\nbatch b\n"), "a.edits:5: the batch above has no end"),
        (format!("{HEAD}batch a\n{good}\nframe 4\n"), "a.edits:5: the batch above has no end"),
        (format!("{HEAD}end\n"), "a.edits:3: nothing is open"),
        (format!("{HEAD}end now\n"), "a line of its own"),
        (format!("{HEAD}frame 5\n{good}\nframe 4\n"), "a.edits:5: frame 4 comes after frame 5"),
        (format!("{HEAD}at 5\n{good}\nat 4.5\n"), "a.edits:5: 4.5 s come after 5 s"),
        (format!("{HEAD}at 5\n{good}\nframe 7\n"), "frames and seconds are mixed"),
        (format!("{HEAD}at -1\n"), "the moment is -1"),
        (format!("{HEAD}frame 1.5\n"), "`1.5` is not a whole number"),
        (format!("{HEAD}{}\n", "x".repeat(5000)), "a.edits:3: the line is longer than 4096 bytes"),
    ] {
        let found = parse(&text).unwrap_err().to_string();
        assert!(found.contains(says), "{found}\nshould say: {says}");
        assert!(found.contains("a.edits") && found.len() < 320, "{found}");
    }
    let late = [HEAD.as_bytes(), b"# x\n\xff\xfe\n"].concat();
    let found = Script::parse(&late, Path::new("a.edits")).unwrap_err().to_string();
    assert!(found.contains("a.edits:4: the line is not UTF-8"), "{found}");
    let png = Script::parse(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", Path::new("a.edits")).unwrap_err();
    assert!(png.to_string().contains("bytes that are not a line of text"), "{png}");
    let missing = Script::read(Path::new("/no/such.edits")).unwrap_err().to_string();
    assert!(missing.contains("/no/such.edits"), "{missing}");
}

#[test]
fn what_would_not_read_back_is_not_written() {
    let set = || Edit::set(SampleRect { west: 0, south: 0, east: 1, north: 1 }, 1.0);
    let text = |batches: Vec<Batch>| {
        Script { batches }.to_text(Path::new("x.edits")).map_err(|error| error.to_string())
    };
    let stamp = |file: &str| Batch {
        steps: vec![Step::Stamp(StampFile { file: file.into(), at: Some([0, 0]), mode: StampMode::Set })],
        ..Batch::default()
    };
    let at = |moment| Batch { moment: Some(moment), ..Batch::of([set()]) };
    for (batches, says) in [
        (vec![], "no edits"),
        (vec![Batch::default()], "batch 1: it has no edits"),
        (vec![Batch { name: Some(" a".into()), ..Batch::of([set()]) }], "is no name"),
        (vec![Batch { name: Some("a\nb".into()), ..Batch::of([set()]) }], "is no name"),
        (vec![stamp("a\"b")], "rename the file"),
        (vec![stamp("")], "rename the file"),
        (vec![stamp(&"x".repeat(5000))], "longer than 4096"),
        (
            vec![Batch::of([set()]), at(Moment::Frame(4)), at(Moment::Frame(3))],
            "batch 3: frame 3 comes after",
        ),
        (vec![at(Moment::Frame(4)), Batch::of([set()])], "has no moment"),
        (vec![at(Moment::Frame(4)), at(Moment::Seconds(5.0))], "mixed"),
        (vec![Batch::of([Edit::set(SampleRect { west: 0, south: 0, east: 1, north: 1 }, f64::NAN)])], "NaN"),
    ] {
        let found = text(batches).unwrap_err();
        assert!(found.contains(says), "{found}\nshould say: {says}");
    }
}

#[test]
fn the_file_is_replaced_only_when_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.edits");
    let good = parse(&format!("{HEAD}crater at 1,2 radius 3 depth 2")).unwrap();
    good.write(&path).unwrap();
    Script::default().write(&path).unwrap_err();
    assert_eq!(Script::read(&path).unwrap(), good);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no leftovers");
    assert!(good.write(&folder.path().join("none/a.edits")).is_err());
}

#[test]
fn stamps_are_loaded_from_the_scripts_folder_once() {
    let folder = tempfile::tempdir().unwrap();
    // A VTP BT file of 3 x 2 samples, columns from the west, each from the south.
    let mut bt = b"binterr1.3".to_vec();
    bt.extend(3i32.to_le_bytes());
    bt.extend(2i32.to_le_bytes());
    bt.extend(2i16.to_le_bytes());
    bt.extend(0i16.to_le_bytes());
    bt.resize(256, 0);
    bt[22..24].copy_from_slice(&1i16.to_le_bytes());
    for value in [0i16, 10, 1, 11, 2, -32768] {
        bt.extend(value.to_le_bytes());
    }
    std::fs::write(folder.path().join("a.bt"), bt).unwrap();
    let path = folder.path().join("x.edits");
    std::fs::write(&path, format!("{HEAD}stamp a.bt sample 4,5 mode add\nstamp a.bt sample -1,0")).unwrap();
    let script = Script::read(&path).unwrap();
    let loaded = match Loader::new(&path, terrasoar_import::open_file).script(&script) {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error}"),
    };
    let Edit::Stamp(stamp) = &loaded[0].edits[0] else { panic!("no stamp") };
    assert_eq!((stamp.samples(), stamp.at, stamp.mode), ([3, 2], [4, 5], StampMode::Add));
    assert_eq!(&stamp.heights_m()[..5], [0.0, 1.0, 2.0, 10.0, 11.0]);
    assert_eq!(loaded[0].label, "2 x stamp");
    let missing = parse(&format!("{HEAD}\nstamp none.tif sample 1,1")).unwrap();
    let error = Loader::new(&path, terrasoar_import::open_file).script(&missing).unwrap_err().to_string();
    assert!(error.contains("x.edits:4: stamp: ") && error.contains("none.tif"), "{error}");
}

#[test]
fn rectangles_count_samples_in_the_first_version_and_metres_in_the_second() {
    let area = |version: u32, field: &str| {
        let script = parse(&format!("terrasoar-edits {version}\nunits metres degrees\nset {field} to 7\n"))?;
        match &script.batches[0].steps[0] {
            Step::Edit(Edit::Set { area, height_m: 7.0 }) => Ok::<_, ScriptError>(*area),
            other => panic!("{other:?}"),
        }
    };
    let samples = Area::Rect(SampleRect { west: 10, south: 20, east: 30, north: 40 });
    let metres = Area::Extent { sides_m: [10.0, 20.0, 30.0, 40.0] };
    assert_eq!(area(1, "rect 10,20,30,40").unwrap(), samples);
    assert_eq!(area(2, "samples 10,20,30,40").unwrap(), samples);
    assert_eq!(area(2, "rect 10,20,30,40").unwrap(), metres);
    assert_eq!(
        area(2, "rect -1.5,2e1,30.25,40").unwrap(),
        Area::Extent { sides_m: [-1.5, 20.0, 30.25, 40.0] }
    );
    for (version, field) in [
        (1, "rect 1.5,2,3,4"),
        (1, "samples 1,2,3,4"),
        (2, "samples 1.5,2,3,4"),
        (2, "rect 1,2,3,4 samples 1,2,3,4"),
    ] {
        assert!(area(version, field).is_err(), "{version} {field}");
    }
    let said = area(2, "rect 30,20,10,40").unwrap_err().to_string();
    assert!(said.contains("inside out; give west, south, east and north"), "{said}");
    let text = |area| {
        let script = Script { batches: vec![Batch::of([Edit::Set { area, height_m: 7.0 }])] };
        script.to_text(Path::new("x")).unwrap()
    };
    assert!(
        text(samples).starts_with("terrasoar-edits 1\n")
            && text(samples).contains("set rect 10,20,30,40 to 7")
    );
    assert!(
        text(metres).starts_with("terrasoar-edits 2\n") && text(metres).contains("set rect 10,20,30,40 to 7")
    );
}

#[test]
fn batches_are_labelled_by_what_they_do() {
    let set = || Edit::set(SampleRect { west: 0, south: 0, east: 1, north: 1 }, 1.0);
    let restore = Edit::Restore(Area::Disc { centre_m: [0.0; 2], radius_m: 1.0 });
    assert_eq!(Batch::of([set()]).label(), "set");
    assert_eq!(Batch::of([set(), set()]).label(), "2 x set");
    assert_eq!(Batch::of([set(), restore]).label(), "2 edits");
    assert_eq!(Batch { name: Some("dam".into()), ..Batch::of([set()]) }.label(), "dam");
}

#[test]
fn moments_come() {
    assert!(Moment::Frame(3).has_come(3, 0.0) && !Moment::Frame(3).has_come(2, 99.0));
    assert!(Moment::Seconds(0.5).has_come(0, 0.5) && !Moment::Seconds(0.5).has_come(99, 0.4));
}

fn any_area() -> impl Strategy<Value = Area> {
    prop_oneof![
        (0..9000u32, 0..9000u32, 0..70_000u32, 0..70_000u32).prop_map(|(west, south, w, h)| {
            Area::Rect(SampleRect { west, south, east: west + w, north: south + h })
        }),
        (any_place(), any_radius()).prop_map(|(centre_m, radius_m)| Area::Disc { centre_m, radius_m }),
        (any_place(), any_place()).prop_map(|(a, b)| Area::Extent {
            sides_m: [a[0].min(b[0]), a[1].min(b[1]), a[0].max(b[0]), a[1].max(b[1])]
        }),
    ]
}

fn any_place() -> impl Strategy<Value = [f64; 2]> {
    prop::array::uniform2(prop_oneof![-1e9..=1e9f64, Just(-0.0), Just(5e-324)])
}

fn any_radius() -> impl Strategy<Value = f64> {
    prop_oneof![1e-300..=1e-9f64, 1e-3..=1e7f64]
}

fn any_step() -> impl Strategy<Value = Step> {
    let falloff = prop::sample::select(vec![Falloff::Hard, Falloff::Linear, Falloff::Smooth]);
    let action = prop_oneof![
        (0.0..=1e7f64).prop_map(BrushAction::Raise),
        (0.0..=1e7f64).prop_map(BrushAction::Lower),
        (prop::option::of(-1e7..=1e7f64), 0.0..=1.0f64)
            .prop_map(|(height_m, strength)| BrushAction::Flatten { height_m, strength }),
        (0.0..=1.0f64).prop_map(|strength| BrushAction::Smooth { strength }),
    ];
    let mode = prop::sample::select(vec![StampMode::Set, StampMode::Add, StampMode::Max, StampMode::Min]);
    prop_oneof![
        (any_place(), -1e9..=1e9f64, any_radius(), 0.0..=1e7f64).prop_map(
            |(centre_m, direction_deg, radius_m, depth_m)| {
                Step::Edit(Edit::Crater(Crater { centre_m, direction_deg, radius_m, depth_m }))
            }
        ),
        (action, any_place(), any_radius(), falloff).prop_map(|(action, centre_m, radius_m, falloff)| {
            Step::Edit(Edit::Brush(Brush { action, centre_m, radius_m, falloff }))
        }),
        (any_area(), -1e7..=1e7f64).prop_map(|(area, height_m)| Step::Edit(Edit::Set { area, height_m })),
        any_area().prop_map(|area| Step::Edit(Edit::Restore(area))),
        (any_area(), -1e7..=1e7f64, any::<bool>()).prop_map(|(area, height_m, up)| {
            let limit = if up { Limit::AtLeast } else { Limit::AtMost };
            Step::Edit(Edit::Limit { area, height_m, limit })
        }),
        any_line(),
        ("[ -!#-~é]{1,30}", any::<Option<[i16; 2]>>(), mode).prop_map(|(file, at, mode)| {
            Step::Stamp(StampFile { file, at: at.map(|at: [i16; 2]| at.map(i64::from)), mode })
        }),
    ]
}

fn any_line() -> impl Strategy<Value = Step> {
    let limit = prop::sample::select(vec![None, Some(Limit::AtLeast), Some(Limit::AtMost)]);
    let crest = prop_oneof![
        (-1e7..=1e7f64, limit, 0.0..=1e7f64).prop_map(|(height_m, limit, sides_m)| Crest::Level {
            height_m,
            limit,
            sides_m
        }),
        (0.0..=1e7f64).prop_map(Crest::Above),
        (0.0..=1e7f64).prop_map(Crest::Below),
    ];
    (prop::collection::vec(any_place(), 2..20), crest, 0.0..=1e7f64, 1e-3..=1e3f64).prop_map(
        |(path_m, crest, width_m, slope)| Step::Edit(Edit::Line(Line { path_m, crest, width_m, slope })),
    )
}

fn any_script() -> impl Strategy<Value = Script> {
    let batch = (
        prop::option::of("[!-~é]([ -~é]{0,20}[!-~])?"),
        prop::collection::vec(any_step(), 1..5),
        prop::option::of(0..50u64),
    );
    (prop::collection::vec(batch, 1..6), any::<bool>()).prop_map(|(mut batches, in_frames)| {
        batches.sort_by_key(|(.., moment)| *moment);
        let moment = |at: u64| match in_frames {
            true => Moment::Frame(at),
            false => Moment::Seconds(at as f64 / 7.0),
        };
        let batches = batches.into_iter().map(|(name, steps, at)| Batch {
            name,
            moment: at.map(moment),
            steps,
            line: 0,
        });
        Script { batches: batches.collect() }
    })
}

proptest! {
    #[test]
    fn a_script_survives_as_text(script in any_script()) {
        let text = script.to_text(Path::new("x")).unwrap();
        prop_assert_eq!(parse(&text).unwrap(), script, "{}", text);
    }

    #[test]
    fn damage_is_refused_or_read_but_never_a_panic(script in any_script(), at in any::<prop::sample::Index>(), flip in 1..=255u8) {
        let mut bytes = script.to_text(Path::new("x")).unwrap().into_bytes();
        for end in 0..bytes.len().min(400) {
            let _ = Script::parse(&bytes[..end], Path::new("x"));
        }
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        if let Ok(read) = Script::parse(&bytes, Path::new("x")) {
            // What was read can be written, and is the same again.
            let text = read.to_text(Path::new("x")).unwrap();
            prop_assert_eq!(parse(&text).unwrap(), read);
        }
    }

    #[test]
    fn no_text_makes_it_panic(line in "[-a-z0-9.,\"# \t]{0,60}", verb in "(crater|raise|set|line|restore|stamp|batch|frame|at) ") {
        for version in 1..=format::VERSION {
            let _ = format::parse(&line, version);
            if let Ok(Read::Step(step)) = format::parse(&format!("{verb}{line}"), version) {
                let mut text = String::new();
                prop_assert!(format::push_step(&mut text, &step, version).is_ok());
            }
        }
    }
}

#[test]
fn a_line_is_read_with_its_places_in_order_and_its_defaults() {
    let text = format!(
        "{HEAD3}line to 9,9 width 8 via 1,2 crest 430 from 0,0 via 3,4\nline from 0,0 to 1,1 by 3 width 0 mode min\n"
    );
    let script = parse(&text).unwrap();
    let crest = Crest::Level { height_m: 430.0, limit: Some(Limit::AtLeast), sides_m: 200.0 };
    let path_m = vec![[0.0, 0.0], [1.0, 2.0], [3.0, 4.0], [9.0, 9.0]];
    let dam = Edit::Line(Line { path_m, crest, width_m: 8.0, slope: 0.5 });
    let path_m = vec![[0.0, 0.0], [1.0, 1.0]];
    let ditch = Edit::Line(Line { path_m, crest: Crest::Below(3.0), width_m: 0.0, slope: 0.5 });
    assert_eq!(script.batches, [Batch::of([dam, ditch])]);
    let written = script.to_text(Path::new("x")).unwrap();
    let expected = "line from 0,0 via 1,2 via 3,4 to 9,9 crest 430 width 8 slope 0.5 sides 200 mode max\n";
    assert!(written.starts_with("terrasoar-edits 3\n") && written.contains(expected), "{written}");
}
