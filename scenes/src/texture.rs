//! Procedural textures: linear reflectances as input, JPEG bytes as output.

use glam::Vec3;
use image::codecs::jpeg::JpegEncoder;

/// A square texture of linear Rec. 709 reflectances, or of relative radiances for emissive panes.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Width and height \[pixels\].
    pub size: usize,
    /// Pixels in raster order, from the top row.
    pub pixels: Vec<Vec3>,
}

impl Texture {
    /// Builds a square texture. `f(u, v)` returns the value at a point of the unit square, with v downwards. Each pixel
    /// is the mean of four samples.
    pub fn new(size: usize, f: impl Fn(f32, f32) -> Vec3) -> Self {
        let mut pixels = Vec::with_capacity(size * size);
        for y in 0..size {
            for x in 0..size {
                let mut sum = Vec3::ZERO;
                for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
                    sum += f((x as f32 + dx) / size as f32, (y as f32 + dy) / size as f32);
                }
                pixels.push(sum * 0.25);
            }
        }
        Self { size, pixels }
    }

    /// Mean of all pixels.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        // Use a sum in double precision, because a sum of a million terms loses digits in single precision.
        let mut sum = glam::DVec3::ZERO;
        for p in &self.pixels {
            sum += p.as_dvec3();
        }
        (sum / self.pixels.len() as f64).as_vec3()
    }

    /// Scales the texture to the given mean reflectance.
    #[must_use]
    pub fn with_mean(mut self, mean: Vec3) -> Self {
        let scale = mean / self.mean();
        for p in &mut self.pixels {
            *p *= scale;
        }
        self
    }

    /// Encodes the texture as a JPEG in sRGB.
    ///
    /// # Panics
    /// If the texture has no pixels, or more than 65 535 per side.
    #[must_use]
    pub fn jpeg(&self, quality: u8) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels.len() * 3);
        for p in &self.pixels {
            bytes.extend(p.to_array().map(|x| (srgb(x.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8));
        }
        let mut out = Vec::new();
        JpegEncoder::new_with_quality(&mut out, quality)
            .encode(&bytes, self.size as u32, self.size as u32, image::ExtendedColorType::Rgb8)
            .expect("a picture of matching size in memory");
        out
    }
}

/// Returns the sRGB value of a linear value, both 0..1.
#[must_use]
pub fn srgb(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Returns a linear color from its sRGB code values.
#[must_use]
pub fn from_srgb(r: u8, g: u8, b: u8) -> Vec3 {
    Vec3::new(r as f32, g as f32, b as f32).map(|c| {
        let c = c / 255.0;
        if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
}
