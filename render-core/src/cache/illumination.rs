//! The light at a place on a surface, and the interface to its source.

use crate::scene::{Projected, View};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use ranks::portable;

/// A place on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Site {
    /// On the surface, world space \[m\].
    pub position: Vec3A,
    /// Unit normal to shade with.
    pub normal: Vec3A,
    /// Unit normal of the triangle, on the same side.
    pub geometric_normal: Vec3A,
    /// The instance, if it is one that moves; else [`NOTHING`](crate::NOTHING).
    pub carrier: u32,
    /// How open it is around: from 0 in a crack to 1 ([`Illumination::openness`]). More than 1 on what glows.
    pub openness: f32,
    /// For random numbers: it stays with a record for life.
    pub key: u64,
}

portable!(Site { position, normal, geometric_normal, carrier, openness, key });

impl Site {
    /// Moves along with what it sits on; what cannot be moved, since all is squeezed flat, loses its normal.
    pub(super) fn carried_by(&mut self, carry: &Affine3A) {
        let normals = crate::scene::normal_matrix(carry);
        self.position = carry.transform_point3a(self.position);
        self.normal = (normals * self.normal).normalize_or_zero();
        self.geometric_normal = (normals * self.geometric_normal).normalize_or_zero();
    }

    /// Width of a pixel on the surface \[m\]: that of a square pixel of the same area where it is seen askew.
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
    /// \[W·m⁻²\], linear RGB.
    pub irradiance: Vec3,
    /// Derivative by the normal: a column for each axis.
    pub by_normal: Mat3A,
    /// Derivative by the position \[W·m⁻³\]: a column for each axis.
    pub by_position: Mat3A,
    /// Harmonic mean distance of the surfaces around \[m\]; may be infinite.
    pub harmonic_mean: f32,
    /// Distance to the nearest of them \[m\]; may be infinite.
    pub nearest: f32,
    /// Tolerable error of the irradiance's luminance here \[W·m⁻²\].
    pub tolerance: f32,
}

portable!(LocalIrradiance { irradiance, by_normal, by_position, harmonic_mean, nearest, tolerance });

/// The light of a record, found from nothing.
#[derive(Clone, Debug)]
pub struct Computed<R> {
    /// The light.
    pub light: LocalIrradiance,
    /// Data that relighting needs, at less cost than a new cut.
    pub recipe: R,
}

/// Source of the light at a site; called from many threads at once.
pub trait Illumination: Sync {
    /// Data kept with a record so that it can be lit again for less than a new one.
    type Recipe: Send + Sync;
    /// Memory that a thread reuses from one record to the next.
    type Scratch: Default;

    /// The light at `site`, from nothing.
    fn compute(&self, site: &Site, scratch: &mut Self::Scratch) -> Computed<Self::Recipe>;

    /// The light at a `site` whose light was last known when `known` says; `None` when too much has changed near it, and it
    /// has to be computed.
    fn relight(&self, site: &Site, recipe: &mut Self::Recipe, known: LastUpdate) -> Option<LocalIrradiance>;

    /// A number that is kept with a record of this recipe, and that all ranks know; 0 where nobody asks for one.
    fn note(&self, _recipe: &Self::Recipe) -> u32 {
        0
    }

    /// Mean of d / (d + `scale`) over cosine-distributed directions from `site`, in each of which something is d away:
    /// alike at places that are alike, so with directions that follow from the normal alone. `scale` is in meters.
    fn openness(&self, _site: &Site, _scale: f32) -> f32 {
        1.0
    }

    /// Whether [`Illumination::openness`] is certain to be next to what it was in the frame before.
    fn is_undisturbed(&self, _site: &Site, _scale: f32) -> bool {
        false
    }
}

/// When the light of a record was last up to date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastUpdate {
    /// In the frame before, at the same place: what moved since then is all that has changed.
    LastFrame,
    /// Longer ago, or at another place: anything may stand between it and a light.
    Earlier,
}
