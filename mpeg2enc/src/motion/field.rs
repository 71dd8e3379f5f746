//! Motion given from outside, pixel by pixel.

use super::HalfSample;
use plane::Plane;
use rayon::prelude::*;

/// Where each pixel's surface was in the picture before.
///
/// A sample is `motion_px`: the position in the previous picture minus the position in this one, in pixels,
/// x to the right and y down. It is NaN where the surface could not be seen then.
///
/// ```
/// use mpeg2enc::MotionField;
/// use plane::Plane;
/// // The camera pans by 1.5 pixels to the right: all was farther right before.
/// let field = MotionField::new(Plane::filled(64, 48, [1.5, 0.0]));
/// assert_eq!(field.motion_px().width(), 64);
/// ```
#[derive(Clone, Debug)]
pub struct MotionField {
    motion_px: Plane<[f32; 2]>,
    has_uncovered: bool,
}

/// Vectors to be tried for one macroblock.
#[derive(Clone, Copy)]
pub(crate) struct Candidates {
    vectors: [HalfSample; CANDIDATES],
    count: usize,
    /// Every pixel could be seen before and moved like the others, to within half a sample.
    pub one_motion: bool,
}

impl Candidates {
    pub const NONE: Self = Self { vectors: [HalfSample::ZERO; CANDIDATES], count: 0, one_motion: false };

    pub fn vectors(&self) -> &[HalfSample] {
        &self.vectors[..self.count]
    }

    /// Adds a vector if it is new and there is room.
    pub fn add(&mut self, vector: HalfSample) {
        if self.count < CANDIDATES && !self.vectors().contains(&vector) {
            self.vectors[self.count] = vector;
            self.count += 1;
        }
    }
}

/// As many as are ever worth trying; a field gives the mean and the four most frequent vectors.
const CANDIDATES: usize = 8;
/// The most frequent vectors that a field gives.
const FREQUENT: usize = 4;
/// Different vectors that are counted in one macroblock; what is left over then counts for the mean alone.
const DISTINCT: usize = 24;
/// Larger than any picture, and small enough for sums of 256: beyond it a vector is as good as unknown.
const FARTHEST_PX: f32 = 65536.0;

impl MotionField {
    /// Takes one vector per luma sample of the frame.
    pub fn new(motion_px: Plane<[f32; 2]>) -> Self {
        let has_uncovered = motion_px.samples().iter().any(|&motion| !is_known(motion));
        Self { motion_px, has_uncovered }
    }

    /// The vectors, in pixels.
    pub fn motion_px(&self) -> &Plane<[f32; 2]> {
        &self.motion_px
    }

    /// Is there a pixel that could not be seen before?
    pub(crate) fn has_uncovered(&self) -> bool {
        self.has_uncovered
    }

    /// Those of all macroblocks, in raster order.
    pub(crate) fn all_candidates(&self, columns: usize, rows: usize) -> Vec<Candidates> {
        (0..columns * rows).into_par_iter().map(|i| self.candidates(i % columns, i / columns)).collect()
    }

    /// The mean and the most frequent vectors of macroblock `(column, row)`.
    fn candidates(&self, column: usize, row: usize) -> Candidates {
        let (left, top) = (16 * column, 16 * row);
        let (right, bottom) = ((left + 16).min(self.motion_px.width()), (top + 16).min(self.motion_px.height()));
        let mut counts = [(HalfSample::ZERO, 0u32); DISTINCT];
        let mut distinct = 0;
        let (mut sum, mut known, mut unknown) = ([0.0f64; 2], 0, 0);
        // A macroblock may lie wholly in the padding.
        for y in top..bottom.max(top) {
            for &motion in &self.motion_px.row(y)[left.min(right)..right] {
                if !is_known(motion) {
                    unknown += 1;
                    continue;
                }
                known += 1;
                sum = [sum[0] + f64::from(motion[0]), sum[1] + f64::from(motion[1])];
                let vector = half_sample(motion.map(f64::from));
                match counts[..distinct].iter_mut().find(|entry| entry.0 == vector) {
                    Some(entry) => entry.1 += 1,
                    None if distinct < DISTINCT => {
                        counts[distinct] = (vector, 1);
                        distinct += 1;
                    }
                    None => {}
                }
            }
        }
        let counts = &mut counts[..distinct];
        counts.sort_unstable_by_key(|&(vector, count)| (std::cmp::Reverse(count), vector));
        let mut out = Candidates::NONE;
        if known > 0 {
            let mean = half_sample(sum.map(|sum| sum / f64::from(known)));
            out.add(mean);
            out.one_motion =
                unknown == 0 && counts.iter().all(|(v, _)| (v.x - mean.x).abs() <= 1 && (v.y - mean.y).abs() <= 1);
        }
        for &(vector, _) in counts.iter().take(FREQUENT) {
            out.add(vector);
        }
        out
    }
}

fn is_known(motion: [f32; 2]) -> bool {
    motion.iter().all(|component| component.abs() < FARTHEST_PX) // false for NaN
}

fn half_sample(motion_px: [f64; 2]) -> HalfSample {
    HalfSample { x: (2.0 * motion_px[0]).round() as i32, y: (2.0 * motion_px[1]).round() as i32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_frequent_vectors_come_first() {
        let plane = Plane::from_fn(20, 16, |x, _| match x {
            0..10 => [1.0, 0.0],
            10..15 => [-3.0, 2.5],
            15 => [f32::NAN, 0.0],
            _ => [0.25, f32::INFINITY],
        });
        let field = MotionField::new(plane);
        assert!(field.has_uncovered());
        let candidates = field.candidates(0, 0);
        assert!(!candidates.one_motion);
        assert_eq!(candidates.vectors()[1..], [HalfSample { x: 2, y: 0 }, HalfSample { x: -6, y: 5 }]);
        assert!(field.candidates(1, 0).vectors().is_empty());
        assert!(field.candidates(7, 7).vectors().is_empty());
    }

    #[test]
    fn one_motion_is_recognised() {
        let field = MotionField::new(Plane::from_fn(16, 16, |x, _| [2.0 + 0.02 * x as f32, 0.0]));
        assert!(field.candidates(0, 0).one_motion);
    }
}
