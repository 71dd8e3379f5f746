//! Indirect light by an irradiance cache: records are computed by lightcuts and interpolated at pixels.

mod estimate;
mod recent;
mod recipe;
mod tree_light;

use super::audits::Audits;
use super::counts::{Counts, RecordCounts};
use super::layer::{Layer, Lit, RegionLayer, RegionSample, Visible};
use super::movement::intensities;
use super::pixel::is_dark;
use super::reprojected::{Holding, Reprojectable};
use super::tolerance::Tolerance;
use super::visibility::{GATHER_RAYS, Visibility};
use crate::frame::Frame;
use crate::plan::{Plan, Stage};
use crate::settings::Aov;
use glam::Vec3;
use pipeline::error::{Error, Result};
use pipeline::state::{NONSENSE, decode, encode};
use plane::Plane;
use recent::RecentChanges;
use recipe::Recipe;
use render_core::cache::{Changes, IrradianceCache, Request, SharedRecord, Site};
use render_core::ranks::Ranks;
use render_core::scene::Projected;
use render_core::{Busy, NOTHING, PACKET, Unseen};
use std::sync::Arc;
use tree_light::TreeLight;

/// Layer of cached light from the light tree and from dynamic anchors. Records persist between frames.
#[derive(Clone)]
pub(super) struct Cached {
    records: IrradianceCache<Recipe>,
    /// Whether lights and geometry are static for the whole film, so that no record is ever updated.
    at_rest: bool,
    /// Whether final gather restores the light lost by clamping virtual lights.
    compensates: bool,
    /// Whether pixels may have several samples.
    has_more: bool,
    /// Intensities of the lights in the previous frame; empty before the first frame.
    intensities: Vec<Vec3>,
    /// Motion and light of the last frames.
    recent: RecentChanges,
    /// Whether updates of records may wait if their light changes slowly.
    waits: bool,
    /// Ranks that share the records. One rank stores the recipe of each record.
    ranks: Arc<dyn Ranks>,
}

impl Cached {
    /// Creates an empty cache for a film with `plan` and at most `most_samples` samples per pixel. Updates wait if the
    /// plan reprojects light: they reuse light of earlier frames, too.
    pub fn new(plan: &Plan, most_samples: u32, ranks: Arc<dyn Ranks>) -> Self {
        let changing = [Stage::ObjectPlacing, Stage::Deformation, Stage::Photons, Stage::TreeUpdate];
        let at_rest = !changing.into_iter().any(|stage| plan.is_on(stage));
        let compensates = plan.is_on(Stage::Compensation);
        let has_more = most_samples > 1;
        Self {
            records: IrradianceCache::default(),
            at_rest,
            compensates,
            has_more,
            intensities: Vec::new(),
            recent: RecentChanges::default(),
            waits: plan.is_on(Stage::ReprojectedLight),
            ranks,
        }
    }

    /// Returns the light tree of a frame, as the source of records.
    fn tree_light<'a>(
        &self,
        visible: &'a Visible<'a>,
        tolerance: &'a Tolerance<'a>,
        counts: &'a Counts,
    ) -> TreeLight<'a> {
        // Update records only with the first sample of the pixels.
        let Visible { frame, movement, sample, part, .. } = *visible;
        let is_first = part.map_or(sample == 0, |part| part == RegionSample::First);
        TreeLight {
            visible,
            tolerance,
            visibility: Visibility::new(frame, GATHER_RAYS),
            counts,
            swept: if is_first { &movement.swept } else { &[] },
            recent: self.recent.clone(),
            waits: self.waits && part.is_none() && !self.recent.is_sudden(),
            standing: movement.standing(),
            moving: frame.surfaces.moving(),
            compensates: self.compensates,
            at_rest: self.at_rest,
        }
    }

    /// Returns an image in which `mark` changes the pixel of each record in use. `mark` receives the size of the
    /// record's lightcut.
    fn at_records(&self, frame: &Frame, mark: impl Fn(&mut f32, u32)) -> Vec<f32> {
        let (width, height) = (frame.seen.pixels.width(), frame.seen.pixels.height());
        let mut picture = vec![0.0; width * height];
        for (position, size) in self.records.records_in_use() {
            let Some(Projected { pixel: place, .. }) = frame.seen.view.project(position) else { continue };
            if place.min_element() >= 0.0 && place.x < width as f32 && place.y < height as f32 {
                mark(&mut picture[place.y as usize * width + place.x as usize], size);
            }
        }
        picture
    }
}

/// Returns whether the lights of the tree have the given `intensities`.
fn are_lit_by(intensities: &[Vec3], frame: &Frame) -> bool {
    frame.tree.lights().iter().map(|light| light.intensity).eq(intensities.iter().copied())
}

/// Returns the changes since the previous frame. `before` contains the intensities of that frame.
fn changes(before: &[Vec3], visible: &Visible) -> Changes {
    let known_changes = visible.known.is_some_and(|known| known.changes());
    Changes { light: known_changes || !are_lit_by(before, visible.frame), geometry: visible.movement.is_any }
}

