//! A picture that is lit part by part, such as tiles of it, each when its turn comes.
//!
//! ```text
//! begin_parts ──► light_part, light_more_of_part … for each part ──► end_parts
//!                     └── records made since go to other caches: take_new ──► adopt
//! ```
//! Parts know the records that parts before them have made, so the light of a picture depends on their order. A part looks at
//! records around it, too: neighbors teach those that its pixels use.

use super::illumination::{Illumination, LocalIrradiance, Site};
use super::interpolate;
use super::known::KnownNeighbors;
use super::openness::{self, Openness};
use super::picture::SurfacePicture;
use super::predict::{Predicted, predictions};
use super::record::{Record, RecordLight};
use super::request::Request;
use super::tile::Tiles;
use super::{CachedLight, Changes, IrradianceCache, Update, taught};
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::Alone;
use crate::{Busy, Timed};
use ranks::portable;

/// Pixels around a part whose records teach those of its own: neighbors count up to 12 pixels away (`predict.rs`).
const MARGIN: usize = 12;

/// A frame whose parts are being lit.
#[derive(Default)]
pub(super) struct FrameParts {
    update: Option<Update>,
    /// Openness of the parts so far.
    openness: Openness,
    /// Records in and around the part that was lit last.
    near: Vec<usize>,
    /// Numbers of the records that were made here since they were last taken, ascending.
    new: Vec<u32>,
}

impl FrameParts {
    /// The records around the part that is being lit, if one is.
    pub fn around(&self) -> Option<&[usize]> {
        self.update.is_some().then_some(&self.near)
    }
}

/// A record of another cache.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedRecord {
    site: Site,
    estimate: LocalIrradiance,
    note: u32,
    radius_by_neighbors: f32,
    share: f32,
    scale: f32,
    /// Frame whose light it has.
    current: u32,
}

portable!(SharedRecord { site, estimate, note, radius_by_neighbors, share, scale, current });

impl<R: Send + Sync> IrradianceCache<R> {
    /// Begins the next frame, whose picture is to be lit part by part; `seen` is all of it.
    pub fn begin_parts<I: Illumination<Recipe = R>>(
        &mut self,
        seen: &GBuffer,
        changes: Changes,
        illumination: &I,
    ) -> Timed<()> {
        Timed::of(|busy| {
            self.frame += 1;
            busy.measure(|| self.carry_along(seen));
            openness::renew(&mut self.records, seen, illumination, &Alone, busy);
            self.parts.update = Some(self.update_by(changes));

            // Records of other ranks cannot be lit again: when the light has changed they are of no use.
            let changed = self.changed;
            self.records.retain(|record| record.recipe.is_some() || record.current >= changed);
            self.parts.openness = Openness::of_nothing(seen);
        })
    }

