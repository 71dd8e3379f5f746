//! Probes: irradiance by normal at the centers of dynamic instances.
//!
//! The radiance around a center is projected to spherical harmonics of degree 2, which represent the irradiance of
//! any normal with an error of about 1 % \[RamamoorthiHanrahan01\]. Rays pass through dynamic instances.

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
    /// Creates the probes of `instances`, each with the radiance that `radiance` returns for a point and a direction
    /// \[W·m⁻²·sr⁻¹\].
    pub fn trace(instances: &[(u32, Vec3A)], radiance: impl Fn(Vec3A, Vec3A) -> Vec3) -> Self {
        let mut probes = BTreeMap::new();
        for &(instance, center) in instances {
            let mut harmonics = Harmonics::default();
            for u in centered_sobol(RAYS) {
                let direction = Vec3A::from(uniform_sphere(u));
                harmonics.add(direction.into(), radiance(center, direction), 4.0 * PI / RAYS as f32);
            }
            probes.insert(instance, harmonics);
        }
        Self(probes)
    }

    /// Returns the irradiance of a surface of `instance` with this unit `normal` \[W·m⁻²\]; zero without a probe.
    pub fn irradiance(&self, instance: u32, normal: Vec3A) -> Vec3 {
        self.0.get(&instance).map_or(Vec3::ZERO, |probe| probe.irradiance(normal.into()).max(Vec3::ZERO))
    }
}
