//! Layers of a frame's light, selected by the scene's plan.

use super::all_lights::AllLights;
use super::cached::Cached;
use super::coats::{Coats, ReprojectedCoats};
use super::direct::Direct;
use super::fine::FirstSample;
use super::layer::{Layer, Lit, RegionLayer, Visible};
use super::per_pixel::PerPixel;
use super::reprojected::{Reprojectable, Reprojected};
use super::sample::Sample;
use super::tolerance::Tolerance;
use crate::frame::Frame;
use crate::plan::{Plan, Stage};
use crate::settings::{Aov, Lighting, RenderSettings};
use glam::Vec3;
use pipeline::error::{Error, Result};
use pipeline::state::NONSENSE;
use plane::Plane;
use render_core::cache::SharedRecord;
use render_core::ranks::Ranks;
use std::sync::Arc;

/// Fraction of a budget's pixels for which indirect light is computed. A cache record costs ten times the direct light
/// of a pixel, and lights the pixels around it, too.
const INDIRECT_BUDGET: f32 = 0.25;

/// Layers of light; their sum is the light of a frame.
pub(super) struct Layers {
    /// Layers of direct light and of light from coats.
    pub direct: Vec<Box<dyn Layer>>,
    /// Layers of indirect light.
    pub indirect: Vec<Box<dyn Layer>>,
}

impl Layers {
    /// Creates the layers of `plan`:
    ///
    /// | light | layers |
    /// |---|---|
    /// | direct | [`Direct`], with reprojection if the plan has it; [`Coats`], likewise, except with tiles |
    /// | indirect | [`Cached`], with reprojection if the plan has it; or [`PerPixel`]; or [`AllLights`] |
    pub fn new(settings: &RenderSettings, plan: &Plan, ranks: &Arc<dyn Ranks>) -> Self {
        let carries = plan.is_on(Stage::ReprojectedLight);
        let mut direct = vec![reprojected_if(carries, Direct::default(), settings)];
        if plan.is_on(Stage::Gloss) && settings.tiles.is_none() {
            direct.push(if carries { Box::new(ReprojectedCoats::new(settings.qscale)) } else { Box::new(Coats) });
        }

        // Reproject no light of the layer if light is baked: the layer lights only surfaces without valid texels.
        let (is_baked, compensates) = (settings.lighting.is_baked(), plan.is_on(Stage::Compensation));
        let mut indirect: Vec<Box<dyn Layer>> = Vec::new();
        if !plan.is_off(Stage::Indirect) {
            indirect.push(match settings.lighting {
                _ if plan.is_on(Stage::Cache) => reprojected_if(
                    carries && !is_baked,
                    Cached::new(plan, settings.samples.most(), ranks.clone()),
                    settings,
                ),
                Lighting::AllLights => Box::new(AllLights::new(compensates)),
                // Store sizes of lightcuts if several ranks share the work: each counts only its own, but an observer
                // may request all.
                _ => Box::new(PerPixel::new(compensates, settings.aov.contains(&Aov::CutSize) || ranks.count() > 1)),
            });
        }
        Self { direct, indirect }
    }

    /// Lights the surfaces of `visible`, with their emission as initial radiance. Returns the radiance of the
    /// sample, and the layers' direct and indirect light. Unwanted pixels may have any value.
    pub fn sample(
        &mut self,
        visible: &Visible,
        wanted: Option<&Plane<bool>>,
        tolerance: &Tolerance,
    ) -> (Sample, [Lit; 2]) {
        let matte = visible.matte;
        // Light direct layers first: relative thresholds of indirect light depend on them.
        let (of_direct, direct) = sum_of(&mut self.direct, visible, wanted, tolerance);
        let after_direct = Visible { radiance: &direct, ..*visible };
        let (of_indirect, _) = sum_of(&mut self.indirect, &after_direct, wanted, tolerance);
        let dark = Plane::filled(direct.width(), direct.height(), Vec3::ZERO);
        let indirect = of_indirect.shown(matte, dark);
        (Sample { direct, indirect }, [of_direct, of_indirect])
    }

    /// Lights the `wanted` surfaces of a further sample. Direct light is computed. Indirect light varies slowly: surfaces
    /// have the irradiance of a nearby pixel's `first` sample.
    pub fn further_sample(
        &mut self,
        visible: &Visible,
        wanted: &Plane<bool>,
        tolerance: &Tolerance,
        first: &FirstSample,
    ) -> (Sample, Lit) {
        // Compute direct light, and the light of smooth coats. Rough coats would show the noise of their few rays.
        let (bases, coats) = self.direct.split_at_mut(1);
        let (mut of_direct, direct) = sum_of(bases, visible, Some(wanted), tolerance);
        let [smooth, rough] = first.by_coat(visible.surfaces, wanted);
        let after_bases = Visible { radiance: &direct, ..*visible };
        let (of_coats, mut direct) = match smooth.samples().contains(&true) {
            true => sum_of(coats, &after_bases, Some(&smooth), tolerance),
            false => (Lit::default(), direct.clone()),
        };
        of_direct.add_counts(of_coats);
        first.add_coats(visible.surfaces, &rough, &mut direct);
        let indirect = first.indirect_of(visible.matte, wanted);
        (Sample { direct, indirect }, of_direct)
    }

