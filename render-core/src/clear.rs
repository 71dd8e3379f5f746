//! Shadow rays that pass clear thin walls, such as window panes.

use crate::PosedScene;
use crate::bsdf::Bsdf;
use crate::surface::Surface;
use glam::{Vec3, Vec3A};

/// Maximum number of walls that a ray passes.
const MOST_WALLS: usize = 32;

/// Visibility through clear walls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClearWalls<'a> {
    scene: PosedScene<'a>,
    /// Whether the scene may have such walls. Without them, a ray is occluded by its first hit.
    has_walls: bool,
    /// Offset of rays from surfaces \[m\].
    epsilon: f32,
}

impl<'a> ClearWalls<'a> {
    pub(crate) fn new(scene: PosedScene<'a>, epsilon: f32) -> Self {
        Self { scene, has_walls: scene.surfaces.has_clear_walls(), epsilon }
    }

    /// Returns the fraction of light from `to` that arrives at `from`, linear RGB.
    pub(crate) fn passed(&self, from: Vec3A, to: Vec3A) -> Vec3 {
        if !self.scene.accelerator.occluded(from, to) {
            return Vec3::ONE;
        }
        match (to - from).try_normalize() {
            Some(direction) if self.has_walls => self.through(from, direction, from.distance(to)),
            _ => Vec3::ZERO,
        }
    }

    /// Returns the fraction of light from infinity in the unit direction `towards` that arrives at `from`, linear RGB.
    pub(crate) fn passed_towards(&self, from: Vec3A, towards: Vec3A) -> Vec3 {
        if !self.scene.accelerator.occluded_towards(from, towards) {
            return Vec3::ONE;
        }
        if self.has_walls { self.through(from, towards, f32::INFINITY) } else { Vec3::ZERO }
    }

    /// Multiplies the transmittances of all walls up to a distance.
    fn through(&self, mut origin: Vec3A, direction: Vec3A, mut distance: f32) -> Vec3 {
        let PosedScene { accelerator, surfaces } = self.scene;
        let mut passed = Vec3::ONE;
        for _ in 0..MOST_WALLS {
            let Some(hit) = accelerator.closest(origin, direction).filter(|hit| hit.distance < distance) else {
                return passed;
            };
            if !surfaces.may_be_clear(hit.instance) {
                return Vec3::ZERO;
            }
            let surface = surfaces.at_indirect(&hit, direction, 0.0);
            passed *= straight(&surface, direction);
            if passed == Vec3::ZERO {
                return passed;
            }
            let next = surface.position - surface.geometric_normal * self.epsilon;
            distance -= (next - origin).dot(direction);
            origin = next;
        }
        Vec3::ZERO
    }
}

/// Returns the fraction of light that passes straight through a surface, hit by a ray in the unit `direction`.
pub(crate) fn straight(surface: &Surface, direction: Vec3A) -> Vec3 {
    let Some(lobes) = surface.lobes.as_deref().filter(|lobes| lobes.is_clear_wall()) else { return Vec3::ZERO };
    let axes = lobes.axes(surface.shading_normal.into());
    let outgoing = -Vec3::from(direction);
    Bsdf::layered(lobes, axes, lobes.glass.ior).straight(axes[2].dot(outgoing))
}
