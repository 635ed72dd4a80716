//! Mutations that repeat: what tests do to seeds where no fuzzer is.

use terrasoar_layout::mix::Random;

const WORDS: &[&str] = &[
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "4294967295",
    "18446744073709551615",
    "1e9",
    "-0",
    "0.5",
    "\"",
    ",",
    "\n",
    "\n\n",
    "#",
    "\t",
    "\u{1b}[2J",
    "\u{feff}",
    "end\n",
    "batch x\n",
    "frame 3\n",
];

const NUMBERS: &[u64] = &[
    0,
    1,
    2,
    3,
    7,
    8,
    16,
    127,
    128,
    255,
    256,
    1024,
    4095,
    4096,
    32_767,
    32_768,
    65_535,
    65_536,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    u64::MAX,
    0x7ff0_0000_0000_0000,
    0x7ff8_0000_0000_0000,
];

/// A seed changed in a few places. The same seed and number give the same bytes.
pub fn mutate(seed: &[u8], number: u64, is_text: bool) -> Vec<u8> {
    let mut random = Random::new(number);
    let mut bytes = seed.to_vec();
    for _ in 0..=random.index(3) {
        if is_text && random.index(2) == 0 {
            change_text(&mut bytes, &mut random);
        } else {
            change_bytes(&mut bytes, &mut random);
        }
    }
    bytes
}

/// Puts a word in the place of another.
fn change_text(bytes: &mut Vec<u8>, random: &mut Random) {
    let starts = bytes.iter().enumerate().filter(|(_, byte)| byte.is_ascii_whitespace()).map(|(i, _)| i + 1);
    let starts: Vec<usize> = std::iter::once(0).chain(starts).collect();
    let start = starts[random.index(starts.len())];
    let length = bytes[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(bytes.len() - start);
    let word = WORDS[random.index(WORDS.len())];
    bytes.splice(start..start + length, word.bytes());
}

fn change_bytes(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return bytes.push(random.index(256) as u8);
    }
    // Headers and directories are at either end.
    let near = random.index(400.min(bytes.len()));
    let at = match random.index(4) {
        0 => random.index(bytes.len()),
        1 => bytes.len() - 1 - near,
        _ => near,
    };
    match random.index(8) {
        0 => bytes[at] ^= 1 << random.index(8),
        1 => bytes[at] = random.index(256) as u8,
        2..=4 => {
            let number = NUMBERS[random.index(NUMBERS.len())];
            let width = [1, 2, 4, 8][random.index(4)].min(bytes.len() - at);
            let big = random.index(2) == 0;
            let raw = if big { number.to_be_bytes() } else { number.to_le_bytes() };
            let from = if big { 8 - width } else { 0 };
            bytes[at..at + width].copy_from_slice(&raw[from..from + width]);
        }
        5 => bytes.truncate(at),
        6 => {
            let end = (at + random.index(64)).min(bytes.len());
            let piece = bytes[at..end].to_vec();
            let to = random.index(bytes.len());
            bytes.splice(to..to, piece);
        }
        _ => {
            let end = (at + random.index(16)).min(bytes.len());
            bytes.drain(at..end);
        }
    }
}
