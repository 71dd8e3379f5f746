//! Frames waiting to be coded, and measurements of them.
//!
//! All measurements compare source frames in luma at half the width and height. They estimate the cost of each 8×8 block of these
//! frames (a macroblock of the picture) with and without prediction from other frames. Picture types ([`plan`]) and quantisers
//! ([`tree`]) follow from these costs. The measured vectors are starting points of the final motion search.

mod block_search;
mod cost;
pub(crate) mod plan;
mod scene;
pub(crate) mod tree;
mod waiting;
pub(crate) mod weights;

use crate::{
    Config, Effort, Picture, RestoreError, SuppliedMotion,
    motion::{BlockPosition, Candidates, all_candidates},
    restore::ensure,
    vector::HalfSample,
};
use block_search::BlockSearch;
use cost::{intra_costs, mean_cost};
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, OnceLock},
};
use threads::prelude::*;
use waiting::{Match, TwoSided, Waiting};

/// Upper bound on the number of frames of a film.
const MOST_FRAMES: usize = 1 << 30;

/// Waiting frames in display order, from the last coded reference frame on.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Lookahead {
    frames: VecDeque<Waiting>,
    /// Display index of the first waiting frame.
    first: usize,
    /// Display index of the last frame that begins a group.
    last_group: usize,
    /// Whether measurements are limited to shot changes and starting vectors.
    quick: bool,
    /// Whether costs are transformed differences, which approximate bits better than plain ones.
    transformed: bool,
}

impl Lookahead {
    pub fn new(effort: Effort) -> Self {
        Self {
            frames: VecDeque::new(),
            first: 0,
            last_group: 0,
            quick: effort == Effort::Fast,
            transformed: effort == Effort::Best,
        }
    }

    /// Returns the display index of the first frame.
    pub fn first(&self) -> usize {
        self.first
    }

    /// Returns the display index of the last frame plus one.
    pub fn end(&self) -> usize {
        self.first + self.frames.len()
    }

    pub fn get(&self, index: usize) -> &Waiting {
        &self.frames[index - self.first]
    }

    /// Accepts the next frame extended to whole macroblocks, and the factors of quantiser_scale of its macroblocks. Decides
    /// whether the frame begins a group.
    pub fn push(&mut self, config: &Config, source: Arc<Picture>, motion: SuppliedMotion, weights: Option<Vec<u32>>) {
        let (columns, rows) = (source.width() / 16, source.height() / 16);
        let known = [motion.to_previous, motion.to_next]
            .map(|known| known.map(|known| all_candidates(known, columns, rows).into()));
        self.frames.push_back(Waiting {
            half: OnceLock::new(),
            quarter: OnceLock::new(),
            intra_costs: OnceLock::new(),
            begins_group: false,
            weights,
            source,
            known,
            matches: BTreeMap::new(),
            two_sided: BTreeMap::new(),
        });
        let index = self.end() - 1;
        // A group begins when the previous one is full or the shot changes.
        let is_due = index == 0 || index - self.last_group >= config.gop as usize;
        if is_due || config.scene_cuts && self.is_scene_cut(index) {
            self.last_group = index;
            self.frames[index - self.first].begins_group = true;
        }
    }

    /// Returns whether a frame is the I picture of a group; see [`Encoder::begins_group`](crate::Encoder::begins_group).
    pub fn begins_group(&self, index: usize, gop: usize) -> Option<bool> {
        if index >= self.end() {
            return Some((index - self.last_group).is_multiple_of(gop));
        }
        let since_last_group = || (index >= self.last_group).then_some(index == self.last_group);
        index.checked_sub(self.first).map_or_else(since_last_group, |place| Some(self.frames[place].begins_group))
    }

    /// Checks that this look-ahead belongs to an encoder with these settings.
    pub fn check(&self, config: &Config) -> Result<(), RestoreError> {
        let fresh = Self::new(config.effort);
        ensure((self.quick, self.transformed) == (fresh.quick, fresh.transformed), "effort of the look-ahead")?;
        ensure(self.first < MOST_FRAMES, "number of frames")?;
        ensure(self.first == 0 || !self.frames.is_empty(), "waiting frames")?;
        self.frames.iter().try_for_each(|frame| frame.check(config))?;
        // Groups must not exceed their maximum length.
        let starts: Vec<usize> = (self.first..self.end()).filter(|&index| self.get(index).begins_group).collect();
        let before = starts.first().map_or(self.last_group, |&first| first.saturating_sub(config.gop as usize));
        let mut bounds = vec![before];
        bounds.extend(&starts);
        bounds.push(self.end().saturating_sub(1));
        ensure(bounds.windows(2).all(|w| w[0] <= w[1] && w[1] - w[0] <= config.gop as usize), "groups")?;
        let last = starts.last().copied().unwrap_or(self.last_group);
        ensure(
            self.last_group == last && (self.first > 0 || self.frames.is_empty() || starts.first() == Some(&0)),
            "groups",
        )
    }

