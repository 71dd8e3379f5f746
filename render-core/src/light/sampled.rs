//! Direct light: what each light that shadow rays go to has for the receivers.

use super::receiver::ShadingPoint;
use super::tile::ReceiverTile;
use crate::accel::{Accelerator, Shadows};
use glam::{Vec3, Vec3A};
use std::any::Any;
use std::fmt::Debug;

/// A light that is sampled with shadow rays at every pixel.
pub(super) trait Sampled: Any + Debug + Send + Sync {
    /// Adds its irradiance \[W·m⁻²\] at each receiver of `tile` to `sums`.
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]);

    /// Radiance \[W·m⁻²·sr⁻¹\] that a receiver of this `brdf` reflects of it.
    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3>;

    /// The region that its shadow rays lead to.
    fn source(&self) -> Source;

    /// One point of it.
    fn lamp(&self) -> Lamp;

    /// Whether `other` is the same light, where it was.
    fn is_same(&self, other: &dyn Sampled) -> bool;

    /// The instance whose surface glows; `None` for lights that no ray meets.
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

/// A region that direct light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A box around a light.
    Lamp {
        /// \[m\]
        low: Vec3A,
        /// \[m\]
        high: Vec3A,
    },
    /// A disc in the sky.
    Disc {
        /// Unit vector.
        towards: Vec3A,
        /// \[rad\]
        angular_radius: f32,
    },
}

/// One point of a light.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lamp {
    /// \[m\]
    At(Vec3A),
    /// Unit vector to a light that is infinitely far away.
    Towards(Vec3A),
}

/// One point of each light that is sampled at every pixel.
#[derive(Clone, Debug, Default)]
pub struct Lamps(pub(super) Vec<Lamp>);

impl Lamps {
    /// Whether any of the points is visible from `position`, on a surface that faces along `normal`.
    pub(crate) fn are_seen(&self, accelerator: &Accelerator, position: Vec3A, normal: Vec3A) -> bool {
        self.0.iter().any(|lamp| match *lamp {
            Lamp::At(lamp) => normal.dot(lamp - position) > 0.0 && !accelerator.occluded(position, lamp),
            Lamp::Towards(towards) => normal.dot(towards) > 0.0 && !accelerator.occluded_towards(position, towards),
        })
    }
}
