//! Baked light of static surfaces, in the texels of an atlas.

use super::coat_fields::CoatFields;
use super::normal_texels::NormalTexels;
use glam::{Vec3, Vec3A};
use render_core::{Atlas, PixelSurface, Surfaces};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Minimum weight of the reliable texels around a point that samples them.
const LEAST_RELIABLE: f32 = 0.5;

/// Minimum cosine between the normals of a pixel and of a texel that it samples: 26°.
const LEAST_COSINE: f32 = 0.9;

/// Baked light of an atlas's texels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakedTexels {
    /// The atlas: texels and their surfaces.
    pub atlas: Arc<Atlas>,
    /// Direct irradiance of each texel \[W·m⁻²\], linear RGB.
    pub direct: Vec<[f32; 3]>,
    /// Indirect irradiance of each texel \[W·m⁻²\], linear RGB.
    pub indirect: Vec<[f32; 3]>,
    /// Whether each texel is outside of geometry and narrow enough for the distance of its surroundings.
    pub is_reliable: Vec<bool>,
    /// Shading normal of each texel's point, times 127; zero without a point.
    pub facing: Vec<[i8; 3]>,
    /// Indirect light of normal-mapped surfaces, by normal. Files store this light in a separate section.
    #[serde(skip)]
    pub normals: Arc<NormalTexels>,
    /// Light reflected by coats, except light from direct sources. Files store this light in a separate section.
    #[serde(skip)]
    pub coats: Arc<CoatFields>,
    /// Light of coats at a later time. Files store this light with that time.
    #[serde(skip)]
    pub later_coats: Option<LaterCoats>,
}

/// Light of coats at a later time.
#[derive(Clone, Debug, PartialEq)]
pub struct LaterCoats {
    /// The light.
    pub coats: Arc<CoatFields>,
    /// Weight in the mean of both times, 0…1.
    pub weight: f32,
}

impl BakedTexels {
    /// Returns the indirect irradiance of a pixel's surface \[W·m⁻²\]. Returns `None` if the atlas lacks the surface, for
    /// example dynamic geometry, or if most of the texels around the pixel are not reliable or face elsewhere.
    ///
    /// ```text
    /// E = Σ w E_texel / Σ w        w  bilinear weights of the reliable texels around the point
    /// ```
    #[must_use]
    pub fn indirect_at(&self, pixel: &PixelSurface, surfaces: &Surfaces) -> Option<Vec3> {
        let blend = self.atlas.bilinear(surfaces, &pixel.into())?;
        let normal = pixel.shading_normal.into();
        let (mut irradiance, mut weights) = (Vec3::ZERO, 0.0);
        for (texel, weight) in blend.texels.into_iter().zip(blend.weights) {
            let by_normal = self.normals.irradiance(texel, normal);
            if self.is_reliable[texel as usize] && (by_normal.is_some() || self.faces(texel, normal)) {
                irradiance += weight * by_normal.unwrap_or_else(|| self.indirect[texel as usize].into());
                weights += weight;
            }
        }
        (weights >= LEAST_RELIABLE).then(|| irradiance / weights)
    }

    /// Returns the mean of this light and the light of the same texels at a `later` time, which has the `weight`.
    pub(crate) fn mixed(&self, later: &Self, weight: f32) -> Self {
        let mix = |own: &[[f32; 3]], later: &[[f32; 3]]| {
            let pairs = own.iter().zip(later);
            pairs.map(|(&own, &later)| Vec3::from(own).lerp(later.into(), weight).to_array()).collect()
        };
        let both_reliable = self.is_reliable.iter().zip(&later.is_reliable).map(|(own, later)| *own && *later);
        Self {
            atlas: self.atlas.clone(),
            direct: mix(&self.direct, &later.direct),
            indirect: mix(&self.indirect, &later.indirect),
            is_reliable: both_reliable.collect(),
            facing: self.facing.clone(),
            normals: Arc::new(self.normals.mixed(&later.normals, weight)),
            coats: self.coats.clone(),
            later_coats: Some(LaterCoats { coats: later.coats.clone(), weight }),
        }
    }

    /// Returns whether a texel has about the given unit normal. A wide texel may cover several sides of a small object.
    fn faces(&self, texel: u32, normal: Vec3A) -> bool {
        let facing = Vec3A::from_array(self.facing[texel as usize].map(f32::from));
        facing.dot(normal) >= LEAST_COSINE * facing.length()
    }

    /// Returns the mean radiance \[W·m⁻²·sr⁻¹\] that a pixel's coat reflects, without direct sources. The unit vector
    /// `mirrored` is the mirror direction. Returns `None` if the coat is not baked. Interpolation between texels is
    /// bilinear.
    #[must_use]
    pub fn coat_at(&self, pixel: &PixelSurface, surfaces: &Surfaces, mirrored: Vec3) -> Option<Vec3> {
        if self.coats.is_empty() {
            return None;
        }
        let blend = self.atlas.bilinear(surfaces, &pixel.into())?;
        // Interpolate the texels with baked coats: texels inside geometry and smoother texels have none.
        let (mut light, mut weights) = (Vec3::ZERO, 0.0);
        for (texel, weight) in blend.texels.into_iter().zip(blend.weights) {
            if let Some(found) = self.coat_of(texel as usize, mirrored) {
                (light, weights) = (light + weight * found, weights + weight);
            }
        }
        (weights > 0.0).then(|| light / weights)
    }

    /// Returns the mean radiance that a texel's coat reflects in the direction `mirrored` \[W·m⁻²·sr⁻¹\].
    fn coat_of(&self, texel: usize, mirrored: Vec3) -> Option<Vec3> {
        let own = self.coats.mean_radiance(texel, mirrored)?;
        let Some(LaterCoats { coats, weight }) = &self.later_coats else { return Some(own) };
        Some(coats.mean_radiance(texel, mirrored).map_or(own, |later| own.lerp(later, *weight)))
    }
}
