//! Pixels with several layers: surfaces seen through blended surfaces and through distant masks.
//!
//! Light is computed for one surface per pixel, so the center of a pixel shows one of its layers. An ordered dither
//! selects this layer. Among neighboring pixels, each layer is selected in proportion to its weight:
//!
//! ```text
//! center(p) = the first k with Σ_{i≤k} wᵢ > τ(p)        wᵢ  weight of layer i (`accel/sheets.rs`)
//! τ(x, y) = ((32 x + 43 y) mod 97 + ½) / 97
//! ```
//!
//! 97 is prime, so the pixels that a coarse-to-fine search visits first (every second or every eighth pixel) also have
//! all thresholds. With Bayer's matrix, these pixels would show only one layer. Among such lattices, this one is the
//! most even over 2×2 to 4×4 pixels.
//!
//! [`Coverage`](super::Coverage) assigns each layer its fraction of each pixel, with the light of the nearest center
//! that shows the layer.

use super::{CameraRay, GBuffer, PixelSample};
use crate::PosedScene;
use crate::accel::{Accelerator, Hit, RayCone};
use crate::ranks::portable;
use crate::scene::View;
use glam::Vec2;

/// Surface that a ray shows, or the sky, with its fraction of the ray. The fractions of a ray sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layer {
    /// Hit of the ray; `None` for the sky.
    pub hit: Option<Hit>,
    pub share: f32,
}

portable!(Layer { hit, share });
portable!(LayeredPixel { index, layers });

/// Pixel with several layers at its center.
#[derive(Clone, Debug, PartialEq)]
pub struct LayeredPixel {
    /// Index of the pixel in raster order.
    pub(super) index: u32,
    /// Layers of the pixel from front to back.
    pub(super) layers: Vec<Layer>,
}

impl GBuffer {
    /// Returns the layers of a pixel, given the pixel's index in raster order. The list is empty for most pixels.
    pub(super) fn layers(&self, pixel: usize) -> &[Layer] {
        let place = self.layered.binary_search_by_key(&pixel, |layered| layered.index as usize);
        place.map_or(&[], |place| &self.layered[place].layers)
    }

    /// Returns whether a pixel has several layers at its center.
    pub fn is_layered(&self, pixel: usize) -> bool {
        !self.layers(pixel).is_empty()
    }
}

/// Scene as camera rays see it.
pub(super) struct Shown<'a> {
    scene: PosedScene<'a>,
    /// Accelerators of the scene without its sheets, and of the sheets alone; `None` if the scene has no sheets.
    apart: Option<&'a [Accelerator; 2]>,
    has_panes: bool,
}

impl<'a> Shown<'a> {
    pub fn new(scene: PosedScene<'a>) -> Self {
        Self { scene, apart: scene.accelerator.without_sheets(), has_panes: scene.surfaces.has_clear_walls() }
    }

    /// Returns whether some surfaces may be clear panes.
    pub fn has_panes(&self) -> bool {
        self.has_panes
    }

    /// Returns the opaque geometry, at which camera rays end.
    pub fn solid(&self) -> PosedScene<'a> {
        let PosedScene { accelerator, surfaces } = self.scene;
        PosedScene { accelerator: self.apart.map_or(accelerator, |[solid, _]| solid), surfaces }
    }

    /// Returns all layers of a ray with the first solid `hit` if the ray passes any sheet, otherwise an empty list.
    /// `width` is the width of the ray's region in the picture \[pixels\].
    pub fn layers(&self, ray: CameraRay, hit: Option<Hit>, view: &View, width: f32) -> Vec<Layer> {
        let Some([_, sheets]) = self.apart else { return Vec::new() };

        // Collect sheets up to the visible surface, which may be behind the backs of single-sided surfaces.
        let CameraRay { origin, direction } = ray;
        let (near, far) = view.distances(direction);
        let shown = hit.and_then(|hit| ray.shown_within((near, far), self.solid(), hit, |_| 0.0)).map(|(hit, _)| hit);

        // The share of a sheet is its opacity times the transmittance of all sheets in front of it.
        let distance = shown.map_or(far, |hit| hit.distance);
        let cone = view.cone(direction, width);
        let mut layers = Vec::new();
        let mut left = 1.0;
        for sheet in sheets.layers(origin, direction, distance, cone) {
            if sheet.hit.distance >= near && left > 0.0 {
                layers.push(Layer { hit: Some(sheet.hit), share: left * sheet.opacity });
                left *= 1.0 - sheet.opacity;
            }
        }

        // The solid surface or the sky receives the rest.
        if left > 0.0 && !layers.is_empty() {
            layers.push(Layer { hit: shown, share: left });
        }
        layers
    }
}

