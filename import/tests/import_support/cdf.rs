//! A writer of small netCDF files (CDF-1): columns, rows, and one grid `z` of any type with any attributes.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::path::Path;

/// Numbers or text as netCDF has them.
#[derive(Clone)]
pub(crate) enum Values {
    Bytes(Vec<i8>),
    Text(String),
    Shorts(Vec<i16>),
    Ints(Vec<i32>),
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
}

impl Values {
    fn code(&self) -> u32 {
        match self {
            Self::Bytes(_) => 1,
            Self::Text(_) => 2,
            Self::Shorts(_) => 3,
            Self::Ints(_) => 4,
            Self::Floats(_) => 5,
            Self::Doubles(_) => 6,
        }
    }

    fn count(&self) -> usize {
        match self {
            Self::Bytes(all) => all.len(),
            Self::Text(text) => text.len(),
            Self::Shorts(all) => all.len(),
            Self::Ints(all) => all.len(),
            Self::Floats(all) => all.len(),
            Self::Doubles(all) => all.len(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut bytes: Vec<u8> = match self {
            Self::Bytes(all) => all.iter().flat_map(|value| value.to_be_bytes()).collect(),
            Self::Text(text) => text.bytes().collect(),
            Self::Shorts(all) => all.iter().flat_map(|value| value.to_be_bytes()).collect(),
            Self::Ints(all) => all.iter().flat_map(|value| value.to_be_bytes()).collect(),
            Self::Floats(all) => all.iter().flat_map(|value| value.to_be_bytes()).collect(),
            Self::Doubles(all) => all.iter().flat_map(|value| value.to_be_bytes()).collect(),
        };
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }
}

/// Text of an attribute.
pub(crate) fn words(text: &str) -> Values {
    Values::Text(text.into())
}

/// Coordinates: name, numbers, attributes.
pub(crate) struct Axis<'a> {
    pub(crate) name: &'a str,
    pub(crate) numbers: Vec<f64>,
    pub(crate) attributes: Vec<(&'a str, Values)>,
}

/// Writes a grid, rows by columns; `more` are variables without dimensions, such as grid mappings.
pub(crate) fn write(
    path: &Path,
    axes: [&Axis<'_>; 2],
    z: (&Values, &[(&str, Values)]),
    more: &[(&str, &[(&str, Values)])],
) {
    write_variables(path, axes, true, z, more);
}

/// As [`write`], with dimensions "x" and "y" that have no coordinates.
pub(crate) fn write_bare(
    path: &Path,
    samples: [usize; 2],
    z: (&Values, &[(&str, Values)]),
    more: &[(&str, &[(&str, Values)])],
) {
    let axis = |name, at: usize| Axis { name, numbers: vec![0.0; samples[at]], attributes: vec![] };
    write_variables(path, [&axis("x", 0), &axis("y", 1)], false, z, more);
}

fn write_variables(
    path: &Path,
    [columns, rows]: [&Axis<'_>; 2],
    has_coordinates: bool,
    (z, about): (&Values, &[(&str, Values)]),
    more: &[(&str, &[(&str, Values)])],
) {
    type Variable<'v> = (&'v str, Vec<u32>, Values, Vec<(&'v str, Values)>);
    assert_eq!(z.count(), columns.numbers.len() * rows.numbers.len());
    let axis = |axis: &Axis<'_>| Values::Doubles(axis.numbers.clone());
    let mut variables: Vec<Variable<'_>> = vec![
        (rows.name, vec![0], axis(rows), rows.attributes.clone()),
        (columns.name, vec![1], axis(columns), columns.attributes.clone()),
        ("z", vec![0, 1], z.clone(), about.to_vec()),
    ];
    if !has_coordinates {
        variables.drain(..2);
    }
    variables.extend(more.iter().map(|(name, about)| (*name, vec![], Values::Ints(vec![0]), about.to_vec())));
    let head = |places: &[u32]| {
        let mut head = b"CDF\x01\0\0\0\0".to_vec();
        let number = |head: &mut Vec<u8>, number: usize| head.extend((number as u32).to_be_bytes());
        let name = |head: &mut Vec<u8>, text: &str| {
            number(head, text.len());
            head.extend(words(text).bytes());
        };
        head.extend([0, 0, 0, 10, 0, 0, 0, 2]);
        for axis in [rows, columns] {
            name(&mut head, axis.name);
            number(&mut head, axis.numbers.len());
        }
        head.extend([0; 8]);
        head.extend([0, 0, 0, 11]);
        number(&mut head, variables.len());
        for ((called, dimensions, values, about), place) in variables.iter().zip(places) {
            name(&mut head, called);
            number(&mut head, dimensions.len());
            dimensions.iter().for_each(|dimension| head.extend(dimension.to_be_bytes()));
            head.extend([0, 0, 0, if about.is_empty() { 0 } else { 12 }]);
            number(&mut head, about.len());
            for (attribute, value) in about {
                name(&mut head, attribute);
                head.extend(value.code().to_be_bytes());
                number(&mut head, value.count());
                head.extend(value.bytes());
            }
            head.extend(values.code().to_be_bytes());
            number(&mut head, values.bytes().len());
            head.extend(place.to_be_bytes());
        }
        head
    };
    let mut at = head(&vec![0; variables.len()]).len();
    let places: Vec<u32> = variables
        .iter()
        .map(|(_, _, values, _)| {
            let place = at as u32;
            at += values.bytes().len();
            place
        })
        .collect();
    let mut bytes = head(&places);
    variables.iter().for_each(|(_, _, values, _)| bytes.extend(values.bytes()));
    std::fs::write(path, bytes).unwrap();
}
