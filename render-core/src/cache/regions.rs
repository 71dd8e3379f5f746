//! Lighting of a picture in regions, such as tiles, one region at a time.
//!
//! ```text
//! begin_regions ──► light_region, light_more_of_region … for each region ──► end_regions
//!                     └── new records for other caches: take_new ──► adopt
//! ```
//!
//! A region uses the records of earlier regions, so the light of a picture depends on the order of regions. A region
//! also uses records around it, because neighbors contribute to the fits of the region's records.

use super::illumination::{Illumination, LocalIrradiance, Site};
use super::interpolate;
use super::known::KnownNeighbors;
use super::openness::{self, Openness};
use super::picture::SurfacePicture;
use super::predict::{Prediction, predictions};
use super::record::{Record, RecordLight};
use super::request::Request;
use super::tile::Tiles;
use super::{CachedLight, Changes, IrradianceCache, Update};
use crate::gbuffer::{GBuffer, NOTHING};
use crate::ranks::Alone;
use crate::{Busy, Timed};
use ranks::portable;

/// Width of the border around a region with records that contribute to the region's fits \[pixels\]. Neighbors count up
/// to a distance of 12 pixels (`predict.rs`).
const MARGIN: usize = 12;

/// State of a frame that is lit in regions.
#[derive(Clone, Default)]
pub(super) struct FrameRegions {
    update: Option<Update>,
    /// Openness of all regions so far.
    openness: Openness,
    /// Indices of the records in and around the latest region.
    near: Vec<usize>,
    /// Creation numbers of the records made by this cache since the last [`take_new`](IrradianceCache::take_new),
    /// ascending.
    new: Vec<u32>,
}

impl FrameRegions {
    /// Returns the records around the current region, or `None` if no frame was begun.
    pub fn around(&self) -> Option<&[usize]> {
        self.update.is_some().then_some(&self.near)
    }
}

/// Record that another cache shares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedRecord {
    site: Site,
    estimate: LocalIrradiance,
    note: u32,
    radius_by_neighbors: f32,
    share: f32,
    scale: f32,
    /// Frame of the record's light.
    current: u32,
}

portable!(SharedRecord { site, estimate, note, radius_by_neighbors, share, scale, current });

impl<R: Send + Sync> IrradianceCache<R> {
    /// Begins the next frame, which is lit in regions. `seen` is the whole picture.
    pub fn begin_regions<I: Illumination<Recipe = R>>(
        &mut self,
        seen: &GBuffer,
        changes: Changes,
        illumination: &I,
    ) -> Timed<()> {
        Timed::of(|busy| {
            self.frame += 1;
            busy.measure(|| self.carry_along(seen));
            openness::renew(&mut self.records, seen, illumination, &Alone, busy);
            // Store the update, which each region applies to the records that it uses.
            self.regions.update = Some(self.update_by(changes));

            // Drop outdated records without a recipe: they cannot be relit after a change of light.
            let changed = self.changed;
            self.records.retain(|record| record.recipe.is_some() || record.current >= changed);
            self.regions.openness = Openness::of_nothing(seen);
        })
    }

