//! Smooth outlines from one shaded sample per pixel: visibility is sampled more densely than light.
//!
//! If an outline crosses a pixel, additional rays find the surfaces in the pixel's area. Each ray uses the light of the
//! nearest surrounding pixel that shows the same surface at its center:
//!
//! ```text
//! L(p) ← Σ_q c_q L(q) / Σ_q c_q      q  pixels around p      c_q  rays of p that show the surface of q
//! ```
//!
//! If a ray passes several layers, each layer contributes in proportion to its fraction of the ray (`layered.rs`).
//!
//! A surface that no center shows, such as a wire thinner than a pixel, borrows the irradiance of a pixel with a
//! similar normal (`borrow.rs`). Callers may also average the regions after tone mapping, with [`Coverage::pixels`].

mod borrow;
mod layered;
mod search;

use super::{GBuffer, PixelSample};
use crate::{PosedScene, Timed};
use glam::Vec3;
use plane::Plane;
use search::{Search, SearchedPixel, Wanted};

pub(super) use borrow::shows;

/// Surfaces in each pixel of a picture, and the fraction of the pixel's area that each surface covers.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Coverage {
    /// Pixels with more than one surface.
    mixed: Vec<Mixed>,
    /// Regions of the mixed pixels, pixel by pixel.
    parts: Vec<SurfaceFragment>,
}

/// Pixel with more than one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Mixed {
    /// Index of the pixel in raster order.
    pixel: u32,
    /// Number of surfaces in the pixel.
    parts: u32,
    /// Whether no outline crosses the pixel: its whole area shows the same layers.
    is_layered: bool,
}

/// Region of a surface in a pixel, and the source of the region's light.
///
/// ```text
/// L = E + t · L(q)      E  emission      t  tint      q  the pixel with the light
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SurfaceFragment {
    /// Fraction of the pixel's area that the region covers. The fractions of a pixel sum to 1.
    pub share: f32,
    /// Whether the light comes from a different surface with a similar normal.
    pub is_borrowed: bool,
    /// Index of the pixel that provides the light, in raster order.
    pixel: u32,
    tint: Vec3,
    emission: Vec3,
}

impl SurfaceFragment {
    /// Returns the radiance of the region \[W·m⁻²·sr⁻¹\]. `light` is the radiance of the pixels' centers.
    #[must_use]
    pub fn radiance(&self, light: &Plane<Vec3>) -> Vec3 {
        self.emission + self.reflected(light)
    }

    /// Returns the radiance of the region for a `light` without emission, such as indirect light.
    #[must_use]
    pub fn reflected(&self, light: &Plane<Vec3>) -> Vec3 {
        self.tint * light.samples()[self.pixel as usize]
    }
}

/// Pixel with more than one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixedPixel<'a> {
    /// Index of the pixel in raster order.
    pub index: usize,
    /// Whether no outline crosses the pixel: its surfaces are layers over its whole area.
    pub is_layered: bool,
    /// Surfaces of the pixel, with the fractions of its area that they cover.
    pub parts: &'a [SurfaceFragment],
}

impl MixedPixel<'_> {
    /// Returns the mean of `light` over the regions, weighted by area.
    #[must_use]
    pub fn mean(&self, light: impl Fn(&SurfaceFragment) -> Vec3) -> Vec3 {
        self.parts.iter().map(|part| part.share * light(part)).sum()
    }
}

