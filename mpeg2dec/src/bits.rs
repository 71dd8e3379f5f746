//! Bit reader over one syntax unit.

/// Reads bits of a slice of bytes, most significant bit first. Zero bits follow the last byte.
#[derive(Clone, Copy)]
pub(crate) struct BitReader<'a> {
    bytes: &'a [u8],
    /// Index of the next byte to load; exceeds the length after the end.
    next: usize,
    /// Loaded bits, in the high bits.
    window: u64,
    /// Number of loaded bits.
    loaded: u32,
}

impl<'a> BitReader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut reader = Self { bytes, next: 0, window: 0, loaded: 0 };
        reader.refill();
        reader
    }

    /// Loads bits, so that at least 56 are available.
    #[inline(always)]
    pub fn refill(&mut self) {
        if let Some(word) = self.bytes.get(self.next..).and_then(<[u8]>::first_chunk) {
            self.window |= u64::from_be_bytes(*word) >> self.loaded;
            self.next += (63 - self.loaded as usize) >> 3;
            self.loaded |= 56;
        } else {
            self.refill_at_end();
        }
    }

    #[cold]
    fn refill_at_end(&mut self) {
        while self.loaded <= 56 {
            let byte = self.bytes.get(self.next).copied().unwrap_or(0);
            self.window |= u64::from(byte) << (56 - self.loaded);
            self.next += 1;
            self.loaded += 8;
        }
    }

    /// Returns the loaded bits, in the high bits.
    #[inline(always)]
    pub fn window(&self) -> u64 {
        self.window
    }

    /// Returns the next `count` bits, 1 to 32, without consuming them.
    #[inline(always)]
    pub fn peek(&self, count: u32) -> u32 {
        (self.window >> (64 - count)) as u32
    }

    /// Consumes `count` loaded bits.
    #[inline(always)]
    pub fn skip(&mut self, count: u32) {
        debug_assert!(count <= self.loaded, "more bits than loaded");
        self.window <<= count;
        self.loaded -= count;
    }

    /// Consumes `count` loaded bits, 1 to 32, and returns them.
    #[inline(always)]
    pub fn take(&mut self, count: u32) -> u32 {
        let value = self.peek(count);
        self.skip(count);
        value
    }

    /// Loads and consumes `count` bits, 1 to 32. Calls are for headers, so the function is not inlined.
    #[inline(never)]
    pub fn read(&mut self, count: u32) -> u32 {
        self.refill();
        self.take(count)
    }

    /// Loads and consumes one bit.
    #[inline]
    pub fn flag(&mut self) -> bool {
        self.read(1) == 1
    }

    /// Returns whether more bits were consumed than exist.
    pub fn is_past_end(&self) -> bool {
        8 * self.next > 8 * self.bytes.len() + self.loaded as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_come_in_order_and_zeros_follow() {
        let bytes: Vec<u8> = (1..=20).collect();
        let mut reader = BitReader::new(&bytes);
        for &byte in &bytes {
            assert_eq!(reader.read(3), u32::from(byte >> 5));
            assert_eq!(reader.read(5), u32::from(byte & 31));
        }
        assert!(!reader.is_past_end());
        assert_eq!(reader.read(9), 0);
        assert!(reader.is_past_end());
    }
}
