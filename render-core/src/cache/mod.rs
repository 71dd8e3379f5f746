//! Irradiance cache. Indirect light varies slowly over a surface, so it is computed at few points and interpolated
//! across pixels and frames.
//!
//! The method follows \[Ward88\] and \[WardHeckbert92\], with practical details from \[Krivanek08\]. An
//! [`Illumination`] computes the light at a point.
//!
//! The steps of each frame:
//!
//! 1. Move the records on moving geometry.
//! 2. Update the records in use.
//! 3. Search lattices of pixels, coarse to fine, for uncovered pixels, and create records at these pixels.
//! 4. Shrink contradicted records, and create records at contradicted pixels.
//! 5. Set every pixel to the weighted mean of the predictions of its records.
//!
//! # Differs from the papers
//!
//! * The weight is `(1 − e²)²` of the error measure e. The weight is smooth at e = 1, so a record has no visible
//!   border.
//! * A record is made where the sum of weights is below a minimum, not only where it is zero. Each pass depends on
//!   earlier passes only, so the result does not depend on the number of threads.
//! * A record is used only at points of similar openness, which a few rays at each point measure: see `openness.rs`.
//! * Derivatives by the position are fitted to neighboring records where the fit is more accurate: see `predict.rs`.
//!   The residual of the fit limits the radius of the record: see `doubt.rs`.
//! * The update of a record waits for up to four frames while its light changes by less than a quarter of its tolerance:
//!   see `record.rs`.
//! * Rotation of the normal is computed exactly from the vector irradiance, as long as no light crosses the horizon.

mod doubt;
mod fill;
mod group;
mod illumination;
mod interpolate;
mod known;
mod openness;
mod picture;
mod predict;
mod radius;
mod record;
mod regions;
mod request;
mod spacing;
mod tile;
mod tolerance;

pub use illumination::{Computed, Illumination, LastUpdate, LocalIrradiance, MOST_WAITED, Site};
pub use record::KeptRecipe;
pub use regions::SharedRecord;
pub use request::Request;
pub use spacing::footprint;

use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::{Assignment, Meter, Ranks, share};
use crate::{Busy, Timed};
use glam::{Affine3A, Vec3A};
use known::KnownNeighbors;
use openness::Openness;
use picture::SurfacePicture;
use plane::Plane;
use predict::predictions;
use rayon::prelude::*;
use record::{Record, RecordLight};
use regions::FrameRegions;
use spacing::Spheres;
use tile::Tiles;

/// Maximum number of frames for which an unseen record is kept.
const PATIENCE: u32 = 50;
/// Maximum number of kept records per record in use.
const KEPT_FOR_EACH_USED: usize = 3;
/// Minimum number of pixels per kept record, unless [`KEPT_FOR_EACH_USED`] allows more records. Above the larger limit,
/// the records unseen for longest are dropped.
const PIXELS_FOR_EACH_KEPT: usize = 16;
/// Refresh period \[frames\]. While geometry moves, each record in view is recomputed once per period.
const TURN: u32 = 32;

/// Number of records per thread task.
const CHUNK: usize = 16;
/// Number of records per thread task, for work without rays.
const LARGE_CHUNK: usize = 512;

/// Cache of irradiance records on surfaces across frames. `R` is the recipe that an [`Illumination`] stores with each
/// record.
///
/// With the feature `serde`, the cache can be written and read back without any effect on the results. If several ranks
/// share the work, each rank stores the recipes of its own records. [`kept`](Self::kept) and
/// [`complete`](Self::complete) collect the recipes.
#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct IrradianceCache<R> {
    records: Vec<Record<R>>,
    frame: u32,
    /// Frame of the last change of light or geometry.
    changed: u32,
    made: u32,
    /// Transforms of the instances in the previous frame.
    world: Vec<Affine3A>,
    /// Openness of the previous frame's pixels.
    openness: Openness,
    /// Neighbors of the records of the current frame, for further pictures of the frame.
    #[cfg_attr(feature = "serde", serde(skip))]
    known: KnownNeighbors,
    /// Radii of the records that limit the radii of new records, while a picture is filled.
    #[cfg_attr(feature = "serde", serde(skip))]
    spheres: Option<Spheres>,
    /// State of a frame that is lit in regions.
    #[cfg_attr(feature = "serde", serde(skip))]
    regions: FrameRegions,
}

