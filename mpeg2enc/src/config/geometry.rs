//! Sizes of coded pictures, and the quantisers available to them.

use super::Config;
use crate::{Standard, quantiser_scale::quantiser_scale_code};

/// Returns the value of horizontal_size or vertical_size. Its low 12 bits must not be zero (6.3.3), so a multiple of 4096 is
/// coded one sample larger. The display size contains the requested size.
pub(crate) fn coded_size(size: usize) -> u32 {
    let size = size as u32;
    if size.is_multiple_of(4096) { size + 1 } else { size }
}

impl Config {
    /// Returns horizontal_size and vertical_size (6.3.3).
    pub(crate) fn coded_size(&self) -> (u32, u32) {
        (coded_size(self.width), coded_size(self.height))
    }

    /// Returns the width and height in whole macroblocks: mb_width and mb_height (6.3.3).
    pub(crate) fn macroblock_counts(&self) -> (usize, usize) {
        let (width, height) = self.coded_size();
        // In sequences that are not progressive, each field has whole macroblocks.
        let rows = if self.pulldown { 2 * height.div_ceil(32) } else { height.div_ceil(16) };
        (width.div_ceil(16) as usize, rows as usize)
    }

    /// Returns the finest quantiser_scale of the standard that is at least `least`, or the coarsest one if all are finer.
    pub(crate) fn quantiser_at_least(&self, least: u32) -> u32 {
        let coarsest = match self.standard {
            Standard::Mpeg1 => 62,
            Standard::Mpeg2 => 112,
        };
        let exists = |scale: &u32| match self.standard {
            Standard::Mpeg1 => scale.is_multiple_of(2),
            Standard::Mpeg2 => quantiser_scale_code(*scale).is_ok(),
        };
        (least..=coarsest).find(exists).unwrap_or(coarsest)
    }

    /// Returns the width and height of the requested picture in macroblocks, rounded up.
    pub(crate) fn shown_macroblocks(&self) -> (usize, usize) {
        (self.width.div_ceil(16), self.height.div_ceil(16))
    }
}
