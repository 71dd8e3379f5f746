//! Smooth outlines from one shaded sample a pixel: visibility is sampled more densely than light.
//!
//! Where an outline crosses a pixel, more rays find the surfaces that its area shows. Each ray takes its light from the
//! nearest pixel around whose center shows the same surface:
//!
//! ```text
//! L(p) ← Σ_q c_q L(q) / Σ_q c_q      q  pixels around p      c_q  rays of p that see what q shows
//! ```
//!
//! Where a ray shows several layers, one behind the other, each counts with its share of the ray (`layered.rs`).
//!
//! A surface that no center shows, as a wire thinner than a pixel, borrows the irradiance of a pixel that faces the same
//! way (`borrow.rs`). The mean may also be taken of what a display shows of the parts: [`Coverage::pixels`].

mod borrow;
mod layered;
mod search;

use super::{GBuffer, PixelSample};
use crate::{PosedScene, Timed};
use glam::Vec3;
use plane::Plane;
use search::{Search, SearchedPixel, Wanted};

/// The surfaces that each pixel of a picture shows, and the share of its area that each covers.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Coverage {
    /// Pixels that show more than one surface.
    mixed: Vec<Mixed>,
    /// Parts of these, one pixel after the other.
    parts: Vec<SurfacePart>,
}

/// A pixel that shows more than one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Mixed {
    /// Its place in raster order.
    pixel: u32,
    /// How many surfaces it shows.
    parts: u32,
    /// Whether no outline crosses it: all of it shows the same layers.
    is_layered: bool,
}

/// A surface that a pixel shows, and where its light is known.
///
/// ```text
/// L = E + t · L(q)      E  emission      t  tint      q  the pixel that knows the light
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SurfacePart {
    /// Share of the pixel's area; those of a pixel sum to 1.
    pub share: f32,
    /// The pixel that knows the light, in raster order.
    pixel: u32,
    tint: Vec3,
    emission: Vec3,
}

impl SurfacePart {
    /// Radiance of the part; `light` has that of the pixels' centers.
    #[must_use]
    pub fn radiance(&self, light: &Plane<Vec3>) -> Vec3 {
        self.emission + self.reflected(light)
    }

    /// Radiance of the part without emission that no center shows; `light` has none of it, as indirect light.
    #[must_use]
    pub fn reflected(&self, light: &Plane<Vec3>) -> Vec3 {
        self.tint * light.samples()[self.pixel as usize]
    }
}

/// A pixel that shows more than one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixedPixel<'a> {
    /// Its place in raster order.
    pub index: usize,
    /// Whether no outline crosses it: its surfaces are one behind the other all over it.
    pub is_layered: bool,
    /// The surfaces that it shows, and their shares of its area.
    pub parts: &'a [SurfacePart],
}

impl MixedPixel<'_> {
    /// Mean of the parts by the light that each has.
    #[must_use]
    pub fn mean(&self, light: impl Fn(&SurfacePart) -> Vec3) -> Vec3 {
        self.parts.iter().map(|part| part.share * light(part)).sum()
    }
}

impl Coverage {
    /// Finds the coverage of each pixel of `seen`, a picture of `scene`. `light` has the radiance of the pixels' centers:
    /// the more it differs about an outline, the more rays are traced.
    ///
    /// # Panics
    /// If `light` is not of the size of the picture.
    pub fn of(seen: &GBuffer, scene: PosedScene, light: &Plane<Vec3>) -> Timed<Self> {
        assert_eq!((seen.pixels.width(), seen.pixels.height()), (light.width(), light.height()), "light of each pixel");
        Timed::of(|busy| {
            let search = Search::new(seen, scene, light);
            let mut is_known = vec![false; light.samples().len()];
            let mut coverage = Self::default();
            let mut wanted = search.crossed(busy);
            wanted.iter().for_each(|pixel| is_known[pixel.index as usize] = true);
            for found in search.by_centers(&is_known, PixelSample::WHOLE.offset, busy) {
                coverage.add(&found, true);
                is_known[found.pixel as usize] = true;
            }
            // Thin things are followed from pixel to pixel until they end, or centers show them again.
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

    /// Finds the shares of the layers of each pixel whose center shows several, where `seen` is this `sample` of each pixel and
    /// `light` has the radiance that it shows. Outlines stay as they are.
    ///
    /// # Panics
    /// If `light` is not of the size of the picture.
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

    /// Adds a pixel, if it shows more than one surface.
    fn add(&mut self, SearchedPixel { pixel, parts, .. }: &SearchedPixel, is_layered: bool) {
        if !parts.is_empty() {
            self.mixed.push(Mixed { pixel: *pixel, parts: parts.len() as u32, is_layered });
            self.parts.extend_from_slice(parts);
        }
    }

    /// Whether this coverage is consistent, and each of its pixels lies in a picture of `pixels` pixels. Coverage that was read from
    /// a file may fail.
    #[must_use]
    pub fn fits(&self, pixels: usize) -> bool {
        let parts: u64 = self.mixed.iter().map(|mixed| u64::from(mixed.parts)).sum();
        parts == self.parts.len() as u64
            && self.mixed.iter().all(|mixed| (mixed.pixel as usize) < pixels)
            && self.parts.iter().all(|part| (part.pixel as usize) < pixels)
    }

    /// Number of pixels that show more than one surface.
    #[must_use]
    pub fn mixed_pixels(&self) -> usize {
        self.mixed.len()
    }

    /// The pixels that show more than one surface.
    pub fn pixels(&self) -> impl Iterator<Item = MixedPixel<'_>> {
        let mut rest = &self.parts[..];
        self.mixed.iter().map(move |mixed| {
            let (parts, others) = rest.split_at(mixed.parts as usize);
            rest = others;
            MixedPixel { index: mixed.pixel as usize, is_layered: mixed.is_layered, parts }
        })
    }

    /// Blends the light of all surfaces that a pixel's area shows; `light` has that of the pixels' centers, with what they
    /// emit.
    ///
    /// # Panics
    /// If `light` is smaller than the picture that the coverage was found for.
    #[must_use]
    pub fn blend(&self, light: &Plane<Vec3>) -> Plane<Vec3> {
        self.blended(light, |part| part.radiance(light))
    }

    /// As [`Coverage::blend`], for light that holds nothing of what surfaces emit.
    #[must_use]
    pub fn blend_reflected(&self, light: &Plane<Vec3>) -> Plane<Vec3> {
        self.blended(light, |part| part.reflected(light))
    }

    fn blended(&self, light: &Plane<Vec3>, of: impl Fn(&SurfacePart) -> Vec3) -> Plane<Vec3> {
        let mut blended = light.clone();
        for pixel in self.pixels() {
            blended.samples_mut()[pixel.index] = pixel.mean(&of);
        }
        blended
    }
}
