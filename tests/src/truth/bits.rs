//! Reads the bits of headers.

/// Reads bits in order, the most significant bit of a byte first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bits<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Returns the next `count` bits, at most 64.
    pub fn take(&mut self, count: usize) -> u64 {
        let bit = |at: usize| u64::from(self.bytes.get(at / 8).copied().unwrap_or(0) >> (7 - at % 8) & 1);
        let value = (self.at..self.at + count).fold(0, |value, at| value << 1 | bit(at));
        self.at += count;
        value
    }

    /// Returns the next bit.
    pub fn flag(&mut self) -> bool {
        self.take(1) == 1
    }

    pub fn skip(&mut self, count: usize) {
        self.at += count;
    }

    /// Returns a time stamp: 33 bits in three groups, each followed by a marker bit (13818-1, 2.4.3.7).
    pub fn stamp(&mut self) -> u64 {
        let mut parts = [0; 3];
        for (part, length) in parts.iter_mut().zip([3, 15, 15]) {
            *part = self.take(length);
            self.skip(1);
        }
        parts[0] << 30 | parts[1] << 15 | parts[2]
    }
}

/// Returns positions and values of start codes: the bytes 0, 0, 1 and the value.
pub(super) fn start_codes(bytes: &[u8]) -> Vec<(usize, u8)> {
    let mut codes = Vec::new();
    let mut at = 0;
    while at + 3 < bytes.len() {
        if bytes[at..at + 3] == [0, 0, 1] {
            codes.push((at, bytes[at + 3]));
            at += 3;
        }
        at += 1;
    }
    codes
}
