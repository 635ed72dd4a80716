//! The south-west corner in a tile's name: `N29E080.hgt`, `s07w072.SRTMGL1.hgt`.

use std::path::Path;

/// Latitude and longitude in whole degrees, or `None` if the name is not of this kind.
pub(super) fn corner(path: &Path) -> Option<(i32, i32)> {
    let name = path.file_name()?.to_str()?.as_bytes();
    let (position, rest) = name.split_at_checked(7)?;
    if rest.first().is_some_and(u8::is_ascii_alphanumeric) {
        return None;
    }
    let latitude = signed(&position[..3], b'N', b'S')?;
    let longitude = signed(&position[3..], b'E', b'W')?;
    ((-90..90).contains(&latitude) && (-180..180).contains(&longitude)).then_some((latitude, longitude))
}

fn signed(text: &[u8], positive: u8, negative: u8) -> Option<i32> {
    let (letter, digits) = text.split_first()?;
    let value = digits
        .iter()
        .try_fold(0, |sum, digit| digit.is_ascii_digit().then(|| sum * 10 + i32::from(digit - b'0')))?;
    match letter.to_ascii_uppercase() {
        letter if letter == positive => Some(value),
        letter if letter == negative => Some(-value),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_give_corners() {
        let of = |name: &str| corner(Path::new(name));
        assert_eq!(of("dir/N29E080.hgt"), Some((29, 80)));
        assert_eq!(of("s07w072.SRTMGL1.hgt"), Some((-7, -72)));
        assert_eq!(of("N00E006.hgt"), Some((0, 6)));
        for bad in ["N29E080x.hgt", "N2E80.hgt", "tile.hgt", "N29E380.hgt", "X29E080.hgt", "N29E0é.hgt", ""]
        {
            assert_eq!(of(bad), None, "{bad}");
        }
    }
}
