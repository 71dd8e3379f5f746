//! Probes: irradiance by normal at the centers of dynamic instances.
//!
//! The radiance around a center is projected to spherical harmonics of degree 2, which represent the irradiance of
//! any normal with an error of about 1 % \[RamamoorthiHanrahan01\]. Rays pass through dynamic instances.

use super::texel_light::TexelLight;
use glam::{Vec3, Vec3A};
use lightfield::Harmonics;
use render_core::sampling::centered_sobol;
use render_core::sampling::uniform_sphere;
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// Number of rays of a probe.
const RAYS: usize = 256;

/// Probes of a frame, by instance.
#[derive(Default)]
pub(super) struct Probes(BTreeMap<u32, Harmonics>);

impl Probes {
    /// Traces a probe for each moving instance. Rays see only static surfaces.
    pub fn trace(light: &TexelLight) -> Self {
        let mut probes = BTreeMap::new();
        for thing in &light.standing {
            probes.insert(thing.instance, probe(light, thing.sphere().center));
        }
        Self(probes)
    }

    /// Returns the irradiance of a surface of `instance` with this unit `normal` \[W·m⁻²\]; zero without a probe.
    pub fn irradiance(&self, instance: u32, normal: Vec3A) -> Vec3 {
        self.0.get(&instance).map_or(Vec3::ZERO, |probe| probe.irradiance(normal.into()).max(Vec3::ZERO))
    }
}

/// Returns the radiance around a point, without dynamic surfaces.
fn probe(light: &TexelLight, center: Vec3A) -> Harmonics {
    let mut harmonics = Harmonics::default();
    let solid_angle = 4.0 * PI / RAYS as f32;
    for u in centered_sobol(RAYS) {
        let direction = Vec3A::from(uniform_sphere(u));
        harmonics.add(direction.into(), light.static_radiance(center, direction, 0.0), solid_angle);
    }
    harmonics
}
