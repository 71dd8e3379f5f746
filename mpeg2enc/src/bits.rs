//! Bit sinks: one writes bytes, the other only counts bits.

use mpeg2::Vlc;

/// Receives the bits of a stream, so that the same function can write a code or count its bits.
pub(crate) trait BitSink {
    /// Receives the `length` low bits of `value`, most significant bit first; `length` is at most 32.
    fn put(&mut self, value: u32, length: u32);

    /// Returns the number of bits received so far.
    fn bits(&self) -> u64;

    /// Returns whether the sink only counts bits.
    fn only_counts(&self) -> bool {
        false
    }

    /// Receives `bits` bits of unspecified value; only for sinks that only count bits.
    fn count(&mut self, bits: u32) {
        unreachable!("{bits} bits without values for a sink that writes them");
    }

    /// Receives a code word.
    #[inline]
    fn put_code(&mut self, vlc: Vlc) {
        debug_assert!(vlc.length > 0, "the table has no such code");
        self.put(vlc.code, vlc.length);
    }
}

/// Writes bits as bytes.
#[derive(Default)]
pub(crate) struct BitWriter {
    /// Complete bytes, followed by free space.
    bytes: Vec<u8>,
    whole: usize,
    /// Bits of the incomplete last byte, in the low bits; higher bits were written before.
    pending: u64,
    pending_bits: u32,
}

impl BitWriter {
    /// Pads the last byte with zero bits (`next_start_code()` of 5.2.3) and writes a start code.
    pub fn start_code(&mut self, code: u8) {
        self.align();
        self.put(0x0000_0100 | u32::from(code), 32);
    }

    /// Returns the bytes, with the last one padded with zero bits.
    pub fn into_bytes(mut self) -> Vec<u8> {
        self.align();
        self.bytes.truncate(self.whole);
        self.bytes
    }

    fn align(&mut self) {
        self.put(0, self.pending_bits.wrapping_neg() % 8);
    }

    /// Enlarges the buffer. Calls are rare, so the function is not inlined.
    #[cold]
    fn grow(&mut self) {
        self.bytes.resize(2 * self.bytes.len() + 256, 0);
    }
}

impl BitSink for BitWriter {
    /// Always writes eight bytes; only the number of retained bytes depends on the length.
    #[inline]
    fn put(&mut self, value: u32, length: u32) {
        debug_assert!(length <= 32 && (length == 32 || value >> length == 0), "{value:#x} has more than {length} bits");
        if self.whole + 8 > self.bytes.len() {
            self.grow();
        }
        self.pending = self.pending << length | u64::from(value);
        // The sum is at most 7 + 32.
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

/// Counts bits for decisions.
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