impl<R> std::fmt::Debug for IrradianceCache<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("IrradianceCache")
            .field("records", &self.records.len())
            .field("frame", &self.frame)
            .finish_non_exhaustive()
    }
}

/// Changes since the previous frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Changes {
    /// Whether the flux of the lights has changed.
    pub light: bool,
    /// Whether geometry that blocks or reflects light has moved.
    pub geometry: bool,
}

/// Irradiance of a picture, and the cost of its computation.
#[derive(Clone, Debug)]
pub struct CachedLight {
    /// Irradiance \[W·m⁻²\], linear RGB, on the side of each pixel's shading normal; zero where no surface reflects.
    pub irradiance: Plane<[f32; 3]>,
    /// Number of records that light any pixel.
    pub in_use: usize,
    /// Number of records that were computed or recomputed.
    pub computed: usize,
}

impl<R> Default for IrradianceCache<R> {
    fn default() -> Self {
        Self {
            records: Vec::new(),
            frame: 0,
            changed: 0,
            made: 0,
            world: Vec::new(),
            openness: Openness::default(),
            known: KnownNeighbors::default(),
            spheres: None,
            regions: FrameRegions::default(),
        }
    }
}

impl<R: Send + Sync> IrradianceCache<R> {
    /// Lights a picture, and returns its irradiance.
    ///
    /// The result depends on the arguments of this call and of all previous calls, but not on the number of threads.
    pub fn light<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        changes: Changes,
        illumination: &I,
    ) -> Timed<CachedLight> {
        Timed::of(|busy| self.lit(request, changes, illumination, busy))
    }

    fn lit<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        changes: Changes,
        illumination: &I,
        busy: &Busy,
    ) -> CachedLight {
        // Measure the openness of the pixels, and update the openness of records.
        self.frame += 1;
        let seen = request.seen;
        let openness = Openness::new(&request, &self.openness, illumination, busy);
        let known = KnownNeighbors::default();
        let picture = SurfacePicture::new(request, &openness, &known, busy);
        busy.measure(|| self.carry_along(seen));
        openness::renew(&mut self.records, seen, illumination, request.ranks, busy);

        // List the records. Hidden records, and records too far from every pixel, need no light.
        let mut tiles = Tiles::new(&picture);
        tiles.list(&picture, &self.records, 0..self.records.len());
        let needed = self.needed(&picture, &tiles, request.is_first_of_many);
        let needed = self.without_superfluous(&picture, &tiles, needed);

        // List records again before gaps between them are filled, because radii depend on the new light.
        let moved: Vec<usize> = (0..needed.len()).filter(|&place| self.records[needed[place]].moved).collect();
        let update = self.update_by(changes);
        let mut computed = self.bring_up_to_date(&needed, &update, illumination, &picture);
        tiles.clear();
        tiles.list(&picture, &self.records, needed);
        computed += self.fill(&picture, &mut tiles, moved, illumination);
        if illumination.is_discarded() {
            let dark = Plane::filled(seen.pixels.width(), seen.pixels.height(), [0.0; 3]);
            return CachedLight { irradiance: dark, in_use: 0, computed };
        }
        let (predicted, taught) = predictions(&picture, &tiles, &self.records, &Vec::from_iter(0..tiles.listed.len()));

        // Interpolate the light, and keep the sums for further pictures.
        let (irradiance, used) = interpolate::picture(&picture, &tiles, &predicted);
        self.known = KnownNeighbors::default();
        if request.is_first_of_many {
            self.known.keep(&tiles.listed, &self.records, taught, self.made);
        }
        let in_use = used.len();
        for index in used {
            self.records[index].seen = self.frame;
        }
        if request.wanted.is_some() {
            self.keep_shown(&picture);
        }
        self.forget(in_use, seen.pixels.samples().len());
        self.openness = openness;
        CachedLight { irradiance, in_use, computed }
    }

    /// Lights a further picture of the frame of the last [`IrradianceCache::light`] call, for example with other sample
    /// positions. Uses the existing records and adds missing records.
    pub fn light_more<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        illumination: &I,
    ) -> Timed<CachedLight> {
        Timed::of(|busy| self.more_lit(request, illumination, busy))
    }

    fn more_lit<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        illumination: &I,
        busy: &Busy,
    ) -> CachedLight {
        let openness = Openness::new(&request, &self.openness, illumination, busy);
        let mut known = std::mem::take(&mut self.known);
        let picture = SurfacePicture::new(request, &openness, &known, busy);

        // Exclude records that were last updated before the light changed.
        let mut tiles = Tiles::new(&picture);
        let is_usable = |record: &Record<R>| record.current >= self.changed || record.waited == self.frame;
        let current = (0..self.records.len()).filter(|&index| is_usable(&self.records[index]));
        tiles.list(&picture, &self.records, current);
        let computed = self.fill(&picture, &mut tiles, Vec::new(), illumination);
        let (predicted, taught) = predictions(&picture, &tiles, &self.records, &Vec::from_iter(0..tiles.listed.len()));

        // Interpolate the light, and keep the sums for further pictures.
        let (irradiance, used) = interpolate::picture(&picture, &tiles, &predicted);
        known.keep(&tiles.listed, &self.records, taught, self.made);
        self.known = known;
        let in_use = used.len();
        for index in used {
            self.records[index].seen = self.frame;
        }
        CachedLight { irradiance, in_use, computed }
    }

    /// Returns the sites and recipes of the records with recipes on this rank.
    pub fn recipes(&self) -> impl Iterator<Item = (&Site, &R)> {
        self.records.iter().filter_map(|record| Some((&record.site, record.recipe.as_ref()?)))
    }

    /// Returns the sites of all records.
    pub fn sites(&self) -> impl Iterator<Item = &Site> {
        self.records.iter().map(|record| &record.site)
    }

    /// Returns the positions of the records that the last picture used, each with its [`note`](Illumination::note).
    pub fn records_in_use(&self) -> impl Iterator<Item = (Vec3A, u32)> {
        let frame = self.frame;
        self.records.iter().filter(move |record| record.seen == frame).map(|record| (record.site.position, record.note))
    }

    /// Returns the recipes on this rank, in the order of their records.
    #[must_use]
    pub fn kept(&self) -> Vec<KeptRecipe<&R>> {
        let mut kept = Vec::new();
        for record in &self.records {
            if let Some(recipe) = &record.recipe {
                kept.push(KeptRecipe { number: record.number, recipe });
            }
        }
        kept
    }

    /// Adds the recipes that [`kept`](Self::kept) returned on another rank.
    pub fn complete(&mut self, kept: Vec<KeptRecipe<R>>) {
        // Merge the lists, which are in the same order.
        let mut kept = kept.into_iter().peekable();
        for record in &mut self.records {
            if let Some(own) = kept.next_if(|kept| kept.number == record.number) {
                record.recipe = Some(own.recipe);
            }
        }
    }

    /// Drops the recipes of records that other ranks own.
    pub fn keep_own(&mut self, ranks: &dyn Ranks) {
        for record in &mut self.records {
            if record.owner(ranks) != ranks.rank() {
                record.recipe = None;
            }
        }
    }

    /// Returns the indices of the listed records that light the picture. If more pictures may follow, includes records
    /// that only further pictures of the previous frame used.
    fn needed(&self, picture: &SurfacePicture, tiles: &Tiles, is_first_of_many: bool) -> Vec<usize> {
        let mut needed = tiles.in_use(picture);
        if is_first_of_many {
            let last = self.frame - 1;
            let listed = tiles.listed.iter().map(|&index| index as usize);
            needed.extend(listed.filter(|&index| self.records[index].seen == last));
            needed.sort_unstable();
            needed.dedup();
        }
        needed
    }

    /// Drops `needed` records that are superfluous next to others. Returns the new indices of the remaining records.
    fn without_superfluous(&mut self, picture: &SurfacePicture, tiles: &Tiles, needed: Vec<usize>) -> Vec<usize> {
        let superfluous = tiles.superfluous(picture, &self.records, &needed);
        if superfluous.is_empty() {
            return needed;
        }

        // Keep the order of the remaining records.
        let mut is_dropped = vec![false; self.records.len()];
        for &index in &superfluous {
            is_dropped[index] = true;
        }
        let mut dropped = is_dropped.into_iter();
        self.records.retain(|_| dropped.next() == Some(false));

        // Decrease each index by the number of records dropped before it.
        let mut left = Vec::with_capacity(needed.len());
        for index in needed {
            if let Err(dropped_before) = superfluous.binary_search(&index) {
                left.push(index - dropped_before);
            }
        }
        left
    }

    /// Moves the records on moving geometry, or drops them if the geometry deforms.
    fn carry_along(&mut self, seen: &GBuffer) {
        if self.world.len() == seen.world.len() {
            // Compute the motion M' M⁻¹ of each instance, or `None` if the instance has not moved.
            let mut carry = Vec::with_capacity(seen.world.len());
            for (now, then) in seen.world.iter().zip(&self.world) {
                carry.push((now != then).then(|| *now * then.inverse()));
            }
            for record in &mut self.records {
                let carrier = record.site.carrier;
                if carrier != NOTHING
                    && let Some(carry) = carry[carrier as usize]
                {
                    record.site.carried_by(&carry);
                    record.moved = true;
                }
            }

            // Drop records on deforming geometry, because points on it do not keep their positions.
            let bends = |carrier: u32| matches!(seen.deformed.get(carrier as usize), Some(Some(_)));
            self.records.retain(|Record { site, .. }| {
                site.position.is_finite()
                    && site.normal != Vec3A::ZERO
                    && (site.carrier == NOTHING || !bends(site.carrier))
            });
        }
        self.world.clone_from(&seen.world);
    }

    /// Returns the update from the previous frame to the current frame, and stores the frame of the `changes`.
    fn update_by(&mut self, changes: Changes) -> Update {
        // Compare with the previous change: a record that was current at that time has missed only the changes of this frame.
        let update = Update { frame: self.frame, geometry: changes.geometry, changed_before: self.changed };
        if changes.light || changes.geometry {
            self.changed = self.frame;
        }
        update
    }

    /// Updates the `needed` records to the light of the picture's frame. Returns the number of recomputed records.
    fn bring_up_to_date<I: Illumination<Recipe = R>>(
        &mut self,
        needed: &[usize],
        update: &Update,
        illumination: &I,
        picture: &SurfacePicture,
    ) -> usize {
        let (ranks, busy) = (picture.ranks(), picture.busy);
        // Select the records that were last lit before the last change, except those that wait.
        let mut outdated = Vec::new();
        for &index in needed {
            let record = &mut self.records[index];
            if record.current < self.changed {
                if record.waits(self.frame) && illumination.may_wait(&record.site) {
                    record.waited = self.frame;
                } else {
                    outdated.push(index);
                }
            }
        }
        let assignments: Vec<Assignment> = outdated.iter().map(|&index| self.records[index].assignment()).collect();

        // Light this rank's records in chunks: reading the clock for each record would take longer than lighting some
        // of them.
        let lights: Vec<RecordLight> = share(ranks, &assignments, |places, meter| {
            let mut own = vec![Fate::Stays; self.records.len()];
            for &place in places {
                own[outdated[place]] = Fate::IsOutdated;
            }
            let chunks = self.records.par_chunks_mut(CHUNK).zip(own.par_chunks_mut(CHUNK));
            let bring = |scratch: &mut I::Scratch, (records, own): (&mut [Record<R>], &mut [Fate])| {
                busy.measure(|| update.bring_all(records.iter_mut().zip(own), illumination, scratch, meter));
            };
            chunks.for_each_init(I::Scratch::default, bring);
            let indices = places.iter().map(|&place| outdated[place]);
            indices.map(|index| self.records[index].light(own[index] == Fate::WasComputed)).collect()
        });

        // Receive the light of the other records from their ranks.
        let mut computed = 0;
        for ((&index, assignment), light) in outdated.iter().zip(assignments).zip(lights) {
            if assignment.owner(ranks.count()) != ranks.rank() {
                update.take(&mut self.records[index], light);
            }
            computed += usize::from(light.afresh);
        }
        computed
    }

    /// Marks the records that the picture shows as seen. If only regions are lit, other regions will need these
    /// records.
    fn keep_shown(&mut self, picture: &SurfacePicture) {
        let frame = self.frame;
        self.records.par_chunks_mut(LARGE_CHUNK).for_each(|records| {
            picture.busy.measure(|| {
                for record in records.iter_mut().filter(|record| picture.has(&record.site)) {
                    record.seen = frame;
                }
            });
        });
    }

    /// Drops records that were unseen for too long. If too many records remain, drops the records unseen for longest.
    fn forget(&mut self, in_use: usize, pixels: usize) {
        let frame = self.frame;
        self.records.retain(|record| frame - record.seen <= PATIENCE);

        // Drop the records seen longest ago if too many remain, but keep all records seen in this frame.
        let most = (KEPT_FOR_EACH_USED * in_use).max(pixels / PIXELS_FOR_EACH_KEPT);
        if self.records.len() > most {
            let mut last_seen: Vec<u32> = self.records.iter().map(|record| record.seen).collect();
            let (_, &mut oldest, _) = last_seen.select_nth_unstable(self.records.len() - most);
            self.records.retain(|record| record.seen > oldest || record.seen == frame);
        }
    }
}

