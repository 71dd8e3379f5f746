//! Everything about a frame that needs no thresholds: objects, photons, light tree, primary rays, motion.

use crate::checkpoint::{Checkpoints, Part};
use crate::error::{Error, Result};
use crate::message::{FrameFigures, Prepared};
use crate::plan::{Plan, Stage};
use crate::settings::{Settings, Size};
use crossbeam_channel::Sender;
use glam::Vec3;
use lighttree::{BuildParams, Emission, Light, LightTree};
use render_core::scene::{Pose, Scene};
use render_core::{
    Accelerator, Anchors, Busy, Correspondence, DirectLights, Emitters, GBuffer, Gather, Geometry, Photons, Surfaces,
    Swept, Units, dome_lights,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Directions that the sky is split into: 5° apart, below the size of the shadows that a sky throws.
const DOME_LIGHTS: usize = 1024;
/// Points that glowing surfaces are split into when they are lights of the tree, all together.
const EMITTER_POINTS: f32 = 2048.0;
/// The same for a single surface, at least and at most.
const POINTS_OF_A_SURFACE: (f32, f32) = (16.0, 1024.0);
/// More glowing surfaces than this are lights of the tree: asking each at every pixel would cost more than a cut.
const MOST_SAMPLED_SURFACES: usize = 8;
/// A surface of more pieces than this, and larger than this share of the scene, is a crowd of lights, not one.
const FEW_PATCHES: usize = 4;
const SMALL_EXTENT: f32 = 0.1;

/// Makes frames 0, 1, 2 … and sends them on; stops early when `stop` is set.
pub fn run<'s>(scene: &'s Scene, settings: &Settings, plan: &Plan, stop: &AtomicBool, out: &Sender<Prepared<'s>>) {
    run_from(&Checkpoints::off(), scene, settings, plan, stop, out).expect("nothing is read or written");
}

/// The tree of the last frame that is done.
pub(super) fn known(checkpoints: &Checkpoints) -> Result<Option<LightTree>> {
    let bytes = checkpoints.part::<Vec<u8>>(Part::Prepare)?;
    bytes.map(|bytes| LightTree::from_bytes(&bytes)).transpose().map_err(Error::other)
}

/// The same from where `checkpoints` say; the last frame that is done comes once more, to begin with.
///
/// # Errors
/// The checkpoint does not hold what it should, or the next cannot be written.
pub fn run_from<'s>(
    checkpoints: &Checkpoints,
    scene: &'s Scene,
    settings: &Settings,
    plan: &Plan,
    stop: &AtomicBool,
    out: &Sender<Prepared<'s>>,
) -> Result<()> {
    let mut preparation = Preparation::new(scene, settings, plan);
    let first = checkpoints.first_frame();
    if let Some(tree) = known(checkpoints)? {
        preparation.tree = Some(Arc::new(tree));
        if out.send(preparation.frame(first - 1)).is_err() {
            return Ok(());
        }
    }
    for n in first..settings.frames {
        if stop.load(Ordering::Relaxed) {
            if let Some(kept) = preparation.kept.as_ref().filter(|_| n > first) {
                checkpoints.end_behind(n - 1);
                checkpoints.leave(n - 1, Part::Prepare, &kept.tree.to_bytes())?;
            }
            break;
        }
        let mut prepared = preparation.frame(n);
        prepared.checkpoint = checkpoints.is_due();
        if prepared.checkpoint {
            checkpoints.leave(n, Part::Prepare, &prepared.tree.to_bytes())?;
        }
        if out.send(prepared).is_err() {
            break;
        }
    }
    Ok(())
}

/// Makes frame `n` alone, as if it were the first.
pub fn single<'s>(scene: &'s Scene, settings: &Settings, plan: &Plan, n: u32) -> Prepared<'s> {
    Preparation::new(scene, settings, plan).frame(n)
}

/// What is kept from frame to frame.
struct Preparation<'s, 'a> {
    scene: &'s Scene,
    settings: &'a Settings,
    plan: &'a Plan,
    geometry: Geometry,
    units: Units,
    anchors: Anchors,
    photons: Photons,
    /// The tree that a checkpoint brought, in place of the first one.
    tree: Option<Arc<LightTree>>,
    kept: Option<Kept>,
}

struct Kept {
    accelerator: Arc<Accelerator>,
    direct: Arc<DirectLights>,
    tree: Arc<LightTree>,
    gather: Arc<Gather>,
    seen: Arc<GBuffer>,
    /// Where nothing moves in the picture, what is true of one frame is true of the next.
    of_itself: Option<Arc<Correspondence>>,
}

/// The lights of a frame.
struct Lights {
    tree: Arc<LightTree>,
    direct: Arc<DirectLights>,
    gather: Arc<Gather>,
}

