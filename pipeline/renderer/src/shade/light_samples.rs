//! Light of all samples of a frame, one sample of all pixels at a time.

use super::audits::Audits;
#[cfg(feature = "bake")]
use super::baked;
use super::counts::LightcutCounts;
use super::fine::even_out_points;
use super::importance::{ImportanceMap, SeenLight};
#[cfg(feature = "bake")]
use super::layer::KnownLight;
use super::layer::{Lit, add_ranks};
use super::lit_frame::{LitFrame, Reused, StoredLight};
use super::movement::Movement;
use super::sample::Sample;
use super::samples::{Common, SampleSurfaces, SamplesLight};
use super::tolerance::Tolerance;
use super::{Shading, coats, triples};
use crate::frame::{Frame, PreparedFrame};
use crate::plan::Stage;
use crate::settings::Aov;
use glam::Vec3;
use pipeline::figures::FrameFigures;
use render_core::ranks::{Alone, Ranks};
use render_core::{AuditCounts, Busy, Coverage, GBuffer, PixelSample, PosedScene, sample_offsets};
use std::sync::Arc;

impl Shading<'_> {
    /// Lights all samples of a frame, adds the cost to `figures`, and returns the audits' errors.
    pub(super) fn light(
        &mut self,
        prepared: &PreparedFrame,
        tolerance: &Tolerance,
        ahead: Option<ImportanceMap>,
        figures: &mut FrameFigures,
    ) -> (LitFrame, Audits) {
        // Let the crew light the frame if tiles are in use.
        if let Some(mut tiling) = self.tiling.take() {
            let lit = tiling.light(self, prepared, tolerance, ahead);
            self.tiling = Some(tiling);
            return self.finished(prepared, lit, figures);
        }

        // Light one sample of all pixels at a time: the first sample may determine importance.
        let frame = &prepared.frame;
        let movement = Movement::to(frame, &self.places);
        let ranks = self.ranks.clone();
        #[cfg(feature = "bake")]
        let baked = self.baked.as_ref().map(|light| baked::TexelsOfFrame::new(light, self.settings.time(frame.index)));
        #[cfg(feature = "bake")]
        let known = baked.as_ref().map(|texels| baked::TexelLight::new(texels, frame, &movement));
        #[cfg(feature = "bake")]
        let known = known.as_ref().map(|known| known as &dyn KnownLight);
        #[cfg(not(feature = "bake"))]
        let known = None;
        let stop = self.stop.clone();
        let stop = self.aside.is_some().then_some(&*stop);
        let common = Common { movement: &movement, known, ranks: &*ranks, tolerance, stop };
        let mut lit = SamplesLight { importance: ahead, ..SamplesLight::default() };
        for sample in 0..self.settings.samples.most() as usize {
            // After the first sample, select the pixels by importance.
            let wanted = lit.importance.as_ref().filter(|_| sample > 0).map(|map| map.wanted(sample));
            if wanted.as_ref().is_some_and(|wanted| !wanted.samples().contains(&true)) {
                break;
            }

            // Light the surfaces of this sample by all layers.
            let of_sample = self.surfaces(frame, sample, &lit.visibility);
            let visible = of_sample.visible(prepared, sample, common);
            let (light, [mut of_direct, of_indirect]) = self.layers.sample(&visible, wanted.as_ref(), tolerance);

            // Derive importance from the first sample if no map was available before lighting.
            if sample == 0 {
                lit.coats = of_direct.radiance.take();
                lit.reused = Reused::new([&of_direct, &of_indirect], visible.matte);
                if let Some(looking) = self.looking.as_mut().filter(|_| lit.importance.is_none()) {
                    let cut_sizes = looking.weighs_costs().then(|| self.layers.channel(Aov::CutSize, frame)).flatten();
                    let radiance = triples(&light.whole());
                    let seen = SeenLight { radiance: &radiance, cut_sizes };
                    lit.importance = Some(lit.visibility.measure(|| looking.at(prepared, &seen)));
                }
            }
            self.add_layers(prepared, &of_sample, (sample, &light), &mut lit);
            lit.samples.push(light);
            lit.direct.add_counts(of_direct);
            lit.indirect.add_counts(of_indirect);

            // Add further samples where this one is not enough.
            if self.plan.is_on(Stage::FineSamples) {
                even_out_points(&mut lit.samples[0].indirect, visible.matte);
                lit.coverage = self.coverage(frame, &lit.samples[0], false, &lit.visibility);
                self.light_finer(prepared, common, &of_sample, &mut lit);
            }
        }
        lit.places = movement.places;
        self.finished(prepared, lit, figures)
    }

    /// Returns the ranks that share the loops of a frame. With tiles, each rank lights its tiles alone.
    pub(super) fn sharing(&self) -> Arc<dyn Ranks> {
        if self.settings.tiles.is_some() { Arc::new(Alone) } else { self.ranks.clone() }
    }

    /// Returns the surfaces of a sample, and adds the CPU time of finding them to `visibility`.
    pub(super) fn surfaces<'f>(&self, frame: &'f Frame, sample: usize, visibility: &Busy) -> SampleSurfaces<'f> {
        // Use the G-buffer for the only sample, or for the first sample with importance.
        let offsets = sample_offsets(self.settings.samples.most() as usize);
        let is_center = offsets.len() == 1 || sample == 0 && self.looking.is_some();
        let seen = &*frame.seen;
        let own = (!is_center).then(|| {
            let place = PixelSample::one_of(offsets.len(), offsets[sample]);
            let size = (seen.pixels.width(), seen.pixels.height());
            let scene = PosedScene::new(&frame.accelerator, &frame.surfaces);
            visibility.take(GBuffer::trace_among(place, scene, &seen.view, size, &*self.sharing()))
        });

        self.surfaces_of(frame, own)
    }

    /// Returns the surfaces of a sample at its `own` positions, or else at the pixel centers.
    pub(super) fn surfaces_of<'f>(&self, frame: &'f Frame, own: Option<GBuffer>) -> SampleSurfaces<'f> {
        // Replace the albedo of coated surfaces: coats are a separate layer of light.
        let seen = &*frame.seen;
        let below =
            self.plan.is_on(Stage::Gloss).then(|| coats::below_coats(own.as_ref().unwrap_or(seen), &frame.surfaces));
        let matte = below.as_ref().or(own.as_ref()).unwrap_or(seen);
        let emitted = matte.pixels.map(|pixel| Vec3::from(pixel.emission));
        SampleSurfaces { seen, own, below, emitted }
    }

    /// Adds transparent layers within pixels to `lit`, if every pixel has several samples.
    pub(super) fn add_layers(
        &self,
        prepared: &PreparedFrame,
        surfaces: &SampleSurfaces,
        (sample, light): (usize, &Sample),
        lit: &mut SamplesLight,
    ) {
        let offsets = sample_offsets(self.settings.samples.most() as usize);
        if offsets.len() > 1 && self.looking.is_none() {
            let place = PixelSample::one_of(offsets.len(), offsets[sample]);
            lit.layers.push(surfaces.layers(prepared, place, light, &lit.visibility));
        }
    }

    /// Finds outlines that are visible, by comparing the `first` light on both sides, and layers in pixels without
    /// layers per sample.
    fn coverage(&self, frame: &Frame, first: &Sample, has_layers: bool, visibility: &Busy) -> Option<Coverage> {
        let Frame { accelerator, surfaces, seen, .. } = frame;
        let scene = PosedScene::new(accelerator, surfaces);
        if self.plan.is_on(Stage::Antialiasing) && !self.is_discarded() {
            return Some(visibility.take(Coverage::of(seen, scene, &first.whole())));
        }
        let is_layered = !has_layers && !seen.layered.is_empty();
        let whole = PixelSample::WHOLE;
        is_layered.then(|| visibility.take(Coverage::of_layers(seen, scene, &first.whole(), whole)))
    }

    /// Returns the lit frame and the errors of its audits, and adds the cost to `figures`.
    fn finished(
        &mut self,
        prepared: &PreparedFrame,
        lit: SamplesLight,
        figures: &mut FrameFigures,
    ) -> (LitFrame, Audits) {
        let SamplesLight {
            samples,
            fine,
            coats: _,
            coverage,
            layers,
            mut direct,
            indirect,
            reused,
            importance,
            places,
            visibility,
        } = lit;
        let coverage =
            coverage.or_else(|| self.coverage(&prepared.frame, &samples[0], !layers.is_empty(), &visibility));
        self.places = places;
        let pixels = prepared.frame.seen.pixels.samples().len().max(1);
        self.open_share = (direct.open + indirect.open) as f64 / pixels as f64;

        // Sum the times and counts of all samples.
        figures.seconds.visibility += visibility.seconds();
        figures.seconds.direct = direct.seconds;
        figures.seconds.indirect = indirect.seconds;
        figures.shaded_share = reused.shaded_share();
        figures.reprojected_share = 1.0 - figures.shaded_share;
        direct.add_counts(indirect);
        add_ranks(&*self.ranks, &mut direct);
        put(&direct, figures);
        // Store the light with all data that a static film reuses.
        let light = StoredLight { samples, fine, layers, coverage, cache_records: direct.records.in_use, importance };
        (LitFrame::new(&prepared.frame, light, reused), direct.audits)
    }
}

/// Writes the cost of light into a frame's figures.
fn put(lit: &Lit, figures: &mut FrameFigures) {
    let LightcutCounts { cuts, clusters, largest } = lit.cuts;
    figures.cut_size_mean = clusters as f64 / cuts.max(1) as f64;
    figures.cut_size_max = largest;
    figures.shadow_rays += lit.rays;
    figures.cache_new += lit.records.computed;
    let AuditCounts { within, all } = lit.audits.reprojected;
    figures.audit_reprojected_within = (all > 0).then(|| within as f64 / all as f64);
}
