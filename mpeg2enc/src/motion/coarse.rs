//! Wide search at a quarter of the resolution, for macroblocks without good candidates.

use crate::{kernel, predict::place_of, vector::HalfSample};
use plane::Plane;

/// Both pictures at a quarter of the width and height.
#[derive(Clone, Copy)]
pub(crate) struct CoarseSearch<'a> {
    pub source: &'a Plane<u8>,
    pub reference: &'a Plane<u8>,
}

/// Reach of the search in coarse samples: ±64 samples of the picture.
const REACH: i32 = 16;
/// Width of the compared window. It exceeds the macroblock's 4 samples, which would often match by chance.
const WINDOW: usize = 8;

impl CoarseSearch<'_> {
    /// Returns the best vector for macroblock `(column, row)`; it may point outside the picture.
    pub fn search(&self, column: usize, row: usize) -> HalfSample {
        let (width, height) = (self.source.width() as i32, self.source.height() as i32);
        let window = WINDOW as i32;
        if width < window || height < window {
            return HalfSample::ZERO;
        }
        // Center the window on the macroblock, and keep it inside the picture.
        let x = (4 * column as i32 - 2).clamp(0, width - window);
        let y = (4 * row as i32 - 2).clamp(0, height - window);
        let place = |x: i32, y: i32| place_of(self.reference, 2 * x, 2 * y);
        let source = place_of(self.source, 2 * x, 2 * y);
        let mut best = (u32::MAX, HalfSample::ZERO);
        for dy in (-REACH).max(-y)..=REACH.min(height - window - y) {
            for dx in (-REACH).max(-x)..=REACH.min(width - window - x) {
                // In flat areas, prefer shorter vectors.
                let difference = kernel::absolute_difference::<WINDOW>(source, place(x + dx, y + dy));
                let error = (dx.abs() + dy.abs()) as u32 + difference;
                if error < best.0 {
                    best = (error, HalfSample { x: 8 * dx, y: 8 * dy });
                }
            }
        }
        best.1
    }
}

/// Averages 4×4 samples.
pub(crate) fn quarter(plane: &Plane<u8>) -> Plane<u8> {
    Plane::from_fn(plane.width() / 4, plane.height() / 4, |x, y| {
        let mut sum = 0u32;
        for i in 0..4 {
            for &sample in &plane.row(4 * y + i)[4 * x..4 * x + 4] {
                sum += u32::from(sample);
            }
        }
        ((sum + 8) / 16) as u8
    })
}