impl Coverage {
    /// Finds the coverage of each pixel of `seen`, a picture of `scene`. `light` is the radiance of the pixels'
    /// centers: more rays are traced at outlines with greater contrast.
    ///
    /// # Panics
    /// If the sizes of `light` and the picture differ.
    pub fn of(seen: &GBuffer, scene: PosedScene, light: &Plane<Vec3>) -> Timed<Self> {
        assert_eq!((seen.pixels.width(), seen.pixels.height()), (light.width(), light.height()), "light of each pixel");
        Timed::of(|busy| {
            let search = Search::new(seen, scene, light);
            let mut is_known = vec![false; light.samples().len()];
            let mut coverage = Self::default();
            // Find the pixels that an outline crosses. Other layered pixels need no further rays.
            let mut wanted = search.crossed(busy);
            wanted.iter().for_each(|pixel| is_known[pixel.index as usize] = true);
            for found in search.by_centers(&is_known, PixelSample::WHOLE.offset, busy) {
                coverage.add(&found, true);
                is_known[found.pixel as usize] = true;
            }

            // Follow thin objects from pixel to pixel until they end or a center shows them.
            while !wanted.is_empty() {
                let mut beside: Vec<Wanted> = Vec::new();
                for found in search.trace(&wanted, busy) {
                    coverage.add(&found, false);
                    let unknown = found.beside.into_iter();
                    beside.extend(unknown.filter(|next| !std::mem::replace(&mut is_known[next.index as usize], true)));
                }
                wanted = beside;
            }
            coverage
        })
    }

    /// Finds the fractions of the layers in each pixel with several layers at its center. `seen` contains this `sample`
    /// of each pixel, and `light` is the radiance of the samples. Outlines are ignored.
    ///
    /// # Panics
    /// If the sizes of `light` and the picture differ.
    pub fn of_layers(seen: &GBuffer, scene: PosedScene, light: &Plane<Vec3>, sample: PixelSample) -> Timed<Self> {
        assert_eq!((seen.pixels.width(), seen.pixels.height()), (light.width(), light.height()), "light of each pixel");
        Timed::of(|busy| {
            let mut coverage = Self::default();
            for found in layered::of_layers(seen, scene, light, sample.offset, busy) {
                coverage.add(&found, true);
            }
            coverage
        })
    }

    /// Adds a pixel if it has more than one surface.
    fn add(&mut self, SearchedPixel { pixel, parts, .. }: &SearchedPixel, is_layered: bool) {
        if !parts.is_empty() {
            self.mixed.push(Mixed { pixel: *pixel, parts: parts.len() as u32, is_layered });
            self.parts.extend_from_slice(parts);
        }
    }

    /// Returns whether this coverage is consistent and each of its pixels is inside a picture of `pixels` pixels.
    /// Coverage read from a file may be inconsistent.
    #[must_use]
    pub fn fits(&self, pixels: usize) -> bool {
        let parts: u64 = self.mixed.iter().map(|mixed| u64::from(mixed.parts)).sum();
        parts == self.parts.len() as u64
            && self.mixed.iter().all(|mixed| (mixed.pixel as usize) < pixels)
            && self.parts.iter().all(|part| (part.pixel as usize) < pixels)
    }

    /// Returns the number of pixels with more than one surface.
    #[must_use]
    pub fn mixed_pixels(&self) -> usize {
        self.mixed.len()
    }

    /// Returns the pixels with more than one surface.
    pub fn pixels(&self) -> impl Iterator<Item = MixedPixel<'_>> {
        let mut rest = &self.parts[..];
        self.mixed.iter().map(move |mixed| {
            let (parts, others) = rest.split_at(mixed.parts as usize);
            rest = others;
            MixedPixel { index: mixed.pixel as usize, is_layered: mixed.is_layered, parts }
        })
    }

    /// Blends the light of all surfaces in each pixel. `light` is the radiance of the pixels' centers, including
    /// emission.
    ///
    /// # Panics
    /// If `light` is smaller than the picture of the coverage.
    #[must_use]
    pub fn blend(&self, light: &Plane<Vec3>) -> Plane<Vec3> {
        self.blended(light, |part| part.radiance(light))
    }

    /// Blends light that excludes emission, in the same way as [`Coverage::blend`].
    #[must_use]
    pub fn blend_reflected(&self, light: &Plane<Vec3>) -> Plane<Vec3> {
        self.blended(light, |part| part.reflected(light))
    }

    fn blended(&self, light: &Plane<Vec3>, of: impl Fn(&SurfaceFragment) -> Vec3) -> Plane<Vec3> {
        let mut blended = light.clone();
        for pixel in self.pixels() {
            blended.samples_mut()[pixel.index] = pixel.mean(&of);
        }
        blended
    }
}