impl View {
    /// Returns the cone along a unit `direction` that is `width` pixels wide.
    fn cone(&self, direction: glam::Vec3A, width: f32) -> RayCone {
        // The width of a pixel is linear in depth, with slope 0 in an orthographic view.
        let (near, far) = (self.pixel_width(0.0), self.pixel_width(1.0));
        RayCone { at_origin: near * width, slope: (far - near) * self.depth_per_meter(direction) * width }
    }
}

/// Returns the hit of the layer that represents the pixel at (x, y).
pub(super) fn center(layers: &[Layer], x: usize, y: usize, sample: PixelSample) -> Option<Hit> {
    let threshold = threshold(x, y, sample.offset);
    let mut sum = 0.0;
    for layer in layers {
        sum += layer.share;
        if sum > threshold {
            return layer.hit;
        }
    }
    // Rounding may leave the sum below 1.
    layers.last().and_then(|layer| layer.hit)
}

/// Returns the threshold τ, 0…1, shifted for each sample of a pixel.
fn threshold(x: usize, y: usize, offset: Vec2) -> f32 {
    let rank = (LATTICE[0] * x + LATTICE[1] * y) % RANKS;
    ((rank as f32 + 0.5) / RANKS as f32 + offset.x + 0.5).fract()
}

/// Number of different thresholds.
const RANKS: usize = 97;
/// Rank difference to the next pixel in the row, and to the next pixel in the column.
const LATTICE: [usize; 2] = [32, 43];

#[cfg(test)]
mod tests {
    use super::*;

    /// In a row, 97 pixels have 97 different thresholds, also if only every second, fourth or eighth pixel is used. The
    /// thresholds of any 4×4 pixels are spread evenly.
    #[test]
    fn thresholds_are_even() {
        let of = |x, y| threshold(x, y, PixelSample::WHOLE.offset);
        for stride in [1, 2, 4, 8] {
            let mut row: Vec<f32> = (0..RANKS).map(|i| of(3 + i * stride, 5)).collect();
            row.sort_by(f32::total_cmp);
            for (rank, threshold) in row.into_iter().enumerate() {
                assert!((threshold - (rank as f32 + 0.5) / RANKS as f32).abs() < 1e-5, "{threshold} at rank {rank}");
            }
            for (x, y) in [(0, 0), (13, 4), (56, 91)] {
                let mut square: Vec<f32> = (0..16).map(|i| of(x + i % 4 * stride, y + i / 4 * stride)).collect();
                square.sort_by(f32::total_cmp);
                let widest = square.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
                assert!(widest < 0.16, "{widest} of all thresholds between two, every {stride} pixels");
            }
        }
    }

    /// Over 97 pixels, each layer is at the center in proportion to its weight.
    #[test]
    fn layers_are_centers_of_their_shares() {
        let hit = |instance| Some(Hit { distance: 1.0, instance, triangle: 0, u: 0.0, v: 0.0 });
        let layers = [(hit(0), 0.25), (hit(1), 0.125), (None, 0.625)].map(|(hit, share)| Layer { hit, share });
        let mut counts = [0; 3];
        for x in 0..RANKS {
            let shown = center(&layers, x, 7, PixelSample::WHOLE);
            counts[shown.map_or(2, |hit| hit.instance as usize)] += 1;
        }
        assert_eq!(counts, [24, 12, 61]);
    }
}
