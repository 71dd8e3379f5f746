//! Which records a macroblock's pixels may take light from, laid out for a loop over them.

use super::record::{Record, Site};
use super::spacing::{radius_in_view, trust};
use super::{Picture, Vec3A};
use crate::{Busy, MACROBLOCK};
use rayon::prelude::*;

/// Records are looked at in groups of so many.
pub(super) const LANES: usize = 8;
/// 1 − cos of the largest angle between the normals of a record and of a pixel that uses it: 28°.
pub(super) const NORMAL_TOLERANCE: f32 = 0.12;
/// Distances along the normal count so many times as much: a step is another surface.
const ACROSS: f32 = 5.0;

/// A macroblock of the picture.
#[derive(Default)]
pub(super) struct Tile {
    /// Box around its surfaces; empty if there are none.
    low: Vec3A,
    high: Vec3A,
    /// Groups of candidates; the last is filled up with records that are nowhere.
    groups: Vec<Group>,
    /// Index of each candidate's record, and the trust in its derivatives.
    pub records: Vec<(u32, f32)>,
}

/// What the error measure of [`LANES`] records needs.
struct Group {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    inverse_radius2: [f32; LANES],
    carrier: [u32; LANES],
}

impl Group {
    /// Infinitely far from everything.
    const NOWHERE: Self = Self {
        position: [[1e18; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        inverse_radius2: [1.0; LANES],
        carrier: [0; LANES],
    };

    /// e² of each record at `site`:
    ///
    /// ```text
    /// e² = (|d|² + k² (d · n̄)²) / R² + (1 − n · nᵢ) / c
    ///   d  way from the record        n̄  mean of the two normals        k  ACROSS     c  NORMAL_TOLERANCE
    /// ```
    #[inline(always)]
    fn error2(&self, site: &Site) -> [f32; LANES] {
        let (p, n) = (site.position.to_array(), site.normal.to_array());
        std::array::from_fn(|k| {
            let (mut d2, mut along, mut cosine) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let d = p[axis] - self.position[axis][k];
                d2 += d * d;
                along += d * (n[axis] + self.normal[axis][k]);
                cosine += n[axis] * self.normal[axis][k];
            }
            let other = if self.carrier[k] == site.carrier { 0.0 } else { 2.0 };
            (d2 + ACROSS * ACROSS / 4.0 * along * along) * self.inverse_radius2[k]
                + (1.0 - cosine) * (1.0 / NORMAL_TOLERANCE)
                + other
        })
    }
}

/// Weight of a record by its e².
#[inline]
pub(super) fn weight(error2: f32) -> f32 {
    let rest = (1.0 - error2).max(0.0);
    rest * rest
}

/// Weight that a record at `from` with this radius has at `to`, on the same footing as [`Tile::weights`].
pub(super) fn weight_between(from: &Site, radius: f32, to: &Site) -> f32 {
    let mut group = Group::NOWHERE;
    group.set(0, from, radius);
    weight(group.error2(to)[0])
}

impl Group {
    fn set(&mut self, lane: usize, site: &Site, radius: f32) {
        for axis in 0..3 {
            self.position[axis][lane] = site.position[axis];
            self.normal[axis][lane] = site.normal[axis];
        }
        self.inverse_radius2[lane] = 1.0 / (radius * radius).max(f32::MIN_POSITIVE);
        self.carrier[lane] = site.carrier;
    }
}

impl Tile {
    /// Calls `each(k, weight)` for the candidates whose weight at `site` is above zero, in their order.
    #[inline]
    pub fn weights(&self, site: &Site, mut each: impl FnMut(usize, f32)) {
        for (g, group) in self.groups.iter().enumerate() {
            let error2 = group.error2(site);
            if error2.iter().fold(1.0f32, |least, &e| least.min(e)) >= 1.0 {
                continue;
            }
            for (lane, &e) in error2.iter().enumerate() {
                if e < 1.0 {
                    each(g * LANES + lane, weight(e));
                }
            }
        }
    }

    fn add(&mut self, index: usize, site: &Site, (radius, trust): (f32, f32)) {
        let lane = self.records.len() % LANES;
        if lane == 0 {
            self.groups.push(Group::NOWHERE);
        }
        self.groups.last_mut().expect("just made").set(lane, site, radius);
        self.records.push((index as u32, trust));
    }

    fn reached_by(&self, position: Vec3A, radius: f32) -> bool {
        let outside = (self.low - position).max(position - self.high).max(Vec3A::ZERO);
        outside.length_squared() < radius * radius
    }
}

/// All macroblocks of a picture, in raster order.
pub(super) struct Tiles(pub Vec<Tile>);

impl Tiles {
    /// Tiles without records.
    pub fn new(picture: &Picture, busy: &Busy) -> Self {
        let (width, height) = picture.size();
        let count = width.div_ceil(MACROBLOCK) * height.div_ceil(MACROBLOCK);
        let empty = |tile| {
            let (columns, rows) = picture.tile_area(tile);
            let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
            for y in rows {
                for x in columns.clone() {
                    if let Some(site) = picture.site(x, y) {
                        (low, high) = (low.min(site.position), high.max(site.position));
                    }
                }
            }
            Tile { low, high, ..Tile::default() }
        };
        Self((0..count).into_par_iter().map(|tile| busy.measure(|| empty(tile))).collect())
    }

    /// Forgets all candidates.
    pub fn clear(&mut self) {
        for tile in &mut self.0 {
            tile.groups.clear();
            tile.records.clear();
        }
    }

    /// Adds those of the `chosen` records, in their order, that reach a tile; returns those that reach any.
    pub fn list<R: Sync + Send>(
        &mut self,
        picture: &Picture,
        records: &[Record<R>],
        chosen: &[usize],
        busy: &Busy,
    ) -> Vec<usize> {
        let view = &picture.seen.view;
        let reach = |&index: &usize| {
            let radius = radius_in_view(&records[index], view);
            (index, radius, trust(&records[index].estimate, radius))
        };
        let spheres: Vec<(usize, f32, f32)> = busy.measure(|| chosen.iter().map(reach).collect());
        // A row of tiles first rules out what none of them needs.
        let across = picture.size().0.div_ceil(MACROBLOCK).max(1);
        let reached: Vec<Vec<usize>> = self
            .0
            .par_chunks_mut(across.min(8))
            .map(|tiles| {
                busy.measure(|| {
                    let low = tiles.iter().fold(Vec3A::INFINITY, |low, tile| low.min(tile.low));
                    let high = tiles.iter().fold(Vec3A::NEG_INFINITY, |high, tile| high.max(tile.high));
                    let together = Tile { low, high, ..Tile::default() };
                    let mut reached = Vec::new();
                    for &(index, radius, trust) in &spheres {
                        let site = &records[index].site;
                        if !together.reached_by(site.position, radius) {
                            continue;
                        }
                        for tile in tiles.iter_mut() {
                            if tile.reached_by(site.position, radius) {
                                tile.add(index, site, (radius, trust));
                                reached.push(index);
                            }
                        }
                    }
                    reached
                })
            })
            .collect();
        let mut reached = reached.concat();
        reached.sort_unstable();
        reached.dedup();
        reached
    }
}