/// Result of updating a record.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    /// The record is up to date, not needed, or owned by another rank.
    Stays,
    IsOutdated,
    /// The record was relit from its recipe.
    WasRelit,
    WasComputed,
}

/// Changes since the previous frame, which determine the update of a record.
#[derive(Clone)]
struct Update {
    frame: u32,
    /// Whether geometry that blocks or reflects light has moved.
    geometry: bool,
    /// Frame of the last change before this change.
    changed_before: u32,
}

impl Update {
    /// Updates the outdated records among `records` to this frame's light, and stores the result of each update.
    fn bring_all<'a, I: Illumination<Recipe: 'a>>(
        &self,
        records: impl Iterator<Item = (&'a mut Record<I::Recipe>, &'a mut Fate)>,
        illumination: &I,
        scratch: &mut I::Scratch,
        meter: &Meter,
    ) {
        // Log the time of each record by its owner, from which costs on more ranks are predicted.
        let mut laps = meter.laps();
        for (record, fate) in records {
            if *fate == Fate::IsOutdated {
                let computed = self.bring(record, illumination, scratch);
                *fate = if computed { Fate::WasComputed } else { Fate::WasRelit };
                laps.note(record.assignment());
            }
        }
    }

    /// Stores light that another rank computed.
    fn take<R>(&self, record: &mut Record<R>, light: RecordLight) {
        record.relit(self.frame, light.estimate);
        record.note = light.note;
    }

