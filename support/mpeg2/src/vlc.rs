//! Code words.

/// A code word: the `length` low bits of `code`, most significant bit first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Vlc {
    /// Bits of the code, in the low bits.
    pub code: u32,
    /// Number of bits; 0 if the standard assigns no code.
    pub length: u32,
}

impl Vlc {
    /// Missing code, for table entries to which the standard assigns none.
    pub const NONE: Self = Self { code: 0, length: 0 };

    /// Returns the code with the sign bit appended, `s` in the printed tables: 1 is negative.
    #[inline]
    #[must_use]
    pub const fn signed(self, negative: bool) -> Self {
        Self { code: self.code << 1 | negative as u32, length: self.length + 1 }
    }
}
