//! An irradiance cache: indirect light varies slowly over a surface, so it is computed at few places and interpolated
//! between them, from pixel to pixel and from frame to frame.
//!
//! After \[Ward88\] and \[WardHeckbert92\] with the practice of \[Krivanek08\]; the light at a place comes from an
//! [`Illumination`].
//!
//! A frame goes like this: records on moving things are carried along; the records that the picture needs are brought up
//! to date; lattices of pixels, coarse to fine, are looked through for pixels that no record covers, and get one; records and
//! pixels where what is known is contradicted get more; at last every pixel is the weighted mean of what the records around it
//! predict.
//!
//! # Differs from the papers
//! * The weight is `(1 − e²)²` of the error measure e and ends smoothly at e = 1, so that a record's border is no edge.
//! * A record is made where the weights sum to less than a minimum, not where none is left. What a pass adds depends on
//!   earlier passes alone, so the result does not depend on the number of threads.
//! * A record serves places that are about as open as its own, by a few rays at each: see `openness.rs`.
//! * Derivatives by the position are fitted to neighboring records, where these know better: see `predict.rs`. What the fit
//!   leaves decides how far a record is used: see `doubt.rs`.
//! * The turn of the normal is accounted for exactly by the vector irradiance, as long as no light crosses the horizon.

mod doubt;
mod fill;
mod group;
mod illumination;
mod interpolate;
mod known;
mod openness;
mod parts;
mod picture;
mod predict;
mod radius;
mod record;
mod request;
mod spacing;
mod tile;
mod tolerance;

pub use illumination::{Computed, Illumination, LastUpdate, LocalIrradiance, Site};
pub use parts::SharedRecord;
pub use record::KeptRecipe;
pub use request::Request;
pub use spacing::footprint;

use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::{Meter, Ranks, Turn, share};
use crate::{Busy, Timed};
use glam::{Affine3A, Vec3A};
use known::{KnownNeighbors, Taught};
use openness::Openness;
use parts::FrameParts;
use picture::SurfacePicture;
use plane::Plane;
use predict::{Predicted, predictions};
use rayon::prelude::*;
use record::{Record, RecordLight};
use tile::Tiles;

/// Frames that a record may stay unseen before it is dropped.
const PATIENCE: u32 = 50;
/// Most records kept for each one that the picture uses, or for a number of pixels where it shows little; beyond, those unseen
/// for longest go first.
const KEPT_FOR_EACH_USED: usize = 3;
const PIXELS_FOR_EACH_KEPT: usize = 16;
/// While things move, each record in view is computed afresh once in this number of frames, in turns.
const TURN: u32 = 32;

/// Records that a thread takes at a time.
const CHUNK: usize = 16;
/// The same for what takes no rays.
const LARGE_CHUNK: usize = 512;

/// Records of light on surfaces, kept from frame to frame. `R` is what an [`Illumination`] keeps with each.
///
/// With the feature `serde` it can be written and read back, and goes on as if nothing had been in between. Where several ranks
/// share the work, each keeps the recipes of its own records: [`kept`](Self::kept) and [`complete`](Self::complete) bring them
/// together.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct IrradianceCache<R> {
    records: Vec<Record<R>>,
    frame: u32,
    /// Frame of the last change of light or things.
    changed: u32,
    made: u32,
    /// Where the instances stood in the last frame.
    world: Vec<Affine3A>,
    /// Openness in the last picture.
    openness: Openness,
    /// Neighbors of the records of this frame, for further pictures of it.
    #[cfg_attr(feature = "serde", serde(skip))]
    known: KnownNeighbors,
    /// The frame that is being lit part by part, if one is.
    #[cfg_attr(feature = "serde", serde(skip))]
    parts: FrameParts,
}

impl<R> std::fmt::Debug for IrradianceCache<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("IrradianceCache")
            .field("records", &self.records.len())
            .field("frame", &self.frame)
            .finish_non_exhaustive()
    }
}

