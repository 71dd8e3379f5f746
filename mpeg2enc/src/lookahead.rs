//! Frames that wait to be coded, and what is known of them beforehand.
//!
//! All is measured on luma of half the width and height, source against source: how well each block of 8×8 there,
//! a macroblock of the picture, is predicted from other frames, and how well from nothing.
//! Types of pictures ([`plan`]) and quantisers ([`tree`]) are chosen from that, and vectors begin with what was found.

pub(crate) mod plan;
mod scene;
pub(crate) mod tree;
pub(crate) mod weights;

use crate::{
    Config, Effort, Picture, RestoreError,
    header::macroblock_counts,
    kernel::{self, Place},
    motion::{Candidates, CoarseSearch, HalfSample, Range, Search, all_candidates, quarter},
    predict::place_of,
    restore::{ensure, is_whole},
};
use plane::{Correspondence, Plane};
use rayon::prelude::*;
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, OnceLock},
};

/// Motion of a frame that the caller knows; nothing by default.
///
/// ```
/// use mpeg2enc::KnownMotion;
/// let field = plane::Correspondence::from_motion(plane::Plane::filled(64, 48, [1.0, 0.0]));
/// assert!(KnownMotion::from(&field).to_previous.is_some());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct KnownMotion<'a> {
    /// Where each pixel was in the frame before.
    pub to_previous: Option<&'a Correspondence>,
    /// Where each pixel will be in the frame after.
    pub to_next: Option<&'a Correspondence>,
}

/// A frame that waits.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Waiting {
    /// The frame in whole macroblocks.
    pub source: Arc<Picture>,
    /// Luma at half and at a quarter of the width and height, when they are looked at.
    #[cfg_attr(feature = "serde", serde(skip))]
    half: OnceLock<Plane<u8>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    quarter: OnceLock<Plane<u8>>,
    /// Candidates of every macroblock that were given: to the frame before and to the frame after.
    known: [Option<Arc<[Candidates]>>; 2],
    /// What every macroblock costs without a prediction.
    #[cfg_attr(feature = "serde", serde(skip))]
    intra_costs: OnceLock<Arc<[u32]>>,
    /// Whether this is the I picture of a group.
    begins_group: bool,
    /// Factors of quantiser_scale in 256ths, where macroblocks do not count alike.
    pub weights: Option<Vec<u32>>,
    /// Of every macroblock, by distance of the reference frame.
    matches: BTreeMap<isize, Arc<[Match]>>,
    /// Of every macroblock as part of a B picture, by the distances of both reference frames.
    two_sided: BTreeMap<(isize, isize), Arc<[TwoSided]>>,
}

impl Waiting {
    /// Whether this is a frame of so many columns and rows of macroblocks, looked at by an encoder with these settings.
    fn check(&self, config: &Config, counts: (usize, usize)) -> Result<(), RestoreError> {
        let count = counts.0 * counts.1;
        ensure(is_whole(&self.source, counts), "the size of a waiting frame")?;
        let known = self.known.iter().flatten();
        ensure(known.clone().all(|known| known.len() == count), "the number of given vectors")?;
        ensure(known.flat_map(|known| known.iter()).all(Candidates::is_plausible), "given vectors")?;
        let weights = self.weights.as_ref();
        ensure(weights.is_none() || config.varies(), "weights")?;
        ensure(
            weights.is_none_or(|weights| weights.len() == count && weights.iter().all(weights::is_plausible)),
            "weights",
        )?;
        let plausible = |found: &Match| found.vector.is_plausible() && found.cost <= COST_MAX;
        let matches = |matches: &Arc<[Match]>| matches.len() == count && matches.iter().all(plausible);
        ensure(self.matches.values().all(matches), "vectors between waiting frames")?;
        let plausible = |found: &TwoSided| found.cost <= COST_MAX && found.shares.iter().all(|&share| share <= 2);
        let two_sided = |found: &Arc<[TwoSided]>| found.len() == count && found.iter().all(plausible);
        ensure(self.two_sided.values().all(two_sided), "predictions between waiting frames")
    }

    fn half(&self) -> &Plane<u8> {
        self.half.get_or_init(|| halved(self.source.luma()))
    }

    fn quarter(&self) -> &Plane<u8> {
        self.quarter.get_or_init(|| quarter(self.source.luma()))
    }
}

impl<'a> From<&'a Correspondence> for KnownMotion<'a> {
    /// Where each pixel was in the frame before.
    fn from(to_previous: &'a Correspondence) -> Self {
        Self { to_previous: Some(to_previous), to_next: None }
    }
}

