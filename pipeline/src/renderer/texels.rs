//! Light of the surfaces that stand still, as texels of an atlas.

use glam::Vec3;
use render_core::{Atlas, PixelSurface, Surfaces};
use serde::{Deserialize, Serialize};

/// Irradiance of the texels of an atlas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakedTexels {
    /// The texels, and where surfaces have them.
    pub atlas: Atlas,
    /// Irradiance straight from its sources \[W·m⁻²\], linear RGB, a texel each.
    pub direct: Vec<[f32; 3]>,
    /// All other irradiance.
    pub indirect: Vec<[f32; 3]>,
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
}
