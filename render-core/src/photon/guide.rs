//! Guided emission: photons start where their light reaches the visible region.
//!
//! An infinitely distant light illuminates a whole scene. If the camera is in a room with a window, few photons of this
//! light enter. A small lamp emits few photons compared with the sky, although it may be the only light in a room.
//! Camera paths therefore record the light that reaches their vertices:
//!
//! ```text
//! p(ℓ)     = μ P_ℓ / Σ P + (1 − μ) I_ℓ / Σ I          probability of light ℓ
//! p(u | ℓ) = g_ℓ(u)                                   density of the start of a photon from a distant light ℓ
//!   P_ℓ  power          I_ℓ  light from ℓ that the paths found
//!   u    four numbers in 0…1 that determine the photon's position and direction          g_ℓ  density of the found light over u
//! ```
//! The flux of each photon is inversely proportional to p, so the expected light is unchanged. Light is weighted
//! relative to its region of the picture, so that dim corners receive photons too. Photons reflected far from the
//! camera aim at the visible region (`photon/aims.rs`). One guide serves all frames of a film.

use super::aims::{AimCone, Aims, Edge};
use super::boxes::Boxes;
use crate::anchor::{Anchor, Anchors};
use crate::gbuffer::CameraRay;
use crate::light::{Emitters, Facing, PhotonSource, Start};
use crate::sampling::{Distribution, Pick, cosine_hemisphere, hash, owen_sobol_point};
use crate::scene::View;
use crate::surface::Interaction;
use crate::{PosedScene, Units, luminance};
use glam::{Vec2, Vec3, Vec3A, Vec4};
use rayon::prelude::*;
use std::sync::Arc;

/// μ: weight of power in the selection of a light. A light that no path has found keeps at least a fifth of its
/// photons.
const BY_POWER: f64 = 0.2;
/// Number of paths from the camera over all moments of a film.
const PATHS: usize = 8192;
/// Maximum number of surfaces on a path after the surface visible to the camera.
const VERTICES: usize = 3;
/// Number of picture regions along each side.
const PARTS: usize = 8;

/// Distribution of photon starts in a film. It is denser where light from the starts reaches the visible region.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Guide {
    /// I_ℓ / Σ I for each light of the [`PhotonSource`], or empty if no light was found.
    shares: Vec<f64>,
    /// g_ℓ of each infinitely distant light, in the order of the [`PhotonSource`].
    distant: Vec<Option<Boxes>>,
    aims: Aims,
}

/// Camera paths at some moments of a film, from which a [`Guide`] is computed.
#[derive(Clone, Debug, Default)]
pub struct GuideSearch {
    found: Vec<Found>,
    edges: Vec<PathEdge>,
    /// Number of paths per moment.
    paths: usize,
    moments: u64,
    lights: usize,
    distant: usize,
}

/// Direct light found at a vertex of a path.
#[derive(Clone, Copy, Debug)]
struct Found {
    /// Joint index of the moment and of the region in the picture.
    part: usize,
    light: usize,
    /// Start of a photon that transports this light, in 0…1. Used for infinitely distant lights.
    start: Vec4,
    /// Luminance that the camera receives from this light.
    light_in_picture: f64,
}

/// Edge of a path.
#[derive(Clone, Copy, Debug)]
struct PathEdge {
    /// Joint index of the moment and of the region in the picture.
    part: usize,
    edge: Edge,
}

impl GuideSearch {
    /// Returns a search over this number of `moments`, which share the paths.
    #[must_use]
    pub fn over(moments: usize) -> Self {
        Self { paths: PATHS.div_ceil(moments.max(1)), ..Self::default() }
    }

    /// Traces paths from the camera at one moment, with the lights at this moment.
    pub fn look(&mut self, scene: PosedScene, emitters: &Emitters, view: &View, units: &Units) {
        let moment = self.moments;
        let from_camera = |index: u32| {
            let at = owen_sobol_point(index, hash(moment, 0, 0));
            let (origin, direction) = view.ray(at * view.size());
            let hit = scene.accelerator.closest(origin, direction)?;
            let (_, surface) = CameraRay { origin, direction }.shown(scene, hit, |_| 0.0)?;
            let part = (at.y * PARTS as f32) as usize * PARTS + (at.x * PARTS as f32) as usize;
            Some((part, Departure::from(&surface, units)))
        };
        self.follow(scene, emitters, units, from_camera);
    }

