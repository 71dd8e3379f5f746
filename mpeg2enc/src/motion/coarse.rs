//! A wide search at a quarter of the resolution, for macroblocks whose motion nothing foretells.

use super::HalfSample;
use plane::Plane;

/// Both pictures at a quarter of the width and height.
#[derive(Clone, Copy)]
pub(crate) struct CoarseSearch<'a> {
    pub source: &'a Plane<u8>,
    pub reference: &'a Plane<u8>,
}

/// Reach of the search in coarse samples: ±64 samples of the picture.
const REACH: i32 = 16;
/// The window is larger than the macroblock's 4 samples, which alone would match by chance.
const WINDOW: usize = 8;

impl CoarseSearch<'_> {
    /// The best vector for macroblock `(column, row)`; one that leaves the picture may come out.
    pub fn search(&self, column: usize, row: usize) -> HalfSample {
        let (width, height) = (self.source.width() as i32, self.source.height() as i32);
        let window = WINDOW as i32;
        if width < window || height < window {
            return HalfSample::ZERO;
        }
        let x = (4 * column as i32 - 2).clamp(0, width - window);
        let y = (4 * row as i32 - 2).clamp(0, height - window);
        let mut source = [[0; WINDOW]; WINDOW];
        for (i, line) in source.iter_mut().enumerate() {
            line.copy_from_slice(&self.source.row(y as usize + i)[x as usize..][..WINDOW]);
        }
        let mut best = (u32::MAX, HalfSample::ZERO);
        for dy in (-REACH).max(-y)..=REACH.min(height - window - y) {
            for dx in (-REACH).max(-x)..=REACH.min(width - window - x) {
                // Shorter vectors win where the picture is flat.
                let mut error = (dx.abs() + dy.abs()) as u32;
                for (i, line) in source.iter().enumerate() {
                    let row: &[u8; WINDOW] = self.reference.row((y + dy) as usize + i)[(x + dx) as usize..][..WINDOW]
                        .try_into()
                        .expect("8 samples");
                    error += line.iter().zip(row).map(|(&a, &b)| u32::from(a.abs_diff(b))).sum::<u32>();
                }
                if error < best.0 {
                    best = (error, HalfSample { x: 8 * dx, y: 8 * dy });
                }
            }
        }
        best.1
    }
}

/// Means of 4×4 samples.
pub(crate) fn quarter(plane: &Plane<u8>) -> Plane<u8> {
    Plane::from_fn(plane.width() / 4, plane.height() / 4, |x, y| {
        let sum: u32 =
            (0..4).flat_map(|i| plane.row(4 * y + i)[4 * x..4 * x + 4].iter()).map(|&sample| u32::from(sample)).sum();
        ((sum + 8) / 16) as u8
    })
}
