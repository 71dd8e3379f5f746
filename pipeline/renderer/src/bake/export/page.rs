//! Image of the atlas: each texel has the color of its surface in a film.
//!
//! ```text
//! L = ρ/π (E_direct + E_indirect) + L_emitted        ρ  reflectance at the texel's point, filtered over the texel
//! code = 255 display(L)                              E  irradiance, bilinear between four baked texels
//! ```
//!
//! A texture cannot contain reflections of coats, which depend on the viewer. Coats are painted matte, with unchanged
//! reflectance: a metal keeps its color, and polish brightens its base color slightly.

use super::fill::{Holed, filled};
use crate::texels::BakedTexels;
use glam::Vec3;
use perceptual::ToneMap;
use pipeline::error::{Context, Result};
use rayon::prelude::*;
use render_core::{FinePoint, FineTexels, Surfaces};
use std::f32::consts::PI;

/// Painter of the image, with the light, the surfaces and the tone curve that determine its colors.
pub(super) struct Painter<'a> {
    pub texels: &'a FineTexels<'a>,
    pub baked: &'a BakedTexels,
    pub surfaces: &'a Surfaces<'a>,
    pub tone_map: ToneMap,
}

impl Painter<'_> {
    /// Returns R′G′B′ and opacity of each texel, in raster order.
    pub fn painted(&self) -> Vec<[u8; 4]> {
        let (width, height) = (self.texels.width() as usize, self.texels.height() as usize);
        let mut picture: Holed = vec![None; width * height];
        // Paint the texels of charts; all other texels are holes, to be filled.
        picture.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.iter_mut().enumerate() {
                *texel = self.texels.point(x as u32, y as u32).map(|point| self.texel(&point));
            }
        });
        filled(picture, width)
    }

    fn texel(&self, point: &FinePoint) -> [u8; 4] {
        // Interpolate the irradiance between the four texels of the atlas.
        let mut irradiance = Vec3::ZERO;
        for (texel, weight) in point.blend.texels.into_iter().zip(point.blend.weights) {
            let [direct, indirect] = [&self.baked.direct, &self.baked.indirect].map(|light| light[texel as usize]);
            irradiance += weight * (Vec3::from(direct) + Vec3::from(indirect));
        }
        let paint = self.surfaces.paint(&point.hit, self.texels.texel_width());
        let radiance = paint.reflectance / PI * irradiance + paint.emission;
        let [r, g, b] = radiance.to_array().map(|light| code(self.tone_map.encode(light)));
        [r, g, b, code(paint.opacity)]
    }
}

/// Quantizes a display value or an opacity, 0…1, to a byte.
fn code(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Encodes an image as PNG, with opacity if `has_alpha`.
pub(in crate::bake) fn png(picture: &[[u8; 4]], width: u32, height: u32, has_alpha: bool) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_color(if has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
    let mut samples = Vec::with_capacity(picture.len() * 4);
    for texel in picture {
        samples.extend(&texel[..if has_alpha { 4 } else { 3 }]);
    }
    let mut writer = encoder.write_header().context("the image of baked light")?;
    writer.write_image_data(&samples).context("the image of baked light")?;
    writer.finish().context("the image of baked light")?;
    Ok(file)
}