impl<'s, 'a> Preparation<'s, 'a> {
    fn new(scene: &'s Scene, settings: &'a Settings, plan: &'a Plan) -> Self {
        let units = Units::of(scene);
        let rest = scene.pose(0.0);
        let carried = if plan.is_off(Stage::DynamicAnchors) { 0 } else { settings.moving_vpls };
        let fixed = if plan.is_off(Stage::Photons) { 0 } else { settings.vpls };
        let geometry = Geometry::new(scene);
        let surfaces = Surfaces::new(scene, &rest);
        let anchors = Anchors::spread_exposed(scene, &surfaces, &geometry, &units, fixed, carried);
        let count = if plan.is_off(Stage::Photons) { 0 } else { settings.photons };
        let mut photons = Photons::new(count, settings.seed);
        if let Some(bounces) = settings.bounces {
            // The last reflection is the one that the viewer sees.
            photons = photons.with_bounces(bounces.saturating_sub(1) as usize);
        }
        if plan.is_on(Stage::KeptPhotons) {
            let times = (0..settings.frames).map(|n| settings.time(n));
            photons = photons.keeping(Swept::of(scene, &units, times));
        }
        Self { scene, settings, plan, geometry, units, anchors, photons, tree: None, kept: None }
    }

    fn frame(&mut self, n: u32) -> Prepared<'s> {
        let _span = tracing::debug_span!("prepare", frame = n).entered();
        let mut figures = FrameFigures::default();
        let busy = Busy::default();
        let pose = self.scene.pose(self.settings.time(n));
        let surfaces = Surfaces::new(self.scene, &pose);
        let accelerator = match &self.kept {
            Some(kept) if !self.plan.runs(Stage::ObjectPlacing, n) => kept.accelerator.clone(),
            _ => busy.measure(|| Arc::new(self.geometry.place(&pose))),
        };
        figures.update = busy.seconds();

        let lights = tracing::debug_span!("lights", frame = n).entered();
        let Lights { tree, direct, gather } = self.lights(n, &pose, &surfaces, &accelerator, &mut figures);

        drop(lights);

        let _rays = tracing::debug_span!("primary rays and motion", frame = n).entered();
        let busy = Busy::default();
        let Size { width, height } = self.settings.size;
        let seen = match &self.kept {
            Some(kept) if !self.plan.runs(Stage::PrimaryRays, n) => kept.seen.clone(),
            _ => {
                let view = self.scene.view(&pose, width, height);
                Arc::new(GBuffer::trace(&accelerator, &surfaces, &view, (width, height), &busy))
            }
        };
        let correspondence = self.kept.as_ref().map(|before| match &before.of_itself {
            Some(known) if Arc::ptr_eq(&before.seen, &seen) => known.clone(),
            _ => Arc::new(Correspondence::between(&seen, &before.seen, &busy)),
        });
        let is_still = self.kept.as_ref().is_some_and(|before| Arc::ptr_eq(&before.seen, &seen));
        let of_itself = correspondence.clone().filter(|_| is_still);
        // B pictures are predicted from both sides.
        let wants_forward = self.settings.motion && self.settings.bframes > 0;
        let before = self.kept.as_ref().filter(|_| wants_forward);
        let forward = before.map(|before| Arc::new(Correspondence::between(&before.seen, &seen, &busy)));
        figures.visibility = busy.seconds();

