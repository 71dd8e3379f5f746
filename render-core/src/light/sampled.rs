//! Interface of lights that are sampled with shadow rays for direct light.

use super::receiver::ShadingPoint;
use super::tile::ReceiverTile;
use crate::accel::{Accelerator, Shadows};
use glam::{Vec3, Vec3A};
use std::any::Any;
use std::fmt::Debug;

/// Light that is sampled with shadow rays at every pixel.
pub(super) trait Sampled: Any + Debug + Send + Sync {
    /// Adds the light's irradiance at each receiver of `tile` to `sums` \[W·m⁻²\].
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]);

    /// Returns the radiance of this light reflected by a receiver with this `brdf` \[W·m⁻²·sr⁻¹\].
    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3>;

    /// Returns the region in which the light's shadow rays end.
    fn source(&self) -> Source;

    /// Returns a point of the light, or the direction towards a distant light.
    fn lamp(&self) -> Lamp;

    /// Returns whether `other` is the same light in the same position.
    fn is_same(&self, other: &dyn Sampled) -> bool;

    /// Returns the instance with the emissive surface, or `None` for lights that rays cannot hit.
    fn instance(&self) -> Option<u32> {
        None
    }
}

/// BRDF \[sr⁻¹\] for light from a disc around a direction. The second argument is the half-angle of the disc \[rad\].
pub(super) type Brdf<'a> = &'a dyn Fn(Vec3A, f32) -> Vec3;

/// Light, and the number of shadow rays traced for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Traced<T> {
    /// Computed light: irradiance or radiance.
    pub value: T,
    /// Number of shadow rays traced.
    pub shadow_rays: u64,
}

impl Traced<Vec3> {
    pub(super) fn add(&mut self, other: Self) {
        self.value += other.value;
        self.shadow_rays += other.shadow_rays;
    }
}

/// Region that emits direct light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// Bounding box of a light.
    Lamp {
        /// Lower corner of the box \[m\].
        low: Vec3A,
        /// Upper corner of the box \[m\].
        high: Vec3A,
    },
    /// Disc in the sky.
    Disc {
        /// Direction towards the disc's center, a unit vector.
        towards: Vec3A,
        /// Half the disc's angular diameter \[rad\].
        angular_radius: f32,
    },
}

/// Point of a light, or the direction towards a distant light.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lamp {
    /// Position of the point \[m\].
    At(Vec3A),
    /// Direction towards a distant light, a unit vector.
    Towards(Vec3A),
}

/// One point of each light that is sampled at every pixel, or the direction towards a distant light.
#[derive(Clone, Debug, Default)]
pub struct Lamps(pub(super) Vec<Lamp>);

impl Lamps {
    /// Returns whether any of the points or distant lights is visible from `position` on a surface with this `normal`.
    pub(crate) fn are_seen(&self, accelerator: &Accelerator, position: Vec3A, normal: Vec3A) -> bool {
        self.0.iter().any(|lamp| match *lamp {
            Lamp::At(lamp) => normal.dot(lamp - position) > 0.0 && !accelerator.occluded(position, lamp),
            Lamp::Towards(towards) => normal.dot(towards) > 0.0 && !accelerator.occluded_towards(position, towards),
        })
    }
}
