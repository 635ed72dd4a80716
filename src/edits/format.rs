//! The script's grammar, a line at a time: what each edit looks like as words (`EDITS.md`).
//!
//! Reader and writer both go through here, so what one accepts the other accepts. Nothing here does I/O.

mod line;

use super::words::{Fields, list, number, quoted, split, whole};
use super::{Moment, StampFile, Step};
use crate::flight::format::{excerpt, push_number};
use terrasoar_layout::edit::{Area, Brush, BrushAction, Crater, Edit, Falloff, Limit, SampleRect, StampMode};

/// Highest version of the format that is read.
pub const VERSION: u32 = 3;
/// The version in which `rect` is metres; before, it counts samples.
const METRES: u32 = 2;
/// The version from which there are lines, `mode` for `set`, and stamps without `sample`.
const LINES: u32 = 3;
/// Most edits a script may have.
pub const MAX_EDITS: u64 = 1_000_000;
/// Most bytes of a line, its end not counted.
pub(super) const MAX_LINE_BYTES: usize = 4096;
/// Most bytes of a batch's name.
pub(super) const MAX_NAME_BYTES: usize = 200;
/// First word of a script.
pub(super) const MAGIC: &str = "terrasoar-edits";
/// The words of the second line.
pub(super) const UNITS: [&str; 3] = ["units", "metres", "degrees"];

const CRATER: &str = "crater at X,Y radius M depth M direction DEG";
const FLATTEN: &str = "flatten at X,Y radius M to M strength 0..1 falloff hard|linear|smooth";
const LOWER: &str = "lower at X,Y radius M by M falloff hard|linear|smooth";
const RAISE: &str = "raise at X,Y radius M by M falloff hard|linear|smooth";
const RESTORE: &str = "restore rect W,S,E,N` or `restore disc X,Y radius M";
const RESTORE_METRES: &str = "restore rect W,S,E,N`, `restore disc X,Y radius M` or `restore samples W,S,E,N";
const SET: &str = "set rect W,S,E,N to M` or `set disc X,Y radius M to M";
const SET_METRES: &str = "set rect W,S,E,N to M`, `set disc X,Y radius M to M` or `set samples W,S,E,N to M";
const SET_MODES: &str = "set rect W,S,E,N to M mode set|max|min`, `set disc X,Y radius M to M mode set|max|min` or `set samples W,S,E,N to M mode set|max|min";
const SMOOTH: &str = "smooth at X,Y radius M strength 0..1 falloff hard|linear|smooth";
const STAMP: &str = "stamp FILE sample COLUMN,ROW mode set|add|max|min";

const FALLOFFS: [(&str, Falloff); 3] =
    [("hard", Falloff::Hard), ("linear", Falloff::Linear), ("smooth", Falloff::Smooth)];
const MODES: [(&str, StampMode); 4] =
    [("set", StampMode::Set), ("add", StampMode::Add), ("max", StampMode::Max), ("min", StampMode::Min)];

/// Which way ground is moved; nothing said is both.
const LIMITS: [(&str, Option<Limit>); 3] =
    [("set", None), ("max", Some(Limit::AtLeast)), ("min", Some(Limit::AtMost))];

/// What a line of a script is.
#[derive(Debug, PartialEq)]
pub(super) enum Line {
    /// White space: ends a batch that has no name.
    Blank,
    Comment,
    Moment(Moment),
    Batch(String),
    End,
    Step(Step),
}