    /// Drops all frames before this frame.
    pub fn drop_before(&mut self, index: usize) {
        while self.first < index {
            self.frames.pop_front();
            self.first += 1;
        }
    }

    fn columns(&self) -> usize {
        self.frames[0].source.width() / 16
    }

    /// Returns the number of macroblocks of a frame.
    pub fn macroblocks(&self) -> usize {
        self.columns() * self.frames[0].source.height() / 16
    }

    /// Returns the cost without prediction of every macroblock of a frame.
    pub fn intra_costs(&self, index: usize) -> &Arc<[u32]> {
        let frame = self.get(index);
        frame.intra_costs.get_or_init(|| intra_costs(frame.half(), self.transformed))
    }

    /// Returns the given motion of this frame to its neighbor, if any.
    fn is_known(&self, index: usize, delta: isize) -> Option<&Arc<[Candidates]>> {
        self.get(index).known[usize::from(delta > 0)].as_ref()
    }

    /// Returns the vectors worth trying in each macroblock towards the frame at distance `delta`, in half samples of the picture.
    pub fn candidates(&mut self, index: usize, delta: isize) -> Arc<[Candidates]> {
        let step = delta.signum();
        let neighbor = away(index, step);
        // Use given motion, or reverse the measured vectors of the next frame.
        let near = match self.is_known(index, step) {
            Some(known) => known.clone(),
            None if step > 0 => self.reversed(neighbor),
            None => vec![Candidates::NONE; self.macroblocks()].into(),
        };
        if delta == step {
            return near;
        }
        // Follow the motion to the neighbor, and continue from the end of the vector.
        let (first, rest) = (self.matches(index, step), self.matches(neighbor, delta - step));
        let columns = self.columns();
        let rows = rest.len() / columns;
        let mut candidates = Vec::with_capacity(near.len());
        for (i, near) in near.iter().enumerate() {
            let mut out = Candidates::NONE;
            let found = full_size(first[i].vector);
            for &vector in [found].iter().chain(near.vectors()) {
                let onward = full_size(rest[landing(i, vector, columns, rows)].vector);
                out.add(vector.offset(onward.x, onward.y));
            }
            candidates.push(out);
        }
        candidates.into()
    }

    /// Returns the vectors from the previous frame of `later` to `later` itself. They are the negated vectors of `later`,
    /// assigned to the macroblocks where these end.
    fn reversed(&mut self, later: usize) -> Arc<[Candidates]> {
        let matches = self.matches(later, -1);
        let columns = self.columns();
        let rows = matches.len() / columns;
        let mut out = vec![Candidates::NONE; matches.len()];
        let none = Arc::default();
        let known = self.is_known(later, -1).unwrap_or(&none);
        for (i, found) in matches.iter().enumerate() {
            let given = known.get(i).map_or(&[][..], |candidates| candidates.vectors());
            for vector in [full_size(found.vector)].iter().chain(given) {
                // A shifted macroblock covers up to four macroblocks.
                let (x, y) = (32 * (i % columns) as i32 + vector.x, 32 * (i / columns) as i32 + vector.y);
                for (x, y) in [(x, y), (x + 31, y), (x, y + 31), (x + 31, y + 31)] {
                    let (column, row) = (x >> 5, y >> 5);
                    if (0..columns as i32).contains(&column) && (0..rows as i32).contains(&row) {
                        out[row as usize * columns + column as usize].add(HalfSample { x: -vector.x, y: -vector.y });
                    }
                }
            }
        }
        out.into()
    }