impl<'a> From<Option<&'a Correspondence>> for KnownMotion<'a> {
    /// Where each pixel was in the frame before, if it is known.
    fn from(to_previous: Option<&'a Correspondence>) -> Self {
        Self { to_previous, to_next: None }
    }
}

/// The best vector found for a block, and the difference that it leaves.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Match {
    /// In half samples of the half-size picture.
    pub vector: HalfSample,
    /// Sum of absolute differences, transformed or plain.
    pub cost: u32,
}

/// The best of three predictions of a B picture.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TwoSided {
    pub cost: u32,
    /// How much of it is forward and backward, in halves.
    pub shares: [u32; 2],
}

/// Blocks of the half-size picture.
const BLOCK: usize = 8;
/// What a bit of a vector is worth here, as quantiser_scale of [`Search::new`]: that of middling quality.
const SEARCH_QUANTISER_SCALE: u32 = 8;
/// Mean difference a sample above which a block is looked for farther away.
const POOR_MATCH: u32 = 6;
/// More than any sum of differences of a block, transformed or not.
const COST_MAX: u32 = 1 << 20;
/// More frames than any film has.
const MOST_FRAMES: usize = 1 << 30;
/// Like the limits of High Level, at half the size: vectors are brought into the true range later.
const REACH: [u32; 2] = [9, 8];

