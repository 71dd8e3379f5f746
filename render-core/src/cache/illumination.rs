//! The light at a point on a surface, and the interface to its source.

use crate::scene::{Projected, View};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use ranks::portable;

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Site {
    /// Position on the surface, in world space \[m\].
    pub position: Vec3A,
    /// Unit shading normal.
    pub normal: Vec3A,
    /// Unit normal of the triangle, on the same side.
    pub geometric_normal: Vec3A,
    /// Index of the instance if it ever moves; otherwise [`NOTHING`](crate::NOTHING).
    pub carrier: u32,
    /// Openness: from 0 in a crack to 1 ([`Illumination::openness`]). Above 1 on emissive surfaces.
    pub openness: f32,
    /// Key for random numbers; a record keeps it.
    pub key: u64,
}

portable!(Site { position, normal, geometric_normal, carrier, openness, key });

impl Site {
    /// Applies the motion of its instance. The normal becomes zero if the transform flattens everything.
    pub(super) fn carried_by(&mut self, carry: &Affine3A) {
        let normals = crate::scene::normal_matrix(carry);
        self.position = carry.transform_point3a(self.position);
        self.normal = (normals * self.normal).normalize_or_zero();
        self.geometric_normal = (normals * self.geometric_normal).normalize_or_zero();
    }

    /// Returns the width of a pixel on the surface \[m\]. On oblique surfaces, this is the width of a square of equal
    /// area.
    pub(super) fn pixel_width(&self, view: &View) -> f32 {
        let Some(Projected { pixel, depth }) = view.project(self.position) else { return 0.0 };
        let cosine = view.ray(pixel).1.dot(self.geometric_normal).abs();
        view.pixel_width(depth) / cosine.max(0.04).sqrt()
    }
}

/// The light at a site.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LocalIrradiance {
    /// Irradiance \[W·m⁻²\], linear RGB.
    pub irradiance: Vec3,
    /// Derivative by the normal: one column per axis.
    pub by_normal: Mat3A,
    /// Derivative by the position \[W·m⁻³\]: one column per axis.
    pub by_position: Mat3A,
    /// Harmonic mean distance of the surrounding surfaces \[m\]; may be infinite.
    pub harmonic_mean: f32,
    /// Distance of the nearest surrounding surface \[m\]; may be infinite.
    pub nearest: f32,
    /// Tolerable error of the irradiance's luminance \[W·m⁻²\].
    pub tolerance: f32,
}

portable!(LocalIrradiance { irradiance, by_normal, by_position, harmonic_mean, nearest, tolerance });

/// The newly computed light of a record.
#[derive(Clone, Debug)]
pub struct Computed<R> {
    /// The computed light.
    pub light: LocalIrradiance,
    /// Data for relighting at less cost than a new lightcut.
    pub recipe: R,
}

/// Source of the light at a site; called from many threads concurrently.
pub trait Illumination: Sync {
    /// Data stored with a record, which makes relighting cheaper than a new computation.
    type Recipe: Send + Sync;
    /// Memory that a thread reuses for its next record.
    type Scratch: Default;

    /// Computes the light at `site`.
    fn compute(&self, site: &Site, scratch: &mut Self::Scratch) -> Computed<Self::Recipe>;

    /// Updates the light at a `site` from its recipe. `known` is the time of its last update. Returns `None` if too
    /// much has changed nearby and the light must be computed.
    fn relight(&self, site: &Site, recipe: &mut Self::Recipe, known: LastUpdate) -> Option<LocalIrradiance>;

    /// Returns a number for this recipe, which is stored with the record on all ranks; 0 if unused.
    fn note(&self, _recipe: &Self::Recipe) -> u32 {
        0
    }

    /// Returns the mean of d / (d + `scale`) over cosine-distributed directions from `site`. d is the distance to the
    /// surface in a direction; d and `scale` are in meters. The directions depend only on the normal, so that similar
    /// sites have similar values.
    fn openness(&self, _site: &Site, _scale: f32) -> f32 {
        1.0
    }

    /// Returns whether [`Illumination::openness`] is certain to be nearly unchanged since the previous frame.
    fn is_undisturbed(&self, _site: &Site, _scale: f32) -> bool {
        false
    }
}

/// Time of the last update of a record's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastUpdate {
    /// In the previous frame, at the same position: only the latest motion has changed anything.
    LastFrame,
    /// Earlier, or at another position: any surface may have come between it and a light.
    Earlier,
}
