//! The thesis's coding: piecewise linear segments over the direction index, with indexed colors [LinkopingThesis, 5.2
//! and 7.2.4].
//!
//! Some of the codes v(0), v(1), … of a texel in all directions are stored as keys. Between keys s and e,
//!
//! ```text
//! v'(j) = v(s) + (v(e) − v(s)) (j − s) / (e − s)       err_c(j) = v_c(j) − v'_c(j), for the channels c
//! ```
//!
//! A segment that starts at s extends to e while [`SegmentRule`] allows it, given a threshold T. With T = 0 the coding
//! is lossless. A key consists of a direction index and a color index, 16 bits each. Objects with more than 65 536
//! colors are split.
//!
//! # Differences from the thesis
//!
//! The pseudocode of the thesis compares each difference with the previous difference, which does not bound the error.
//! The largest errors that the thesis prints match [`SegmentRule::Checked`]. The thesis's color tables contain all
//! colors of an object. These color tables contain only the colors of keys.

use lightfield::{Field, LogScale, LookUp, Rank, Samples, Slot, TexelTiles};
use rayon::prelude::*;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Number of colors with a 16-bit index.
const MOST_COLORS: usize = 1 << 16;

/// Codes of a color, one per channel.
type Color = [u8; 3];

/// Rule for the length of a segment. In both rules, no step v(j + 1) − v(j) of a channel has the opposite sign of the
/// segment's first step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentRule {
    /// The segment continues while Σ_c |err_c(j)| < T and |err_c(j)| < T/2 for all j between s and e. The mean error of
    /// the channels is below T/3.
    Checked,
    /// The segment continues while the deviation from its initial line, `v(e) − v(s) − (e − s) d_s` with `d_s = v(s +
    /// 1) − v(s)`, satisfies the same limits. Errors may exceed T/3.
    FirstDifference,
}

/// A field of 8-bit codes, stored as segments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segmented {
    tiles: TexelTiles,
    directions: usize,
    /// Index of the first key of each texel, by rank, and the total number of keys.
    starts: Vec<usize>,
    /// Direction index of each key.
    positions: Vec<u16>,
    /// Color index of each key.
    colors: Vec<u16>,
    objects: Vec<Object>,
}

/// Texels that share a table of colors.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Object {
    /// Rank of the object's first texel.
    first: usize,
    table: Vec<Color>,
}

/// Direction index and color of a key.
#[derive(Clone, Copy)]
struct Key {
    position: u16,
    color: Color,
}

impl Segmented {
    /// Encodes a field as segments with the threshold T.
    ///
    /// # Panics
    ///
    /// If the codes of the field are not 8-bit codes.
    pub fn encode(field: &Field, threshold: u16, rule: SegmentRule) -> Self {
        let Samples::Bytes(codes) = field.samples() else { panic!("segments hold 8-bit codes alone") };
        let directions = field.directions();
        let mut stored = Self {
            tiles: field.tiles().clone(),
            directions,
            starts: vec![0],
            positions: Vec::new(),
            colors: Vec::new(),
            objects: Vec::new(),
        };

        // Encode in batches, to bound the memory for keys without color indices.
        let mut numbers = HashMap::new();
        for batch in codes.chunks(4096 * directions * 3) {
            let texels: Vec<Vec<Key>> =
                batch.par_chunks(directions * 3).map(|texel| keys(texel, i64::from(threshold), rule)).collect();
            for texel in texels {
                stored.push(&texel, &mut numbers);
            }
        }
        stored
    }

    /// Adds the keys of the next texel. `numbers` contains the color indices of the last object.
    fn push(&mut self, texel: &[Key], numbers: &mut HashMap<Color, u16>) {
        // A texel with too many colors for the table starts a new object.
        if self.objects.is_empty() || numbers.len() + texel.len() > MOST_COLORS {
            numbers.clear();
            self.objects.push(Object { first: self.starts.len() - 1, table: Vec::new() });
        }
        let table = &mut self.objects.last_mut().expect("one to begin with").table;
        for key in texel {
            let next = numbers.len() as u16;
            let number = match numbers.entry(key.color) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(new) => {
                    table.push(key.color);
                    *new.insert(next)
                }
            };
            self.positions.push(key.position);
            self.colors.push(number);
        }
        self.starts.push(self.positions.len());
    }

    /// Returns the number of keys.
    #[must_use]
    pub fn keys(&self) -> usize {
        self.positions.len()
    }

    /// Returns the size in bytes, counted as in the thesis. A texel takes 4 bytes (the index of its first key), a key 4
    /// (direction and color), a color of a table 3.
    #[must_use]
    pub fn size(&self) -> usize {
        let colors: usize = self.objects.iter().map(|object| object.table.len()).sum();
        4 * self.tiles.texels() + 4 * self.keys() + 3 * colors
    }

    /// Returns a reader with a linear search over the keys of a texel, as in the thesis.
    #[must_use]
    pub fn linear(&self) -> LinearSearch<'_> {
        LinearSearch(self)
    }

    /// Returns a reader with a binary search over the keys of a texel.
    #[must_use]
    pub fn bisection(&self) -> Bisection<'_> {
        Bisection(self)
    }

    /// Returns the codes of a texel in a direction. `find` receives the ascending directions of the keys, which start
    /// at 0. It returns the index of the first key that is not before the direction.
    #[inline]
    fn codes(&self, slot: Slot, direction: usize, find: impl Fn(&[u16]) -> usize) -> Option<[f32; 3]> {
        let Rank(rank) = self.tiles.rank(slot).filter(|_| direction < self.directions)?;
        let (start, end) = (self.starts[rank], self.starts[rank + 1]);
        let after = start + find(&self.positions[start..end]);
        let object = &self.objects[self.objects.partition_point(|object| object.first <= rank) - 1];
        let high = object.table[usize::from(self.colors[after])].map(f32::from);
        let position = usize::from(self.positions[after]);
        if position == direction {
            return Some(high);
        }

        // Interpolate between two keys.
        let low = object.table[usize::from(self.colors[after - 1])].map(f32::from);
        let before = usize::from(self.positions[after - 1]);
        let share = (direction - before) as f32 / (position - before) as f32;
        Some([0, 1, 2].map(|c| low[c] + (high[c] - low[c]) * share))
    }
}