impl Layer for Cached {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        let Visible { frame, matte, sample, part, ranks, .. } = *visible;
        let (busy, counts) = (Busy::default(), Counts::default());
        let is_first_of_many = sample == 0 && self.has_more;
        let request = Request { seen: matte, moving: frame.surfaces.moving(), wanted, is_first_of_many, ranks };
        let is_new_frame = part.is_none() && sample == 0;
        let changes = is_new_frame.then(|| {
            let before = std::mem::replace(&mut self.intensities, intensities(frame));
            self.recent.note(&visible.movement.swept, &before, &self.intensities);
            changes(&before, visible)
        });
        let (light, records) = (self.tree_light(visible, tolerance, &counts), &mut self.records);
        // Update records with the first sample of a frame or region; later samples reuse them.
        let lit = busy.take(match (part, changes) {
            (Some(RegionSample::First), _) => records.light_region(request, &light),
            (Some(RegionSample::Further), _) => records.light_more_of_region(request, &light),
            (None, Some(changes)) => records.light(request, changes, &light),
            (None, None) => records.light_more(request, &light),
        });
        Lit {
            rays: counts.rays(),
            seconds: busy.seconds(),
            cuts: counts.cuts(),
            records: RecordCounts { in_use: lit.in_use as u64, computed: lit.computed as u64 },
            audits: Audits { cuts: counts.audits, ..Audits::default() },
            ..Lit::of_irradiance(lit.irradiance)
        }
    }

    fn in_regions(&mut self) -> Option<&mut dyn RegionLayer> {
        Some(self)
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
    }

    fn is_dark(&self, frame: &Frame<'_>) -> bool {
        is_dark(frame)
    }

    fn channel(&self, aov: Aov, frame: &Frame<'_>) -> Option<Vec<f32>> {
        match aov {
            Aov::CutSize => Some(self.at_records(frame, |cell, size| *cell = cell.max(size as f32))),
            Aov::Cache => Some(self.at_records(frame, |cell, _| *cell += 1.0)),
            _ => None,
        }
    }

    fn forget(&mut self) {
        (self.records, self.intensities) = (IrradianceCache::default(), Vec::new());
        self.recent = RecentChanges::default();
    }

    /// Returns the state: on rank 0 with the recipes of all ranks, on other ranks empty.
    fn state(&self) -> Vec<u8> {
        let state = encode(&(&self.records, &self.recent));
        if self.ranks.count() == 1 {
            return state;
        }
        // Collect the recipes of all ranks on rank 0: only one rank stores each recipe.
        let Some(kept) = self.ranks.gather(encode(&self.records.kept())) else { return Vec::new() };
        let (mut whole, recent): (IrradianceCache<Recipe>, RecentChanges) =
            decode(&state).expect("the state was encoded here");
        for kept in kept {
            whole.complete(decode(&kept).expect("every rank sends its recipes"));
        }
        encode(&(whole, recent))
    }

    fn restore(&mut self, state: &[u8], last: &Frame<'_>) -> Result<()> {
        let (mut records, recent): (IrradianceCache<Recipe>, RecentChanges) = decode(state)?;
        let intensities = intensities(last);

        // Check all indices: a forged state may contain indices out of range.
        let instances = last.surfaces.scene().instances.len();
        let is_in_scene = |site: &Site| site.carrier == NOTHING || (site.carrier as usize) < instances;
        let is_of_frame = |(_, recipe): (&Site, &Recipe)| {
            recipe.clusters.iter().all(|&cluster| last.tree.may_hold(cluster))
                && recipe.visible.len() == recipe.clusters.len().div_ceil(PACKET)
                && last.gather.is_complete(&recipe.surroundings)
        };
        if !(records.sites().all(is_in_scene) && records.recipes().all(is_of_frame)) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        // Drop the recipes that other ranks store.
        records.keep_own(&*self.ranks);
        (self.records, self.intensities, self.recent) = (records, intensities, recent);
        Ok(())
    }
}

impl RegionLayer for Cached {
    fn begin_regions(&mut self, visible: &Visible<'_>, tolerance: &Tolerance<'_>) {
        let counts = Counts::default();
        // Update the records for the whole frame before its regions are lit.
        let (light, changes) = (self.tree_light(visible, tolerance, &counts), changes(&self.intensities, visible));
        let _ = self.records.begin_regions(visible.matte, changes, &light);
        self.intensities = intensities(visible.frame);
    }

    fn end_regions(&mut self, visible: &Visible<'_>) {
        self.records.end_regions(visible.matte, visible.frame.surfaces.moving());
    }

    fn take_records(&mut self) -> Vec<SharedRecord> {
        self.records.take_new()
    }

    fn adopt(&mut self, records: Vec<SharedRecord>) {
        self.records.adopt(records);
    }
}

impl Reprojectable for Cached {
    /// Contrast of indirect light: smooth around a pixel.
    const UNSEEN: Unseen = Unseen::Smooth;

    /// Returns all surfaces if no light and no object has changed, otherwise none.
    fn holding<'a>(&mut self, visible: &Visible<'a>) -> Holding<'a> {
        let is_unchanged = !visible.movement.is_any && are_lit_by(&self.intensities, visible.frame);
        if is_unchanged { Holding::Everywhere } else { Holding::Nowhere }
    }
}

#[cfg(test)]
mod tests;