/// Changes since the frame before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Changes {
    /// The lights have other flux.
    pub light: bool,
    /// Something that blocks or reflects light has moved.
    pub geometry: bool,
}

/// Irradiance of a picture, and what it took.
#[derive(Clone, Debug)]
pub struct CachedLight {
    /// \[W·m⁻²\], linear RGB, on the side of each pixel's shading normal; zero where no surface reflects.
    pub irradiance: Plane<[f32; 3]>,
    /// Records that some pixel took its light from.
    pub in_use: usize,
    /// Records computed, new ones and old ones afresh.
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
            parts: FrameParts::default(),
        }
    }
}

impl<R: Send + Sync> IrradianceCache<R> {
    /// Lights a picture.
    ///
    /// The result depends on the arguments of this call and the calls before it, not on the number of threads.
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
        // Openness of the picture's pixels. Records on moving things move to where the picture shows them.
        self.frame += 1;
        let seen = request.seen;
        let openness = Openness::new(&request, &self.openness, illumination, busy);
        let known = KnownNeighbors::default();
        let picture = SurfacePicture::new(request, &openness, &known, busy);
        busy.measure(|| self.carry_along(seen));
        openness::renew(&mut self.records, seen, illumination, request.ranks, busy);

        // Records that are hidden, or too far from every pixel, need no light.
        let mut tiles = Tiles::new(&picture);
        tiles.list(&picture, &self.records, 0..self.records.len());
        let needed = self.needed(&picture, &tiles, request.is_first_of_many);
        let needed = self.without_superfluous(&picture, &tiles, needed);

        // Their radii follow from their new light: they are listed anew before gaps between them are filled.
        let carried: Vec<usize> = (0..needed.len()).filter(|&place| self.records[needed[place]].carried).collect();
        let update = self.update_by(changes);
        let mut computed = self.bring_up_to_date(&needed, &update, illumination, &picture);
        tiles.clear();
        tiles.list(&picture, &self.records, needed);
        computed += self.fill(&picture, &mut tiles, carried, illumination);
        let predicted = predictions(&picture, &tiles, &self.records, &Vec::from_iter(0..tiles.listed.len()));

        // Pixels take their light, and what they took it from stays known.
        let (irradiance, used) = interpolate::picture(&picture, &tiles, &predicted);
        self.known = KnownNeighbors::default();
        if request.is_first_of_many {
            self.known.keep(&tiles.listed, &self.records, taught(&predicted), self.made);
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

    /// Lights another picture of the frame that [`IrradianceCache::light`] was last called for, such as one through other
    /// places of its pixels, from the records there are and those it still needs.
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

        // What this frame has not brought up to date is light of another.
        let mut tiles = Tiles::new(&picture);
        let current = (0..self.records.len()).filter(|&index| self.records[index].current >= self.changed);
        tiles.list(&picture, &self.records, current);
        let computed = self.fill(&picture, &mut tiles, Vec::new(), illumination);
        let predicted = predictions(&picture, &tiles, &self.records, &Vec::from_iter(0..tiles.listed.len()));

        // Pixels take their light, and what they took it from stays known.
        let (irradiance, used) = interpolate::picture(&picture, &tiles, &predicted);
        known.keep(&tiles.listed, &self.records, taught(&predicted), self.made);
        self.known = known;
        let in_use = used.len();
        for index in used {
            self.records[index].seen = self.frame;
        }
        CachedLight { irradiance, in_use, computed }
    }

    /// Places and recipes of the records, without those whose recipes other ranks have.
    pub fn recipes(&self) -> impl Iterator<Item = (&Site, &R)> {
        self.records.iter().filter_map(|record| Some((&record.site, record.recipe.as_ref()?)))
    }

    /// Places of all records.
    pub fn sites(&self) -> impl Iterator<Item = &Site> {
        self.records.iter().map(|record| &record.site)
    }

