//! Reflection rays shared between neighboring pixels.
//!
//! Rays of a neighbor q contribute to pixel p according to the similarity k of their lobes:
//!
//! ```text
//! k = tent · (1 − u²)           u² = (|m_p − m_q|² + |x_p − x_q|² n²) / (s α)² + ((α_p − α_q) / (r α))²
//!   m  center of the lobe       x  position      n  mean of 1/t over the rays      α  GGX's lobe width
//!   s, r  SAME_LOBE, SAME_ALPHA       tent  filter over the distance in pixels      t  distance to the first hit
//! ```
//! Rays with u ≥ 1 do not contribute. The second term of u² is the parallax of the surfaces hit by the rays. Therefore,
//! pixels at contact shadows, bumps and borders of smoother regions use only their own rays.

use super::OWN_RAYS;
use super::coated::Coated;
use super::reflections::{Brought, Typical};
use glam::Vec3;
use plane::Plane;
use ranks::portable;
use render_core::{CoatView, LobeLight};

/// Maximum distance of neighbors that share rays \[pixels\].
const REACH: usize = 2;
/// Maximum distance of neighbors that determine the typical brightness of rays \[pixels\].
const NEXT: usize = 1;
/// Maximum distance s between shared lobes, in units of α. Shared rays widen a lobe by at most 4 %, according to α'² =
/// α² (1 + s²/6), as for disc lights (`Bsdf::evaluate_coat`).
const SAME_LOBE: f32 = 0.7;
/// Maximum difference r between the widths of shared lobes, relative to α.
const SAME_ALPHA: f32 = 0.5;
/// Minimum effective number of rays, (Σ k r)² / Σ k² r, where a pixel has r rays of weight k. With fewer, a pixel
/// traces more rays.
const ENOUGH: f32 = 16.0;

/// Coat of a pixel, with the pixel's own rays; without rays if there is no coat, or if the coat needs none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lobe {
    /// Radiance computed without reflection rays \[W·m⁻²·sr⁻¹\].
    pub known: Vec3,
    /// Fraction of uniform light that the coat reflects.
    pub albedo: Vec3,
    pub brought: Brought,
    position: Vec3,
    middle: Vec3,
    alpha: f32,
    is_rough: bool,
    /// Mean of 1/t over the rays, where t is the distance to the first hit \[1/m\].
    nearness: f32,
}

portable!(Lobe { known, albedo, brought, position, middle, alpha, is_rough, nearness });

impl Lobe {
    /// Creates a coat without rays.
    pub fn without_rays(known: Vec3) -> Self {
        Self { known, ..Self::default() }
    }

    pub fn new(coated: &Coated, known: Vec3, brought: Brought) -> Self {
        Self {
            known,
            albedo: coated.albedo(),
            brought,
            position: coated.receiver.position.into(),
            middle: coated.middle().into(),
            alpha: coated.alpha(),
            is_rough: coated.is_rough(),
            nearness: brought.mean_nearness(),
        }
    }

    /// Creates the coat `view` with reprojected `light`, as if it had traced its own rays.
    pub fn reprojected(view: &CoatView, albedo: Vec3, light: &LobeLight) -> Self {
        Self {
            known: Vec3::ZERO,
            albedo,
            brought: Brought::of_lobe(OWN_RAYS[1], light),
            position: view.position.into(),
            middle: view.mirrored.into(),
            alpha: view.alpha,
            is_rough: true,
            nearness: light.nearness,
        }
    }

    /// Returns whether the coat has rays to share.
    pub fn has_rays(&self) -> bool {
        self.brought.rays > 0.0
    }

    /// Returns max(1 − u², 0) for this lobe p and the lobe `other` q.
    fn likeness(&self, other: &Self) -> f32 {
        // Evaluate 1 − u² of the module documentation: lobe distance, parallax, lobe widths.
        let nearness = self.nearness.max(other.nearness);
        let turned = self.middle.distance_squared(other.middle);
        let moved = self.position.distance_squared(other.position) * nearness * nearness;
        let width = SAME_LOBE * self.alpha;
        let wider = (self.alpha - other.alpha) / (SAME_ALPHA * self.alpha);
        (1.0 - (turned + moved) / (width * width) - wider * wider).max(0.0)
    }
}

