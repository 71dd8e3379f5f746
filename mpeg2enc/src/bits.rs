//! Where bits go: into bytes, or into a count.

/// A code word: the `length` low bits of `code`, first bit highest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Vlc {
    pub code: u32,
    pub length: u32,
}

impl Vlc {
    /// No code: what a table holds where the standard prints none.
    pub const NONE: Self = Self { code: 0, length: 0 };

    /// The code with one more bit, the sign `s` of the printed tables: 1 is negative.
    #[inline]
    pub const fn signed(self, negative: bool) -> Self {
        Self { code: self.code << 1 | negative as u32, length: self.length + 1 }
    }
}

/// Takes the bits of a stream, so that decisions count with the code that writes.
pub(crate) trait BitSink {
    /// Takes the `length` low bits of `value`, the highest first; `length` is at most 32.
    fn put(&mut self, value: u32, length: u32);

    /// Bits taken so far.
    fn bits(&self) -> u64;

    /// Is the number of bits all that is wanted?
    fn only_counts(&self) -> bool {
        false
    }

    /// Takes `bits` bits whose values do not matter; only for sinks that only count.
    fn count(&mut self, bits: u32) {
        unreachable!("{bits} bits without values for a sink that keeps them");
    }

    /// Takes a code word.
    #[inline]
    fn put_code(&mut self, vlc: Vlc) {
        debug_assert!(vlc.length > 0, "the table has no such code");
        self.put(vlc.code, vlc.length);
    }
}

/// Makes bytes.
#[derive(Default)]
pub(crate) struct BitWriter {
    /// Bytes that are whole, and room for more.
    bytes: Vec<u8>,
    whole: usize,
    /// Bits that do not make a byte yet are the low ones; those above were written before.
    pending: u64,
    pending_bits: u32,
}

impl BitWriter {
    /// Fills the last byte with zero bits: `next_start_code()` of 5.2.3, and a start code follows.
    pub fn start_code(&mut self, code: u8) {
        self.align();
        self.put(0x0000_0100 | u32::from(code), 32);
    }

    /// The bytes, the last one filled with zero bits.
    pub fn into_bytes(mut self) -> Vec<u8> {
        self.align();
        self.bytes.truncate(self.whole);
        self.bytes
    }

    fn align(&mut self) {
        self.put(0, self.pending_bits.wrapping_neg() % 8);
    }

    /// More room: rarely needed, so it stays out of the way.
    #[cold]
    fn grow(&mut self) {
        self.bytes.resize(2 * self.bytes.len() + 256, 0);
    }
}

impl BitSink for BitWriter {
    /// Eight bytes are written whatever the length, so that nothing depends on it but how many of them stay.
    #[inline]
    fn put(&mut self, value: u32, length: u32) {
        debug_assert!(length <= 32 && (length == 32 || value >> length == 0), "{value:#x} has more than {length} bits");
        if self.whole + 8 > self.bytes.len() {
            self.grow();
        }
        self.pending = self.pending << length | u64::from(value);
        // 7 + 32 at most.
        let bits = self.pending_bits + length;
        let highest_first = (self.pending << (63 - bits) << 1).to_be_bytes();
        self.bytes[self.whole..self.whole + 8].copy_from_slice(&highest_first);
        self.whole += bits as usize / 8;
        self.pending_bits = bits % 8;
    }

    fn bits(&self) -> u64 {
        8 * self.whole as u64 + u64::from(self.pending_bits)
    }
}

/// Makes a decision possible: only counts.
#[derive(Default)]
pub(crate) struct BitCounter(pub u64);

impl BitSink for BitCounter {
    #[inline]
    fn put(&mut self, _value: u32, length: u32) {
        self.0 += u64::from(length);
    }

    fn only_counts(&self) -> bool {
        true
    }

    #[inline]
    fn count(&mut self, bits: u32) {
        self.0 += u64::from(bits);
    }

    fn bits(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_become_bytes_highest_first() {
        let mut writer = BitWriter::default();
        writer.put(0b101, 3);
        writer.put(0xffff_ffff, 32);
        assert_eq!(writer.bits(), 35);
        writer.start_code(0xb7);
        assert_eq!(writer.into_bytes(), [0xbf, 0xff, 0xff, 0xff, 0xe0, 0, 0, 1, 0xb7]);
    }

    #[test]
    fn the_counter_counts_what_the_writer_writes() {
        let (mut writer, mut counter) = (BitWriter::default(), BitCounter::default());
        for length in 1..=32 {
            writer.put(1, length);
            counter.put(1, length);
            assert_eq!(writer.bits(), counter.bits());
        }
    }
}
