//! The levels of one 8×8 block.

/// Quantised levels of one block.
#[derive(Clone, Copy)]
pub(crate) struct Block {
    /// Levels in transmission order.
    pub levels: [i16; 64],
    /// Places of the levels that are not zero, the first place lowest, and of the DC of an intra block.
    pub places: u64,
    /// Bits of the coefficients and End of block; the intra DC is left out, an empty inter block takes none.
    pub bits: u32,
    /// Squared error that is left, with twice [`COEFFICIENT_BITS`](crate::dct::COEFFICIENT_BITS) fractional bits.
    pub error: i64,
}

impl Block {
    pub const EMPTY: Self = Self { levels: [0; 64], places: 0, bits: 0, error: 0 };

    /// Leaves nothing to write; levels at other than the first place are not looked at then.
    pub fn clear(&mut self) {
        (self.levels[0], self.places, self.bits, self.error) = (0, 0, 0, 0);
    }

    /// Is there anything to write? Always, in an intra block.
    pub fn is_coded(&self) -> bool {
        self.places != 0
    }
}

/// The places of a set, the lowest first.
#[inline]
pub(crate) fn places(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = set.trailing_zeros() as usize;
        set &= set.wrapping_sub(1);
        (place < 64).then_some(place)
    })
}

/// The formulae of 7.4 that hold for a block.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum BlockKind {
    Intra,
    Inter,
}
