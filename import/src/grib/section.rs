//! A section of a message as numbers, by the octets that the standard counts from 1.
//!
//! An octet behind the end counts as 0; what needs it checks the length before. Numbers with a sign have it in their first bit. Cost: none.

/// A section, with its length and number ahead.
#[derive(Debug, Clone)]
pub(super) struct Section(pub(super) Vec<u8>);

impl Section {
    fn bytes<const N: usize>(&self, octet: usize) -> [u8; N] {
        self.0.get(octet - 1..octet - 1 + N).and_then(|bytes| bytes.try_into().ok()).unwrap_or([0; N])
    }

    pub(super) fn u8(&self, octet: usize) -> u8 {
        self.bytes::<1>(octet)[0]
    }

    pub(super) fn u16(&self, octet: usize) -> u16 {
        u16::from_be_bytes(self.bytes(octet))
    }

    pub(super) fn u32(&self, octet: usize) -> u32 {
        u32::from_be_bytes(self.bytes(octet))
    }

    pub(super) fn i16(&self, octet: usize) -> i32 {
        let number = self.u16(octet);
        let size = i32::from(number & 0x7fff);
        if number & 0x8000 == 0 { size } else { -size }
    }

    pub(super) fn i32(&self, octet: usize) -> i64 {
        let number = self.u32(octet);
        let size = i64::from(number & 0x7fff_ffff);
        if number & 0x8000_0000 == 0 { size } else { -size }
    }

    pub(super) fn f32(&self, octet: usize) -> f64 {
        f32::from_be_bytes(self.bytes(octet)).into()
    }

    /// A number of four octets and the power of ten by which it is divided, ahead of it; none where its bits are all set.
    pub(super) fn scaled(&self, octet: usize) -> Option<f64> {
        let (power, number) = (self.u8(octet), self.u32(octet + 1));
        let power = i32::from(power & 0x7f) * if power & 0x80 == 0 { 1 } else { -1 };
        (number != u32::MAX).then(|| f64::from(number) / terrasoar_layout::portable::pow(10.0, power.into()))
    }

    /// Whether it reaches to an octet.
    pub(super) fn reaches(&self, octet: usize) -> bool {
        self.0.len() >= octet
    }
}
