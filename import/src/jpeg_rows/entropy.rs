//! The packed coefficients of a baseline JPEG (ITU-T T.81, annex F): read code by code, and written again with codes of one's own.
//!
//! Only the codes change; the numbers behind them are copied. The codes written are the same for every picture: 4 bits for what stands before a first coefficient, 8 or 9 for others. Cost: some nanoseconds a
//! code, one thread.

use std::io::Read;

/// Bytes read at once.
const BUFFER: usize = 1 << 16;
/// Bits that a code is looked up by; longer ones are searched.
const LOOKUP: u32 = 9;

/// Why the coefficients end too early.
#[derive(Debug)]
pub(super) enum Trouble {
    Io(std::io::Error),
    Damaged,
}

/// Codes as a file declares them.
#[derive(Debug, Clone)]
pub(super) struct Codes {
    /// Value and length by the first bits; a length of 0 is a longer code.
    lookup: Vec<(u8, u8)>,
    /// By length: the last code, and where the values of the length begin, less its first code.
    last: [i32; 17],
    offset: [i32; 17],
    values: Vec<u8>,
}

impl Codes {
    /// Of how many codes there are of each length from 1 on, and their values.
    pub(super) fn new(counts: &[u8; 16], values: &[u8]) -> Option<Self> {
        let mut this = Self {
            lookup: vec![(0, 0); 1 << LOOKUP],
            last: [-1; 17],
            offset: [0; 17],
            values: values.to_vec(),
        };
        let (mut code, mut at) = (0i32, 0usize);
        for (length, count) in (1u32..).zip(counts) {
            let count = i32::from(*count);
            if code + count > 1 << length || at + count as usize > values.len() {
                return None;
            }
            this.offset[length as usize] = at as i32 - code;
            for number in 0..count {
                if length <= LOOKUP {
                    let first = ((code + number) as usize) << (LOOKUP - length);
                    this.lookup[first..first + (1 << (LOOKUP - length))]
                        .fill((values[at + number as usize], length as u8));
                }
            }
            code += count;
            at += count as usize;
            this.last[length as usize] = if count > 0 { code - 1 } else { -1 };
            code <<= 1;
        }
        Some(this)
    }
}

/// Bits of packed coefficients.
pub(super) struct Bits<R> {
    input: R,
    buffer: Vec<u8>,
    at: usize,
    bits: u64,
    count: u32,
    /// Bits of these that are none of the file's.
    padding: u32,
    /// A marker that was met.
    marker: Option<u8>,
}

impl<R: Read> Bits<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, buffer: Vec::new(), at: 0, bits: 0, count: 0, padding: 0, marker: None }
    }

    fn byte(&mut self) -> Result<Option<u8>, Trouble> {
        if self.at == self.buffer.len() {
            self.buffer.resize(BUFFER, 0);
            let read = self.input.read(&mut self.buffer).map_err(Trouble::Io)?;
            self.buffer.truncate(read);
            self.at = 0;
        }
        let byte = self.buffer.get(self.at).copied();
        self.at += usize::from(byte.is_some());
        Ok(byte)
    }

    /// At least 48 bits.
    fn fill(&mut self) -> Result<(), Trouble> {
        while self.count <= 48 {
            let mut next = None;
            if self.marker.is_none() {
                next = self.byte()?;
                if next == Some(0xff) {
                    let mut after = self.byte()?;
                    while after == Some(0xff) {
                        after = self.byte()?;
                    }
                    if after != Some(0) {
                        self.marker = Some(after.unwrap_or(0));
                        next = None;
                    }
                }
            }
            self.padding += if next.is_none() { 8 } else { 0 };
            self.bits = self.bits << 8 | u64::from(next.unwrap_or(0));
            self.count += 8;
        }
        Ok(())
    }

    fn peek(&self, count: u32) -> u32 {
        (self.bits >> (self.count - count)) as u32 & ((1 << count) - 1)
    }

    /// The value of the next code.
    fn value(&mut self, codes: &Codes) -> Result<u8, Trouble> {
        self.fill()?;
        let (value, length) = codes.lookup[self.peek(LOOKUP) as usize];
        if length > 0 {
            self.count -= u32::from(length);
            return Ok(value);
        }
        for length in LOOKUP + 1..=16 {
            let code = self.peek(length) as i32;
            if code <= codes.last[length as usize] {
                self.count -= length;
                let at =
                    usize::try_from(code + codes.offset[length as usize]).map_err(|_| Trouble::Damaged)?;
                return codes.values.get(at).copied().ok_or(Trouble::Damaged);
            }
        }
        Err(Trouble::Damaged)
    }

    /// So many bits, at most 16.
    fn take(&mut self, count: u32) -> Result<u32, Trouble> {
        if count == 0 {
            return Ok(0);
        }
        self.fill()?;
        let bits = self.peek(count);
        self.count -= count;
        Ok(bits)
    }

    /// That all bits so far were the file's.
    pub(super) fn check(&self) -> Result<(), Trouble> {
        if self.count < self.padding { Err(Trouble::Damaged) } else { Ok(()) }
    }

    /// Goes on behind a mark of restart, which must come next.
    pub(super) fn restart(&mut self) -> Result<(), Trouble> {
        self.check()?;
        if self.marker.is_none() {
            // What is left of a byte, and whole bytes that are none.
            self.fill()?;
        }
        match self.marker {
            Some(0xd0..=0xd7) => {
                (self.bits, self.count, self.padding, self.marker) = (0, 0, 0, None);
                Ok(())
            }
            _ => Err(Trouble::Damaged),
        }
    }
}

