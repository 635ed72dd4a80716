//! Numbers below 65,536 as one of 64 tokens and some bits beside it (FORMAT.md, section 9.4).
//!
//! The small ones, which are nearly all, are tokens of their own; from 16 on an octave of numbers has four tokens.

/// Tokens there are.
pub(crate) const TOKENS: usize = 64;

/// First number of each token, and how many bits beside it say which.
pub(crate) const BASES: [(u16, u8); TOKENS] = {
    let mut bases = [(0, 0); TOKENS];
    let mut t = 0;
    while t < TOKENS {
        bases[t] = if t < 16 {
            (t as u16, 0)
        } else {
            let bits = (t as u32 - 16) / 4 + 2;
            ((((t as u32 - 16) % 4 + 4) << bits) as u16, bits as u8)
        };
        t += 1;
    }
    bases
};

/// Tokens of the numbers that occur much.
const NEAR: [u8; 1024] = {
    let mut near = [0; 1024];
    let mut value = 0;
    while value < near.len() {
        near[value] = found_token(value as u16);
        value += 1;
    }
    near
};

const fn found_token(value: u16) -> u8 {
    if value < 16 {
        return value as u8;
    }
    let octave = value.ilog2();
    (16 + (octave - 4) * 4 + (value >> (octave - 2) & 3) as u32) as u8
}

/// Token of a number.
#[inline(always)]
pub(crate) fn token_of(value: u16) -> u8 {
    match NEAR.get(usize::from(value)) {
        Some(token) => *token,
        None => found_token(value),
    }
}

/// A signed number as one that is small if it is near 0; both count modulo 65,536.
#[inline(always)]
pub(crate) fn folded(value: i32) -> u16 {
    let value = value as i16;
    ((value << 1) ^ (value >> 15)) as u16
}

/// What [`folded`] was given.
#[inline(always)]
pub(crate) fn unfolded(value: u16) -> i32 {
    i32::from((value >> 1) as i16 ^ -((value & 1) as i16))
}

/// As [`folded`], modulo 256.
#[inline(always)]
pub(crate) fn folded8(value: u8) -> u16 {
    let value = value as i8;
    u16::from(((value << 1) ^ (value >> 7)) as u8)
}

/// What [`folded8`] was given.
#[inline(always)]
pub(crate) fn unfolded8(value: u16) -> u8 {
    let value = value as u8;
    (value >> 1) ^ (value & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back() {
        for value in 0..=u16::MAX {
            let (base, bits) = BASES[usize::from(token_of(value))];
            assert!(value >= base && u32::from(value - base) < 1 << bits, "{value}");
            assert_eq!(folded(unfolded(value)), value);
        }
        for value in 0..=255u8 {
            assert_eq!(unfolded8(folded8(value)), value);
            assert!(folded8(value) < 256);
        }
        assert_eq!([0, -1, 1, -2].map(folded), [0, 1, 2, 3]);
    }
}