    /// Places of the records that the last picture took light from, and the [`note`](Illumination::note) of each.
    pub fn records_in_use(&self) -> impl Iterator<Item = (Vec3A, u32)> {
        let frame = self.frame;
        self.records.iter().filter(move |record| record.seen == frame).map(|record| (record.site.position, record.note))
    }

    /// The recipes that this rank keeps, in the order of their records.
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

    /// Adds recipes that another rank has [`kept`](Self::kept).
    pub fn complete(&mut self, kept: Vec<KeptRecipe<R>>) {
        // Both are in the same order.
        let mut kept = kept.into_iter().peekable();
        for record in &mut self.records {
            if let Some(own) = kept.next_if(|kept| kept.number == record.number) {
                record.recipe = Some(own.recipe);
            }
        }
    }

    /// Drops the recipes of records that are not this rank's.
    pub fn keep_own(&mut self, ranks: &dyn Ranks) {
        for record in &mut self.records {
            if record.owner(ranks) != ranks.rank() {
                record.recipe = None;
            }
        }
    }

    /// Indices of the listed records that a picture takes light from. Its first picture brings all of a frame's records up to date:
    /// those that only further ones needed in the frame before are among them.
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

    /// Drops those of the `needed` records that add nothing to the others; returns the indices of the others.
    fn without_superfluous(&mut self, picture: &SurfacePicture, tiles: &Tiles, needed: Vec<usize>) -> Vec<usize> {
        let superfluous = tiles.superfluous(picture, &self.records, &needed);
        if superfluous.is_empty() {
            return needed;
        }

        // Drop them. The others keep their order.
        let mut is_dropped = vec![false; self.records.len()];
        for &index in &superfluous {
            is_dropped[index] = true;
        }
        let mut dropped = is_dropped.into_iter();
        self.records.retain(|_| dropped.next() == Some(false));

        // Each record moved down by as many places as records before it are gone.
        let mut left = Vec::with_capacity(needed.len());
        for index in needed {
            if let Err(dropped_before) = superfluous.binary_search(&index) {
                left.push(index - dropped_before);
            }
        }
        left
    }

    /// Records on moving things move with them.
    fn carry_along(&mut self, seen: &GBuffer) {
        if self.world.len() == seen.world.len() {
            // From where an instance stood to where it stands: M' M⁻¹; none if it has not moved.
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
                    record.carried = true;
                }
            }