    /// Begins a frame that is lit region by region.
    pub fn begin_regions(&mut self, visible: &Visible, tolerance: &Tolerance) {
        for layer in self.lit_in_regions(visible.frame) {
            layer.begin_regions(visible, tolerance);
        }
    }

    /// Ends a frame that was lit region by region.
    pub fn end_regions(&mut self, visible: &Visible) {
        for layer in self.lit_in_regions(visible.frame) {
            layer.end_regions(visible);
        }
    }

    /// Returns the new records of all layers in frames lit region by region.
    pub fn take_records(&mut self) -> Vec<SharedRecord> {
        let mut records = Vec::new();
        for layer in &mut self.indirect {
            if let Some(layer) = layer.in_regions() {
                records.extend(layer.take_records());
            }
        }
        records
    }

    /// Adds the records of other ranks.
    pub fn adopt(&mut self, records: Vec<SharedRecord>) {
        if let Some(first) = self.indirect.first_mut().and_then(|first| first.in_regions()) {
            first.adopt(records);
        }
    }

    /// Returns the layers that keep records and have light in this frame.
    fn lit_in_regions(&mut self, frame: &Frame) -> impl Iterator<Item = &mut dyn RegionLayer> {
        let lit = self.direct.iter_mut().chain(&mut self.indirect).filter(|layer| !layer.is_dark(frame));
        lit.filter_map(|layer| layer.in_regions())
    }

    fn all(&self) -> impl Iterator<Item = &dyn Layer> {
        self.direct.iter().chain(&self.indirect).map(|layer| &**layer)
    }

    /// Returns the channel `aov` of the last lit frame, from the first layer that provides this channel.
    pub fn channel(&self, aov: Aov, frame: &Frame) -> Option<Vec<f32>> {
        self.all().find_map(|layer| layer.channel(aov, frame))
    }

    /// Makes every layer keep the data of the channels `aov` from the next frame on.
    pub fn keep(&mut self, aov: &[Aov]) {
        for layer in self.direct.iter_mut().chain(&mut self.indirect) {
            aov.iter().for_each(|&aov| layer.keep(aov));
        }
    }

    /// Adapts every layer to the quantiser_scale of the next frames, 1…112.
    pub fn set_quantiser_scale(&mut self, quantiser_scale: u32) {
        for layer in self.direct.iter_mut().chain(&mut self.indirect) {
            layer.set_quantiser_scale(quantiser_scale);
        }
    }

    /// Limits the pixels for which every layer computes light in the next frames: to a `share` of all pixels in direct
    /// layers, and to a fraction of it in indirect ones.
    pub fn set_budget(&mut self, share: Option<f32>) {
        self.direct.iter_mut().for_each(|layer| layer.set_budget(share));
        self.indirect.iter_mut().for_each(|layer| layer.set_budget(share.map(|share| INDIRECT_BUDGET * share)));
    }

    /// Discards the state of earlier frames in every layer.
    pub fn forget(&mut self) {
        self.direct.iter_mut().chain(&mut self.indirect).for_each(|layer| layer.forget());
    }

    /// Returns a copy with the state after the last frame; `None` if some layer cannot be copied.
    pub fn copy(&self) -> Option<Self> {
        let of = |layers: &[Box<dyn Layer>]| layers.iter().map(|layer| layer.copy()).collect::<Option<Vec<_>>>();
        Some(Self { direct: of(&self.direct)?, indirect: of(&self.indirect)? })
    }

    /// Returns the states of all layers, in order.
    pub fn states(&self) -> Vec<Vec<u8>> {
        self.all().map(|layer| layer.state()).collect()
    }

    /// Continues after frame `last` from the [`states`](Layers::states) of all layers.
    pub fn restore(&mut self, states: &[Vec<u8>], last: &Frame) -> Result<()> {
        if states.len() != self.direct.len() + self.indirect.len() {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        let all = self.direct.iter_mut().chain(&mut self.indirect);
        for (layer, state) in all.zip(states) {
            layer.restore(state, last)?;
        }
        Ok(())
    }
}

/// Returns the summed light of `layers`, and the pixels' radiance including that light. Each layer receives the
/// radiance of all earlier layers.
fn sum_of(
    layers: &mut [Box<dyn Layer>],
    visible: &Visible,
    wanted: Option<&Plane<bool>>,
    tolerance: &Tolerance,
) -> (Lit, Plane<Vec3>) {
    let mut sum = Lit::default();
    let mut radiance = visible.radiance.clone();
    for layer in layers {
        if !layer.is_dark(visible.frame) && !visible.has_stopped() {
            sum += layer.light(&Visible { radiance: &radiance, ..*visible }, wanted, tolerance);
            radiance = sum.shown(visible.matte, visible.radiance.clone());
        }
    }
    (sum, radiance)
}

/// Returns `layer`, with reprojection of the layer's light if `is_reprojected`.
fn reprojected_if<L: Reprojectable + Clone + 'static>(
    is_reprojected: bool,
    layer: L,
    settings: &RenderSettings,
) -> Box<dyn Layer> {
    match is_reprojected {
        true => Box::new(Reprojected::new(layer, settings.qscale)),
        false => Box::new(layer),
    }
}
