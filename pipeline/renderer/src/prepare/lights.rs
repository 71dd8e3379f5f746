//! Lights of a frame: light tree, directly sampled lights, and final gather.

use super::film_light::{CHANGING, FilmLight, FirstFrame, Lights};
use super::{Kept, PlacedScene, PrepareState};
use crate::plan::Stage;
use glam::Vec3;
use lighttree::{BuildParams, Emission, Light, LightTree};
use pipeline::figures::FrameFigures;
use render_core::ranks::share_blocks;
use render_core::{AnchorFlux, Busy, DirectLights, Emitters, FinalGather, PosedScene, Surfaces, dome_lights};
use std::f32::consts::PI;
use std::sync::Arc;

/// Minimum number of searches in a round of tree construction for sharing. Ranks and threads do not share smaller
/// rounds.
const SHARED_SEARCHES: usize = 512;
/// Number of searches that a thread runs together.
const SEARCHES_AT_ONCE: usize = 32;
/// Number of directions for sky light. They are 5° apart, less than the width of shadows from a sky.
const DOME_LIGHTS: usize = 1024;
/// Number of points on the dome of a studio, whose lamps are wide.
const STUDIO_DOME_LIGHTS: usize = 256;
/// Total number of points that represent area lights in the light tree.
const EMITTER_POINTS: f32 = 2048.0;
/// Minimum and maximum number of points that represent one surface in the light tree.
const POINTS_OF_A_SURFACE: (f32, f32) = (16.0, 1024.0);
/// Maximum number of area lights sampled at every pixel. With more emissive surfaces, the light tree is cheaper.
const MOST_SAMPLED_SURFACES: usize = 8;
/// Maximum number of patches of a static area light of any extent that pixels sample directly.
const FEW_PATCHES: usize = 4;
/// Maximum extent of a static area light with more patches that pixels sample directly, as a fraction of the scene's
/// radius.
const SMALL_EXTENT: f32 = 0.1;