    /// Lights the wanted pixels of the frame's picture.
    ///
    /// # Panics
    /// Unless the frame was begun with [`begin_parts`](Self::begin_parts).
    pub fn light_part<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        illumination: &I,
    ) -> Timed<CachedLight> {
        Timed::of(|busy| {
            // The records in and around the part, but for those that crowd it.
            self.known = KnownNeighbors::default();
            let openness = Openness::new(&request, &self.openness, illumination, busy);
            let nothing_known = KnownNeighbors::default();
            let picture = SurfacePicture::new(request, &openness, &nothing_known, busy);
            let mut tiles = Tiles::around(&picture, MARGIN);
            tiles.list(&picture, &self.records, 0..self.records.len());
            let (needed, before) = (tiles.in_use(&picture), self.records.len());
            let needed = self.without_superfluous(&picture, &tiles, needed);
            if self.records.len() < before {
                tiles.clear();
                tiles.list(&picture, &self.records, 0..self.records.len());
            }
            self.parts.near = tiles.candidates();

            // Records that the part's pixels use are brought up to date.
            let carried: Vec<bool> = self.records.iter().map(|record| record.carried).collect();
            let update = self.parts.update.take().expect("the frame was begun");
            let computed = self.bring_up_to_date(&needed, &update, illumination, &picture);
            self.parts.update = Some(update);

            let mut lit = self.part_lit(&picture, tiles, &carried, illumination);
            lit.computed += computed;
            self.parts.openness.take_wanted(&request, &openness);
            lit
        })
    }

    /// Lights the pixels of the same part, or some of them, through other places.
    pub fn light_more_of_part<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        illumination: &I,
    ) -> Timed<CachedLight> {
        Timed::of(|busy| {
            let openness = Openness::new(&request, &self.parts.openness, illumination, busy);
            let known = std::mem::take(&mut self.known);
            let picture = SurfacePicture::new(request, &openness, &known, busy);
            let tiles = Tiles::around(&picture, MARGIN);
            let lit = self.part_lit(&picture, tiles, &[], illumination);

            // Sums of this picture join those of the ones before.
            let mut known = known;
            known.join(std::mem::take(&mut self.known));
            self.known = known;
            lit
        })
    }

    /// Ends a frame whose parts are lit: by this cache, or by others. Records that `seen` shows are kept for them.
    pub fn end_parts(&mut self, seen: &GBuffer, moving: &[bool]) {
        let busy = Busy::default();
        let (openness, known) = (std::mem::take(&mut self.parts.openness), KnownNeighbors::default());
        self.keep_shown(&SurfacePicture::new(Request::whole(seen, moving), &openness, &known, &busy));
        let in_use = self.records.iter().filter(|record| record.seen == self.frame).count();
        self.forget(in_use, seen.pixels.samples().len());
        self.openness = openness;
        self.known = known;
        self.parts.update = None;
    }

    /// The records that were made here since they were last taken, for other caches to [`adopt`](Self::adopt).
    pub fn take_new(&mut self) -> Vec<SharedRecord> {
        let mut taken = Vec::new();
        for number in std::mem::take(&mut self.parts.new) {
            // Some may have been dropped meanwhile.
            let Ok(index) = self.records.binary_search_by_key(&number, |record| record.number) else { continue };
            let Record { site, estimate, note, radius_by_neighbors, share, scale, current, .. } = self.records[index];
            taken.push(SharedRecord { site, estimate, note, radius_by_neighbors, share, scale, current });
        }
        taken
    }

    /// Adds records that other caches have made of the same scene, without their recipes. The radii that their neighbors there leave
    /// them hold here. Those whose light or place may have
    /// changed since are left out.
    pub fn adopt(&mut self, shared: Vec<SharedRecord>) {
        for SharedRecord { site, estimate, note, radius_by_neighbors, share, scale, current } in shared {
            let is_late = current < self.changed || current < self.frame && site.carrier != NOTHING;
            if is_late || current > self.frame {
                continue;
            }
            let light = RecordLight { estimate, note, afresh: true };
            let mut record = Record::new(site, scale, light, self.made, current);
            record.radius = record.radius.min(radius_by_neighbors);
            (record.radius_by_neighbors, record.share) = (radius_by_neighbors, share);
            self.records.push(record);
            self.made = self.made.wrapping_add(1);
        }
    }

    /// The light of a part, from the current ones of the records near it and those it still needs.
    fn part_lit<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        mut tiles: Tiles,
        carried: &[bool],
        illumination: &I,
    ) -> CachedLight {
        // The records near it that have this frame's light.
        let mut near = Vec::with_capacity(self.parts.near.len());
        for &index in &self.parts.near {
            if self.records[index].current >= self.changed {
                near.push(index);
            }
        }
        let was_carried = |&place: &usize| carried.get(near[place]) == Some(&true);
        let carried = (0..near.len()).filter(was_carried).collect();
        tiles.clear();
        tiles.list(picture, &self.records, near);

        // New ones where these leave something bare.
        let (first, first_number) = (self.records.len(), self.made);
        let computed = self.fill(picture, &mut tiles, carried, illumination);
        self.parts.near.extend(first..self.records.len());
        self.parts.new.extend((0..computed as u32).map(|k| first_number.wrapping_add(k)));

        // Pixels take their light from those that reach them: what the others predict is not asked for.
        let places = tiles.places_in_use(picture);
        let found = predictions(picture, &tiles, &self.records, &places);
        let mut predicted = vec![Predicted::NOTHING; tiles.listed.len()];
        for (&place, &own) in places.iter().zip(&found) {
            predicted[place] = own;
        }
        let (irradiance, used) = interpolate::picture(picture, &tiles, &predicted);

        // Sums of these predictions stay known for further samples.
        let mut known = KnownNeighbors::default();
        let listed: Vec<u32> = places.iter().map(|&place| tiles.listed[place]).collect();
        known.keep(&listed, &self.records, taught(&found), self.made);
        self.known = known;
        let in_use = used.len();
        for index in used {
            self.records[index].seen = self.frame;
        }
        CachedLight { irradiance, in_use, computed }
    }
}