            // What bends does not keep its points in place: records there are made anew.
            let bends = |carrier: u32| matches!(seen.deformed.get(carrier as usize), Some(Some(_)));
            self.records.retain(|Record { site, .. }| {
                site.position.is_finite()
                    && site.normal != Vec3A::ZERO
                    && (site.carrier == NOTHING || !bends(site.carrier))
            });
        }
        self.world.clone_from(&seen.world);
    }

    /// The way from the frame before to this one, in which so much has changed.
    fn update_by(&mut self, changes: Changes) -> Update {
        // A record that was up to date at the change before this one has missed nothing but this one.
        let update = Update { frame: self.frame, geometry: changes.geometry, changed_before: self.changed };
        if changes.light || changes.geometry {
            self.changed = self.frame;
        }
        update
    }

    /// Brings the `needed` records to the light of the picture's frame; returns how many were computed afresh.
    fn bring_up_to_date<I: Illumination<Recipe = R>>(
        &mut self,
        needed: &[usize],
        update: &Update,
        illumination: &I,
        picture: &SurfacePicture,
    ) -> usize {
        let (ranks, busy) = (picture.ranks(), picture.busy);
        // Outdated is what was last lit before the last change.
        let is_outdated = |&index: &usize| self.records[index].current < self.changed;
        let outdated: Vec<usize> = needed.iter().copied().filter(is_outdated).collect();
        let turns: Vec<Turn> = outdated.iter().map(|&index| self.records[index].turn()).collect();

        // This rank lights its own, a few at a time: to look at the clock for each would take longer than to light some of them.
        let lights: Vec<RecordLight> = share(ranks, &turns, |places, meter| {
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

        // All others come from their ranks.
        let mut computed = 0;
        for ((&index, turn), light) in outdated.iter().zip(turns).zip(lights) {
            if turn.owner(ranks.count()) != ranks.rank() {
                update.take(&mut self.records[index], light);
            }
            computed += usize::from(light.afresh);
        }
        computed
    }

    /// Where only parts of the picture are lit, its other parts will want their records again.
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

    /// Drops records that were not seen for long, and those unseen for longest of more than the picture's needs explain.
    fn forget(&mut self, in_use: usize, pixels: usize) {
        let frame = self.frame;
        self.records.retain(|record| frame - record.seen <= PATIENCE);

        // If still too many are left, those seen longest ago go, but none that this frame has seen.
        let most = (KEPT_FOR_EACH_USED * in_use).max(pixels / PIXELS_FOR_EACH_KEPT);
        if self.records.len() > most {
            let mut last_seen: Vec<u32> = self.records.iter().map(|record| record.seen).collect();
            let (_, &mut oldest, _) = last_seen.select_nth_unstable(self.records.len() - most);
            self.records.retain(|record| record.seen > oldest || record.seen == frame);
        }
    }
}

/// The sums behind predictions.
fn taught(predicted: &[Predicted]) -> Vec<Taught> {
    predicted.iter().map(|predicted| predicted.taught).collect()
}

/// Fate of a record when all that are needed are brought up to date.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    /// It is up to date, not needed, or another rank's.
    Stays,
    IsOutdated,
    /// It was lit again from its recipe.
    WasRelit,
    WasComputed,
}

/// The changes since the frame before, by which a record is brought up to date.
struct Update {
    frame: u32,
    /// Whether something that blocks or reflects light has moved.
    geometry: bool,
    /// Frame of the last change before this one.
    changed_before: u32,
}

impl Update {
    /// Brings those of `records` that are outdated to this frame's light, and notes how in their fates.
    fn bring_all<'a, I: Illumination<Recipe: 'a>>(
        &self,
        records: impl Iterator<Item = (&'a mut Record<I::Recipe>, &'a mut Fate)>,
        illumination: &I,
        scratch: &mut I::Scratch,
        meter: &Meter,
    ) {
        let mut laps = meter.laps();
        for (record, fate) in records {
            if *fate == Fate::IsOutdated {
                let computed = self.bring(record, illumination, scratch);
                *fate = if computed { Fate::WasComputed } else { Fate::WasRelit };
                laps.note(record.turn());
            }
        }
    }

    /// Takes the light that another rank has found.
    fn take<R>(&self, record: &mut Record<R>, light: RecordLight) {
        (record.current, record.carried) = (self.frame, false);
        record.relit(light.estimate);
        record.note = light.note;
    }

    /// Brings a record to this frame's light; returns whether it was computed afresh.
    fn bring<I: Illumination>(
        &self,
        record: &mut Record<I::Recipe>,
        illumination: &I,
        scratch: &mut I::Scratch,
    ) -> bool {
        // While things move, each record has its turn to be computed afresh, however well it could be lit again.
        let is_its_turn = self.geometry && record.number.wrapping_add(self.frame).is_multiple_of(TURN);

        // Relighting costs less, least where only the latest motion can have changed something.
        let kept_up = !record.carried && record.current >= self.changed_before;
        let known = if kept_up { LastUpdate::LastFrame } else { LastUpdate::Earlier };
        (record.current, record.carried) = (self.frame, false);
        if !is_its_turn
            && let Some(recipe) = &mut record.recipe
            && let Some(estimate) = illumination.relight(&record.site, recipe, known)
        {
            record.relit(estimate);
            return false;
        }
        let computed = illumination.compute(&record.site, scratch);
        record.note = illumination.note(&computed.recipe);
        record.computed_afresh(computed);
        true
    }
}

#[cfg(test)]
mod tests;