/// Reads a line of a script of some version; `Err` says what is wrong and what to write instead.
pub(super) fn parse(line: &str, version: u32) -> Result<Line, String> {
    let line = line.trim_matches([' ', '\t']);
    if line.is_empty() {
        return Ok(Line::Blank);
    }
    if line.starts_with('#') {
        return Ok(Line::Comment);
    }
    // A name is the rest of its line, whatever is in it.
    if let Some(name) =
        line.strip_prefix("batch").filter(|rest| rest.is_empty() || rest.starts_with([' ', '\t']))
    {
        let name = name.trim_matches([' ', '\t']);
        return name_fault(name).map_or_else(|| Ok(Line::Batch(name.to_owned())), Err);
    }
    let words = split(line)?;
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["end"] => Ok(Line::End),
        ["frame", frame] => whole(frame).map(|frame| Line::Moment(Moment::Frame(frame))),
        ["at", seconds] => match number(seconds)? {
            seconds if (0.0..=1e9).contains(&seconds) => Ok(Line::Moment(Moment::Seconds(seconds))),
            seconds => Err(format!("the moment is {seconds}; write seconds from 0 to 1e9")),
        },
        ["end" | "frame" | "at", ..] => {
            Err("a line of its own is `end`, `frame N` or `at SECONDS`, and nothing beside it".into())
        }
        _ => step(&words, version).map(Line::Step),
    }
}

/// Why a batch cannot be called so.
pub(super) fn name_fault(name: &str) -> Option<String> {
    if name.is_empty() {
        return Some(
            "the batch has no name; write `batch NAME`, or set its edits apart by blank lines".into(),
        );
    }
    let is_name = name.len() <= MAX_NAME_BYTES
        && name.trim_matches([' ', '\t']) == name
        && !name.chars().any(char::is_control);
    (!is_name)
        .then(|| format!("{} is no name; write one line of at most {MAX_NAME_BYTES} bytes", excerpt(name)))
}

fn step(words: &[String], version: u32) -> Result<Step, String> {
    let (verb, rest) = (words[0].as_str(), &words[1..]);
    let edit = match verb {
        "crater" => crater(Fields::new(rest, CRATER))?,
        "raise" => brush(Fields::new(rest, RAISE), |f| f.required("by", number).map(BrushAction::Raise))?,
        "lower" => brush(Fields::new(rest, LOWER), |f| f.required("by", number).map(BrushAction::Lower))?,
        "flatten" => brush(Fields::new(rest, FLATTEN), |f| {
            let height_m = f.optional("to", number)?;
            Ok(BrushAction::Flatten { height_m, strength: strength(f)? })
        })?,
        "smooth" => brush(Fields::new(rest, SMOOTH), |f| Ok(BrushAction::Smooth { strength: strength(f)? }))?,
        "set" => set(rest, version)?,
        "line" if version >= LINES => line::parse(rest)?,
        "line" => {
            return Err("a line takes version 3; write `terrasoar-edits 3` in the first line".into());
        }
        "restore" => {
            let mut fields = Fields::new(rest, RESTORE);
            let area = area(&mut fields, version, if version < METRES { RESTORE } else { RESTORE_METRES })?;
            fields.finish()?;
            Edit::Restore(area)
        }
        "stamp" => return stamp(rest, version).map(Step::Stamp),
        _ => {
            return Err(format!(
                "{} is nothing that can be done; write crater, raise, lower, flatten, smooth, line, stamp, set or restore",
                excerpt(verb)
            ));
        }
    };
    edit.check_numbers().map_err(|error| error.to_string())?;
    Ok(Step::Edit(edit))
}

fn place(word: &str) -> Result<[f64; 2], String> {
    list(word, "1500,820.5", number)
}

fn strength(fields: &mut Fields<'_>) -> Result<f64, String> {
    Ok(fields.optional("strength", number)?.unwrap_or(1.0))
}

fn crater(mut fields: Fields<'_>) -> Result<Edit, String> {
    let crater = Crater {
        centre_m: fields.required("at", place)?,
        radius_m: fields.required("radius", number)?,
        depth_m: fields.required("depth", number)?,
        direction_deg: fields.optional("direction", number)?.unwrap_or(0.0),
    };
    fields.finish()?;
    Ok(Edit::Crater(crater))
}

