//! Anchor lights: virtual point lights that never move over the surface they sit on.
//!
//! A fixed number is spread evenly by area over the surfaces that stand still, and a few over the
//! things that move. Photons give them their energy, frame by frame ([`crate::photon`]): each anchor shines with what
//! photons left at the surfels that belong to it ([`surfels`]).

mod exposure;
mod grid;
mod surfels;

use grid::Grid;
pub(crate) use grid::{SplatScratch, Spot};
pub(crate) use surfels::{SurfelMap, Surfels};

use crate::Units;
use crate::sampling::{Distribution, radical_inverse, triangle};
use crate::scene::Scene;
use crate::surface::Surfaces;
use glam::{Vec2, Vec3A};
use std::f32::consts::PI;

/// Shares of surface that an anchor is softened over, where the light that softening takes is given back.
///
/// Near an anchor it matters by chance where it happens to lie; rays that look around do not care, and surfels tell them more.
/// `cornell`, `atrium` and `nave` by all lights, 128×128, relative MSE against paths: 3.8e-4, 1.8e-3 and 2.8e-3 with 1 share;
/// 2.8e-4, 1.4e-3 and 1.6e-3 with 4; 2.6e-4, 1.3e-3 and 1.4e-3 with 8. Cuts are as large, and frames take as long.
pub(crate) const SHARES: f32 = 8.0;

/// A place that stands for the light its share of surface sends back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// A little off the surface, world space.
    pub position: Vec3A,
    /// Unit normal of the side it stands for.
    pub normal: Vec3A,
    /// Index into [`Scene::instances`].
    pub instance: u32,
}

/// An anchor bound to a point of a triangle: it goes where that goes, however its mesh moves or bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarriedAnchor {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Barycentric weights of the second and the third corner.
    pub place: (f32, f32),
    /// Whether it stands for the front.
    pub front: bool,
    /// Metres off the surface.
    pub offset: f32,
}

/// The anchors of a scene.
#[derive(Clone, Debug, Default)]
pub struct Anchors {
    /// On surfaces that never move: the lights of the tree.
    pub fixed: Vec<Anchor>,
    /// On surfaces that move or bend.
    pub carried: Vec<CarriedAnchor>,
    /// Square metres that each fixed anchor stands for.
    pub area_share: f32,
    /// Square metres that each carried anchor stands for.
    pub carried_area_share: f32,
    /// What photons leave their energy at.
    pub(crate) surfels: Surfels,
}

impl Anchors {
    /// Spreads `fixed` anchors over what stands still and `carried` over what moves.
    pub fn spread(scene: &Scene, surfaces: &Surfaces, units: &Units, fixed: usize, carried: usize) -> Self {
        let anchors = Self::without_surfels(scene, surfaces, units, fixed, carried);
        Self { surfels: Surfels::of(&anchors, surfaces, units), ..anchors }
    }

    fn without_surfels(scene: &Scene, surfaces: &Surfaces, units: &Units, fixed: usize, carried: usize) -> Self {
        let mut anchors = Anchors::default();
        if let Some(patches) = Patches::of(scene, surfaces, false) {
            anchors.fixed = patches.spread(fixed, units).iter().map(|anchor| anchor.in_world(surfaces)).collect();
            anchors.area_share = patches.area() / fixed.max(1) as f32;
        }
        if let Some(patches) = Patches::of(scene, surfaces, true) {
            anchors.carried = patches.spread(carried, units);
            anchors.carried_area_share = patches.area() / carried.max(1) as f32;
        }
        anchors
    }

    /// Softening of the fixed anchors as lights \[m²\]: what stands for r² in place of it is r² + softening. Where the light
    /// that this takes is given back by [`crate::Gather`], it reaches as far as the disc of eight shares; where it is not, no
    /// farther than an anchor's own.
    pub fn softening(&self, given_back: bool) -> f32 {
        self.area_share / PI * if given_back { SHARES } else { 1.0 }
    }

    /// Softening of the carried anchors \[m²\]: of their own share, as they are seen from near by no more than a few things.
    pub fn carried_softening(&self) -> f32 {
        self.carried_area_share / PI
    }

    /// The carried anchors in world space at the pose that `surfaces` has.
    pub fn carried_in_world(&self, surfaces: &Surfaces) -> Vec<Anchor> {
        self.carried.iter().map(|anchor| anchor.in_world(surfaces)).collect()
    }

    /// A sensible number of fixed anchors for a scene: 2000 for a box, 9000 for a building, as in \[Herzog08\], table 1.
    pub fn default_count(scene: &Scene) -> usize {
        let triangles = scene.triangle_count().max(1) as f64;
        // 1000 triangles → 2000, 64 000 and more → 9000, on a straight line in log₂.
        let steps = (triangles / 1000.0).log2().clamp(0.0, 6.0);
        (2000.0 + 7000.0 * steps / 6.0) as usize
    }
}

impl CarriedAnchor {
    /// Where it is at the pose that `surfaces` has.
    fn in_world(&self, surfaces: &Surfaces) -> Anchor {
        let [a, b, c] = surfaces.corners(self.instance as usize, self.triangle as usize);
        let mirrored = surfaces.world(self.instance as usize).matrix3.determinant() < 0.0;
        let turn = if self.front != mirrored { 1.0 } else { -1.0 };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();
        let (u, v) = self.place;
        let position = a + (b - a) * u + (c - a) * v + normal * self.offset;
        Anchor { position, normal, instance: self.instance }
    }
}

/// All sides of triangles that reflect, of what stands still or of what moves.
struct Patches {
    /// Instance, triangle, whether it is the front.
    list: Vec<(usize, usize, bool)>,
    /// By area \[m²\].
    choice: Distribution,
}

impl Patches {
    /// `None` if there is no area.
    fn of(scene: &Scene, surfaces: &Surfaces, on_moving: bool) -> Option<Self> {
        let moving = scene.moving_instances();
        let (mut list, mut areas) = (Vec::new(), Vec::new());
        for (index, instance) in scene.instances.iter().enumerate().filter(|(index, _)| moving[*index] == on_moving) {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            // Both sides of a sheet reflect, each with its own anchors; unlit surfaces reflect nothing.
            let sides: &[bool] = match (material.unlit, material.double_sided) {
                (true, _) => &[],
                (false, false) => &[true],
                (false, true) => &[true, false],
            };
            for (t, &front) in (0..mesh.triangles.len()).flat_map(|t| sides.iter().map(move |front| (t, front))) {
                let [a, b, c] = surfaces.corners(index, t);
                list.push((index, t, front));
                areas.push(f64::from((b - a).cross(c - a).length() / 2.0));
            }
        }
        Some(Self { list, choice: Distribution::new(areas)? })
    }

    /// Square metres.
    fn area(&self) -> f32 {
        self.choice.total() as f32
    }

    /// `count` points, evenly by area.
    fn spread(&self, count: usize, units: &Units) -> Vec<CarriedAnchor> {
        let point = |i: u64| {
            let (patch, _, _) = self.choice.pick((i as f64 + 0.5) / count as f64);
            let (instance, t, front) = self.list[patch];
            let place = triangle(Vec2::new(radical_inverse(2, i), radical_inverse(3, i)));
            CarriedAnchor { instance: instance as u32, triangle: t as u32, place, front, offset: units.epsilon }
        };
        (0..count as u64).map(point).collect()
    }
}
