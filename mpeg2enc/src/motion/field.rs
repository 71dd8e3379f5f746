//! Motion given from outside, pixel by pixel.

use crate::vector::HalfSample;
use plane::{Correspondence, NO_MATCH};
use rayon::prelude::*;

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

    /// Whether there are no more vectors than fit, and none of them is too long.
    pub fn is_plausible(&self) -> bool {
        self.count <= CANDIDATES && self.vectors().iter().all(HalfSample::is_plausible)
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

/// Candidates of all macroblocks in raster order.
pub(crate) fn all_candidates(known: &Correspondence, columns: usize, rows: usize) -> Vec<Candidates> {
    (0..columns * rows).into_par_iter().map(|i| candidates(known, i % columns, i / columns)).collect()
}

/// The mean and the most frequent vectors of macroblock `(column, row)`.
fn candidates(known: &Correspondence, column: usize, row: usize) -> Candidates {
    let (left, top) = (16 * column, 16 * row);
    let (width, height) = (known.width(), known.height());
    if left + 16 <= width && top + 16 <= height {
        let first = top * width + left;
        let spread = spread(&known.motion().samples()[first..], &known.matches().samples()[first..], width);
        let mean = mean_of(spread.sum, 16 * SAMPLED_ROWS as i32);
        let near = |half: [i32; 2]| (half[0] - mean.x).abs() <= 1 && (half[1] - mean.y).abs() <= 1;
        // The most frequent ones are looked at as neighbors of the mean then.
        if spread.all_known && near(spread.least.map(half_of)) && near(spread.most.map(half_of)) {
            let mut out = Candidates { one_motion: true, ..Candidates::NONE };
            out.add(mean);
            return out;
        }
    }
    several(known, left, top)
}

/// A vector in 64ths of a pixel; none where nothing corresponds or the vector is too long.
fn parts(motion_px: [f32; 2], index: u32) -> Option<[i32; 2]> {
    let is_known = index != NO_MATCH && motion_px.iter().all(|component| component.abs() < FARTHEST_PX); // false for NaN
    is_known.then(|| motion_px.map(in_64ths))
}

/// The mean and the most frequent vectors of a macroblock that is not of one motion.
fn several(known: &Correspondence, left: usize, top: usize) -> Candidates {
    let (right, bottom) = ((left + 16).min(known.width()), (top + 16).min(known.height()));
    let columns = left.min(right)..right;
    let mut counts = [(HalfSample::ZERO, 0u32); DISTINCT];
    let (mut distinct, mut latest) = (0, 0);
    let (mut sum, mut count, mut unknown) = ([0; 2], 0, 0);
    // A macroblock may lie wholly in the padding.
    for y in top..bottom.max(top) {
        let (motion_px, matches) = (&known.motion().row(y)[columns.clone()], &known.matches().row(y)[columns.clone()]);
        for (&motion_px, &index) in motion_px.iter().zip(matches) {
            let Some(parts) = parts(motion_px, index) else {
                unknown += 1;
                continue;
            };
            count += 1;
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
    if count > 0 {
        let mean = mean_of(sum, count);
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

vectorized! {
    /// The spread of 16 rows of 16 vectors with their matches, which begin `stride` apart.
    fn spread, spread_plain(motion_px: &[[f32; 2]], matches: &[u32], stride: usize) -> Spread {
        // A row is 32 components: the compiler vectorizes loops of that length, and no nested shorter ones.
        let (mut sum, mut least, mut most, mut farthest) = ([0; 32], [i32::MAX; 32], [i32::MIN; 32], [0; 32]);
        let mut last_match = [0; 16]; // NO_MATCH is the last index
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
            let row: &[u32; 16] = matches[y * stride..][..16].try_into().expect("16 matches");
            for k in 0..16 {
                last_match[k] = u32::max(last_match[k], row[k]);
            }
        }
        Spread {
            sum: fold(sum, i32::wrapping_add),
            least: fold(least, i32::min),
            most: fold(most, i32::max),
            all_known: farthest.iter().all(|&bits| bits < FARTHEST_PX.to_bits() as i32)
                && last_match.iter().all(|&index| index != NO_MATCH),
        }
    }
}

/// The horizontal and the vertical components of sixteen vectors, each reduced by `f`.
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
    use plane::Plane;

    #[test]
    fn the_most_frequent_vectors_come_first() {
        let known = Correspondence::from_motion(Plane::from_fn(20, 16, |x, _| match x {
            0..10 => [1.0, 0.0],
            10..15 => [-3.0, 2.5],
            15 => [f32::NAN, 0.0],
            _ => [0.25, f32::INFINITY],
        }));
        let found = candidates(&known, 0, 0);
        assert!(found.is_uncovered);
        assert!(!found.one_motion);
        assert_eq!(found.vectors()[1..], [HalfSample { x: 2, y: 0 }, HalfSample { x: -6, y: 5 }]);
        assert!(candidates(&known, 1, 0).vectors().is_empty());
        assert!(candidates(&known, 7, 7).vectors().is_empty());
    }

    #[test]
    fn one_motion_is_recognized() {
        for (slope, one_motion) in [(0.02, true), (0.05, true), (0.2, false), (-0.2, false), (f32::NAN, false)] {
            let plane = Plane::from_fn(16, 16, |x, _| [2.0 + slope * x as f32, -0.75]);
            // A motion that is not a number counts as unknown whatever its match.
            let all_match = Correspondence::new(plane.clone(), Plane::filled(16, 16, 0)).unwrap();
            for known in [Correspondence::from_motion(plane), all_match] {
                let (quick, thorough) = (candidates(&known, 0, 0), several(&known, 0, 0));
                assert_eq!(quick.one_motion, one_motion, "{slope}");
                assert_eq!(thorough.one_motion, one_motion, "{slope}");
                assert_eq!(quick.vectors().first(), thorough.vectors().first(), "the mean");
                let (motion, matches) = (known.motion().samples(), known.matches().samples());
                let (a, b) = (spread(motion, matches, 16), spread_plain(motion, matches, 16));
                assert!(a == b || !a.all_known && !b.all_known, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn a_pixel_without_match_is_uncovered_whatever_its_motion() {
        let motion = Plane::filled(16, 16, [2.0, 1.0]);
        for (x, y) in [(0, 0), (15, 4), (7, 13)] {
            let matches = Plane::from_fn(16, 16, |column, row| if (column, row) == (x, y) { NO_MATCH } else { 0 });
            let known = Correspondence::new(motion.clone(), matches).unwrap();
            let all_known = spread(motion.samples(), known.matches().samples(), 16).all_known;
            assert_eq!(all_known, y % (16 / SAMPLED_ROWS) != 0, "column {x}, row {y}");
            let found = several(&known, 0, 0);
            assert!(found.is_uncovered && !found.one_motion);
            assert_eq!(found.vectors(), [HalfSample { x: 4, y: 2 }]);
        }
    }
}
