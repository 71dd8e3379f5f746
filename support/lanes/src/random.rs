//! Numbers for tests.

pub(crate) struct Random(pub(crate) u32);

impl Random {
    /// All 32 bits.
    pub(crate) fn next(&mut self) -> u32 {
        // Of a linear congruence only the upper bits are any good.
        let mut half = || {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            self.0 >> 16
        };
        half() << 16 | half()
    }
}
