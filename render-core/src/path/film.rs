//! Accumulation of samples to a picture, with an estimate of the variance.

use super::PathTracer;
use super::vertex::Points;
use crate::sampling::hash;
use crate::scene::View;
use glam::{DVec3, Vec2};
use plane::Plane;
use rayon::prelude::*;

/// Starting points of paths in a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelSampling {
    /// Random points of the pixel's area, with unfiltered textures. The picture converges to the mean radiance of each
    /// pixel's area.
    Area,
    /// Center of the pixel, with textures filtered to the pixel's width, as in a renderer with one ray per pixel.
    Center,
}

/// Settings of the path tracer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathOptions {
    /// Number of paths per pixel, at least 1.
    pub samples: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Maximum number of reflections of a path: 0 shows emission only, 1 adds direct light. `None` sets no limit.
    pub max_bounces: Option<u32>,
    /// Starting points of paths in a pixel.
    pub pixel: PixelSampling,
}

impl Default for PathOptions {
    /// Returns options for 64 paths per pixel over the pixel's whole area, without a limit of reflections.
    fn default() -> Self {
        Self { samples: 64, seed: 1, max_bounces: None, pixel: PixelSampling::Area }
    }
}

/// Noisy picture and its variance.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PathEstimate {
    /// Mean radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub mean: Plane<[f32; 3]>,
    /// Estimated variance of each mean, per channel, or 0 for a single path. Pixels are independent.
    pub variance_of_mean: Plane<[f32; 3]>,
}

/// Number of groups into which a pixel's samples are divided. Samples within a group are stratified, so their spread
/// does not measure the variance. Groups are independent, so the spread of their means does.
const GROUPS: u32 = 16;
/// Side of the tiles that threads process \[pixels\].
const TILE: usize = 16;

impl PathTracer<'_> {
    /// Renders all pixels of `view`. The result is independent of the number of threads.
    ///
    /// `progress` is called from any thread with the number of finished tiles and the total number of tiles.
    pub fn render(&self, view: &View, options: &PathOptions, progress: impl Fn(usize, usize) + Sync) -> PathEstimate {
        let (width, height) = (view.size().x as usize, view.size().y as usize);
        // Divide the picture into tiles, which threads render in any order.
        let columns = width.div_ceil(TILE);
        let count = columns * height.div_ceil(TILE);
        let done = std::sync::atomic::AtomicUsize::new(0);
        let area = |tile: usize| {
            let (left, top) = (tile % columns * TILE, tile / columns * TILE);
            (top..height.min(top + TILE)).flat_map(move |y| (left..width.min(left + TILE)).map(move |x| (x, y)))
        };
        let tiles: Vec<Vec<[DVec3; 2]>> = (0..count)
            .into_par_iter()
            .map(|tile| {
                let corner = |x, y| Vec2::new(x as f32, y as f32);
                let pixels = area(tile).map(|(x, y)| self.pixel(view, corner(x, y), y * width + x, options)).collect();
                progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, count);
                pixels
            })
            .collect();

        // Copy the pixels of each tile into the picture.
        let black = || Plane::filled(width, height, [0.0f32; 3]);
        let mut estimate = PathEstimate { mean: black(), variance_of_mean: black() };
        for (tile, pixels) in tiles.iter().enumerate() {
            for ((x, y), [mean, variance]) in area(tile).zip(pixels) {
                estimate.mean.set(x, y, mean.as_vec3().to_array());
                estimate.variance_of_mean.set(x, y, variance.as_vec3().to_array());
            }
        }
        estimate
    }

    /// Returns the mean, and the variance of the mean, for the pixel with the upper left `corner`. Each `index` uses
    /// different paths.
    ///
    /// ```text
    /// Var ≈ Σ n_k (m_k − m)² / ((K − 1) n)        for K independent groups of n_k samples with means m_k, n samples in total
    /// ```
    fn pixel(&self, view: &View, corner: Vec2, index: usize, options: &PathOptions) -> [DVec3; 2] {
        // Divide the samples into groups. Group sizes differ by at most one.
        let samples = options.samples.max(1);
        let groups = GROUPS.min(samples);
        let sharp = options.pixel == PixelSampling::Area;
        let group = |k: u32| {
            let first = |k: u32| (u64::from(samples) * u64::from(k) / u64::from(groups)) as u32;
            let size = first(k + 1) - first(k);
            let key = hash(options.seed, index as u64, u64::from(k));
            let mut sum = DVec3::ZERO;
            for i in 0..size {
                // The first pair of numbers is the position in the pixel. Center sampling ignores it.
                let mut points = Points { key, index: i, dimension: 0 };
                let place = points.next();
                let place = corner + if sharp { place } else { Vec2::splat(0.5) };
                sum += self.sample(view, place, options, &mut points).as_dvec3();
            }
            (f64::from(size), sum)
        };

        // Compute the mean of all samples, and the weighted spread of the groups around it.
        let sums: Vec<(f64, DVec3)> = (0..groups).map(group).collect();
        let n = f64::from(samples);
        let mean = sums.iter().map(|(_, sum)| *sum).sum::<DVec3>() / n;
        let spread: DVec3 = sums
            .iter()
            .map(|(size, sum)| {
                let off = *sum / *size - mean;
                off * off * *size
            })
            .sum();
        let variance = if groups > 1 { spread / (f64::from(groups - 1) * n) } else { DVec3::ZERO };
        [mean, variance]
    }
}
