//! Texels in use within a large rectangle, and their indices.

use super::NONE;

/// Side of a tile \[texels\].
const SIDE: u32 = 16;
/// Number of words in a tile's mask.
const WORDS: usize = 4;

/// Square of 16×16 texels with at least one texel in use.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct TexelTile {
    /// Index of the square, in raster order.
    cell: u32,
    /// Index of the tile's first texel in use.
    first: u32,
    /// Mask of the texels in use, in raster order, starting with the lowest bit of the first word.
    mask: [u64; WORDS],
}

impl TexelTile {
    fn count(&self) -> u32 {
        self.mask.iter().map(|word| word.count_ones()).sum()
    }
}

/// Tiles with a texel in use, in raster order. Texel indices follow the order of tiles and, within each tile, the
/// raster order.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Tiles {
    /// Number of squares in a row.
    columns: u32,
    /// Index of each square's tile, or [`NONE`].
    grid: Vec<u32>,
    tiles: Vec<TexelTile>,
}

/// Marked texels, before indices are assigned.
pub(super) struct Marks {
    columns: u32,
    masks: Vec<[u64; WORDS]>,
}

/// Returns the word and the bit of a texel in its tile.
fn bit(x: u32, y: u32) -> (usize, u32) {
    let bit = y % SIDE * SIDE + x % SIDE;
    ((bit / u64::BITS) as usize, bit % u64::BITS)
}

impl Marks {
    /// Returns a rectangle of `width` × `height` texels without marks.
    pub fn new(width: u32, height: u32) -> Self {
        let (columns, rows) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        Self { columns, masks: vec![[0; WORDS]; columns as usize * rows as usize] }
    }

    pub fn set(&mut self, x: u32, y: u32) {
        let (word, bit) = bit(x, y);
        self.masks[(y / SIDE * self.columns + x / SIDE) as usize][word] |= 1 << bit;
    }

    /// Assigns indices to the marked texels.
    pub fn numbered(self) -> Tiles {
        let mut tiles = Tiles { columns: self.columns, grid: vec![NONE; self.masks.len()], tiles: Vec::new() };
        let mut first = 0;
        // Keep only tiles with a mark. Indices continue from tile to tile.
        for (cell, mask) in self.masks.into_iter().enumerate().filter(|(_, mask)| *mask != [0; WORDS]) {
            tiles.grid[cell] = tiles.tiles.len() as u32;
            let tile = TexelTile { cell: cell as u32, first, mask };
            first += tile.count();
            tiles.tiles.push(tile);
        }
        tiles
    }
}

impl Tiles {
    pub fn len(&self) -> usize {
        self.tiles.len()
    }

    /// Returns the number of texels in use.
    pub fn texels(&self) -> usize {
        self.tiles.last().map_or(0, |last| (last.first + last.count()) as usize)
    }

    /// Returns the width and height of the rectangle \[texels\].
    pub fn size(&self) -> (u32, u32) {
        (self.columns * SIDE, (self.grid.len() as u32).checked_div(self.columns).unwrap_or(0) * SIDE)
    }

    /// Returns the index of a texel, or `None` if it is not in use.
    pub fn index(&self, x: u32, y: u32) -> Option<u32> {
        // Find the tile. Columns beyond the last would alias to the next row of tiles.
        let column = x / SIDE;
        let cell = (y / SIDE) as usize * self.columns as usize + column as usize;
        let tile = *self.grid.get(cell).filter(|&&tile| column < self.columns && tile != NONE)?;
        let TexelTile { first, mask, .. } = self.tiles[tile as usize];

        // Count the preceding texels: in the previous words, and in the lower bits of the texel's word.
        let (word, bit) = bit(x, y);
        let before: u32 = mask[..word].iter().map(|word| word.count_ones()).sum();
        let lower = mask[word] & ((1 << bit) - 1);
        (mask[word] >> bit & 1 == 1).then(|| first + before + lower.count_ones())
    }

    /// Returns the column and row of a texel in use.
    pub fn place(&self, index: u32) -> (u32, u32) {
        // Find the word of the mask that contains the texel.
        let TexelTile { cell, first, mask } = self.tiles[self.tiles.partition_point(|tile| tile.first <= index) - 1];
        let (mut word, mut rest) = (0, index - first);
        while rest >= mask[word].count_ones() {
            (word, rest) = (word + 1, rest - mask[word].count_ones());
        }

        // Clear the lowest set bits, which precede the texel.
        let mut bits = mask[word];
        for _ in 0..rest {
            bits &= bits - 1;
        }
        let bit = word as u32 * u64::BITS + bits.trailing_zeros();
        (cell % self.columns * SIDE + bit % SIDE, cell / self.columns * SIDE + bit / SIDE)
    }

    /// Returns whether grid and tiles are consistent and the tiles are numbered in order.
    pub fn is_valid(&self) -> bool {
        let is_rectangle = self.columns > 0 && self.grid.len().is_multiple_of(self.columns as usize);
        let mut next = (0u32, 0);
        for (cell, &tile) in self.grid.iter().enumerate().filter(|&(_, &tile)| tile != NONE) {
            // Track the index of the next tile and of its first texel in `next`.
            let Some(found) = self.tiles.get(tile as usize) else { return false };
            let (index, first) = next;
            if tile != index || found.cell as usize != cell || found.first != first || found.count() == 0 {
                return false;
            }
            let Some(after) = first.checked_add(found.count()) else { return false };
            next = (index + 1, after);
        }
        is_rectangle && next.0 as usize == self.tiles.len() && self.has_size()
    }

    /// Returns whether the numbers of columns and rows are within their limits.
    fn has_size(&self) -> bool {
        let rows = self.grid.len() / self.columns as usize;
        [self.columns as usize, rows].iter().all(|&side| side < (1 << 24))
    }
}