fn brush<'a>(
    mut fields: Fields<'a>,
    action: impl FnOnce(&mut Fields<'a>) -> Result<BrushAction, String>,
) -> Result<Edit, String> {
    let brush = Brush {
        centre_m: fields.required("at", place)?,
        radius_m: fields.required("radius", number)?,
        action: action(&mut fields)?,
        falloff: fields.optional("falloff", |word| named(word, &FALLOFFS))?.unwrap_or_default(),
    };
    fields.finish()?;
    Ok(Edit::Brush(brush))
}

fn area(fields: &mut Fields<'_>, version: u32, form: &str) -> Result<Area, String> {
    let samples = |word: &str| list(word, "10,10,20,20", whole::<u32>);
    let (samples, extent) = if version < METRES {
        (fields.optional("rect", samples)?, None)
    } else {
        let metres = |word: &str| list(word, "700,380,800,400.5", number);
        (fields.optional("samples", samples)?, fields.optional("rect", metres)?)
    };
    let disc = fields.optional("disc", place)?;
    match (samples, extent, disc) {
        (Some([west, south, east, north]), None, None) => {
            Ok(Area::Rect(SampleRect { west, south, east, north }))
        }
        (None, Some(sides_m), None) => Ok(Area::Extent { sides_m }),
        (None, None, Some(centre_m)) => {
            Ok(Area::Disc { centre_m, radius_m: fields.required("radius", number)? })
        }
        _ => Err(format!("where is not said, or said twice; write `{form}`")),
    }
}

fn set(words: &[String], version: u32) -> Result<Edit, String> {
    let mut fields = Fields::new(words, if version < LINES { SET } else { SET_MODES });
    let form = match version {
        ..METRES => SET,
        METRES => SET_METRES,
        _ => SET_MODES,
    };
    let (area, height_m) = (area(&mut fields, version, form)?, fields.required("to", number)?);
    let limit = if version < LINES { None } else { fields.optional("mode", |word| named(word, &LIMITS))? };
    fields.finish()?;
    Ok(match limit.flatten() {
        None => Edit::Set { area, height_m },
        Some(limit) => Edit::Limit { area, height_m, limit },
    })
}

fn stamp(words: &[String], version: u32) -> Result<StampFile, String> {
    let Some((file, rest)) = words.split_first() else {
        return Err(format!("the file is missing; write `{STAMP}`"));
    };
    if file.is_empty() {
        return Err(format!("the file has no name; write `{STAMP}`"));
    }
    if quoted(file).is_none() {
        return Err(format!("{} has a quotation mark inside of it; rename the file", excerpt(file)));
    }
    let mut fields = Fields::new(rest, STAMP);
    let sample = |word: &str| list(word, "120,-4", whole::<i64>);
    let at = match version {
        ..LINES => Some(fields.required("sample", sample)?),
        _ => fields.optional("sample", sample)?,
    };
    let mode = fields.optional("mode", |word| named(word, &MODES))?.unwrap_or_default();
    fields.finish()?;
    Ok(StampFile { file: file.clone(), at, mode })
}

fn named<T: Copy>(word: &str, names: &[(&str, T)]) -> Result<T, String> {
    let found = names.iter().find(|(name, _)| *name == word).map(|(_, value)| *value);
    found.ok_or_else(|| {
        let known: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        format!("{} is none of {}", excerpt(word), known.join(", "))
    })
}

