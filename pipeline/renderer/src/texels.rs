//! Light of the surfaces that stand still, as texels of an atlas.

use super::coat_fields::CoatFields;
use glam::Vec3;
use render_core::{Atlas, PixelSurface, Surfaces};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Light of the texels of an atlas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakedTexels {
    /// The texels, and where surfaces have them.
    pub atlas: Atlas,
    /// Irradiance straight from its sources \[W·m⁻²\], linear RGB, a texel each.
    pub direct: Vec<[f32; 3]>,
    /// All other irradiance.
    pub indirect: Vec<[f32; 3]>,
    /// Light that coats reflect, but for its sources; a section of its own in files.
    #[serde(skip)]
    pub coats: Arc<CoatFields>,
}

impl BakedTexels {
    /// Indirect irradiance of the surface that a pixel shows; none where it is not in the atlas, as on what moves.
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

    /// Mean radiance \[W·m⁻²·sr⁻¹\] that the coat which a pixel shows reflects, but for its sources, where a mirror would show the
    /// world in the unit direction `mirrored`; none where it is not baked. Bilinear like irradiance.
    #[must_use]
    pub fn coat_at(&self, pixel: &PixelSurface, surfaces: &Surfaces, mirrored: Vec3) -> Option<Vec3> {
        if self.coats.is_empty() {
            return None;
        }
        let blend = self.atlas.bilinear(surfaces, &pixel.into())?;
        // Texels within something and smoother ones have none: the others stand for them.
        let (mut light, mut weights) = (Vec3::ZERO, 0.0);
        for (texel, weight) in blend.texels.into_iter().zip(blend.weights) {
            if let Some(found) = self.coats.mean_radiance(texel as usize, mirrored) {
                (light, weights) = (light + weight * found, weights + weight);
            }
        }
        (weights > 0.0).then(|| light / weights)
    }
}
