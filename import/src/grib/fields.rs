//! Messages one behind the other, sections in them, and the fields that these make.
//!
//! ```text
//! 0 "GRIB", 2 x unused, discipline, edition, u64 length | 1 where and when | 2 local | 3 grid | 4 product | 5 packing | 6 bitmap | 7 numbers | 8 "7777"
//! sections 1 to 7: u32 length, u8 number, content; 2 to 7, 3 to 7 or 4 to 7 may come again, and what does not come again still holds
//! ```
//!
//! What lies between messages is passed over. Cost: two small reads a section.

use super::Fault;
use super::products::Product;
use super::section::Section;
use std::fs::File;
use terrasoar_layout::file::disk::read_at;

/// Fields of a file, at most.
const MOST_FIELDS: usize = 1 << 16;
/// Longest section that is looked into.
const MOST_SECTION: u64 = 1 << 20;
/// Bytes that are searched at once for the beginning of a message.
const SEARCHED: u64 = 1 << 16;
const MAGIC: &[u8] = b"GRIB";

/// Bytes of a file: from, to (not included).
pub(super) type Part = [u64; 2];

/// One field.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub(super) product: Product,
    pub(super) grid: Part,
    pub(super) packing: Part,
    /// The bits that say where there are numbers; none where there are numbers everywhere.
    pub(super) bitmap: Option<Part>,
    pub(super) numbers: Part,
}

/// The fields of a file.
pub(super) fn fields(file: &File, length: u64) -> Result<Vec<Field>, Fault> {
    let mut fields = Vec::new();
    let mut at = 0;
    while let Some(begin) = find(file, at, length)? {
        let mut head = [0; 16];
        if begin + 16 > length {
            return Err(Fault::Damaged("it is cut short"));
        }
        read_at(file, &mut head, begin)?;
        let edition = head[7];
        if edition == 1 {
            return Err(Fault::FirstEdition);
        }
        if edition != 2 {
            // Letters that happen to be there, or an edition that is not known.
            if begin == 0 {
                return Err(Fault::Unsupported(format!("it is of edition {edition}")));
            }
            at = begin + MAGIC.len() as u64;
            continue;
        }
        let total = u64::from_be_bytes([8, 9, 10, 11, 12, 13, 14, 15].map(|i: usize| head[i]));
        let end = begin.checked_add(total).filter(|end| *end <= length && total >= 20);
        let end = end.ok_or(Fault::Damaged("a message reaches beyond the end: it is cut short"))?;
        message(file, head[6], [begin + 16, end - 4], &mut fields)?;
        at = end;
    }
    Ok(fields)
}

/// Where the next message begins.
fn find(file: &File, mut at: u64, length: u64) -> Result<Option<u64>, Fault> {
    // Most messages follow each other.
    let mut buffer = vec![0; MAGIC.len()];
    if at + 16 <= length {
        read_at(file, &mut buffer, at)?;
        if buffer == MAGIC {
            return Ok(Some(at));
        }
    }
    while at + 16 <= length {
        buffer.resize((length - at).min(SEARCHED) as usize, 0);
        read_at(file, &mut buffer, at)?;
        if let Some(found) = buffer.windows(MAGIC.len()).position(|bytes| bytes == MAGIC) {
            return Ok(Some(at + found as u64));
        }
        at += (buffer.len() - (MAGIC.len() - 1)) as u64;
    }
    Ok(None)
}

/// The sections of one message.
fn message(file: &File, discipline: u8, [mut at, end]: Part, fields: &mut Vec<Field>) -> Result<(), Fault> {
    let (mut grid, mut product, mut packing, mut bitmap, mut last_bitmap) = (None, None, None, None, None);
    while at < end {
        let mut head = [0; 6];
        let wide = (end - at).min(6) as usize;
        read_at(file, &mut head[..wide], at)?;
        let length = u64::from(u32::from_be_bytes([head[0], head[1], head[2], head[3]]));
        let part = [at, at + length];
        if length < 5 || part[1] > end {
            return Err(Fault::Damaged("a section reaches beyond its message"));
        }
        match head[4] {
            1 | 2 => {}
            3 => grid = Some(part),
            4 => product = Some(Product::of(discipline, &section(file, part)?)),
            5 => packing = Some(part),
            6 => {
                bitmap = match head[5] {
                    _ if length < 6 => return Err(Fault::Damaged("its bitmap is cut short")),
                    0 => Some([at + 6, part[1]]),
                    254 => last_bitmap,
                    255 => None,
                    code => {
                        return Err(Fault::Unsupported(format!(
                            "bitmap {code} of a centre of its own is named"
                        )));
                    }
                };
                last_bitmap = bitmap.or(last_bitmap);
            }
            7 => {
                let (Some(grid), Some(product), Some(packing)) = (grid, product.take(), packing.take())
                else {
                    return Err(Fault::Damaged("a field has numbers and says not what they are"));
                };
                if fields.len() == MOST_FIELDS {
                    return Err(Fault::Unsupported(format!("it has more than {MOST_FIELDS} fields")));
                }
                fields.push(Field {
                    product,
                    grid,
                    packing,
                    bitmap: bitmap.take(),
                    numbers: [at + 5, part[1]],
                });
            }
            _ => return Err(Fault::Damaged("a section has no number of GRIB")),
        }
        at = part[1];
    }
    Ok(())
}

/// A section in memory.
pub(super) fn section(file: &File, [from, to]: Part) -> Result<Section, Fault> {
    if to - from > MOST_SECTION {
        return Err(Fault::Unsupported("a section of its header is longer than a mebibyte".into()));
    }
    let mut bytes = vec![0; (to - from) as usize];
    read_at(file, &mut bytes, from)?;
    Ok(Section(bytes))
}
