//! How many heights a tile has along its sides, from their number alone.
//!
//! Most tiles are square. Towards the poles meridians come together, and tiles have fewer columns than rows: every second from 50 degrees north on, or as Copernicus tiles do.

/// Rows of a tile that is not square: one and three arc-seconds, a third, and six.
const ROWS: [u64; 4] = [3601, 1201, 10_801, 601];
/// Twice the steps between rows for a step between columns, in tiles that are not square.
const TWICE_RATIOS: [u64; 5] = [4, 3, 6, 10, 20];

/// Columns and rows of a tile of so many bytes; `None` if tiles do not have so many.
pub(super) fn samples_of(bytes: u64) -> Option<[u32; 2]> {
    let count = bytes / 2;
    if !bytes.is_multiple_of(2) {
        return None;
    }
    let side = count.isqrt();
    if side * side == count {
        return u32::try_from(side).ok().filter(|side| *side >= 2).map(|side| [side; 2]);
    }
    ROWS.iter().find_map(|rows| {
        let columns = count / rows;
        let is_known =
            TWICE_RATIOS.iter().any(|twice| columns > 1 && (columns - 1) * twice == 2 * (rows - 1));
        // Both are of the lists above.
        (columns * rows == count && is_known).then_some([columns as u32, *rows as u32])
    })
}

/// What to say of a file whose length is no tile's.
pub(super) fn refusal(bytes: u64) -> String {
    format!(
        "{bytes} bytes are no tile of 16-bit heights, so this is no .hgt tile or it is cut short (1201 x 1201 heights are 2884802 bytes, 3601 x 3601 are \
         25934402, 1801 x 3601 are 12970802); fetch it again, or state its shape, such as 1801x3601:i16be"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_tiles() {
        for sides in [
            [3601, 3601],
            [1201, 1201],
            [1801, 3601],
            [2401, 3601],
            [1201, 3601],
            [601, 1201],
            [601, 601],
            [12, 12],
            [2, 2],
        ] {
            assert_eq!(samples_of(2 * u64::from(sides[0]) * u64::from(sides[1])), Some(sides));
        }
        for bytes in [0, 2, 3, 6, 2 * 1800 * 3601, 2 * 1801 * 3600, 2 * 3601, 25_934_401] {
            assert_eq!(samples_of(bytes), None, "{bytes}");
        }
    }
}