    /// Traces paths from points on all static surfaces, for light that may be viewed from anywhere.
    pub fn look_everywhere(&mut self, scene: PosedScene, emitters: &Emitters, anchors: &Anchors, units: &Units) {
        let from_anchor = |index: u32| {
            // Use runs of anchors as regions, because consecutive anchors are mostly close together.
            let count = anchors.fixed.len();
            let Anchor { position, normal, .. } = anchors.fixed.get(index as usize * count / PATHS)?;
            let part = index as usize * PARTS * PARTS / PATHS;
            Some((part, Departure { origin: *position, normal: *normal, geometric_normal: *normal }))
        };
        self.follow(scene, emitters, units, from_anchor);
    }

    /// Traces the paths of a moment. `depart` returns the region and the first surface of each path.
    fn follow(
        &mut self,
        scene: PosedScene,
        emitters: &Emitters,
        units: &Units,
        depart: impl Fn(u32) -> Option<(usize, Departure)> + Sync,
    ) {
        // Trace paths in parallel, and append their results in the order of paths.
        let Some(source) = emitters.photons(scene.surfaces.scene()) else { return };
        let paths = Paths { scene, source: &source, units, moment: self.moments };
        let first_part = self.moments as usize * PARTS * PARTS;
        let follow = |index| {
            depart(index).map(|(part, start)| paths.follow(index, first_part + part, start)).unwrap_or_default()
        };
        let ways: Vec<Way> = (0..self.paths as u32).into_par_iter().map(follow).collect();
        for Way { found, edges } in ways {
            self.found.extend(found);
            self.edges.extend(edges);
        }
        self.moments += 1;
        (self.lights, self.distant) = (source.powers().len(), source.near_lights());
    }

    /// Returns the guide, or `None` if it would change nothing.
    #[must_use]
    pub fn finish(mut self) -> Option<Guide> {
        // Weight light relative to its region of the picture.
        let mut sums = vec![0.0; self.moments as usize * PARTS * PARTS];
        self.found.iter().for_each(|found| sums[found.part] += found.light_in_picture);
        self.found.iter_mut().for_each(|found| found.light_in_picture /= sums[found.part]);
        let lit = sums.iter().filter(|&&sum| sum > 0.0).count() as f64;
        if lit == 0.0 || self.lights == 1 && self.distant == 1 {
            return None;
        }

        // Compute the fractions of the lights, and the start densities of the distant lights.
        let mut shares = vec![0.0; self.lights];
        self.found.iter().for_each(|found| shares[found.light] += found.light_in_picture / lit);
        let boxes = |light: usize| {
            let of_light = self.found.iter().filter(|found| found.light == light);
            Boxes::around(of_light.map(|found| (found.start, found.light_in_picture)).collect())
        };
        let distant = (self.distant..self.lights).map(boxes).collect();

        // Keep only edges with light.
        let mut edges = Vec::new();
        for PathEdge { part, edge } in self.edges {
            if edge.light > 0.0 {
                edges.push(Edge { light: edge.light / sums[part], ..edge });
            }
        }
        Some(Guide { shares, distant, aims: Aims::new(edges) })
    }
}

/// Light and edges found by one path.
#[derive(Default)]
struct Way {
    found: Vec<Found>,
    edges: Vec<PathEdge>,
}

/// Start of a path segment at a surface.
struct Departure {
    /// Position slightly off the surface.
    origin: Vec3A,
    normal: Vec3A,
    geometric_normal: Vec3A,
}

impl Departure {
    fn from(surface: &Interaction, units: &Units) -> Self {
        let geometric_normal = surface.geometric_normal;
        let origin = surface.position + geometric_normal * units.epsilon;
        Self { origin, normal: surface.shading_normal(), geometric_normal }
    }
}

/// Camera paths at one moment. They are traced against the direction of light.
struct Paths<'a> {
    scene: PosedScene<'a>,
    source: &'a PhotonSource<'a>,
    units: &'a Units,
    moment: u64,
}