    /// Updates a record to this frame's light. Returns whether it was recomputed.
    fn bring<I: Illumination>(
        &self,
        record: &mut Record<I::Recipe>,
        illumination: &I,
        scratch: &mut I::Scratch,
    ) -> bool {
        // Recompute each record once per period while geometry moves, even if it could be relit.
        let is_its_turn = self.geometry && record.number.wrapping_add(self.frame).is_multiple_of(TURN);

        // Relight the record if possible. Relighting costs least if only the latest motion can have changed the light.
        // A record that was current at the last change before this frame has missed this frame's motion only.
        let ago = if record.current >= self.changed_before { 1 } else { (self.frame - record.current) as usize };
        let kept_up = !record.moved && ago <= MOST_WAITED;
        let known = if kept_up { LastUpdate::FramesAgo(ago) } else { LastUpdate::Earlier };
        if !is_its_turn
            && let Some(recipe) = &mut record.recipe
            && let Some(estimate) = illumination.relight(&record.site, recipe, known)
        {
            record.relit(self.frame, estimate);
            return false;
        }

        // Otherwise, recompute the light and the recipe.
        let computed = illumination.compute(&record.site, scratch);
        record.note = illumination.note(&computed.recipe);
        record.computed_afresh(self.frame, computed);
        true
    }
}

#[cfg(test)]
mod tests;
