//! What is the same on every machine, down to the last bit: terrain files, edits, heights, ray hits, meshes, flights, made-up terrain.
//!
//! Each result is put into a number of 64 bits and compared with the one that is written here. The numbers are those of x86-64 with glibc; `scripts/portable` runs the same tests on other
//! processors. Beside the numbers, the sources are searched for functions of the system that could bring a difference: sines, logarithms, powers.

mod results;
mod sources;

/// A digest that takes bits one after the other (FNV-1a, 64 bits).
struct Digest(u64);

impl Digest {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn number(&mut self, number: f64) {
        self.bytes(&number.to_bits().to_le_bytes());
    }

    fn hex(&self) -> String {
        format!("{:016x}", self.0)
    }
}
