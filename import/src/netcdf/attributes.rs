//! Attributes of variables by name, as numbers or text.

use netcdf_reader::{NcAttrValue, NcAttribute, NcVariable};

/// Text of an attribute, without blanks and NULs around it.
pub(super) fn text(attributes: &[NcAttribute], name: &str) -> Option<String> {
    let text = find(attributes, name)?.as_string()?;
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    (!text.is_empty()).then(|| text.to_owned())
}

/// Whether there is an attribute of that name.
pub(super) fn has(attributes: &[NcAttribute], name: &str) -> bool {
    find(attributes, name).is_some()
}

/// Number of an attribute.
pub(super) fn number(attributes: &[NcAttribute], name: &str) -> Option<f64> {
    find(attributes, name)?.as_f64().filter(|number| number.is_finite())
}

/// Numbers of an attribute.
pub(super) fn numbers(attributes: &[NcAttribute], name: &str) -> Vec<f64> {
    find(attributes, name).and_then(NcAttrValue::as_f64_vec).unwrap_or_default()
}

fn find<'a>(attributes: &'a [NcAttribute], name: &str) -> Option<&'a NcAttrValue> {
    attributes.iter().find(|attribute| attribute.name == name).map(|attribute| &attribute.value)
}

/// Numbers of an attribute as text that loses nothing: "-32768", "9.969209968386869e36", "nan".
pub(super) fn exact(attributes: &[NcAttribute], name: &str) -> Vec<String> {
    fn all<T: ToString>(values: &[T]) -> Vec<String> {
        values.iter().map(ToString::to_string).collect()
    }
    match find(attributes, name) {
        Some(NcAttrValue::Bytes(values)) => all(values),
        Some(NcAttrValue::Shorts(values)) => all(values),
        Some(NcAttrValue::Ints(values)) => all(values),
        Some(NcAttrValue::Floats(values)) => {
            values.iter().map(|value| f64::from(*value).to_string()).collect()
        }
        Some(NcAttrValue::Doubles(values)) => all(values),
        Some(NcAttrValue::UBytes(values)) => all(values),
        Some(NcAttrValue::UShorts(values)) => all(values),
        Some(NcAttrValue::UInts(values)) => all(values),
        Some(NcAttrValue::Int64s(values)) => all(values),
        Some(NcAttrValue::UInt64s(values)) => all(values),
        _ => Vec::new(),
    }
}

/// Whether a whole number that the format knows with a sign only is meant without.
pub(super) fn is_unsigned(variable: &NcVariable) -> bool {
    text(variable.attributes(), "_Unsigned").is_some_and(|text| text.eq_ignore_ascii_case("true"))
}