/// Frames in display order, from the last coded reference frame on.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Lookahead {
    frames: VecDeque<Waiting>,
    /// Display index of the first of them.
    first: usize,
    /// Display index of the last frame that begins a group.
    last_group: usize,
    /// Is only what tells new scenes and begins vectors to be found?
    quick: bool,
    /// Do transformed differences count, which are nearer to bits, or plain ones?
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

    /// Display index of the first frame.
    pub fn first(&self) -> usize {
        self.first
    }

    /// One more than the display index of the last frame.
    pub fn end(&self) -> usize {
        self.first + self.frames.len()
    }

    pub fn get(&self, index: usize) -> &Waiting {
        &self.frames[index - self.first]
    }

    /// Takes the next frame, in whole macroblocks, and factors of quantiser_scale for them; decides whether it begins a group.
    pub fn push(&mut self, config: &Config, source: Arc<Picture>, motion: KnownMotion, weights: Option<Vec<u32>>) {
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
        let is_due = index == 0 || index - self.last_group >= config.gop as usize;
        if is_due || config.scene_cuts && self.is_scene_cut(index) {
            self.last_group = index;
            self.frames[index - self.first].begins_group = true;
        }
    }

    /// Whether a frame is the I picture of a group, see [`Encoder::begins_group`](crate::Encoder::begins_group).
    pub fn begins_group(&self, index: usize, gop: usize) -> Option<bool> {
        if index >= self.end() {
            return Some((index - self.last_group).is_multiple_of(gop));
        }
        let since_last_group = || (index >= self.last_group).then_some(index == self.last_group);
        index.checked_sub(self.first).map_or_else(since_last_group, |place| Some(self.frames[place].begins_group))
    }

    /// Whether this is a look-ahead of an encoder with these settings.
    pub fn check(&self, config: &Config) -> Result<(), RestoreError> {
        let fresh = Self::new(config.effort);
        ensure((self.quick, self.transformed) == (fresh.quick, fresh.transformed), "the effort of the look-ahead")?;
        ensure(self.first < MOST_FRAMES, "the number of frames")?;
        ensure(self.first == 0 || !self.frames.is_empty(), "the waiting frames")?;
        let counts = macroblock_counts(config.width, config.height);
        self.frames.iter().try_for_each(|frame| frame.check(config, counts))?;
        // Groups are as long as they may be at most.
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

    /// Forgets the frames before this one.
    pub fn drop_before(&mut self, index: usize) {
        while self.first < index {
            self.frames.pop_front();
            self.first += 1;
        }
    }

    fn columns(&self) -> usize {
        self.frames[0].source.width() / 16
    }

    /// Macroblocks of a frame.
    pub fn macroblocks(&self) -> usize {
        self.columns() * self.frames[0].source.height() / 16
    }

    /// What every macroblock of a frame costs without a prediction.
    pub fn intra_costs(&self, index: usize) -> &Arc<[u32]> {
        let frame = self.get(index);
        frame.intra_costs.get_or_init(|| intra_costs(frame.half(), self.transformed))
    }

    /// Is the motion of this frame towards its neighbour given?
    fn is_known(&self, index: usize, delta: isize) -> Option<&Arc<[Candidates]>> {
        self.get(index).known[usize::from(delta > 0)].as_ref()
    }

    /// Vectors worth trying in each macroblock towards the frame `delta` away, in half samples of the picture.
    pub fn candidates(&mut self, index: usize, delta: isize) -> Arc<[Candidates]> {
        let step = delta.signum();
        let neighbour = away(index, step);
        let near = match self.is_known(index, step) {
            Some(known) => known.clone(),
            None if step > 0 => self.reversed(neighbour),
            None => vec![Candidates::NONE; self.macroblocks()].into(),
        };
        if delta == step {
            return near;
        }
        // Where this is in the neighbour, and from there on.
        let (first, rest) = (self.matches(index, step), self.matches(neighbour, delta - step));
        let columns = self.columns();
        let rows = rest.len() / columns;
        near.iter()
            .enumerate()
            .map(|(i, near)| {
                let mut out = Candidates::NONE;
                let found = full_size(first[i].vector);
                for &vector in [found].iter().chain(near.vectors()) {
                    let onward = full_size(rest[landing(i, vector, columns, rows)].vector);
                    out.add(vector.offset(onward.x, onward.y));
                }
                out
            })
            .collect()
    }

    /// Vectors from the frame before `later` to it: its own turned round, where they end.
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
                // Up to four macroblocks are covered.
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

    /// The best match of every macroblock in the frame `delta` away.
    pub fn matches(&mut self, index: usize, delta: isize) -> Arc<[Match]> {
        if let Some(matches) = self.get(index).matches.get(&delta) {
            return matches.clone();
        }
        let candidates = self.candidates(index, delta);
        let before =
            (delta == -1 && index > self.first).then(|| self.get(index - 1).matches.get(&-1).cloned()).flatten();
        let frame = self.get(index);
        let reference = self.get(away(index, delta));
        // Farther frames are reached by way of nearer ones.
        let turned_round = delta == 1 && self.is_known(index + 1, -1).is_some();
        let wide = delta.abs() == 1 && self.is_known(index, delta).is_none() && !turned_round;
        let (columns, transformed) = (self.columns(), self.transformed);
        let rows = candidates.len() / columns;
        let matches: Arc<[Match]> = (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let mut left = HalfSample::ZERO;
                let (candidates, before) = (&candidates, before.as_deref());
                (0..columns).map(move |column| {
                    let i = row * columns + column;
                    let found = best_match(
                        frame,
                        reference,
                        (column, row),
                        left,
                        &candidates[i],
                        before.map(|b| b[i].vector),
                        wide,
                        transformed,
                    );
                    left = found.vector;
                    found
                })
            })
            .collect();
        self.frames[index - self.first].matches.insert(delta, matches.clone());
        matches
    }

    /// The best of forward, backward and both in every macroblock of a B picture.
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
                let both = mean_cost(
                    frame.half(),
                    references,
                    (i % columns, i / columns),
                    [f.vector, b.vector],
                    self.transformed,
                );
                let best = both.min(f.cost).min(b.cost);
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

    /// Vectors towards the frame `delta` away, as given from frame to frame and nothing else; `None` if they are not.
    fn chained(&mut self, index: usize, delta: isize) -> Option<Arc<[Candidates]>> {
        let step = delta.signum();
        let neighbour = away(index, step);
        let near = match self.is_known(index, step) {
            Some(known) => known.clone(),
            None if step > 0 && self.is_known(neighbour, -1).is_some() => self.reversed(neighbour),
            None => return None,
        };
        if delta == step {
            return Some(near);
        }
        let rest = self.chained(neighbour, delta - step)?;
        let columns = self.columns();
        let rows = rest.len() / columns;
        let chained = near.iter().enumerate().map(|(i, near)| {
            let mut out = Candidates::NONE;
            out.one_motion = near.one_motion;
            for &vector in near.vectors() {
                let onward = &rest[landing(i, vector, columns, rows)];
                out.one_motion &= onward.one_motion;
                for further in onward.vectors().iter().take(2) {
                    out.add(vector.offset(further.x, further.y));
                }
            }
            out
        });
        Some(chained.collect())
    }

    /// What a search in the picture itself begins with, towards the frame `delta` away.
    pub fn for_coding(&mut self, index: usize, delta: isize) -> Arc<[Candidates]> {
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
                if out.one_motion {
                    return out;
                }
                let left = (i % columns > 0).then(|| i - 1);
                let right = (i % columns + 1 < columns).then_some(i + 1);
                for neighbour in [left, right, i.checked_sub(columns), Some(i + columns)].into_iter().flatten() {
                    if let Some(found) = matches.get(neighbour) {
                        out.add(full_size(found.vector));
                    }
                }
                out
            })
            .collect()
    }
}

/// Display index of the frame `delta` after another.
fn away(index: usize, delta: isize) -> usize {
    index.checked_add_signed(delta).expect("references are frames of the sequence")
}

