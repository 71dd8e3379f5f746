//! Motion given from outside, pixel by pixel.

use super::HalfSample;
use plane::Plane;
use rayon::prelude::*;

/// Where each pixel's surface was in the picture before.
///
/// A sample is the position in the previous picture minus the position in this one, x to the right and y down.
///
/// ```
/// use mpeg2enc::MotionField;
/// use plane::Plane;
/// // The camera pans by 1.5 pixels to the right: all was farther right before.
/// let field = MotionField::new(Plane::filled(64, 48, [1.5, 0.0]));
/// let same = MotionField::from_64ths(Plane::filled(64, 48, [96, 0]));
/// assert_eq!((field.width(), field.height()), (same.width(), same.height()));
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MotionField {
    vectors: Vectors,
}

/// One vector per luma sample.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Vectors {
    Pixels(Plane<[f32; 2]>),
    Parts(Plane<[i16; 2]>),
}

/// Vectors to be tried for one macroblock.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Candidates {
    vectors: [HalfSample; CANDIDATES],
    count: usize,
    /// Every pixel could be seen before and moved like the others, to within half a sample.
    pub one_motion: bool,
    /// Some pixel could not be seen before.
    pub is_uncovered: bool,
}

impl Candidates {
    pub const NONE: Self =
        Self { vectors: [HalfSample::ZERO; CANDIDATES], count: 0, one_motion: false, is_uncovered: false };

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
/// Larger than any picture, and small enough for 64ths and their sums: beyond it a vector is as good as unknown.
const FARTHEST_PX: f32 = 16384.0;

impl MotionField {
    /// Takes one vector per luma sample of the frame, in pixels: NaN where the surface could not be seen in the picture
    /// before.
    pub fn new(motion_px: Plane<[f32; 2]>) -> Self {
        Self { vectors: Vectors::Pixels(motion_px) }
    }

    /// The same in 64ths of a pixel, which takes half of the memory and less time: a component of `i16::MIN` where the
    /// surface could not be seen.
    pub fn from_64ths(motion: Plane<[i16; 2]>) -> Self {
        Self { vectors: Vectors::Parts(motion) }
    }

    /// Vectors in a row.
    pub fn width(&self) -> usize {
        match &self.vectors {
            Vectors::Pixels(plane) => plane.width(),
            Vectors::Parts(plane) => plane.width(),
        }
    }

    /// Rows of vectors.
    pub fn height(&self) -> usize {
        match &self.vectors {
            Vectors::Pixels(plane) => plane.height(),
            Vectors::Parts(plane) => plane.height(),
        }
    }

    /// Gives back what [`from_64ths`](Self::from_64ths) took, so that the next field can have its memory.
    pub fn into_64ths(self) -> Option<Plane<[i16; 2]>> {
        match self.vectors {
            Vectors::Pixels(_) => None,
            Vectors::Parts(plane) => Some(plane),
        }
    }

    /// Those of all macroblocks, in raster order.
    pub(crate) fn all_candidates(&self, columns: usize, rows: usize) -> Vec<Candidates> {
        (0..columns * rows).into_par_iter().map(|i| self.candidates(i % columns, i / columns)).collect()
    }