/// Reader of a [`Segmented`] by linear search.
#[derive(Clone, Copy, Debug)]
pub struct LinearSearch<'a>(&'a Segmented);

impl LookUp for LinearSearch<'_> {
    #[inline]
    fn codes(&self, slot: Slot, direction: usize) -> Option<[f32; 3]> {
        self.0.codes(slot, direction, |positions| {
            let mut place = 0;
            while usize::from(positions[place]) < direction {
                place += 1;
            }
            place
        })
    }

    fn scale(&self) -> Option<LogScale> {
        None
    }
}

/// Reader of a [`Segmented`] by binary search.
#[derive(Clone, Copy, Debug)]
pub struct Bisection<'a>(&'a Segmented);

impl LookUp for Bisection<'_> {
    #[inline]
    fn codes(&self, slot: Slot, direction: usize) -> Option<[f32; 3]> {
        self.0.codes(slot, direction, |positions| {
            positions.partition_point(|&position| usize::from(position) < direction)
        })
    }

    fn scale(&self) -> Option<LogScale> {
        None
    }
}

/// Returns the keys of a texel: the first and the last direction, and the ends of segments between them.
fn keys(codes: &[u8], threshold: i64, rule: SegmentRule) -> Vec<Key> {
    let (colors, _) = codes.as_chunks::<3>();
    let last = colors.len() - 1;
    let key = |position: usize| Key { position: position as u16, color: colors[position] };
    let (mut keys, mut start) = (vec![key(0)], 0);
    while start < last {
        start = match rule {
            SegmentRule::Checked => checked_end(colors, start, threshold),
            SegmentRule::FirstDifference => first_difference_end(colors, start, threshold),
        };
        keys.push(key(start));
    }
    keys
}

/// Returns a − b per channel.
#[inline]
fn difference(a: Color, b: Color) -> [i64; 3] {
    [0, 1, 2].map(|c| i64::from(a[c]) - i64::from(b[c]))
}

/// Returns whether an error of `n`-ths is within the threshold. A zero error is always within it.
#[inline]
fn within(error: [i64; 3], n: i64, threshold: i64) -> bool {
    let [a, b, c] = error.map(i64::abs);
    a + b + c == 0 || a + b + c < threshold * n && 2 * a.max(b).max(c) < threshold * n
}

/// Returns whether the step to direction `end` has the opposite sign of the segment's first difference.
#[inline]
fn turns(colors: &[Color], end: usize, first: [i64; 3]) -> bool {
    let step = difference(colors[end], colors[end - 1]);
    (0..3).any(|c| step[c] * first[c] < 0)
}

/// Returns the end of the segment that starts at `start`, according to [`SegmentRule::Checked`].
fn checked_end(colors: &[Color], start: usize, threshold: i64) -> usize {
    let first = difference(colors[start + 1], colors[start]);
    // While codes follow the line exactly, intermediate codes need no check.
    let mut straight = true;
    let mut end = start + 1;
    while end + 1 < colors.len() && !turns(colors, end + 1, first) {
        let n = (end + 1 - start) as i64;
        let chord = difference(colors[end + 1], colors[start]);
        straight &= chord == first.map(|d| d * n);
        if !straight && !(start + 1..=end).all(|j| within(error(colors, [start, j], chord, n), n, threshold)) {
            break;
        }
        end += 1;
    }
    end
}

/// Returns the error at direction j, in units of 1/n code, of a segment that starts at s and rises by `chord` over n
/// directions.
#[inline]
fn error(colors: &[Color], [s, j]: [usize; 2], chord: [i64; 3], n: i64) -> [i64; 3] {
    let rise = difference(colors[j], colors[s]);
    [0, 1, 2].map(|c| rise[c] * n - chord[c] * (j - s) as i64)
}

/// Returns the end of the segment that starts at `start`, according to [`SegmentRule::FirstDifference`].
fn first_difference_end(colors: &[Color], start: usize, threshold: i64) -> usize {
    let first = difference(colors[start + 1], colors[start]);
    let mut end = start + 1;
    while end + 1 < colors.len() && !turns(colors, end + 1, first) {
        let n = (end + 1 - start) as i64;
        let rise = difference(colors[end + 1], colors[start]);
        if !within([0, 1, 2].map(|c| rise[c] - n * first[c]), 1, threshold) {
            break;
        }
        end += 1;
    }
    end
}