/// The macroblock in which the middle of macroblock `i` lands.
fn landing(i: usize, vector: HalfSample, columns: usize, rows: usize) -> usize {
    let place = |position: usize, component: i32, count: usize| {
        ((32 * position as i32 + component + 16) >> 5).clamp(0, count as i32 - 1) as usize
    };
    place(i / columns, vector.y, rows) * columns + place(i % columns, vector.x, columns)
}

fn full_size(vector: HalfSample) -> HalfSample {
    HalfSample { x: 2 * vector.x, y: 2 * vector.y }
}

#[expect(clippy::too_many_arguments, reason = "all that a vector can be foretold from")]
fn best_match(
    frame: &Waiting,
    reference: &Waiting,
    (column, row): (usize, usize),
    left: HalfSample,
    candidates: &Candidates,
    before: Option<HalfSample>,
    wide: bool,
    transformed: bool,
) -> Match {
    let range = Range::of_block(reference.half(), BLOCK, column, row, REACH);
    let mut search =
        Search::<BLOCK>::new(frame.half(), reference.half(), (column, row), range, left, SEARCH_QUANTISER_SCALE);
    search.try_vector(HalfSample::ZERO);
    for vector in candidates.vectors() {
        search.try_vector(HalfSample { x: (vector.x + 1) >> 1, y: (vector.y + 1) >> 1 });
    }
    if !candidates.one_motion && search.best_error > 0 {
        search.try_vector(left);
        if let Some(before) = before {
            search.try_vector(before);
        }
        search.descend();
        if wide && search.best_error > (BLOCK * BLOCK) as u32 * POOR_MATCH {
            let coarse = CoarseSearch { source: frame.quarter(), reference: reference.quarter() }.search(column, row);
            if search.try_vector(HalfSample { x: coarse.x / 2, y: coarse.y / 2 }) {
                search.descend();
            }
        }
    }
    if transformed {
        if !candidates.one_motion {
            search.refine();
        }
        search.transform_differences();
    }
    Match { vector: search.best, cost: search.best_error }
}

/// Sum of absolute differences to the mean of two predictions, transformed or plain.
fn mean_cost(
    source: &Plane<u8>,
    references: [&Plane<u8>; 2],
    (column, row): (usize, usize),
    vectors: [HalfSample; 2],
    transformed: bool,
) -> u32 {
    let mut predicted = [[[0u8; BLOCK]; BLOCK]; 2];
    for s in 0..2 {
        let (x2, y2) = ((2 * BLOCK * column) as i32 + vectors[s].x, (2 * BLOCK * row) as i32 + vectors[s].y);
        kernel::predict(place_of(references[s], x2, y2), &mut predicted[s]);
    }
    let mut mean = [[0; BLOCK]; BLOCK];
    kernel::mean(predicted[0].as_flattened(), predicted[1].as_flattened(), mean.as_flattened_mut());
    let place = place_of(source, (2 * BLOCK * column) as i32, (2 * BLOCK * row) as i32);
    difference(place, whole(&mean), transformed)
}

/// Sum of absolute differences, transformed or plain.
fn difference(source: Place, reference: Place, transformed: bool) -> u32 {
    if transformed {
        kernel::transformed_difference::<BLOCK>(source, reference)
    } else {
        kernel::absolute_difference::<BLOCK>(source, reference)
    }
}

/// A prediction that was made already.
fn whole(block: &[[u8; BLOCK]; BLOCK]) -> Place<'_> {
    Place::whole(block.as_flattened(), BLOCK)
}

/// Sums of absolute differences of every block to its mean, transformed or plain.
fn intra_costs(half: &Plane<u8>, transformed: bool) -> Arc<[u32]> {
    let (columns, rows) = (half.width() / BLOCK, half.height() / BLOCK);
    (0..columns * rows)
        .map(|i| {
            let block = half.block(i % columns, i / columns);
            let sum: u32 = block.iter().map(|&sample| u32::from(sample)).sum();
            let mean = [[((sum + 32) / 64) as u8; BLOCK]; BLOCK];
            let source = Place::whole(&block, BLOCK);
            difference(source, whole(&mean), transformed)
        })
        .collect()
}

/// Means of 2×2 samples.
fn halved(plane: &Plane<u8>) -> Plane<u8> {
    let (width, height) = (plane.width() / 2, plane.height() / 2);
    let mut half = Plane::filled(width, height, 0);
    for (y, row) in half.samples_mut().chunks_exact_mut(width).enumerate() {
        kernel::means_of_four(plane.row(2 * y), plane.row(2 * y + 1), row);
    }
    half
}