    /// The mean and the most frequent vectors of macroblock `(column, row)`.
    fn candidates(&self, column: usize, row: usize) -> Candidates {
        match &self.vectors {
            Vectors::Pixels(plane) => candidates(plane, spread, column, row),
            Vectors::Parts(plane) => candidates(plane, spread_of_parts, column, row),
        }
    }
}

/// A vector as it was given.
trait Given: Copy {
    /// In 64ths of a pixel; nothing if it is not known.
    fn parts(self) -> Option<[i32; 2]>;
}

impl Given for [f32; 2] {
    fn parts(self) -> Option<[i32; 2]> {
        let is_known = self.iter().all(|component| component.abs() < FARTHEST_PX); // false for NaN
        is_known.then(|| self.map(in_64ths))
    }
}

impl Given for [i16; 2] {
    fn parts(self) -> Option<[i32; 2]> {
        let is_known = !self.contains(&i16::MIN);
        is_known.then(|| self.map(i32::from))
    }
}

/// The mean and the most frequent vectors of macroblock `(column, row)`.
fn candidates<V: Given>(
    vectors: &Plane<V>,
    spread: impl Fn(&[V], usize) -> Spread,
    column: usize,
    row: usize,
) -> Candidates {
    let (left, top) = (16 * column, 16 * row);
    let (width, height) = (vectors.width(), vectors.height());
    if left + 16 <= width && top + 16 <= height {
        let spread = spread(&vectors.samples()[top * width + left..], width);
        let mean = mean_of(spread.sum, 16 * SAMPLED_ROWS as i32);
        let near = |half: [i32; 2]| (half[0] - mean.x).abs() <= 1 && (half[1] - mean.y).abs() <= 1;
        // The most frequent ones are looked at as neighbours of the mean then.
        if spread.all_known && near(spread.least.map(half_of)) && near(spread.most.map(half_of)) {
            let mut out = Candidates { one_motion: true, ..Candidates::NONE };
            out.add(mean);
            return out;
        }
    }
    several(vectors, left, top)
}

/// The mean and the most frequent vectors of a macroblock that is not of one motion.
fn several<V: Given>(vectors: &Plane<V>, left: usize, top: usize) -> Candidates {
    let (right, bottom) = ((left + 16).min(vectors.width()), (top + 16).min(vectors.height()));
    let mut counts = [(HalfSample::ZERO, 0u32); DISTINCT];
    let (mut distinct, mut latest) = (0, 0);
    let (mut sum, mut known, mut unknown) = ([0; 2], 0, 0);
    // A macroblock may lie wholly in the padding.
    for y in top..bottom.max(top) {
        for vector in &vectors.row(y)[left.min(right)..right] {
            let Some(parts) = vector.parts() else {
                unknown += 1;
                continue;
            };
            known += 1;
            sum = [sum[0] + parts[0], sum[1] + parts[1]];
            let vector = HalfSample { x: half_of(parts[0]), y: half_of(parts[1]) };
            if counts[latest].0 != vector || distinct == 0 {
                latest = counts[..distinct].iter().position(|entry| entry.0 == vector).unwrap_or(distinct);
                if latest == DISTINCT {
                    latest = 0;
                    continue;
                }
                distinct = distinct.max(latest + 1);
                counts[latest].0 = vector;
            }
            counts[latest].1 += 1;
        }
    }
    let counts = &mut counts[..distinct];
    counts.sort_unstable_by_key(|&(vector, count)| (std::cmp::Reverse(count), vector));
    let mut out = Candidates { is_uncovered: unknown > 0, ..Candidates::NONE };
    if known > 0 {
        let mean = mean_of(sum, known);
        out.add(mean);
        out.one_motion =
            unknown == 0 && counts.iter().all(|(v, _)| (v.x - mean.x).abs() <= 1 && (v.y - mean.y).abs() <= 1);
    }
    for &(vector, _) in counts.iter().take(FREQUENT) {
        out.add(vector);
    }
    out
}

/// A component in 64ths of a pixel: the sum with 3·2²² has no bits left for a fraction.
#[inline(always)]
fn in_64ths(component_px: f32) -> i32 {
    const ROUNDING: f32 = 12_582_912.0;
    (component_px * 64.0 + ROUNDING).to_bits().wrapping_sub(ROUNDING.to_bits()) as i32
}

/// Half samples of 64ths of a pixel.
#[inline(always)]
fn half_of(part: i32) -> i32 {
    (part + 16) >> 5
}

fn mean_of(sum: [i32; 2], count: i32) -> HalfSample {
    let [x, y] = sum.map(|sum| (sum + 16 * count).div_euclid(32 * count));
    HalfSample { x, y }
}

/// Rows of vectors of a macroblock that are looked at to tell whether it is of one motion: all of them differ too little to pay
/// for reading twice the memory.
const SAMPLED_ROWS: usize = 4;

/// How far the vectors of 16×16 pixels lie apart, in 64ths of a pixel.
#[derive(Debug, PartialEq)]
pub(crate) struct Spread {
    sum: [i32; 2],
    least: [i32; 2],
    most: [i32; 2],
    /// Nothing else means anything if this is false.
    all_known: bool,
}

vectorised! {
    /// The spread of 16 rows of 16 vectors, which begin `stride` apart.
    fn spread, spread_plain(motion_px: &[[f32; 2]], stride: usize) -> Spread {
        // A row is 32 components: the compiler makes vectors of loops over so many, and of none over nested shorter ones.
        let (mut sum, mut least, mut most, mut farthest) = ([0; 32], [i32::MAX; 32], [i32::MIN; 32], [0; 32]);
        for y in (0..16).step_by(16 / SAMPLED_ROWS) {
            let row: &[f32; 32] = motion_px[y * stride..][..16].as_flattened().try_into().expect("16 vectors");
            for k in 0..32 {
                let part = in_64ths(row[k]);
                sum[k] = i32::wrapping_add(sum[k], part);
                least[k] = least[k].min(part);
                most[k] = most[k].max(part);
                // Magnitudes and their bits are in the same order, infinity and NaN last.
                farthest[k] = i32::max(farthest[k], row[k].abs().to_bits() as i32);
            }
        }
        Spread {
            sum: fold(sum, i32::wrapping_add),
            least: fold(least, i32::min),
            most: fold(most, i32::max),
            all_known: farthest.iter().all(|&bits| bits < FARTHEST_PX.to_bits() as i32),
        }
    }
}

vectorised! {
    /// The spread of 16 rows of 16 vectors in 64ths, which begin `stride` apart.
    fn spread_of_parts, spread_of_parts_plain(motion: &[[i16; 2]], stride: usize) -> Spread {
        let (mut sum, mut least, mut most) = ([0; 32], [i16::MAX; 32], [i16::MIN; 32]);
        for y in (0..16).step_by(16 / SAMPLED_ROWS) {
            let row: &[i16; 32] = motion[y * stride..][..16].as_flattened().try_into().expect("16 vectors");
            for k in 0..32 {
                sum[k] += i32::from(row[k]);
                least[k] = least[k].min(row[k]);
                most[k] = most[k].max(row[k]);
            }
        }
        let least = fold(least, i16::min);
        Spread {
            sum: fold(sum, i32::wrapping_add),
            least: least.map(i32::from),
            most: fold(most, i16::max).map(i32::from),
            all_known: !least.contains(&i16::MIN),
        }
    }
}

/// What becomes of the horizontal and of the vertical components of sixteen vectors.
#[inline(always)]
fn fold<T: Copy>(mut values: [T; 32], f: fn(T, T) -> T) -> [T; 2] {
    // By halves, which vector instructions can do.
    for half in [16, 8, 4, 2] {
        for k in 0..half {
            values[k] = f(values[k], values[k + half]);
        }
    }
    [values[0], values[1]]
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
        let candidates = field.candidates(0, 0);
        assert!(candidates.is_uncovered);
        assert!(!candidates.one_motion);
        assert_eq!(candidates.vectors()[1..], [HalfSample { x: 2, y: 0 }, HalfSample { x: -6, y: 5 }]);
        assert!(field.candidates(1, 0).vectors().is_empty());
        assert!(field.candidates(7, 7).vectors().is_empty());
    }

