//! Which numbers of a grid are data: `valid_range`, or `valid_min` and `valid_max` (CF 1.11, section 2.5.1). All others mean "no data".
//!
//! They are numbers as the file stores them, before scale and offset, without a sign where the grid's are. A range that cannot be meant is left out, and that is said.

use super::attributes::{exact, has, is_unsigned, number};
use netcdf_reader::{NcType, NcVariable};
use terrasoar_layout::words::harmless;

/// The lowest and the highest number, the attributes that say so, and what is wrong with them, in words.
#[derive(Debug, Default)]
pub(super) struct Valid {
    pub(super) range: Option<[f64; 2]>,
    pub(super) by: &'static str,
    pub(super) problems: Vec<String>,
}

/// What the attributes of the `variable` say.
pub(super) fn of(variable: &NcVariable) -> Valid {
    let attributes = variable.attributes();
    let name = harmless(variable.name(), 40);
    let mut problems = Vec::new();
    let mut end = |attribute: &str, idle: f64| {
        if !has(attributes, attribute) {
            return idle;
        }
        let found = match &numbers(variable, attribute)[..] {
            [one] if !one.is_nan() => Some(*one),
            _ => None,
        };
        found.unwrap_or_else(|| {
            problems.push(format!(
                "attribute {attribute} of variable \"{name}\" is not one number and was left out"
            ));
            idle
        })
    };
    let (range, by) = if has(attributes, "valid_range") {
        let range = match numbers(variable, "valid_range")[..] {
            [low, high] if low <= high => Some([low, high]),
            _ => {
                problems.push(format!(
                    "attribute valid_range of variable \"{name}\" is not a low and a high number and was left out; no number was made void by it"
                ));
                None
            }
        };
        (range, "valid_range")
    } else {
        let ends = [end("valid_min", f64::NEG_INFINITY), end("valid_max", f64::INFINITY)];
        if ends[0] > ends[1] {
            problems.push(format!(
                "attribute valid_min of variable \"{name}\" is above its valid_max; both were left out, and no number was made void by them"
            ));
        }
        let by = match ends.map(f64::is_finite) {
            [true, false] => "valid_min",
            [false, true] => "valid_max",
            _ => "valid_min and valid_max",
        };
        (Some(ends).filter(|[low, high]| low <= high && (low.is_finite() || high.is_finite())), by)
    };
    let is_whole = !matches!(variable.dtype(), NcType::Float | NcType::Double);
    let is_packed = ["scale_factor", "add_offset"].iter().any(|name| number(attributes, name).is_some());
    let is_wider = by.split(" and ").any(|attribute| are_reals(variable, attribute));
    if range.is_some() && is_whole && is_packed && is_wider {
        problems.push(format!(
            "attribute {by} of variable \"{name}\" is of real numbers and the variable of packed whole ones; it was taken as packed numbers, as the convention has \
             it; if it is meant in unpacked ones, take it away: ncatted -a {},{name},d,, INPUT output.nc",
            by.split(' ').next().unwrap_or_default()
        ));
    }
    Valid { range, by, problems }
}

/// Whether an attribute is there and its numbers are not whole ones by their type.
fn are_reals(variable: &NcVariable, attribute: &str) -> bool {
    use netcdf_reader::NcAttrValue::{Doubles, Floats};
    let found = variable.attributes().iter().find(|found| found.name == attribute);
    found.is_some_and(|found| matches!(found.value, Floats(_) | Doubles(_)))
}

/// The numbers of an attribute, without a sign where those of the variable have none.
fn numbers(variable: &NcVariable, attribute: &str) -> Vec<f64> {
    let turn = match variable.dtype() {
        NcType::Byte => 256.0,
        NcType::Short => 65_536.0,
        NcType::Int => 4_294_967_296.0,
        _ => 0.0,
    };
    let turn = if is_unsigned(variable) { turn } else { 0.0 };
    let texts = exact(variable.attributes(), attribute);
    let found = texts.iter().map(|text| text.parse::<f64>().unwrap_or(f64::NAN));
    found.map(|value| if value < 0.0 { value + turn } else { value }).collect()
}
