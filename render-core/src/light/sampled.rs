//! Direct light sampled with shadow rays: interface of the lights.

use super::receiver::ShadingPoint;
use super::tile::ReceiverTile;
use crate::accel::{Accelerator, Shadows};
use glam::{Vec3, Vec3A};
use std::any::Any;
use std::fmt::Debug;

/// A light that is sampled with shadow rays at every pixel.
pub(super) trait Sampled: Any + Debug + Send + Sync {
    /// Adds the light's irradiance \[W·m⁻²\] at each receiver of `tile` to `sums`.
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]);

    /// Reflected radiance of this light \[W·m⁻²·sr⁻¹\] at a receiver with this `brdf`.
    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3>;

    /// The region where the light's shadow rays end.
    fn source(&self) -> Source;

    /// One point of the light.
    fn lamp(&self) -> Lamp;

    /// Whether `other` is the same light in the same position.
    fn is_same(&self, other: &dyn Sampled) -> bool;

    /// The instance with the emissive surface; `None` for lights that rays cannot hit.
    fn instance(&self) -> Option<u32> {
        None
    }
}

/// A BRDF \[sr⁻¹\] for light from a disc around a direction. The disc has the given half-angle \[rad\].
pub(super) type Brdf<'a> = &'a dyn Fn(Vec3A, f32) -> Vec3;

/// Light and the shadow rays traced for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Traced<T> {
    /// Irradiance or radiance.
    pub value: T,
    /// Number of shadow rays.
    pub shadow_rays: u64,
}

impl Traced<Vec3> {
    pub(super) fn add(&mut self, other: Self) {
        self.value += other.value;
        self.shadow_rays += other.shadow_rays;
    }
}

/// A region that emits direct light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A bounding box of a light.
    Lamp {
        /// Lower corner \[m\].
        low: Vec3A,
        /// Upper corner \[m\].
        high: Vec3A,
    },
    /// A disc in the sky.
    Disc {
        /// Direction towards the disc, a unit vector.
        towards: Vec3A,
        /// Half the disc's angular diameter \[rad\].
        angular_radius: f32,
    },
}

/// One point of a light.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lamp {
    /// Position \[m\].
    At(Vec3A),
    /// Direction towards a distant light, a unit vector.
    Towards(Vec3A),
}

/// One point of each light that is sampled at every pixel.
#[derive(Clone, Debug, Default)]
pub struct Lamps(pub(super) Vec<Lamp>);

impl Lamps {
    /// Whether any of the points is visible from `position` on a surface with this `normal`.
    pub(crate) fn are_seen(&self, accelerator: &Accelerator, position: Vec3A, normal: Vec3A) -> bool {
        self.0.iter().any(|lamp| match *lamp {
            Lamp::At(lamp) => normal.dot(lamp - position) > 0.0 && !accelerator.occluded(position, lamp),
            Lamp::Towards(towards) => normal.dot(towards) > 0.0 && !accelerator.occluded_towards(position, towards),
        })
    }
}