/// Returns the excess of a pixel's own rays over the typical light around the pixel. In a smooth coat, typical light
/// includes the pixel's own rays, because reflections in smooth coats have edges.
pub(super) fn excess(lobes: &Plane<Lobe>, x: usize, y: usize) -> Vec3 {
    let own = lobes.get(x, y);
    let mut typical = Typical::default();
    for_neighbors(lobes, x, y, NEXT, |weight, (u, v)| {
        let other = lobes.get(u, v);
        // Exclude the pixel itself in a rough coat: a single bright ray would raise its own limit.
        if (u, v) != (x, y) || !own.is_rough {
            typical.add(weight * other.brought.rays, other.brought.luminance());
        }
    });
    match typical.luminance() {
        Some(typical) => own.brought.excess_over(typical),
        None => Vec3::ZERO,
    }
}

/// Returns the sums over the rays of a pixel and its neighbors, and whether the rays suffice.
pub(super) fn shared(lobes: &Plane<Lobe>, excess: &Plane<Vec3>, x: usize, y: usize) -> (Brought, bool) {
    let mut sum = Brought::default();
    // Sum k² r: pixels with r rays of weight k have the variance of (Σ k r)² / Σ k² r rays of equal weight.
    let mut squares = 0.0;
    for_neighbors(lobes, x, y, REACH, |weight, (u, v)| {
        let brought = lobes.get(u, v).brought;
        sum.add(weight, &brought.with_excess(excess.get(u, v)));
        squares += weight * weight * brought.rays;
    });
    (sum, sum.rays * sum.rays >= ENOUGH * squares)
}

/// Calls `of` with k and the position of each pixel within `reach` that contributes rays to (x, y), including the pixel
/// at (x, y).
fn for_neighbors(lobes: &Plane<Lobe>, x: usize, y: usize, reach: usize, mut of: impl FnMut(f32, (usize, usize))) {
    let around = |center: usize, end: usize| center.saturating_sub(reach)..(center + reach + 1).min(end);
    let tent = |apart: usize| (reach + 1 - apart) as f32 / (reach + 1) as f32;
    let own = &lobes.row(y)[x];
    for v in around(y, lobes.height()) {
        let row = lobes.row(v);
        for u in around(x, lobes.width()) {
            // Weight neighbors by distance in pixels and by the similarity of their lobes.
            if row[u].has_rays() {
                let weight = tent(u.abs_diff(x)) * tent(v.abs_diff(y)) * own.likeness(&row[u]);
                if weight > 0.0 {
                    of(weight, (u, v));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a rough coat of α 0.25 that faces +x, with two rays of radiance `light`.
    fn lobe(light: f32) -> Lobe {
        let brought = Brought::of_lobe(2, &LobeLight { traced: [light; 3], ..LobeLight::default() });
        Lobe { albedo: Vec3::ONE, brought, middle: Vec3::X, alpha: 0.25, is_rough: true, ..Lobe::default() }
    }

    #[test]
    fn alike_pixels_have_enough_rays_together_and_a_single_one_has_not() {
        let (x, y) = (2, 2);
        let none = Plane::filled(5, 5, Vec3::ZERO);
        let even = Plane::filled(5, 5, lobe(3.0));
        let (brought, enough) = shared(&even, &none, x, y);
        assert!(enough && (brought.mean().0 - 3.0).abs().max_element() < 1e-5);
        let turned = Lobe { middle: Vec3::Y, ..lobe(100.0) };
        let alone = Plane::from_fn(5, 5, |u, v| if (u, v) == (x, y) { lobe(3.0) } else { turned });
        let (brought, enough) = shared(&alone, &none, x, y);
        assert!(!enough && (brought.mean().0 - 3.0).abs().max_element() < 1e-5);
    }

    /// Checks that light beyond the typical luminance becomes an excess, and that no light is lost.
    #[test]
    fn a_spark_becomes_an_excess() {
        let spark = Plane::from_fn(5, 5, |x, y| lobe(if (x, y) == (2, 2) { 1000.0 } else { 1.0 }));
        let excess = Plane::from_fn(5, 5, |x, y| excess(&spark, x, y));
        let (light, beyond) = shared(&spark, &excess, 2, 2).0.mean();
        // The tent weights sum to 9, so the pixel's own fraction of Σ k is 1/9.
        assert!((light + beyond - (1000.0 + 8.0) / 9.0).abs().max_element() < 0.1, "{light} + {beyond}");
        assert!(light.max_element() < 20.0, "{light}");
    }
}
