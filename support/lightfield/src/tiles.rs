//! Texels in tiles of 16×16, with masks of the existing texels.

/// Number of texels per side of a tile.
pub const TILE_SIDE: usize = 16;
/// Number of texel slots per tile.
pub const TILE_SLOTS: usize = TILE_SIDE * TILE_SIDE;

/// Place of a texel in its tiles: 256 × tile + 16 y + x. A slot may have no texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Slot(pub usize);

/// Number of existing texels in the slots before a texel. Samples are in order of rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Rank(pub usize);

impl Slot {
    /// Returns the slot of texel (x, y) of a picture of this `width` ([`TexelTiles::of_picture`]).
    ///
    /// ```
    /// use lightfield::Slot;
    /// assert_eq!(Slot::in_picture(40, 3, 1), Slot(16 + 3));
    /// // The second tile, and the first tile of the second row of three tiles.
    /// assert_eq!([Slot::in_picture(40, 16, 0), Slot::in_picture(40, 0, 16)], [Slot(256), Slot(3 * 256)]);
    /// ```
    #[must_use]
    pub fn in_picture(width: usize, x: usize, y: usize) -> Self {
        let tile = y / TILE_SIDE * width.div_ceil(TILE_SIDE) + x / TILE_SIDE;
        Self(tile * TILE_SLOTS + y % TILE_SIDE * TILE_SIDE + x % TILE_SIDE)
    }

    /// Returns the number of the tile, and the place within the tile.
    fn parts(self) -> (usize, usize) {
        (self.0 / TILE_SLOTS, self.0 % TILE_SLOTS)
    }
}

/// Bit set of the existing texels of a tile: texel (x, y) is bit x + 16 y, 64 bits per word.
pub(crate) type Mask = [u64; 4];

/// Texels of an atlas, in tiles of 16×16. Tiles may lack texels.
///
/// Each texel has a [`Slot`]. Existing texels are ranked by slot. A [`Field`](crate::Field) stores samples in order of
/// [`Rank`], which differs from the order of a picture's rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TexelTiles {
    masks: Vec<Mask>,
    /// Total number of texels in the tiles before each tile, then in all tiles.
    before: Vec<usize>,
}

impl TexelTiles {
    /// Creates tiles with the given texels. Texel (x, y) of a tile is bit x + 16 y, 64 bits per word, lowest first.
    #[must_use]
    pub fn new(masks: Vec<[u64; 4]>) -> Self {
        let mut before = Vec::with_capacity(masks.len() + 1);
        let mut texels = 0;
        for mask in &masks {
            before.push(texels);
            texels += count(mask);
        }
        before.push(texels);
        Self { masks, before }
    }

    /// Creates tiles with all texels of a picture of `width` × `height`, in rows from the top left.
    #[must_use]
    pub fn of_picture(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(TILE_SIDE), height.div_ceil(TILE_SIDE));
        let mut masks = vec![[0; 4]; columns * rows];
        for (tile, mask) in masks.iter_mut().enumerate() {
            let (left, top) = (tile % columns * TILE_SIDE, tile / columns * TILE_SIDE);
            // Tiles at the right and lower borders lack the texels outside the picture.
            for bit in 0..TILE_SLOTS {
                let (x, y) = (left + bit % TILE_SIDE, top + bit / TILE_SIDE);
                mask[bit / 64] |= u64::from(x < width && y < height) << (bit % 64);
            }
        }
        Self::new(masks)
    }

    /// Number of tiles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.masks.len()
    }

    /// Returns whether there are no tiles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// Number of existing texels.
    #[must_use]
    pub fn texels(&self) -> usize {
        self.before[self.len()]
    }

    /// Masks of all tiles, in the format of [`TexelTiles::new`].
    #[must_use]
    pub fn masks(&self) -> &[[u64; 4]] {
        &self.masks
    }

    /// Returns the rank of the texel in a slot, or `None` if the slot has no texel.
    #[must_use]
    #[inline]
    pub fn rank(&self, slot: Slot) -> Option<Rank> {
        let (tile, place) = slot.parts();
        let in_tile = rank_in(self.masks.get(tile)?, place)?;
        Some(Rank(self.before[tile] + in_tile))
    }

    /// Iterates over the slots of all texels, by rank.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        let has_texel = |slot: &Slot| {
            let (tile, place) = slot.parts();
            is_set(&self.masks[tile], place)
        };
        (0..self.len() * TILE_SLOTS).map(Slot).filter(has_texel)
    }

    /// Returns the slot of the texel with the given rank.
    ///
    /// # Panics
    ///
    /// If `rank` is not less than the number of texels.
    pub(crate) fn slot(&self, Rank(rank): Rank) -> Slot {
        assert!(rank < self.texels(), "rank {rank} of {} texels", self.texels());
        // Find the tile by the number of preceding texels, then count its present texels.
        let tile = self.before.partition_point(|&before| before <= rank) - 1;
        let mut left = rank - self.before[tile];
        for bit in 0..TILE_SLOTS {
            if is_set(&self.masks[tile], bit) {
                if left == 0 {
                    return Slot(tile * TILE_SLOTS + bit);
                }
                left -= 1;
            }
        }
        unreachable!("tile {tile} has more texels than its mask")
    }

    /// Returns the ranks of the texels of a tile.
    pub(crate) fn ranks(&self, tile: usize) -> std::ops::Range<usize> {
        self.before[tile]..self.before[tile + 1]
    }
}

/// Returns the number of texels in a mask.
pub(crate) fn count(mask: &Mask) -> usize {
    mask.iter().map(|word| word.count_ones() as usize).sum()
}

/// Returns whether a mask contains the texel at `bit`.
#[inline]
pub(crate) fn is_set(mask: &Mask, bit: usize) -> bool {
    mask[bit / 64] >> (bit % 64) & 1 == 1
}

/// Returns the rank, within its tile, of the texel at `bit`.
#[inline]
pub(crate) fn rank_in(mask: &Mask, bit: usize) -> Option<usize> {
    let word = bit / 64;
    if !is_set(mask, bit) {
        return None;
    }
    // Count the set bits before `bit`: in its word, then in the words before it.
    let mut rank = (mask[word] & ((1 << (bit % 64)) - 1)).count_ones();
    for word in &mask[..word] {
        rank += word.count_ones();
    }
    Some(rank as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_count_the_texels_before() {
        let tiles = TexelTiles::of_picture(21, 19);
        assert_eq!((tiles.len(), tiles.texels()), (4, 21 * 19));
        let slots: Vec<usize> = tiles.slots().map(|slot| slot.0).collect();
        // These slots were counted by hand: the tiles have 16×16, 5×16, 16×3 and 5×3 texels.
        assert_eq!([slots[255], slots[256], slots[256 + 5], slots[256 + 80]], [255, 256, 256 + 16, 512]);
        for (rank, &slot) in slots.iter().enumerate() {
            assert_eq!((tiles.rank(Slot(slot)), tiles.slot(Rank(rank))), (Some(Rank(rank)), Slot(slot)));
        }
        let absent = (0..5 * TILE_SLOTS).filter(|slot| !slots.contains(slot));
        for (x, y) in [(0, 0), (20, 3), (3, 18), (20, 18)] {
            assert!(tiles.rank(Slot::in_picture(21, x, y)).is_some());
        }
        assert!(absent.map(|slot| tiles.rank(Slot(slot))).all(|rank| rank.is_none()));
    }
}