    #[test]
    fn one_motion_is_recognised() {
        for (slope, one_motion) in [(0.02, true), (0.05, true), (0.2, false), (-0.2, false), (f32::NAN, false)] {
            let plane = Plane::from_fn(16, 16, |x, _| [2.0 + slope * x as f32, -0.75]);
            let field = MotionField::new(plane.clone());
            let (quick, thorough) = (field.candidates(0, 0), several(&plane, 0, 0));
            assert_eq!(quick.one_motion, one_motion, "{slope}");
            assert_eq!(thorough.one_motion, one_motion, "{slope}");
            assert_eq!(quick.vectors().first(), thorough.vectors().first(), "the mean");
            let (a, b) = (spread(plane.samples(), 16), spread_plain(plane.samples(), 16));
            assert!(a == b || !a.all_known && !b.all_known, "{a:?} {b:?}");
            // The same in 64ths.
            let parts = plane.map(|v| if v[0].is_nan() { [i16::MIN, 0] } else { v.map(|c| in_64ths(c) as i16) });
            let (c, d) = (spread_of_parts(parts.samples(), 16), spread_of_parts_plain(parts.samples(), 16));
            assert_eq!(c, d);
            assert!(a == c || !a.all_known && !c.all_known, "{a:?} {c:?}");
            let field = MotionField::from_64ths(parts);
            assert_eq!(field.candidates(0, 0).vectors(), quick.vectors());
            assert_eq!(field.candidates(0, 0).one_motion, quick.one_motion);
        }
    }
}