impl PrepareState<'_> {
    /// Returns the lights of a frame, with their current flux.
    pub(super) fn lights(&mut self, placed: PlacedScene, figures: &mut FrameFigures) -> Lights {
        // Report the work before this frame with this frame.
        let PlacedScene { frame: n, time, pose, surfaces, accelerator } = placed;
        let pending = std::mem::take(&mut self.light.pending);
        figures.seconds.anchors = pending.anchors;
        figures.seconds.update += pending.update;
        (figures.seconds.photons, figures.seconds.tree) = (pending.photons, pending.tree);
        if n == 0 {
            figures.photons_traced = pending.photons_traced;
        }

        // Reuse the lights of the previous frame, or of frame 0, if nothing changes.
        let changes = CHANGING.iter().any(|&stage| self.plan.runs(stage, n));
        if let Some(kept) = self.kept.as_ref().filter(|kept| !changes || kept.time == time) {
            let Kept { tree, direct, gather, .. } = kept;
            return Lights { tree: tree.clone(), direct: direct.clone(), gather: gather.clone() };
        }
        if !self.light.is_lit_as_first(n) {
            self.light.first = FirstFrame::default();
        }
        if let Some(lights) = &self.light.first.lights {
            return lights.clone();
        }

        // Trace photons, which bring flux to the anchors.
        let emitters = Emitters::new(surfaces, pose, &self.light.units);
        let FilmLight { photons, anchors, units, first, .. } = &mut self.light;
        let traced = match &first.flux {
            Some(_) => None,
            None => Some(photons.trace(PosedScene::new(accelerator, surfaces), &emitters, anchors, units)),
        };
        if let Some(traced) = &traced {
            figures.photons_traced = traced.value.traced;
            figures.seconds.photons += traced.seconds;
        }
        let flux = traced.as_ref().map(|traced| &traced.value).or(self.light.first.flux.as_ref());
        let anchor_flux = flux.expect("frame 0 or this frame was traced");

        // Build or update the tree, which contains static anchors, and area lights if they are numerous.
        let busy = Busy::default();
        let FilmLight { anchors, units, first, .. } = &self.light;
        let sampled = sampled_areas(&emitters, surfaces, self.light.units.radius);
        let before = self.kept.as_ref().map(|kept| &kept.tree);
        let tree = match before.or(self.tree.as_ref()).or(first.tree.as_ref()) {
            Some(before) => {
                let (tree, swapped_share) = busy.measure(|| self.updated(before, anchor_flux));
                figures.tree_swaps_share = swapped_share;
                tree
            }
            None => {
                let lights = self.tree_lights(anchor_flux, self.lights_that_stay(&emitters, surfaces, &sampled));
                let bound = anchors.geometry_term_bound(self.plan.is_on(Stage::Compensation));
                let params = BuildParams::bounded_by(bound).with_seed(self.settings.seed);
                // Let the ranks share the searches. Small rounds cost less than their messages.
                let ranks = &*self.ranks;
                let searches = |count: usize, search: &(dyn Fn(usize) -> u64 + Sync)| match count {
                    ..SHARED_SEARCHES => (0..count).map(search).collect(),
                    _ => busy.take(share_blocks(ranks, count, SEARCHES_AT_ONCE, search)),
                };
                Arc::new(busy.measure(|| LightTree::build_with(&lights, params, &searches)))
            }
        };

        // Collect the lights that each pixel samples directly.
        let mut direct = DirectLights::new(&emitters, surfaces, anchors, &anchor_flux.dynamic, &sampled);
        if self.plan.is_on(Stage::Cache) {
            // Let records cache light reflected by moving objects: it is as smooth as other indirect light.
            direct = direct.with_dynamic_apart();
        }

        // Let final gather find the emission of area lights that are in the tree.
        let mut virtual_emitters = vec![false; self.scene.instances.len()];
        for (place, area) in emitters.areas.iter().enumerate() {
            virtual_emitters[area.instance] |= !sampled.contains(&place);
        }
        let gather = busy.measure(|| {
            let gather = FinalGather::new(surfaces, anchors, anchor_flux, units)
                .with_lamps(direct.lamps())
                .with_virtual_emitters(virtual_emitters);
            if self.settings.bounces.is_some() { gather.with_limited_bounces() } else { gather }
        });
        figures.seconds.tree += busy.seconds();
        let lights = Lights { tree, direct: Arc::new(direct), gather: Arc::new(gather) };
        if self.light.is_static {
            self.light.first.lights = Some(lights.clone());
        }
        lights
    }

    /// Returns the lights of a new tree: the static anchors, and the lights `that_stay` constant for the whole film.
    fn tree_lights(&self, anchor_flux: &AnchorFlux, that_stay: Vec<Light>) -> Vec<Light> {
        let mut lights = Vec::new();
        // List anchors first: updates of the tree replace their intensities by index.
        for (anchor, &flux) in self.light.anchors.fixed.iter().zip(&anchor_flux.fixed) {
            let emission = Emission::Cosine(anchor.normal.into());
            lights.push(Light { position: anchor.position.into(), emission, intensity: flux / PI });
        }
        lights.extend(that_stay);
        lights
    }

    /// Returns the tree with the current flux of the anchors, and the fraction of nodes with swapped children.
    fn updated(&self, before: &Arc<LightTree>, anchor_flux: &AnchorFlux) -> (Arc<LightTree>, f64) {
        // Append the constant intensities of surfaces and sky, which follow the anchors in the tree.
        let mut intensities: Vec<Vec3> = anchor_flux.fixed.iter().map(|&flux| flux / PI).collect();
        intensities.extend(before.lights()[self.light.anchors.fixed.len()..].iter().map(|light| light.intensity));

        // Update the tree only if the flux has changed.
        let mut tree = before.clone();
        let same = tree.lights().iter().map(|light| light.intensity).eq(intensities.iter().copied());
        let swapped_share = if same { 0.0 } else { Arc::make_mut(&mut tree).update_drawn(&intensities).swapped_share };
        (tree, swapped_share)
    }

    /// Returns the lights of constant intensity for the tree: area lights not in `sampled`, and the sky.
    fn lights_that_stay(&self, emitters: &Emitters, surfaces: &Surfaces, sampled: &[usize]) -> Vec<Light> {
        let luminance = render_core::luminance;
        let areas: Vec<_> = (0..emitters.areas.len()).filter(|place| !sampled.contains(place)).collect();
        // Divide the points between the surfaces in proportion to power.
        let power: f32 = areas.iter().map(|&place| luminance(emitters.areas[place].power())).sum();
        let mut lights = Vec::new();
        for place in areas {
            let area = &emitters.areas[place];
            let (least, most) = POINTS_OF_A_SURFACE;
            let by_power = EMITTER_POINTS * luminance(area.power()) / power.max(f32::MIN_POSITIVE);
            // Put a few points on each panel of a surface that consists of many small panels.
            let by_panels = (4 * area.patch_count()) as f32;
            let count = by_power.max(by_panels).clamp(least, most) as usize;
            lights.extend(area.samples(surfaces, count).into_iter().map(|sample| Light {
                position: sample.position.into(),
                emission: Emission::Cosine(sample.normal.into()),
                intensity: sample.intensity,
            }));
        }
        // Represent the sky by points on a dome far outside the scene.
        let dome = if self.scene.ground.is_some() { STUDIO_DOME_LIGHTS } else { DOME_LIGHTS };
        lights.extend(dome_lights(self.scene, &self.light.units, dome).into_iter().map(|light| Light {
            position: light.position.into(),
            emission: Emission::Omni,
            intensity: light.intensity,
        }));
        lights
    }
}

/// Returns the indices of the area lights that each pixel samples directly: moving ones, and compact ones if these
/// are few. `radius` is the scene's radius \[m\].
pub(crate) fn sampled_areas(emitters: &Emitters, surfaces: &Surfaces, radius: f32) -> Vec<usize> {
    let moves = |place: usize| surfaces.moving()[emitters.areas[place].instance];
    let compact = |place: usize| {
        let light = &emitters.areas[place];
        light.patch_count() <= FEW_PATCHES || light.extent(surfaces) <= SMALL_EXTENT * radius
    };
    let places = 0..emitters.areas.len();
    // Sample compact lights only if they are few: every pixel evaluates each of them.
    let few: Vec<usize> = places.clone().filter(|&place| !moves(place) && compact(place)).collect();
    if few.len() <= MOST_SAMPLED_SURFACES {
        places.filter(|&place| moves(place) || compact(place)).collect()
    } else {
        places.filter(|&place| moves(place)).collect()
    }
}