/// Bits written.
#[derive(Default)]
pub(super) struct Out {
    pub(super) bytes: Vec<u8>,
    bits: u64,
    count: u32,
}

impl Out {
    fn put(&mut self, bits: u32, count: u32) {
        self.bits = self.bits << count | u64::from(bits);
        self.count += count;
        while self.count >= 8 {
            self.count -= 8;
            let byte = (self.bits >> self.count) as u8;
            self.bytes.push(byte);
            if byte == 0xff {
                self.bytes.push(0);
            }
        }
    }

    /// The first coefficient's number of bits.
    fn first(&mut self, value: u8) {
        self.put(u32::from(value), 4);
    }

    fn other(&mut self, value: u8) {
        match value {
            0..254 => self.put(u32::from(value), 8),
            _ => self.put(508 + u32::from(value - 254), 9),
        }
    }

    /// Fills the last byte.
    pub(super) fn end(&mut self) {
        if self.count > 0 {
            let missing = 8 - self.count;
            self.put((1 << missing) - 1, missing);
        }
    }
}

/// The tables of the codes that [`Out`] writes, as segments.
pub(super) fn tables() -> Vec<u8> {
    let mut bytes = vec![0xff, 0xc4, 0, 2 + 17 + 12, 0, 0, 0, 0, 12];
    bytes.resize(5 + 16, 0);
    bytes.extend(0..12);
    bytes.extend([0xff, 0xc4]);
    bytes.extend((2u16 + 17 + 256).to_be_bytes());
    bytes.push(0x10);
    let mut counts = [0; 16];
    (counts[7], counts[8]) = (254, 2);
    bytes.extend(counts);
    bytes.extend(0..=255);
    bytes
}

/// Copies the coefficients of a block. `before` is the first coefficient of the block before, in the file and in what is written.
pub(super) fn copy_block<R: Read>(
    bits: &mut Bits<R>,
    out: &mut Out,
    [first, others]: [&Codes; 2],
    before: &mut [i32; 2],
) -> Result<(), Trouble> {
    let size = u32::from(bits.value(first)?);
    if size > 11 {
        return Err(Trouble::Damaged);
    }
    let raw = bits.take(size)? as i32;
    // Numbers below 0 are written less one, without their sign.
    let step = if size > 0 && raw < 1 << (size - 1) { raw - (1 << size) + 1 } else { raw };
    let value = before[0] + step;
    let written = value - before[1];
    *before = [value, value];
    let size = 32 - written.unsigned_abs().leading_zeros();
    if size > 11 {
        return Err(Trouble::Damaged);
    }
    out.first(size as u8);
    if size > 0 {
        let raw = if written < 0 { written + (1 << size) - 1 } else { written };
        out.put(raw as u32, size);
    }
    let mut at = 1;
    while at < 64 {
        let value = bits.value(others)?;
        out.other(value);
        let (zeros, size) = (u32::from(value >> 4), u32::from(value & 15));
        if size == 0 {
            if zeros != 15 {
                return Ok(());
            }
            at += 16;
            continue;
        }
        at += zeros + 1;
        let raw = bits.take(size)?;
        out.put(raw, size);
    }
    if at > 64 { Err(Trouble::Damaged) } else { Ok(()) }
}