        let kept = Kept { accelerator, direct, tree, gather, seen, of_itself };
        let prepared = Prepared {
            frame: n,
            checkpoint: false,
            surfaces,
            accelerator: kept.accelerator.clone(),
            direct: kept.direct.clone(),
            tree: kept.tree.clone(),
            gather: kept.gather.clone(),
            seen: kept.seen.clone(),
            correspondence,
            forward,
            epsilon: self.units.epsilon,
            figures,
        };
        self.kept = Some(kept);
        prepared
    }

    /// The light tree and the direct lights of frame `n`, with the energies they have there.
    fn lights(
        &mut self,
        n: u32,
        pose: &Pose,
        surfaces: &Surfaces,
        accelerator: &Accelerator,
        figures: &mut FrameFigures,
    ) -> Lights {
        if let Some(kept) = self
            .kept
            .as_ref()
            .filter(|_| !self.plan.runs(Stage::Photons, n) && !self.plan.runs(Stage::ObjectPlacing, n))
        {
            let Kept { tree, direct, gather, .. } = kept;
            return Lights { tree: tree.clone(), direct: direct.clone(), gather: gather.clone() };
        }
        let busy = Busy::default();
        let emitters = Emitters::new(surfaces, pose, &self.units);
        let energies = self.photons.trace(accelerator, surfaces, &emitters, &self.anchors, &self.units, &busy);
        figures.photons_traced = energies.traced;
        figures.photons = busy.seconds();

        let busy = Busy::default();
        let sampled = self.sampled_areas(&emitters, surfaces);
        let mut intensities: Vec<Vec3> = energies.fixed.iter().map(|&flux| flux / std::f32::consts::PI).collect();
        let tree = match self.kept.as_ref().map(|kept| &kept.tree).or(self.tree.as_ref()) {
            Some(before) => {
                // Behind the anchors stand the lights that keep their energy: surfaces and sky.
                intensities.extend(before.lights()[self.anchors.fixed.len()..].iter().map(|light| light.intensity));
                let mut tree = before.clone();
                // The same energies again are no news.
                if tree.lights().iter().map(|light| light.intensity).ne(intensities.iter().copied()) {
                    let update = busy.measure(|| Arc::make_mut(&mut tree).update_drawn(&intensities));
                    figures.tree_swaps_share = update.swapped_share;
                }
                tree
            }
            None => {
                let anchors = self.anchors.fixed.iter().zip(intensities).map(|(anchor, intensity)| Light {
                    position: anchor.position.into(),
                    emission: Emission::Cosine(anchor.normal.into()),
                    intensity,
                });
                let lights: Vec<Light> = anchors.chain(self.lights_that_stay(&emitters, surfaces, &sampled)).collect();
                let bound = self.anchors.softening(self.plan.is_on(Stage::Compensation));
                let params = BuildParams::bounded_by(bound).with_seed(self.settings.seed);
                Arc::new(busy.measure(|| LightTree::build(&lights, params)))
            }
        };
        let mut direct = DirectLights::new(&emitters, surfaces, &self.anchors, &energies.carried, &sampled);
        if self.plan.is_on(Stage::Cache) {
            // Light that moving things send back is as smooth as all indirect light: records hold it too.
            direct = direct.with_carried_apart();
        }
        let mut glow_softened = vec![false; self.scene.instances.len()];
        for place in (0..emitters.areas.len()).filter(|place| !sampled.contains(place)) {
            glow_softened[emitters.areas[place].instance] = true;
        }
        let gather = busy
            .measure(|| Gather::new(surfaces, &self.anchors, &energies, &self.units, direct.lamps(), glow_softened));
        figures.tree = busy.seconds();
        Lights { tree, direct: Arc::new(direct), gather: Arc::new(gather) }
    }

    /// Places of the glowing surfaces that each pixel asks for itself: few and compact ones, and those that move.
    fn sampled_areas(&self, emitters: &Emitters, surfaces: &Surfaces) -> Vec<usize> {
        let moving = self.scene.moving_instances();
        let moves = |place: usize| moving[emitters.areas[place].instance];
        let compact = |place: usize| {
            let light = &emitters.areas[place];
            light.patch_count() <= FEW_PATCHES || light.extent(surfaces) <= SMALL_EXTENT * self.units.radius
        };
        let places = 0..emitters.areas.len();
        let few: Vec<usize> = places.clone().filter(|&place| !moves(place) && compact(place)).collect();
        if few.len() <= MOST_SAMPLED_SURFACES {
            places.filter(|&place| moves(place) || compact(place)).collect()
        } else {
            places.filter(|&place| moves(place)).collect()
        }
    }

    /// The lights of the tree that keep their energy: glowing surfaces that are not in `sampled`, and the sky.
    fn lights_that_stay(&self, emitters: &Emitters, surfaces: &Surfaces, sampled: &[usize]) -> Vec<Light> {
        let luminance = render_core::luminance;
        let areas: Vec<_> = (0..emitters.areas.len()).filter(|place| !sampled.contains(place)).collect();
        let power: f32 = areas.iter().map(|&place| luminance(emitters.areas[place].power())).sum();
        let mut lights = Vec::new();
        for place in areas {
            let area = &emitters.areas[place];
            let (least, most) = POINTS_OF_A_SURFACE;
            let by_power = EMITTER_POINTS * luminance(area.power()) / power.max(f32::MIN_POSITIVE);
            // A surface of many small panels needs a few points on each.
            let by_panels = (4 * area.patch_count()) as f32;
            let count = by_power.max(by_panels).clamp(least, most) as usize;
            lights.extend(area.samples(surfaces, count).into_iter().map(|sample| Light {
                position: sample.position.into(),
                emission: Emission::Cosine(sample.normal.into()),
                intensity: sample.intensity,
            }));
        }
        lights.extend(dome_lights(self.scene, &self.units, DOME_LIGHTS).into_iter().map(|light| Light {
            position: light.position.into(),
            emission: Emission::Omni,
            intensity: light.intensity,
        }));
        lights
    }
}
