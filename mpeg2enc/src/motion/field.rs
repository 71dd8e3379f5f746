//! Candidate vectors from a motion field with one vector per pixel.

use crate::vector::HalfSample;
use plane::{Correspondence, NO_MATCH};
use threads::prelude::*;

/// Vectors to try for one macroblock.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Candidates {
    vectors: [HalfSample; CANDIDATES],
    count: usize,
    /// Whether all pixels were visible before and have equal motion, within half a sample.
    pub one_motion: bool,
    /// Whether some pixel was not visible before.
    pub is_uncovered: bool,
}

impl Candidates {
    pub const NONE: Self =
        Self { vectors: [HalfSample::ZERO; CANDIDATES], count: 0, one_motion: false, is_uncovered: false };

    pub fn vectors(&self) -> &[HalfSample] {
        &self.vectors[..self.count]
    }

    /// Returns whether the number and lengths of the vectors are possible.
    pub fn is_plausible(&self) -> bool {
        self.count <= CANDIDATES && self.vectors().iter().all(HalfSample::is_plausible)
    }

    /// Adds a vector if it is new and capacity remains.
    pub fn add(&mut self, vector: HalfSample) {
        if self.count < CANDIDATES && !self.vectors().contains(&vector) {
            self.vectors[self.count] = vector;
            self.count += 1;
        }
    }
}

/// Maximum number of vectors worth trying. A field supplies the mean and the four most frequent vectors.
const CANDIDATES: usize = 8;
/// Number of most frequent vectors taken from a field.
const FREQUENT: usize = 4;
/// Maximum number of different vectors counted in one macroblock; all others affect only the mean.
const DISTINCT: usize = 24;
/// Length in pixels above which a vector is ignored. It exceeds every picture, and sums of 64ths still fit in the integer type.
const FARTHEST_PX: f32 = 16384.0;

/// Returns the candidates of all macroblocks in raster order.
pub(crate) fn all_candidates(known: &Correspondence, columns: usize, rows: usize) -> Vec<Candidates> {
    (0..columns * rows).into_par_iter().map(|i| candidates(known, i % columns, i / columns)).collect()
}

/// Returns the mean and the most frequent vectors of macroblock `(column, row)`.
fn candidates(known: &Correspondence, column: usize, row: usize) -> Candidates {
    let (left, top) = (16 * column, 16 * row);
    let (width, height) = (known.width(), known.height());
    if left + 16 <= width && top + 16 <= height {
        let first = top * width + left;
        let spread = spread(&known.motion().samples()[first..], &known.matches().samples()[first..], width);
        let mean = mean_of(spread.sum, 16 * SAMPLED_ROWS as i32);
        let near = |half: [i32; 2]| (half[0] - mean.x).abs() <= 1 && (half[1] - mean.y).abs() <= 1;
        // The search then reaches the most frequent vectors as neighbors of the mean.
        if spread.all_known && near(spread.least.map(half_of)) && near(spread.most.map(half_of)) {
            let mut out = Candidates { one_motion: true, ..Candidates::NONE };
            out.add(mean);
            return out;
        }
    }
    several(known, left, top)
}

/// Converts a vector to 64ths of a pixel; `None` without a match, or if the vector is too long.
fn parts(motion_px: [f32; 2], index: u32) -> Option<[i32; 2]> {
    let is_known = index != NO_MATCH && motion_px.iter().all(|component| component.abs() < FARTHEST_PX); // false for NaN
    is_known.then(|| motion_px.map(in_64ths))
}

/// Returns the mean and the most frequent vectors of a macroblock with different motions.
fn several(known: &Correspondence, left: usize, top: usize) -> Candidates {
    let (right, bottom) = ((left + 16).min(known.width()), (top + 16).min(known.height()));
    let columns = left.min(right)..right;
    let mut counts = [(HalfSample::ZERO, 0u32); DISTINCT];
    let (mut distinct, mut latest) = (0, 0);
    let (mut sum, mut count, mut unknown) = ([0; 2], 0, 0);
    // A macroblock may be completely in the padding.
    for y in top..bottom.max(top) {
        let (motion_px, matches) = (&known.motion().row(y)[columns.clone()], &known.matches().row(y)[columns.clone()]);
        for (&motion_px, &index) in motion_px.iter().zip(matches) {
            let Some(parts) = parts(motion_px, index) else {
                unknown += 1;
                continue;
            };
            // Neighboring vectors are usually equal, so compare with the latest vector first.
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
    // Sort the most frequent vectors to the front; sorting ties makes the order unique.
    let counts = &mut counts[..distinct];
    counts.sort_unstable_by_key(|&(vector, count)| (std::cmp::Reverse(count), vector));
    let mut out = Candidates { is_uncovered: unknown > 0, ..Candidates::NONE };
    // Put the mean first, because a quick search of uniform motion uses the first vector.
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

/// Converts a component to 64ths of a pixel. Adding 3·2²² rounds, because the sum has no fractional bits.
#[inline(always)]
fn in_64ths(component_px: f32) -> i32 {
    const ROUNDING: f32 = 12_582_912.0;
    (component_px * 64.0 + ROUNDING).to_bits().wrapping_sub(ROUNDING.to_bits()) as i32
}

/// Converts 64ths of a pixel to half samples.
#[inline(always)]
fn half_of(part: i32) -> i32 {
    (part + 16) >> 5
}

fn mean_of(sum: [i32; 2], count: i32) -> HalfSample {
    let [x, y] = sum.map(|sum| (sum + 16 * count).div_euclid(32 * count));
    HalfSample { x, y }
}

/// Number of rows of vectors sampled to detect uniform motion. Reading all rows would cost twice the memory traffic and seldom
/// change the result.
const SAMPLED_ROWS: usize = 4;

/// Spread of the vectors of 16×16 pixels, in 64ths of a pixel.
#[derive(Debug, PartialEq)]
pub(crate) struct Spread {
    sum: [i32; 2],
    least: [i32; 2],
    most: [i32; 2],
    /// Whether all sampled vectors are known; if not, the other fields are meaningless.
    all_known: bool,
}

vectorized! {
    /// Measures the spread of 16 rows of 16 vectors with their matches; rows are `stride` apart.
    fn spread, spread_plain(motion_px: &[[f32; 2]], matches: &[u32], stride: usize) -> Spread {
        // A row has 32 components: the compiler vectorizes loops of this length, but not shorter nested ones.
        let (mut sum, mut least, mut most, mut farthest) = ([0; 32], [i32::MAX; 32], [i32::MIN; 32], [0; 32]);
        let mut last_match = [0; 16]; // NO_MATCH is the maximum index
        for y in (0..16).step_by(16 / SAMPLED_ROWS) {
            let row: &[f32; 32] = motion_px[y * stride..][..16].as_flattened().try_into().expect("16 vectors");
            for k in 0..32 {
                let part = in_64ths(row[k]);
                sum[k] = i32::wrapping_add(sum[k], part);
                least[k] = least[k].min(part);
                most[k] = most[k].max(part);
                // Magnitudes have the same order as their bit patterns; infinity and NaN are greatest.
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

/// Reduces the horizontal and the vertical components of sixteen vectors with `f`.
#[inline(always)]
fn fold<T: Copy>(mut values: [T; 32], f: fn(T, T) -> T) -> [T; 2] {
    // Reduce by halving, which suits vector instructions.
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
            // NaN motion counts as unknown, even with a match.
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
