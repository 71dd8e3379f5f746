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
    pub atlas: Atlas,
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
            if let Some(found) = self.coats.mean_radiance(texel as usize, mirrored) {
                (light, weights) = (light + weight * found, weights + weight);
            }
        }
        (weights > 0.0).then(|| light / weights)
    }
}
