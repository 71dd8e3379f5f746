//! Smooth outlines from one shaded sample a pixel: visibility is sampled more densely than light.
//!
//! Where an outline crosses a pixel, a few more rays find the surfaces that its area shows. Each ray takes its light from the
//! nearest pixel around whose center shows the same surface:
//!
//! ```text
//! L(p) ← Σ_q c_q L(q) / Σ_q c_q      q  the 3×3 pixels around p      c_q  rays of p that see what q shows
//! ```
//!
//! Rays that see what no center around shows, as on wires thinner than a pixel, count for nothing.

use super::{CameraRay, EMPTY, GBuffer, NOTHING, PixelSurface, first_hits, is_same_surface};
use crate::accel::{Hit, PACKET};
use crate::{MACROBLOCK, PosedScene, Timed, sample_offsets};
use glam::{Vec2, Vec3A};
use plane::Plane;
use rayon::prelude::*;
use std::ops::{Add, Mul};

/// Rays through a pixel that an outline crosses. Their share of the area is off by a sixteenth in the mean.
const RAYS: usize = 8;
/// Pixels whose rays are traced together.
const TOGETHER: usize = PACKET / RAYS;
/// The pixels around one, with itself.
const AROUND: usize = 9;

/// The surfaces that each pixel of a picture shows, and the share of its area that each covers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Pixels that show more than one, in raster order of macroblock rows.
    mixed: Vec<Mixed>,
}

/// A pixel that an outline crosses.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mixed {
    /// Its place in raster order.
    pixel: u32,
    /// Rays that show the surface of each of the 3×3 pixels around it, in raster order.
    rays: [u8; AROUND],
}

impl Coverage {
    /// Finds the coverage of each pixel of `seen`, a picture of `scene`.
    pub fn of(seen: &GBuffer, scene: PosedScene) -> Timed<Self> {
        let rows = seen.pixels.height().div_ceil(MACROBLOCK);
        Timed::of(|busy| {
            let strips: Vec<Vec<Mixed>> = (0..rows)
                .into_par_iter()
                .map(|row| busy.measure(|| seen.mixed_pixels(scene, row * MACROBLOCK)))
                .collect();
            Self { mixed: strips.concat() }
        })
    }

    /// Number of pixels that show more than one surface.
    #[must_use]
    pub fn mixed_pixels(&self) -> usize {
        self.mixed.len()
    }

    /// Blends the light of all surfaces that a pixel's area shows; `light` has that of the pixels' centers.
    ///
    /// # Panics
    /// If `light` is smaller than the picture that the coverage was found for.
    pub fn blend<T>(&self, light: &Plane<T>) -> Timed<Plane<T>>
    where
        T: Copy + Add<Output = T> + Mul<f32, Output = T>,
    {
        let blend = || {
            let mut blended = light.clone();
            let (width, height) = (light.width(), light.height());
            for Mixed { pixel, rays } in &self.mixed {
                let (x, y) = (*pixel as usize % width, *pixel as usize / width);
                let whole = rays.iter().map(|&count| f32::from(count)).sum::<f32>();
                let parts = around(x, y, (width, height)).zip(rays).filter(|(_, count)| **count > 0);
                let parts =
                    parts.filter_map(|(q, &count)| q.map(|(u, v)| light.get(u, v) * (f32::from(count) / whole)));
                if let Some(sum) = parts.reduce(|a, b| a + b) {
                    blended.set(x, y, sum);
                }
            }
            blended
        };
        Timed::of(|busy| busy.measure(blend))
    }
}

/// The 3×3 pixels around one in raster order; none where the picture ends.
fn around(x: usize, y: usize, (width, height): (usize, usize)) -> impl Iterator<Item = Option<(usize, usize)>> {
    (0..AROUND).map(move |k| {
        let (u, v) = ((x + k % 3).checked_sub(1)?, (y + k / 3).checked_sub(1)?);
        (u < width && v < height).then_some((u, v))
    })
}

impl GBuffer {
    /// Pixels of one row of macroblocks that show more than one surface; `top` is the row's first line.
    fn mixed_pixels(&self, scene: PosedScene, top: usize) -> Vec<Mixed> {
        let size = (self.pixels.width(), self.pixels.height());
        let rows = top..size.1.min(top + MACROBLOCK);
        let pixels: Vec<(usize, usize)> = rows
            .flat_map(|y| (0..size.0).map(move |x| (x, y)))
            .filter(|&(x, y)| {
                let center = self.pixels.get(x, y);
                around(x, y, size).flatten().any(|(u, v)| !shows(&self.pixels.get(u, v), &center))
            })
            .collect();
        let offsets = sample_offsets(RAYS);
        let mut mixed = Vec::new();
        for pixels in pixels.chunks(TOGETHER) {
            let places = pixels
                .iter()
                .flat_map(|&(x, y)| offsets.iter().map(move |offset| Vec2::new(x as f32, y as f32) + *offset));
            let seen: Vec<PixelSurface> = self.see_at(scene, places);
            for (&(x, y), seen) in pixels.iter().zip(seen.chunks_exact(RAYS)) {
                let mut rays = [0; AROUND];
                seen.iter().filter_map(|surface| self.nearest_alike((x, y), surface)).for_each(|k| rays[k] += 1);
                // A pixel of its own surface alone stays as it is.
                if rays.iter().enumerate().any(|(k, &count)| k != AROUND / 2 && count > 0) {
                    mixed.push(Mixed { pixel: (y * size.0 + x) as u32, rays });
                }
            }
        }
        mixed
    }

    /// Surfaces that rays through `places` of the picture show, at most [`PACKET`] of them: which, where, and whether they glow,
    /// all that outlines need.
    fn see_at(&self, scene: PosedScene, places: impl Iterator<Item = Vec2>) -> Vec<PixelSurface> {
        let rays: Vec<CameraRay> = places.map(|place| CameraRay::through(place, &self.view)).collect();
        let hits = first_hits(scene, &rays);
        let outlined = |(ray, hit): (&CameraRay, Option<Hit>)| {
            let shown = hit.and_then(|hit| ray.shown(scene, hit, |_| 0.0));
            shown.map_or(EMPTY, |(hit, point)| PixelSurface {
                position: point.position.into(),
                geometric_normal: point.geometric_normal.into(),
                emission: point.emission().into(),
                instance: hit.instance,
                triangle: hit.triangle,
                ..EMPTY
            })
        };
        rays.iter().zip(hits).map(outlined).collect()
    }

    /// Index of the pixel, of the 3×3 around (x, y), that shows the surface `seen` by a ray, nearest to the ray's hit.
    fn nearest_alike(&self, (x, y): (usize, usize), seen: &PixelSurface) -> Option<usize> {
        let pixels = around(x, y, (self.pixels.width(), self.pixels.height())).enumerate();
        let alike = pixels.filter_map(|(k, q)| {
            let (u, v) = q?;
            let other = self.pixels.get(u, v);
            let apart = Vec3A::from(other.position).distance_squared(seen.position.into());
            shows(&other, seen).then_some((k, apart))
        });
        alike.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(k, _)| k)
    }
}

/// Whether `pixel` shows the surface that `seen` is a point of.
fn shows(pixel: &PixelSurface, seen: &PixelSurface) -> bool {
    if seen.instance == NOTHING || pixel.instance == NOTHING {
        return seen.instance == pixel.instance;
    }
    // A lamp's pixels hold its own radiance; those of the surface that carries it hold reflected light.
    (pixel.emission == [0.0; 3]) == (seen.emission == [0.0; 3])
        && is_same_surface(pixel, seen.instance, seen.position.into(), seen.geometric_normal.into())
}
