//! What a header says of a DEM in words: fields, each with its kind and its length, one after the other (FORMAT.md, section 4.1).
//!
//! What does not fit is left out, the least needed first: units come before the text of the reference system, that before warnings, these before what was found where. A
//! field of an unknown kind is skipped. Cost: one pass over at most 2,810 bytes.

use crate::dem::{About, UnitOf};
use crate::file::bytes::{get_f64, get_u16, get_u32, put_u16};

/// Where the fields stand in a header page: their length, then they.
const AT: usize = 0x500;
const END: usize = 0xffc;
/// Bytes before the value of a field.
const HEAD: usize = 3;

const CRS_TEXT: u8 = 1;
const HORIZONTAL_UNIT: u8 = 2;
const VERTICAL_NAME: u8 = 3;
const VERTICAL_EPSG: u8 = 4;
const VERTICAL_UNIT: u8 = 5;
const ORIGIN: u8 = 6;
const WARNING: u8 = 7;

fn unit_bytes(unit: &UnitOf) -> Vec<u8> {
    let mut bytes = unit.size.to_le_bytes().to_vec();
    bytes.push(u8::from(unit.is_angle));
    bytes.extend_from_slice(unit.name.as_bytes());
    bytes
}

/// The fields in the order of their worth.
fn fields(about: &About) -> Vec<(u8, Vec<u8>)> {
    let mut fields = Vec::new();
    let text = |text: &str| text.as_bytes().to_vec();
    fields.extend(about.horizontal_unit.iter().map(|unit| (HORIZONTAL_UNIT, unit_bytes(unit))));
    fields.extend(about.vertical_unit.iter().map(|unit| (VERTICAL_UNIT, unit_bytes(unit))));
    fields.extend(about.vertical_epsg.iter().map(|code| (VERTICAL_EPSG, code.to_le_bytes().to_vec())));
    for (kind, said) in [(VERTICAL_NAME, &about.vertical_name), (CRS_TEXT, &about.crs_text)] {
        if !said.is_empty() {
            fields.push((kind, text(said)));
        }
    }
    fields.extend(about.warnings.iter().map(|words| (WARNING, text(words))));
    fields
        .extend(about.origins.iter().map(|(what, words)| (ORIGIN, format!("{what}\0{words}").into_bytes())));
    fields
}

/// Stores what fits.
pub(super) fn put(page: &mut [u8], about: &About) {
    let mut at = AT + 2;
    for (kind, value) in fields(about) {
        if at + HEAD + value.len() > END {
            continue;
        }
        page[at] = kind;
        put_u16(page, at + 1, value.len() as u16);
        page[at + HEAD..at + HEAD + value.len()].copy_from_slice(&value);
        at += HEAD + value.len();
    }
    put_u16(page, AT, (at - AT - 2) as u16);
}

fn unit_of(value: &[u8]) -> Option<UnitOf> {
    let (size, is_angle) = (get_f64(value.get(..8)?, 0), *value.get(8)?);
    let name = std::str::from_utf8(value.get(9..)?).ok()?.to_owned();
    (size.is_finite() && size > 0.0 && is_angle <= 1).then_some(UnitOf {
        name,
        size,
        is_angle: is_angle == 1,
    })
}

/// Reads what is there; `None` where the fields do not fill their length, or one of them is no text or number.
pub(super) fn get(page: &[u8]) -> Option<About> {
    let length = usize::from(get_u16(page, AT));
    let mut rest = page.get(AT + 2..END)?.get(..length)?;
    let mut about = About::default();
    while !rest.is_empty() {
        let kind = rest[0];
        let size = usize::from(get_u16(rest.get(..HEAD)?, 1));
        let value = rest.get(HEAD..HEAD + size)?;
        rest = &rest[HEAD + size..];
        let text = || std::str::from_utf8(value).ok().map(str::to_owned);
        match kind {
            CRS_TEXT => about.crs_text = text()?,
            HORIZONTAL_UNIT => about.horizontal_unit = Some(unit_of(value)?),
            VERTICAL_NAME => about.vertical_name = text()?,
            VERTICAL_EPSG => about.vertical_epsg = Some(get_u32(value.get(..4)?, 0)),
            VERTICAL_UNIT => about.vertical_unit = Some(unit_of(value)?),
            ORIGIN => {
                let text = text()?;
                let (what, words) = text.split_once('\0')?;
                about.origins.push((what.to_owned(), words.to_owned()));
            }
            WARNING => about.warnings.push(text()?),
            _ => {}
        }
    }
    Some(about)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> About {
        About {
            crs_text: "PROJCS[\"x\"]".into(),
            horizontal_unit: Some(UnitOf {
                name: "US survey foot".into(),
                size: 1200.0 / 3937.0,
                is_angle: false,
            }),
            vertical_name: "NAVD88 height (ftUS)".into(),
            vertical_epsg: Some(6360),
            vertical_unit: Some(UnitOf { name: "ft".into(), size: 0.3048, is_angle: false }),
            origins: vec![("heights".into(), "band 1".into()), ("place".into(), "a.tfw".into())],
            warnings: vec!["one".into(), "two".into()],
        }
    }

    #[test]
    fn what_was_put_comes_back_and_nothing_is_nothing() {
        let mut page = vec![0; 4096];
        assert_eq!(get(&page), Some(About::default()));
        put(&mut page, &About::default());
        assert!(page.iter().all(|byte| *byte == 0));
        put(&mut page, &full());
        assert_eq!(get(&page), Some(full()));
    }

    #[test]
    fn what_does_not_fit_is_left_out_and_the_rest_kept() {
        let mut about = full();
        about.crs_text = "x".repeat(3000);
        let mut page = vec![0; 4096];
        put(&mut page, &about);
        let kept = get(&page).unwrap();
        assert_eq!(kept, About { crs_text: String::new(), ..full() });
        about.crs_text = "x".repeat(2600);
        about.warnings = vec!["w".repeat(400), "short".into()];
        put(&mut page, &about);
        let kept = get(&page).unwrap();
        assert_eq!((kept.crs_text.len(), kept.warnings), (2600, vec!["short".to_owned()]));
        assert!(page[0xffc..].iter().all(|byte| *byte == 0));
    }

    #[test]
    fn damage_is_seen() {
        let mut page = vec![0; 4096];
        put(&mut page, &full());
        for (at, value) in [(AT, 1u8), (AT + 1, 0xff), (AT + 3, 0xff), (AT + 4, 0xff), (AT + 5 + 7, 0x7f)] {
            let mut broken = page.clone();
            broken[at] = value;
            if at == AT + 5 + 7 {
                broken[at - 1] = 0xf0;
            }
            assert_eq!(get(&broken), None, "{at:#x}");
        }
    }
}