    /// Lights the wanted pixels of the frame's picture.
    ///
    /// # Panics
    /// If the frame was not begun with [`begin_regions`](Self::begin_regions).
    pub fn light_region<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        illumination: &I,
    ) -> Timed<CachedLight> {
        Timed::of(|busy| {
            // List the records in and around the region, without superfluous records.
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
            self.regions.near = tiles.candidates();

            // Update the records that the region's pixels use.
            let moved: Vec<bool> = self.records.iter().map(|record| record.moved).collect();
            let update = self.regions.update.take().expect("the frame was begun");
            let computed = self.bring_up_to_date(&needed, &update, illumination, &picture);
            self.regions.update = Some(update);

            let mut lit = self.region_lit(&picture, tiles, &moved, illumination);
            lit.computed += computed;
            self.regions.openness.take_wanted(&request, &openness);
            lit
        })
    }

    /// Lights pixels of the same region again at other sample positions.
    pub fn light_more_of_region<I: Illumination<Recipe = R>>(
        &mut self,
        request: Request,
        illumination: &I,
    ) -> Timed<CachedLight> {
        Timed::of(|busy| {
            // Reuse openness and sums of the earlier pictures of this region.
            let openness = Openness::new(&request, &self.regions.openness, illumination, busy);
            let known = std::mem::take(&mut self.known);
            let picture = SurfacePicture::new(request, &openness, &known, busy);
            let tiles = Tiles::around(&picture, MARGIN);
            let lit = self.region_lit(&picture, tiles, &[], illumination);

            // Append the sums of this picture to the sums of earlier pictures.
            let mut known = known;
            known.join(std::mem::take(&mut self.known));
            self.known = known;
            lit
        })
    }

    /// Ends a frame after this cache or other caches have lit all regions. Records visible in `seen` are kept.
    pub fn end_regions(&mut self, seen: &GBuffer, moving: &[bool]) {
        let busy = Busy::default();
        let (openness, known) = (std::mem::take(&mut self.regions.openness), KnownNeighbors::default());
        self.keep_shown(&SurfacePicture::new(Request::whole(seen, moving), &openness, &known, &busy));
        let in_use = self.records.iter().filter(|record| record.seen == self.frame).count();
        self.forget(in_use, seen.pixels.samples().len());
        self.openness = openness;
        self.known = known;
        self.regions.update = None;
    }

    /// Returns the records that this cache made since the last call, for other caches to [`adopt`](Self::adopt).
    pub fn take_new(&mut self) -> Vec<SharedRecord> {
        let mut taken = Vec::new();
        for number in std::mem::take(&mut self.regions.new) {
            // Skip records that were dropped in the meantime.
            let Ok(index) = self.records.binary_search_by_key(&number, |record| record.number) else { continue };
            let Record { site, estimate, note, radius_by_neighbors, share, scale, current, .. } = self.records[index];
            taken.push(SharedRecord { site, estimate, note, radius_by_neighbors, share, scale, current });
        }
        taken
    }

    /// Adds records that other caches have made in the same scene, without their recipes. Keeps the radii that
    /// neighbors in the other cache have limited. Skips records if their light or position may have changed since.
    pub fn adopt(&mut self, shared: Vec<SharedRecord>) {
        for SharedRecord { site, estimate, note, radius_by_neighbors, share, scale, current } in shared {
            // Light is valid until the next change; positions on moving geometry are valid for one frame.
            let is_late = current < self.changed || current < self.frame && site.carrier != NOTHING;
            if is_late || current > self.frame {
                continue;
            }

            // Adopt the record under a number of this cache, with the limits that the other cache found.
            let light = RecordLight { estimate, note, afresh: true };
            let mut record = Record::new(site, scale, light, self.made, current);
            record.radius = record.radius.min(radius_by_neighbors);
            (record.radius_by_neighbors, record.share) = (radius_by_neighbors, share);
            self.records.push(record);
            self.made = self.made.wrapping_add(1);
        }
    }

    /// Lights a region with the current records near it and with new records.
    fn region_lit<I: Illumination<Recipe = R>>(
        &mut self,
        picture: &SurfacePicture,
        mut tiles: Tiles,
        moved: &[bool],
        illumination: &I,
    ) -> CachedLight {
        // Select the records near the region that have this frame's light.
        let mut near = Vec::with_capacity(self.regions.near.len());
        for &index in &self.regions.near {
            if self.records[index].current >= self.changed {
                near.push(index);
            }
        }
        let was_moved = |&place: &usize| moved.get(near[place]) == Some(&true);
        let moved = (0..near.len()).filter(was_moved).collect();
        tiles.clear();
        tiles.list(picture, &self.records, near);

        // Add records at pixels that these records leave uncovered.
        let (first, first_number) = (self.records.len(), self.made);
        let computed = self.fill(picture, &mut tiles, moved, illumination);
        self.regions.near.extend(first..self.records.len());
        self.regions.new.extend((0..computed as u32).map(|k| first_number.wrapping_add(k)));

        // Predict only records that reach the region's pixels.
        let places = tiles.places_in_use(picture);
        let (found, taught) = predictions(picture, &tiles, &self.records, &places);
        let mut predicted = vec![Prediction::NOTHING; tiles.listed.len()];
        for (&place, &own) in places.iter().zip(&found) {
            predicted[place] = own;
        }
        let (irradiance, used) = interpolate::picture(picture, &tiles, &predicted);

        // Keep the sums of these predictions for further pictures of the region.
        let mut known = KnownNeighbors::default();
        let listed: Vec<u32> = places.iter().map(|&place| tiles.listed[place]).collect();
        known.keep(&listed, &self.records, taught, self.made);
        self.known = known;
        let in_use = used.len();
        for index in used {
            self.records[index].seen = self.frame;
        }
        CachedLight { irradiance, in_use, computed }
    }
}
