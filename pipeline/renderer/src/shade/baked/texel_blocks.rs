//! Values that are constant over blocks of texels, computed when a ray first ends in a block.
//!
//! A value depends only on its block, so results do not depend on the order of rays.

use render_core::Atlas;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Mutex;

/// Number of maps that share the blocks, so that threads rarely wait for each other.
const MAPS: usize = 64;

/// Values of blocks of texels.
pub(super) struct TexelBlocks<T> {
    /// Side of a block \[texels\].
    side: u32,
    maps: Vec<Mutex<HashMap<Block, T, BuildHasherDefault<Mixed>>>>,
}

/// Square of texels of one chart: its column and row, and the chart.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Block(u32, u32, u32);

/// Hash of a few numbers, by multiplication.
#[derive(Default)]
struct Mixed(u64);

impl Hasher for Mixed {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u32(byte.into());
        }
    }

    fn write_u32(&mut self, number: u32) {
        self.0 = (self.0.rotate_left(5) ^ u64::from(number)).wrapping_mul(0x517c_c1b7_2722_0a95);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

impl<T: Copy> TexelBlocks<T> {
    /// Creates blocks of about `side` meters.
    pub fn new(atlas: &Atlas, side: f32) -> Self {
        let side = (side * atlas.texels_per_meter()).round().clamp(1.0, 4096.0) as u32;
        Self { side, maps: (0..MAPS).map(|_| Mutex::default()).collect() }
    }

    /// Returns the value of the block with a `texel`. `compute` computes it at another texel of the block.
    pub fn value(&self, atlas: &Atlas, texel: u32, compute: impl FnOnce(usize) -> T) -> T {
        let (x, y) = atlas.place(texel as usize);
        let block = Block(x / self.side, y / self.side, atlas.chart(texel as usize));
        let map = &self.maps[(block.0 ^ block.1 << 3) as usize % MAPS];
        if let Some(&known) = map.lock().expect("no thread panics").get(&block) {
            return known;
        }
        let computed = compute(self.middle(atlas, block).unwrap_or(texel) as usize);
        map.lock().expect("no thread panics").insert(block, computed);
        computed
    }

    /// Returns a texel of a block near its middle.
    fn middle(&self, atlas: &Atlas, Block(column, row, chart): Block) -> Option<u32> {
        let half = self.side / 2;
        let at = |x: u32, y: u32| {
            let texel = atlas.texel(column * self.side + x, row * self.side + y)?;
            (atlas.chart(texel as usize) == chart).then_some(texel)
        };
        // Most blocks have a texel in the middle. In the others, take the first texel by rows.
        at(half, half).or_else(|| (0..self.side * self.side).find_map(|place| at(place % self.side, place / self.side)))
    }
}
