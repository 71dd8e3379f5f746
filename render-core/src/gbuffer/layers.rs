//! Pixels that show several surfaces one behind the other: through blended surfaces, and through masks from afar.
//!
//! The center of a pixel is one of its layers, so that light is found for one surface a pixel. Which one is the choice of an
//! ordered dither, so that each layer is the center of its share of the pixels around:
//!
//! ```text
//! center(p) = the first k with Σ_{i≤k} wᵢ > τ(p)        wᵢ  share of layer i (`accel/sheets.rs`)
//! τ(x, y) = ((32 x + 43 y) mod 97 + ½) / 97
//! ```
//!
//! 97 is prime: the pixels that a search from coarse to fine takes first, every second or every eighth, have all thresholds too.
//! Bayer's matrix would show them one layer alone. Of such lattices this one is the most even over 2×2 to 4×4 of them.
//!
//! [`Coverage`](super::Coverage) gives each layer its share of each pixel, by the light of the nearest center that shows it.

use super::{CameraRay, GBuffer, PixelSample};
use crate::PosedScene;
use crate::accel::{Accelerator, Hit, RayCone};
use crate::scene::View;
use glam::Vec2;

/// A surface that a ray shows, or the sky, and its share of what the ray shows; the shares of a ray sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layer {
    /// `None` for the sky.
    pub hit: Option<Hit>,
    pub share: f32,
}

/// A pixel whose center shows several surfaces one behind the other.
#[derive(Clone, Debug, PartialEq)]
pub struct LayeredPixel {
    /// Its place in raster order.
    pub(super) index: u32,
    /// Front to back.
    pub(super) layers: Vec<Layer>,
}

impl GBuffer {
    /// The layers of a pixel, by its place in raster order; none of most.
    pub(super) fn layers(&self, pixel: usize) -> &[Layer] {
        let place = self.layered.binary_search_by_key(&pixel, |layered| layered.index as usize);
        place.map_or(&[], |place| &self.layered[place].layers)
    }

    /// Whether the center of a pixel is one of several layers.
    pub(crate) fn is_layered(&self, pixel: usize) -> bool {
        !self.layers(pixel).is_empty()
    }
}

/// A scene as rays from the camera see it.
pub(super) struct Shown<'a> {
    scene: PosedScene<'a>,
    /// The same scene without its sheets, and these alone, if it has any.
    apart: Option<&'a [Accelerator; 2]>,
}

impl<'a> Shown<'a> {
    pub fn new(scene: PosedScene<'a>) -> Self {
        Self { scene, apart: scene.accelerator.without_sheets() }
    }

    /// The solid geometry, which stops camera rays.
    pub fn solid(&self) -> PosedScene<'a> {
        let PosedScene { accelerator, surfaces } = self.scene;
        PosedScene { accelerator: self.apart.map_or(accelerator, |[solid, _]| solid), surfaces }
    }

    /// All that a ray shows whose first solid hit is `hit`, if it passes any sheet; none else. `width` is that of the ray's part
    /// of the picture, in pixels.
    pub fn layers(&self, ray: CameraRay, hit: Option<Hit>, view: &View, width: f32) -> Vec<Layer> {
        let Some([_, sheets]) = self.apart else { return Vec::new() };

        // Sheets up to the surface that is shown, which may lie behind backs of single-sided ones.
        let CameraRay { origin, direction } = ray;
        let (near, far) = view.distances(direction);
        let shown = hit.and_then(|hit| ray.shown_within((near, far), self.solid(), hit, |_| 0.0)).map(|(hit, _)| hit);
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
        if left > 0.0 && !layers.is_empty() {
            layers.push(Layer { hit: shown, share: left });
        }
        layers
    }
}

impl View {
    /// The part of the world that is `width` pixels wide along a unit `direction`.
    fn cone(&self, direction: glam::Vec3A, width: f32) -> RayCone {
        let (near, far) = (self.pixel_width(0.0), self.pixel_width(1.0));
        RayCone { at_origin: near * width, slope: (far - near) * self.depth_per_meter(direction) * width }
    }
}

/// The layer that represents the pixel at (x, y).
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

/// τ, 0…1; samples of a pixel have others.
fn threshold(x: usize, y: usize, offset: Vec2) -> f32 {
    let rank = (LATTICE[0] * x + LATTICE[1] * y) % RANKS;
    ((rank as f32 + 0.5) / RANKS as f32 + offset.x + 0.5).fract()
}

/// Different thresholds.
const RANKS: usize = 97;
/// Ranks from a pixel to the next in its row, and in its column.
const LATTICE: [usize; 2] = [32, 43];

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 97 pixels in a row, or every second, fourth or eighth of them, each has a threshold of its own; any 4×4 are spread over
    /// all.
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

    /// Of 97 pixels, each layer is the center of its share.
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