fn name_of<T: PartialEq>(value: &T, names: &[(&'static str, T)]) -> &'static str {
    names.iter().find(|(_, v)| v == value).map_or("", |(name, _)| name)
}

/// The lowest version that can say this.
pub(super) fn version_of(step: &Step) -> u32 {
    match step {
        Step::Edit(Edit::Set { area: Area::Extent { .. }, .. } | Edit::Restore(Area::Extent { .. })) => {
            METRES
        }
        Step::Edit(Edit::Line(_) | Edit::Limit { .. }) | Step::Stamp(StampFile { at: None, .. }) => LINES,
        _ => 1,
    }
}

/// Appends a step's line without its end, as a version of the format has it; `Err` says why it cannot be written.
pub(super) fn push_step(line: &mut String, step: &Step, version: u32) -> Result<(), String> {
    match step {
        Step::Stamp(stamp) => {
            let file = quoted(&stamp.file).filter(|_| !stamp.file.is_empty());
            let file = file.ok_or_else(|| {
                format!("no line can hold the file name {}; rename the file", excerpt(&stamp.file))
            })?;
            let mode = name_of(&stamp.mode, &MODES);
            let at = stamp.at.map_or_else(String::new, |[column, row]| format!(" sample {column},{row}"));
            line.push_str(&format!("stamp {file}{at} mode {mode}"));
        }
        Step::Edit(Edit::Stamp(_)) => {
            return Err("a stamp in memory has no file to be named; write its heights to one".into());
        }
        Step::Edit(edit) => {
            edit.check_numbers().map_err(|error| error.to_string())?;
            push_edit(line, edit, version);
        }
    }
    if line.len() > MAX_LINE_BYTES {
        return Err(format!("the line would be longer than {MAX_LINE_BYTES} bytes; use shorter names"));
    }
    Ok(())
}

fn push_edit(line: &mut String, edit: &Edit, version: u32) {
    line.push_str(edit.name());
    match edit {
        Edit::Crater(crater) => {
            push_values(line, "at", &crater.centre_m);
            push_values(line, "radius", &[crater.radius_m]);
            push_values(line, "depth", &[crater.depth_m]);
            push_values(line, "direction", &[crater.direction_deg]);
        }
        Edit::Brush(brush) => {
            push_values(line, "at", &brush.centre_m);
            push_values(line, "radius", &[brush.radius_m]);
            match brush.action {
                BrushAction::Raise(metres) | BrushAction::Lower(metres) => push_values(line, "by", &[metres]),
                BrushAction::Flatten { height_m, strength } => {
                    if let Some(height_m) = height_m {
                        push_values(line, "to", &[height_m]);
                    }
                    push_values(line, "strength", &[strength]);
                }
                BrushAction::Smooth { strength } => push_values(line, "strength", &[strength]),
            }
            line.push_str(" falloff ");
            line.push_str(name_of(&brush.falloff, &FALLOFFS));
        }
        Edit::Set { area, height_m } => {
            push_area(line, area, version);
            push_values(line, "to", &[*height_m]);
        }
        Edit::Limit { area, height_m, limit } => {
            push_area(line, area, version);
            push_values(line, "to", &[*height_m]);
            line.push_str(" mode ");
            line.push_str(name_of(&Some(*limit), &LIMITS));
        }
        Edit::Line(edit) => line::push(line, edit),
        Edit::Restore(area) => push_area(line, area, version),
        // Refused before.
        Edit::Stamp(_) => {}
    }
}

fn push_area(line: &mut String, area: &Area, version: u32) {
    match area {
        Area::Rect(r) => {
            let name = if version < METRES { "rect" } else { "samples" };
            line.push_str(&format!(" {name} {},{},{},{}", r.west, r.south, r.east, r.north));
        }
        Area::Disc { centre_m, radius_m } => {
            push_values(line, "disc", centre_m);
            push_values(line, "radius", &[*radius_m]);
        }
        Area::Extent { sides_m } => push_values(line, "rect", sides_m),
    }
}

fn push_values(line: &mut String, name: &str, values: &[f64]) {
    line.push(' ');
    line.push_str(name);
    for (i, value) in values.iter().enumerate() {
        line.push(if i == 0 { ' ' } else { ',' });
        // Formatting into a string cannot fail.
        let _ = push_number(line, *value);
    }
}

/// Appends a moment's line without its end.
pub(super) fn push_moment(line: &mut String, moment: Moment) {
    match moment {
        Moment::Frame(frame) => line.push_str(&format!("frame {frame}")),
        Moment::Seconds(seconds) => {
            line.push_str("at ");
            let _ = push_number(line, seconds);
        }
    }
}
