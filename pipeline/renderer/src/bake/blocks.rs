//! Blocks of texels that are lit together.

use render_core::Atlas;
use std::collections::BTreeMap;

/// Side of a block \[texels\].
const SIDE: u32 = 8;

/// Block of at most 64 nearby texels of one chart.
pub(super) struct TexelBlock {
    pub texels: Vec<usize>,
}

/// Splits an atlas into blocks.
pub(super) fn blocks(atlas: &Atlas) -> Vec<TexelBlock> {
    let mut by_place: BTreeMap<(u32, u32, u32), Vec<usize>> = BTreeMap::new();
    for texel in 0..atlas.len() {
        let (x, y) = atlas.place(texel);
        by_place.entry((y / SIDE, x / SIDE, atlas.chart(texel))).or_default().push(texel);
    }
    by_place.into_values().map(|texels| TexelBlock { texels }).collect()
}
