//! Light at a surface point, and the interface to the source of this light.

use crate::scene::{Projected, View};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use ranks::portable;

/// Point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Site {
    /// Position on the surface, in world space \[m\].
    pub position: Vec3A,
    /// Unit shading normal.
    pub normal: Vec3A,
    /// Unit normal of the triangle, on the side of `normal`.
    pub geometric_normal: Vec3A,
    /// Index of the instance if it ever moves, otherwise [`NOTHING`](crate::NOTHING).
    pub carrier: u32,
    /// Openness ([`Illumination::openness`]), from 0 in a crack to 1. Values above 1 mark emissive surfaces.
    pub openness: f32,
    /// Key of the random numbers, which is constant for a record.
    pub key: u64,
}

portable!(Site { position, normal, geometric_normal, carrier, openness, key });

impl Site {
    /// Applies the motion of the site's instance. The normal becomes zero if the transform flattens everything.
    pub(super) fn carried_by(&mut self, carry: &Affine3A) {
        let normals = crate::scene::normal_matrix(carry);
        self.position = carry.transform_point3a(self.position);
        self.normal = (normals * self.normal).normalize_or_zero();
        self.geometric_normal = (normals * self.geometric_normal).normalize_or_zero();
    }

    /// Returns the width of a pixel on the surface \[m\]. On oblique surfaces, this is the width of a square with the
    /// area of the pixel on the surface.
    pub(super) fn pixel_width(&self, view: &View) -> f32 {
        let Some(Projected { pixel, depth }) = view.project(self.position) else { return 0.0 };
        let cosine = view.ray(pixel).1.dot(self.geometric_normal).abs();
        view.pixel_width(depth) / cosine.max(0.04).sqrt()
    }
}

/// Light at a site, with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LocalIrradiance {
    /// Irradiance \[W·m⁻²\], linear RGB.
    pub irradiance: Vec3,
    /// Derivative of the irradiance by the normal \[W·m⁻²\], with one column per axis.
    pub by_normal: Mat3A,
    /// Derivative of the irradiance by the position \[W·m⁻³\], with one column per axis.
    pub by_position: Mat3A,
    /// Harmonic mean of the distances to surrounding surfaces \[m\]. It may be infinite.
    pub harmonic_mean: f32,
    /// Distance to the nearest surrounding surface \[m\]. It may be infinite.
    pub nearest: f32,
    /// Tolerable error of the irradiance's luminance \[W·m⁻²\].
    pub tolerance: f32,
}

portable!(LocalIrradiance { irradiance, by_normal, by_position, harmonic_mean, nearest, tolerance });

/// Newly computed light of a record, with its recipe.
#[derive(Clone, Debug)]
pub struct Computed<R> {
    /// The computed light.
    pub light: LocalIrradiance,
    /// Recipe for relighting, which costs less than a new lightcut.
    pub recipe: R,
}

/// Source of the light at sites. Many threads call it concurrently.
pub trait Illumination: Sync {
    /// Recipe stored with a record, which makes relighting cheaper than a new computation.
    type Recipe: Send + Sync;
    /// Working memory that a thread reuses for its next record.
    type Scratch: Default;

    /// Computes the light at `site`.
    fn compute(&self, site: &Site, scratch: &mut Self::Scratch) -> Computed<Self::Recipe>;

    /// Updates the light at a `site` from its recipe. `known` is the time of the last update. Returns `None` if so much
    /// has changed nearby that the light must be computed.
    fn relight(&self, site: &Site, recipe: &mut Self::Recipe, known: LastUpdate) -> Option<LocalIrradiance>;

    /// Returns a number for this recipe, which is stored with the record on all ranks. Returns 0 by default.
    fn note(&self, _recipe: &Self::Recipe) -> u32 {
        0
    }

    /// Returns the mean of d / (d + `scale`) over cosine-distributed directions from `site`. d is the distance to the
    /// surface in a direction; d and `scale` are in meters. The directions depend only on the normal, so that similar
    /// sites have similar values.
    fn openness(&self, _site: &Site, _scale: f32) -> f32 {
        1.0
    }

    /// Returns whether an update at `site` may wait for a few frames, as long as the light changes slowly: nothing near
    /// the site moves, and no light changes suddenly. Returns false by default.
    fn may_wait(&self, _site: &Site) -> bool {
        false
    }

    /// Returns whether the cache and its light will be discarded, so that light may have any value from now on. The cache
    /// then returns soon. Returns false by default.
    fn is_discarded(&self) -> bool {
        false
    }

    /// Returns whether [`Illumination::openness`] is certain to have changed little since the previous frame.
    fn is_undisturbed(&self, _site: &Site, _scale: f32) -> bool {
        false
    }
}

/// Maximum number of frames between two updates of a record whose light changes.
pub const MOST_WAITED: usize = 4;

/// Time of the last update of a record's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastUpdate {
    /// The light was updated this number of frames ago at the same position, 1…[`MOST_WAITED`]. Only motion since then can
    /// have changed it.
    FramesAgo(usize),
    /// The light was updated earlier or at another position. Any surface may now occlude a light.
    Earlier,
}
