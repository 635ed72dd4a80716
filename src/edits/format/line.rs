//! The words of a line: a dam, dike, ditch or road along a path.

use super::{LIMITS, name_of, named, place, push_values};
use crate::edits::words::{Fields, number};
use terrasoar_layout::edit::{Crest, Edit, Limit, Line};

const FORM: &str = "line from X,Y via X,Y to X,Y crest M width M slope S sides M mode max|min|set` or `line from X,Y to X,Y by M width M slope S mode max|min";
/// Fall of the sides in metres a metre where nothing is said.
const SLOPE: f64 = 0.5;
/// How far the sides reach below the crest where nothing is said, metres.
const SIDES_M: f64 = 200.0;

/// Reads the words behind `line`.
pub(super) fn parse(words: &[String]) -> Result<Edit, String> {
    let mut fields = Fields::new(words, FORM);
    let mut path_m = vec![fields.required("from", place)?];
    while let Some(via) = fields.optional("via", place)? {
        path_m.push(via);
    }
    path_m.push(fields.required("to", place)?);
    let (height_m, by_m) = (fields.optional("crest", number)?, fields.optional("by", number)?);
    let width_m = fields.required("width", number)?;
    let slope = fields.optional("slope", number)?.unwrap_or(SLOPE);
    let sides = fields.optional("sides", number)?;
    let limit = fields.optional("mode", |word| named(word, &LIMITS))?.unwrap_or(Some(Limit::AtLeast));
    fields.finish()?;
    let crest = match (height_m, by_m, limit) {
        (Some(height_m), None, limit) => Crest::Level { height_m, limit, sides_m: sides.unwrap_or(SIDES_M) },
        (None, Some(_), _) if sides.is_some() => {
            return Err(format!("with `by` the sides end at the ground; leave `sides` out; write `{FORM}`"));
        }
        (None, Some(by_m), Some(Limit::AtLeast)) => Crest::Above(by_m),
        (None, Some(by_m), Some(Limit::AtMost)) => Crest::Below(by_m),
        (None, Some(_), None) => {
            return Err(format!("`by` raises (mode max) or lowers (mode min) the ground; write `{FORM}`"));
        }
        _ => return Err(format!("give `crest` or `by`, and not both; write `{FORM}`")),
    };
    Ok(Edit::Line(Line { path_m, crest, width_m, slope }))
}

/// Appends the words behind `line`.
pub(super) fn push(text: &mut String, line: &Line) {
    let last = line.path_m.len().saturating_sub(1);
    for (i, place) in line.path_m.iter().enumerate() {
        let name = match i {
            0 => "from",
            i if i == last => "to",
            _ => "via",
        };
        push_values(text, name, place);
    }
    let (name, metres, limit, sides) = match line.crest {
        Crest::Level { height_m, limit, sides_m } => ("crest", height_m, limit, Some(sides_m)),
        Crest::Above(metres) => ("by", metres, Some(Limit::AtLeast), None),
        Crest::Below(metres) => ("by", metres, Some(Limit::AtMost), None),
    };
    push_values(text, name, &[metres]);
    push_values(text, "width", &[line.width_m]);
    push_values(text, "slope", &[line.slope]);
    if let Some(sides_m) = sides {
        push_values(text, "sides", &[sides_m]);
    }
    text.push_str(" mode ");
    text.push_str(name_of(&limit, &LIMITS));
}