impl Paths<'_> {
    /// Traces the path with this `index`. Returns the light and the edges of the path.
    fn follow(&self, index: u32, part: usize, mut from: Departure) -> Way {
        let Way { mut found, mut edges } = Way::default();
        let mut dimension = 0;
        let mut points = || {
            dimension += 1;
            owen_sobol_point(index, hash(self.moment, dimension, 0))
        };
        let mut throughput = Vec3::ONE;
        for _ in 0..VERTICES {
            // Find the next surface in a cosine-distributed direction.
            let direction = Vec3A::from(cosine_hemisphere(from.normal.into(), points()));
            if direction.dot(from.geometric_normal) <= 0.0 {
                break;
            }
            let Some(hit) = self.scene.accelerator.closest(from.origin, direction) else { break };
            let surface = self.scene.surfaces.meet(&hit, direction, 0.0);
            throughput *= if surface.is_back() { Vec3::ZERO } else { surface.reflectance() };
            if luminance(throughput) <= 0.0 {
                break;
            }

            // Sample the light at the new vertex, which is visible from the previous surface.
            let (to, before) = (from.origin, found.len());
            from = Departure::from(&surface, self.units);
            self.light(&from, throughput, &mut points, &mut found);

            // Add this light to all edges so far, along which it reaches the camera.
            edges.push(PathEdge { part, edge: Edge { from: from.origin, to, light: 0.0 } });
            let gain: f64 = found[before..].iter().map(|found| found.light_in_picture).sum();
            edges.iter_mut().for_each(|PathEdge { edge, .. }| edge.light += gain);
        }
        found.iter_mut().for_each(|found| found.part = part);
        Way { found, edges }
    }

    /// Samples direct light at a surface, from one near light and from all infinitely distant lights.
    fn light(&self, at: &Departure, throughput: Vec3, points: &mut impl FnMut() -> Vec2, found: &mut Vec<Found>) {
        let PosedScene { accelerator, surfaces } = self.scene;
        for (light, chance) in self.source.some_lights(points().x) {
            // Draw a point or direction of the light, then test visibility.
            let (place, way) = (points(), points());
            let facing = Facing { position: at.origin, normal: at.normal };
            let Some(seen) = self.source.towards(surfaces, light, facing, [place, way]) else { continue };
            let hidden = match seen.end {
                Some(end) => accelerator.occluded(at.origin, end),
                None => accelerator.occluded_towards(at.origin, seen.towards),
            };

            // Divide by the probability of the light, because only one near light is drawn.
            let light_in_picture = f64::from(luminance(throughput * seen.irradiance)) / chance;
            if !hidden && light_in_picture > 0.0 {
                found.push(Found { part: 0, light, start: seen.start, light_in_picture });
            }
        }
    }
}

impl Guide {
    /// Returns the weights for selecting lights, from the probabilities of lights by power.
    fn weights(&self, by_power: &Distribution, count: usize) -> Vec<f64> {
        let weight = |light: usize| {
            let power = by_power.probability(light);
            let share = self.shares.get(light).copied().unwrap_or(0.0);
            if power > 0.0 { BY_POWER * power + (1.0 - BY_POWER) * share } else { 0.0 }
        };
        (0..count).map(weight).collect()
    }
}

/// Distribution of the lights and start points of photons.
pub(super) struct Starts {
    choice: Distribution,
    guide: Option<Arc<Guide>>,
    /// Number of lights before the first infinitely distant light.
    near: usize,
}

impl Starts {
    /// Returns the distribution for the lights of `source`.
    pub fn new(source: &PhotonSource, guide: Option<Arc<Guide>>) -> Self {
        let by_power = source.choice();
        let choice = guide.as_ref().and_then(|guide| Distribution::new(guide.weights(by_power, source.powers().len())));
        Self { choice: choice.unwrap_or_else(|| by_power.clone()), guide, near: source.near_lights() }
    }

    /// Returns the cone that photons reflected at `place` aim into, or `None` if they need not aim.
    #[inline]
    pub fn cone(&self, place: Vec3A) -> Option<AimCone> {
        self.guide.as_ref()?.aims.cone(place)
    }

    /// Draws a photon start from numbers in 0…1.
    pub fn draw(&self, which: f64, place: Vec2, way: Vec2) -> Start {
        let Pick { index: light, probability, rest } = self.choice.pick(which);
        // Find the start density, which only distant lights have.
        let boxes = self
            .guide
            .as_ref()
            .and_then(|guide| light.checked_sub(self.near).and_then(|distant| guide.distant.get(distant)?.as_ref()));
        let Some(boxes) = boxes else { return Start { light, rest, place, way, density: probability as f32 } };

        // Draw the start with the density of the light. The remainder `rest` selects the box.
        let (start, density) = boxes.draw(rest as f32, Vec4::new(place.x, place.y, way.x, way.y));
        let (place, way) = (Vec2::new(start.x, start.y), Vec2::new(start.z, start.w));
        Start { light, rest, place, way, density: probability as f32 * density }
    }
}