    /// Returns the best match of every macroblock in the frame at distance `delta`.
    pub fn matches(&mut self, index: usize, delta: isize) -> Arc<[Match]> {
        if let Some(matches) = self.get(index).matches.get(&delta) {
            return matches.clone();
        }
        let candidates = self.candidates(index, delta);
        // Motion usually continues, so the vectors of the previous frame are candidates too.
        let before =
            (delta == -1 && index > self.first).then(|| self.get(index - 1).matches.get(&-1).cloned()).flatten();
        let frame = self.get(index);
        let reference = self.get(away(index, delta));
        // Distant frames are reached through nearer ones, so only neighbors need a wide search.
        let turned_round = delta == 1 && self.is_known(index + 1, -1).is_some();
        let wide = delta.abs() == 1 && self.is_known(index, delta).is_none() && !turned_round;
        let (columns, transformed) = (self.columns(), self.transformed);
        let rows = candidates.len() / columns;
        let search = &BlockSearch { frame, reference, wide, transformed };
        // Rows are independent; within a row the left vector predicts the next one.
        let matches: Arc<[Match]> = (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let mut left = HalfSample::ZERO;
                let (candidates, before) = (&candidates, before.as_deref());
                (0..columns).map(move |column| {
                    let i = row * columns + column;
                    let block = BlockPosition { column, row };
                    let found = search.best(block, left, &candidates[i], before.map(|b| b[i].vector));
                    left = found.vector;
                    found
                })
            })
            .collect();
        self.frames[index - self.first].matches.insert(delta, matches.clone());
        matches
    }

    /// Returns the best of forward, backward and two-sided prediction for every macroblock of a B picture.
    pub fn two_sided(&mut self, index: usize, back: isize, ahead: isize) -> Arc<[TwoSided]> {
        if let Some(found) = self.get(index).two_sided.get(&(back, ahead)) {
            return found.clone();
        }
        let (forward, backward) = (self.matches(index, back), self.matches(index, ahead));
        let frame = self.get(index);
        let references = [back, ahead].map(|delta| self.get(away(index, delta)).half());
        let columns = self.columns();
        let found: Arc<[TwoSided]> = (0..forward.len())
            .into_par_iter()
            .map(|i| {
                let (f, b) = (forward[i], backward[i]);
                // Both vectors stay fixed; only the kind of prediction is chosen.
                let both = mean_cost(
                    frame.half(),
                    references,
                    BlockPosition { column: i % columns, row: i / columns },
                    [f.vector, b.vector],
                    self.transformed,
                );
                let best = both.min(f.cost).min(b.cost);
                // Ties prefer the mean, then forward prediction.
                let shares = if best == both {
                    [1, 1]
                } else if best == f.cost {
                    [2, 0]
                } else {
                    [0, 2]
                };
                TwoSided { cost: best, shares }
            })
            .collect();
        self.frames[index - self.first].two_sided.insert((back, ahead), found.clone());
        found
    }

    /// Returns the vectors towards the frame at distance `delta`, chained only from given motion; `None` if a link is missing.
    fn chained(&mut self, index: usize, delta: isize) -> Option<Arc<[Candidates]>> {
        let step = delta.signum();
        let neighbor = away(index, step);
        // Give up if motion is given in neither direction.
        let near = match self.is_known(index, step) {
            Some(known) => known.clone(),
            None if step > 0 && self.is_known(neighbor, -1).is_some() => self.reversed(neighbor),
            None => return None,
        };
        if delta == step {
            return Some(near);
        }
        let rest = self.chained(neighbor, delta - step)?;
        // Continue each vector from the macroblock where it ends.
        let columns = self.columns();
        let rows = rest.len() / columns;
        let mut chained = Vec::with_capacity(near.len());
        for (i, near) in near.iter().enumerate() {
            let mut out = Candidates::NONE;
            out.one_motion = near.one_motion;
            for &vector in near.vectors() {
                let onward = &rest[landing(i, vector, columns, rows)];
                out.one_motion &= onward.one_motion;
                for further in onward.vectors().iter().take(2) {
                    out.add(vector.offset(further.x, further.y));
                }
            }
            chained.push(out);
        }
        Some(chained.into())
    }

    /// Returns the starting vectors for the final search towards the frame at distance `delta`.
    pub fn for_coding(&mut self, index: usize, delta: isize) -> Arc<[Candidates]> {
        // Quick searches use given motion without measurements.
        if self.quick
            && let Some(chained) = self.chained(index, delta)
        {
            return chained;
        }
        let near = self.candidates(index, delta);
        let matches = self.matches(index, delta);
        let columns = self.columns();
        (0..near.len())
            .map(|i| {
                let mut out = near[i];
                out.add(full_size(matches[i].vector));
                // Uniform motion needs no candidates from neighboring macroblocks.
                if out.one_motion {
                    return out;
                }
                // Motion borders may cross the macroblock, so try the vectors of its four neighbors.
                let left = (i % columns > 0).then(|| i - 1);
                let right = (i % columns + 1 < columns).then_some(i + 1);
                for neighbor in [left, right, i.checked_sub(columns), Some(i + columns)].into_iter().flatten() {
                    if let Some(found) = matches.get(neighbor) {
                        out.add(full_size(found.vector));
                    }
                }
                out
            })
            .collect()
    }
}

/// Returns the display index at distance `delta` from `index`.
fn away(index: usize, delta: isize) -> usize {
    index.checked_add_signed(delta).expect("references are frames of the sequence")
}

/// Returns the macroblock that contains the center of macroblock `i` after displacement by `vector`.
fn landing(i: usize, vector: HalfSample, columns: usize, rows: usize) -> usize {
    let place = |position: usize, component: i32, count: usize| {
        ((32 * position as i32 + component + 16) >> 5).clamp(0, count as i32 - 1) as usize
    };
    place(i / columns, vector.y, rows) * columns + place(i % columns, vector.x, columns)
}

fn full_size(vector: HalfSample) -> HalfSample {
    HalfSample { x: 2 * vector.x, y: 2 * vector.y }
}
