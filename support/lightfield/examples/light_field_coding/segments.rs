//! The rival: piecewise linear segments along the direction's number, with indexed colors [LinkopingThesis, 5.2 and 7.2.4].
//!
//! Some of the codes v(0), v(1), … of a texel in all directions are kept as keys. Between keys s and e,
//!
//! ```text
//! v'(j) = v(s) + (v(e) − v(s)) (j − s) / (e − s)       err_c(j) = v_c(j) − v'_c(j), for the channels c
//! ```
//!
//! A segment that begins at s goes on to e while [`SegmentRule`] lets it, by a threshold T. With T = 0 nothing is lost.
//! A key is the direction's number and a color's, 16 bits each. Objects with more than 65 536 colors are split.
//!
//! # Differs from the thesis
//!
//! Its pseudocode compares a difference with the difference before, which bounds no error; its printed largest errors are
//! those of [`SegmentRule::Checked`]. Its tables hold all colors of an object, ours those of keys.

use lightfield::{Field, LookUp, Samples, TexelTiles};
use rayon::prelude::*;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Colors that 16 bits can number.
const MOST_COLORS: usize = 1 << 16;

/// The codes of a color.
type Color = [u8; 3];

/// The length of a segment. In both rules no first difference v(j + 1) − v(j) has the opposite sign of the segment's first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentRule {
    /// While Σ_c |err_c(j)| < T and |err_c(j)| < T/2 for all j between s and e: the mean error of channels is below T/3.
    Checked,
    /// While the same holds for v(e) − v(s) − (e − s) d_s, the deviation from the line that the segment begins with, with
    /// d_s = v(s + 1) − v(s). Errors may exceed T/3.
    FirstDifference,
}

/// A field of 8-bit codes as segments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segmented {
    tiles: TexelTiles,
    directions: usize,
    /// The first key of each texel, by rank, and the number of all keys.
    starts: Vec<usize>,
    /// Direction and color of each key.
    positions: Vec<u16>,
    colors: Vec<u16>,
    objects: Vec<Object>,
}

/// Texels that share a table of colors.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Object {
    /// The rank of the first one.
    first: usize,
    table: Vec<Color>,
}

/// A direction's number and its color.
#[derive(Clone, Copy)]
struct Key {
    position: u16,
    color: Color,
}

impl Segmented {
    /// Stores a field as segments with the threshold T.
    ///
    /// # Panics
    ///
    /// If codes are not 8-bit ones.
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

        // A batch of texels bounds the memory for keys whose colors have no numbers yet.
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

    /// Adds the keys of the next texel. `numbers` has the numbers of the colors of the last object.
    fn push(&mut self, texel: &[Key], numbers: &mut HashMap<Color, u16>) {
        // A texel whose colors might not find room begins an object.
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

    /// The number of keys.
    #[must_use]
    pub fn keys(&self) -> usize {
        self.positions.len()
    }

    /// Bytes as the thesis counts them: 4 for each texel (where its keys begin), 2 + 2 for each key (direction and color), 3
    /// for each color of a table.
    #[must_use]
    pub fn size(&self) -> usize {
        let colors: usize = self.objects.iter().map(|object| object.table.len()).sum();
        4 * self.tiles.texels() + 4 * self.keys() + 3 * colors
    }

    /// Look-up as in the thesis: along the keys of a texel, one after the other.
    #[must_use]
    pub fn linear(&self) -> LinearSearch<'_> {
        LinearSearch(self)
    }

    /// Look-up by bisection of the keys of a texel.
    #[must_use]
    pub fn bisection(&self) -> Bisection<'_> {
        Bisection(self)
    }

    /// The codes of a texel in a direction. `find` has the directions of keys, of which the first is 0, and gives the place
    /// of the first one that is not before the direction.
    #[inline]
    fn codes(&self, slot: usize, direction: usize, find: impl Fn(&[u16]) -> usize) -> Option<[f32; 3]> {
        let rank = self.tiles.rank(slot).filter(|_| direction < self.directions)?;
        let (start, end) = (self.starts[rank], self.starts[rank + 1]);
        let after = start + find(&self.positions[start..end]);
        let object = &self.objects[self.objects.partition_point(|object| object.first <= rank) - 1];
        let high = object.table[usize::from(self.colors[after])].map(f32::from);
        let position = usize::from(self.positions[after]);
        if position == direction {
            return Some(high);
        }

        // Between two keys.
        let low = object.table[usize::from(self.colors[after - 1])].map(f32::from);
        let before = usize::from(self.positions[after - 1]);
        let share = (direction - before) as f32 / (position - before) as f32;
        Some([0, 1, 2].map(|c| low[c] + (high[c] - low[c]) * share))
    }
}

/// [`Segmented`], looked up along the keys.
#[derive(Clone, Copy, Debug)]
pub struct LinearSearch<'a>(&'a Segmented);

impl LookUp for LinearSearch<'_> {
    #[inline]
    fn codes(&self, slot: usize, direction: usize) -> Option<[f32; 3]> {
        self.0.codes(slot, direction, |positions| {
            let mut place = 0;
            while usize::from(positions[place]) < direction {
                place += 1;
            }
            place
        })
    }
}

/// [`Segmented`], looked up by bisection.
#[derive(Clone, Copy, Debug)]
pub struct Bisection<'a>(&'a Segmented);

impl LookUp for Bisection<'_> {
    #[inline]
    fn codes(&self, slot: usize, direction: usize) -> Option<[f32; 3]> {
        self.0.codes(slot, direction, |positions| {
            positions.partition_point(|&position| usize::from(position) < direction)
        })
    }
}

/// The keys of a texel: the first and the last direction, and those where segments meet.
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

/// a − b, by channel.
#[inline]
fn difference(a: Color, b: Color) -> [i64; 3] {
    [0, 1, 2].map(|c| i64::from(a[c]) - i64::from(b[c]))
}

/// Whether an error of `n`-ths stays within the threshold. None at all always does.
#[inline]
fn within(error: [i64; 3], n: i64, threshold: i64) -> bool {
    let [a, b, c] = error.map(i64::abs);
    a + b + c == 0 || a + b + c < threshold * n && 2 * a.max(b).max(c) < threshold * n
}

/// Whether the step to direction `end` goes against the first difference of the segment.
#[inline]
fn turns(colors: &[Color], end: usize, first: [i64; 3]) -> bool {
    let step = difference(colors[end], colors[end - 1]);
    (0..3).any(|c| step[c] * first[c] < 0)
}

/// The end of the segment that begins at `start`, by [`SegmentRule::Checked`].
fn checked_end(colors: &[Color], start: usize, threshold: i64) -> usize {
    let first = difference(colors[start + 1], colors[start]);
    // As long as codes go along the line exactly, there is nothing between to be checked.
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

/// n-ths of the error at direction j of a segment from s on that rises by `chord` in n directions.
#[inline]
fn error(colors: &[Color], [s, j]: [usize; 2], chord: [i64; 3], n: i64) -> [i64; 3] {
    let rise = difference(colors[j], colors[s]);
    [0, 1, 2].map(|c| rise[c] * n - chord[c] * (j - s) as i64)
}

/// The end of the segment that begins at `start`, by [`SegmentRule::FirstDifference`].
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
