//! Pixels that show several surfaces one behind the other: through blended surfaces, and through masks from afar.
//!
//! The center of a pixel is one of its layers, so that light is found for one surface a pixel. Which one is the choice of an
//! ordered dither, so that each layer is the center of its share of the pixels around:
//!
//! ```text
//! center(p) = the first k with Σ_{i≤k} wᵢ > τ(p)        wᵢ  share of layer i (`accel/sheets.rs`)      τ  Bayer's 8×8 matrix
//! ```
//!
//! [`Coverage`](super::Coverage) gives each layer its share of each pixel, by the light of the nearest center that shows it.

use super::{CameraRay, PixelSample};
use crate::PosedScene;
use crate::accel::{Accelerator, Cone, Hit};
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

/// A scene as rays from the camera see it.
pub(super) struct Shown<'a> {
    scene: PosedScene<'a>,
    /// The same scene without its sheets, if it has any.
    solid: Option<Accelerator>,
}

impl<'a> Shown<'a> {
    pub fn new(scene: PosedScene<'a>) -> Self {
        Self { scene, solid: scene.accelerator.without_sheets() }
    }

    /// What stops rays from the camera.
    pub fn solid(&self) -> PosedScene<'_> {
        let PosedScene { accelerator, surfaces } = self.scene;
        PosedScene { accelerator: self.solid.as_ref().unwrap_or(accelerator), surfaces }
    }

    /// All that a ray shows whose first solid hit is `hit`, if it passes any sheet; none else. `width` is that of the ray's part
    /// of the picture, in pixels.
    pub fn layers(&self, ray: CameraRay, hit: Option<Hit>, view: &View, width: f32) -> Vec<Layer> {
        if self.solid.is_none() {
            return Vec::new();
        }

        // Sheets up to the surface that is shown, which may lie behind backs of single-sided ones.
        let CameraRay { origin, direction } = ray;
        let (near, far) = view.distances(direction);
        let shown = hit.and_then(|hit| ray.shown_within((near, far), self.solid(), hit, |_| 0.0)).map(|(hit, _)| hit);
        let distance = shown.map_or(far, |hit| hit.distance);
        let cone = view.cone(direction, width);
        let mut layers = Vec::new();
        let mut left = 1.0;
        for sheet in self.scene.accelerator.layers(origin, direction, distance, cone) {
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
    fn cone(&self, direction: glam::Vec3A, width: f32) -> Cone {
        let (near, far) = (self.pixel_width(0.0), self.pixel_width(1.0));
        Cone { at_origin: near * width, slope: (far - near) * self.depth_per_meter(direction) * width }
    }
}

/// Of the layers of a pixel at (x, y), the one that its center shows.
pub(super) fn center(layers: &[Layer], (x, y): (usize, usize), sample: PixelSample) -> Option<Hit> {
    let threshold = threshold((x, y), sample.offset);
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

/// τ, 0…1: every 8×8 pixels have 64 different ones, far apart where pixels are near; samples of a pixel have others.
fn threshold((x, y): (usize, usize), offset: Vec2) -> f32 {
    let (mut rank, crossed) = (0, x ^ y);
    for bit in 0..3 {
        rank = rank << 2 | (crossed >> bit & 1) << 1 | (y >> bit & 1);
    }
    ((rank as f32 + 0.5) / 64.0 + offset.x + 0.5).fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each of the 64 thresholds stands once in 8×8 pixels, and each quarter of them once in every 2×2.
    #[test]
    fn thresholds_are_even() {
        let of = |x, y| threshold((x, y), PixelSample::WHOLE.offset);
        let mut all: Vec<f32> = (0..64).map(|i| of(i % 8 + 3, i / 8 + 5)).collect();
        all.sort_by(f32::total_cmp);
        for (rank, threshold) in all.into_iter().enumerate() {
            assert!((threshold - (rank as f32 + 0.5) / 64.0).abs() < 1e-5, "{threshold} at rank {rank}");
        }
        for (x, y) in [(0, 0), (3, 4), (6, 1), (7, 7)] {
            let mut quarters = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(u, v)| (of(x + u, y + v) * 4.0) as usize);
            quarters.sort_unstable();
            assert_eq!(quarters, [0, 1, 2, 3], "at {x} {y}");
        }
    }

    /// Of 64 pixels, each layer is the center of its share.
    #[test]
    fn layers_are_centers_of_their_shares() {
        let hit = |instance| Some(Hit { distance: 1.0, instance, triangle: 0, u: 0.0, v: 0.0 });
        let layers = [(hit(0), 0.25), (hit(1), 0.125), (None, 0.625)].map(|(hit, share)| Layer { hit, share });
        let mut counts = [0; 3];
        for i in 0..64 {
            let shown = center(&layers, (i % 8, i / 8), PixelSample::WHOLE);
            counts[shown.map_or(2, |hit| hit.instance as usize)] += 1;
        }
        assert_eq!(counts, [16, 8, 40]);
    }
}
