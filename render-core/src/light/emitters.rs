//! Lights of a scene, grouped by type.

use super::area::AreaLight;
use super::distant::DistantLight;
use super::emission::{Ball, PhotonEmitter};
use super::point::PointLight;
use super::sampled::Sampled;
use super::sky;
use super::sun::SunLight;
use crate::Units;
use crate::environment::Environment;
use crate::scene::{Pose, PunctualKind};
use crate::surface::Surfaces;
use glam::Vec3A;

/// All lights of a scene at one time.
#[derive(Clone, Debug)]
pub struct Emitters {
    /// Emissive surfaces of the scene.
    pub areas: Vec<AreaLight>,
    /// Point and spot lights of the scene.
    pub points: Vec<PointLight>,
    /// Directional lights of the scene.
    pub suns: Vec<SunLight>,
    /// Bounding sphere of the scene.
    pub(super) ball: Ball,
}

impl Emitters {
    /// Collects the lights of a scene. `units` defines the scene's bounding sphere.
    #[must_use]
    pub fn new(surfaces: &Surfaces, pose: &Pose, units: &Units) -> Self {
        let scene = surfaces.scene();
        let areas = (0..scene.instances.len()).filter_map(|instance| AreaLight::new(surfaces, instance)).collect();
        // Sort punctual lights by type. A degenerate transform yields a light that points down.
        let (mut points, mut suns) = (Vec::new(), Vec::new());
        let moving = scene.moving_nodes();
        for light in pose.punctual_lights(scene) {
            let (world, moves) = (&pose.world[light.node], moving[light.node]);
            let axis = world.transform_vector3a(-Vec3A::Z).try_normalize().unwrap_or(-Vec3A::Y);
            match light.kind {
                PunctualKind::Directional => suns.push(SunLight::new(light, axis, moves, &scene.settings)),
                _ => points.push(PointLight::new(light, world.translation, axis, moves)),
            }
        }
        Self { areas, points, suns, ball: Ball { center: units.center, radius: units.radius } }
    }

    /// Returns all lights as sources of photons. Distant lights are last.
    pub(super) fn emissions<'a>(&'a self, sky: Option<&'a Environment>) -> Vec<&'a dyn PhotonEmitter> {
        let mut lights = Vec::<&dyn PhotonEmitter>::new();
        lights.extend(self.areas.iter().map(|light| light as &dyn PhotonEmitter));
        lights.extend(self.points.iter().map(|light| light as &dyn PhotonEmitter));
        lights.extend(self.suns.iter().map(|light| light as &dyn PhotonEmitter));
        lights.extend(sky.map(|light| light as &dyn PhotonEmitter));
        lights
    }

    /// Returns all distant lights: suns and sky.
    pub(crate) fn distant<'a>(&'a self, sky: Option<&'a Environment>) -> impl Iterator<Item = &'a dyn DistantLight> {
        let suns = self.suns.iter().map(|light| light as &dyn DistantLight);
        suns.chain(sky.map(|light| light as &dyn DistantLight))
    }

    /// Returns the lights that are sampled with shadow rays, including the emissive surfaces with the indices `areas`.
    pub(super) fn sampled(&self, surfaces: &Surfaces, areas: &[usize]) -> Vec<Box<dyn Sampled>> {
        let lamps = surfaces.scene().sky.iter().flat_map(Environment::lamps);
        let mut lights = Vec::<Box<dyn Sampled>>::new();
        lights.extend(areas.iter().map(|&index| boxed(self.areas[index].sampled(surfaces))));
        lights.extend(self.points.iter().map(|&light| boxed(light)));
        lights.extend(self.suns.iter().map(|light| boxed(light.sampled())));
        lights.extend(lamps.map(|lamp| boxed(sky::sampled(lamp))));
        lights
    }
}

fn boxed(light: impl Sampled) -> Box<dyn Sampled> {
    Box::new(light)
}
