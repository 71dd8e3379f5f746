//! Baked light of static surfaces, in the texels of an atlas.

use super::coat_fields::CoatFields;
use glam::Vec3;
use render_core::{Atlas, PixelSurface, Surfaces};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Baked light of an atlas's texels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakedTexels {
    /// The atlas: texels and their surfaces.
    pub atlas: Atlas,
    /// Direct irradiance of each texel \[W·m⁻²\], linear RGB.
    pub direct: Vec<[f32; 3]>,
    /// Indirect irradiance of each texel \[W·m⁻²\], linear RGB.
    pub indirect: Vec<[f32; 3]>,
    /// Light reflected by coats, except light from direct sources. Files store this light in a separate section.
    #[serde(skip)]
    pub coats: Arc<CoatFields>,
}

impl BakedTexels {
    /// Returns the indirect irradiance of a pixel's surface \[W·m⁻²\]. Returns `None` if the atlas lacks the surface,
    /// for example dynamic geometry.
    ///
    /// ```text
    /// E = Σ w E_texel        w  bilinear weights of the four texels around the point
    /// ```
    #[must_use]
    pub fn indirect_at(&self, pixel: &PixelSurface, surfaces: &Surfaces) -> Option<Vec3> {
        let blend = self.atlas.bilinear(surfaces, &pixel.into())?;
        let mut irradiance = Vec3::ZERO;
        for (texel, weight) in blend.texels.into_iter().zip(blend.weights) {
            irradiance += weight * Vec3::from(self.indirect[texel as usize]);
        }
        Some(irradiance)
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
