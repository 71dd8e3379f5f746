//! Quantised levels of one 8×8 block.

/// Quantised levels of one block.
#[derive(Clone, Copy)]
pub(crate) struct Block {
    /// Levels in transmission order.
    pub levels: [i16; 64],
    /// Bit set of the positions with non-zero levels, and of the DC position of an intra block; bit 0 is the first position.
    pub places: u64,
    /// Number of bits of the coefficients and End of block. The intra DC is excluded; an empty inter block takes no bits.
    pub bits: u32,
    /// Squared error, with twice [`COEFFICIENT_BITS`](crate::dct::COEFFICIENT_BITS) fractional bits.
    pub error: i64,
}

impl Block {
    pub const EMPTY: Self = Self { levels: [0; 64], places: 0, bits: 0, error: 0 };

    /// Removes all levels. Only the first entry of `levels` is reset, because an empty set of positions hides the others.
    pub fn clear(&mut self) {
        (self.levels[0], self.places, self.bits, self.error) = (0, 0, 0, 0);
    }

    /// Returns whether the block has levels to write; always true for an intra block.
    pub fn is_coded(&self) -> bool {
        self.places != 0
    }
}

/// Returns the positions in a set, in ascending order.
#[inline]
pub(crate) fn places(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = set.trailing_zeros() as usize;
        set &= set.wrapping_sub(1);
        (place < 64).then_some(place)
    })
}

/// Kind of block, which selects the formulas of 7.4.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum BlockKind {
    Intra,
    Inter,
}
