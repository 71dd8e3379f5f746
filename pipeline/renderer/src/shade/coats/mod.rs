//! Light reflected by coats: metals, and the gloss of painted or polished surfaces.
//!
//! A coat's single scattering is computed in three ways, with each light in exactly one of them:
//!
//! ```text
//! point and spot lights, the sun       direction and shadow ray
//! sampled area lights                  points of direct light for roughness ≥ 0.2, otherwise reflection rays
//! everything else                      reflection rays: area lights of the light tree, the sky, lit surfaces
//! ```
//!
//! Reflection rays follow the visible microfacets \[Dupuy23\]. The random points of the rays depend only on the pixel, so noise
//! is static. The mean of the rays' radiance is scaled by the known albedo of the coat, not by the sum of the sample
//! weights:
//!
//! ```text
//! L = C(θ_o) · Σ wᵢ Lᵢ / Σ wᵢ            w = F·G₂/G₁   C  albedo of the coat      Lᵢ  radiance along ray i
//!   θ_o  angle between normal and viewer      F  Fresnel term      G₁, G₂  masking; masking and shadowing
//! ```
//! Under uniform light, a coat is therefore uniform for any number of rays.
//!
//! A pixel traces few rays and shares the rays of nearby pixels (`neighbors.rs`); if these differ, it traces more.
//! Rough coats with baked light sample that light without rays (`texel.rs`). Other rough coats reuse the light of the
//! previous frame (`reprojected.rs`).
//!
//! Glass adds refracted rays (`glass.rs`).
//!
//! Reflected surfaces are computed less accurately than visible ones (`along.rs`). Sheets are seen by their opacity. Coats of roughness ≥ 0.2 show
//! the radiance of photons stored in surfels. In smoother coats, reflected surfaces have direct light and a coarse
//! lightcut. A smooth coat within a smooth coat reflects light sources by its lobe, and all other light in the mirror
//! direction.

mod along;
mod coated;
mod glass;
mod neighbors;
mod reflections;
mod reprojected;
mod sparks;
#[cfg(feature = "bake")]
mod texel;

use super::layer::{KnownLight, Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::tolerance::Tolerance;
#[cfg(feature = "bake")]
use crate::BAKED_ROUGHNESS;
use crate::frame::Frame;
use coated::{Coated, Points};
use glam::{Vec2, Vec3};
use lighttree::Scratch;
use neighbors::{Lobe, excess, shared};
use plane::Plane;
use ranks::portable;
use reflections::{Brought, KnownIrradiance, Reflections, Typical};
use render_core::ranks::Alone;
use render_core::{Busy, GBuffer, Hit, LightPoints, PixelSurface, Surface, Surfaces};
pub(super) use reprojected::ReprojectedCoats;
use std::sync::atomic::{AtomicU64, Ordering};
#[cfg(feature = "bake")]
pub(crate) use texel::{KnownScene, TexelCoat, arriving_light};

/// Number of reflection rays that each pixel traces, in smooth and in rough coats. On a flat coat, two rays and the
/// rays of nearby pixels leave as much noise as 36 rays.
const OWN_RAYS: [u32; 2] = [4, 2];
/// Number of reflection rays of a pixel without enough similar rays in its neighbors, in smooth and in rough coats.
const RAYS: [u32; 2] = [8, 16];

/// Returns `seen` with the albedo below coats toward the viewer, for all light that [`Coats`] do not reflect. Surfaces
/// without a coat are unchanged.
pub(super) fn below_coats(seen: &GBuffer, surfaces: &Surfaces) -> GBuffer {
    let pixels = seen.pixels.map(|pixel| match Coated::of_pixel(&pixel, seen, surfaces, 0.0) {
        Some(coated) => PixelSurface { albedo: coated.diffuse_albedo().into(), ..pixel },
        None => pixel,
    });
    // Naming all fields avoids a copy of the pixels.
    let GBuffer { pixels: _, view, world, deformed, layered, through } = seen;
    let (world, deformed) = (world.clone(), deformed.clone());
    GBuffer { pixels, view: *view, world, deformed, layered: layered.clone(), through: through.clone() }
}

/// Layer of light that coats reflect toward the viewer by single scattering.
#[derive(Clone, Default)]
pub(super) struct Coats;

/// Returns whether a pixel's coat is rough: its rays are shared with nearby pixels.
pub(super) fn is_rough_coat(pixel: &PixelSurface) -> bool {
    pixel.roughness >= coated::ROUGH
}

/// Returns a pixel's light if it is baked; `None` if the pixel needs reflection rays.
#[cfg(feature = "bake")]
fn looked_up(
    known: Option<&dyn KnownLight>,
    reflections: &mut Reflections,
    coated: &Coated,
    pixel: &PixelSurface,
) -> Option<Lobe> {
    // Add light sources, which are not in the baked light.
    let is_baked = pixel.roughness >= BAKED_ROUGHNESS && !coated.has_lobes();
    let texels = known.filter(|_| is_baked)?.texels();
    let light = texels.coat_at(pixel, &reflections.prepared.surfaces, coated.middle().into())?;
    Some(Lobe::without_rays(reflections.sources(coated) + coated.albedo() * light))
}

#[cfg(not(feature = "bake"))]
fn looked_up(_: Option<&dyn KnownLight>, _: &mut Reflections, _: &Coated, _: &PixelSurface) -> Option<Lobe> {
    None
}

/// Returns a pixel's baked light, or the light from the pixel's own rays. A pixel without a coat has no light.
fn own_lobe(known: Option<&dyn KnownLight>, reflections: &mut Reflections, seen: &GBuffer, x: usize, y: usize) -> Lobe {
    let Some(coated) = coated(reflections, seen, x, y) else { return Lobe::default() };
    let pixel = seen.pixels.get(x, y);
    looked_up(known, reflections, &coated, &pixel).unwrap_or_else(|| own_rays(reflections, &coated, x, y))
}

impl Layer for Coats {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, _: &Tolerance<'_>) -> Lit {
        let (busy, shadow_rays) = (Busy::default(), AtomicU64::new(0));
        let is_wanted = |x, y| wanted.is_none_or(|wanted| wanted.get(x, y));
        let lobe_of = |x, y| (!is_wanted(x, y)).then(Lobe::default);
        let (_, reflected) = reflected(visible, lobe_of, &shadow_rays, &busy);
        Lit { radiance: Some(with_sparks(&reflected, visible.surfaces, &busy)), ..counted(shadow_rays, &busy) }
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
    }
}

/// Returns the cost of light.
fn counted(shadow_rays: AtomicU64, busy: &Busy) -> Lit {
    Lit { rays: shadow_rays.into_inner(), seconds: busy.seconds(), ..Lit::default() }
}

/// Returns the radiance of each pixel, with excess light spread over nearby pixels \[W·m⁻²·sr⁻¹\].
fn with_sparks(reflected: &Plane<Reflected>, seen: &GBuffer, busy: &Busy) -> Plane<Vec3> {
    let sparks = sparks::spread(&reflected.map(|pixel| pixel.spark), seen, busy);
    Plane::from_fn(sparks.width(), sparks.height(), |x, y| reflected.get(x, y).light + sparks.get(x, y))
}

/// Returns the lobes and the reflected light of the pixels for which `lobe_of` returns no lobe. All other pixels have
/// the returned lobe, which may have rays to share, and no light. The cost is added to `shadow_rays` and `busy`.
fn reflected(
    visible: &Visible,
    lobe_of: impl Fn(usize, usize) -> Option<Lobe> + Sync,
    shadow_rays: &AtomicU64,
    busy: &Busy,
) -> (Plane<Lobe>, Plane<Reflected>) {
    let Visible { frame, surfaces: seen, ranks, .. } = *visible;
    let (width, height) = (seen.pixels.width(), seen.pixels.height());
    let of_known = visible.known.map(|light| move |hit: &Hit, surface: &Surface| Some(light.irradiance(hit, surface)));
    let known = of_known.as_ref().map(|irradiance| irradiance as KnownIrradiance);

    // Trace a few rays for each pixel.
    let own = busy.take(by_macroblock(ranks, width, height, Scratch::default, |scratch, columns, rows| {
        let mut reflections = Reflections { prepared: frame, scratch, points: visible.points, shadow_rays: 0, known };
        let mut lobes = Vec::with_capacity(columns.len() * rows.len());
        for (x, y) in places(columns, rows) {
            let lobe = lobe_of(x, y).or_else(|| visible.has_stopped().then(Lobe::default));
            lobes.push(lobe.unwrap_or_else(|| own_lobe(visible.known, &mut reflections, seen, x, y)));
        }
        shadow_rays.fetch_add(reflections.shadow_rays, Ordering::Relaxed);
        lobes
    }));

    // Find light that is much brighter than typical light around it.
    let is_lit = |x, y| lobe_of(x, y).is_none();
    let beyond = busy.take(by_macroblock(
        &Alone,
        width,
        height,
        || (),
        |(), columns, rows| {
            // The excess of reprojected light is known.
            let of = |(x, y)| match own.get(x, y) {
                lobe if !lobe.has_rays() => Vec3::ZERO,
                lobe if !is_lit(x, y) => lobe.brought.excess,
                _ => excess(&own, x, y),
            };
            places(columns, rows).map(of).collect()
        },
    ));

    // Share rays between pixels, and trace more rays if too few pixels are similar.
    let traced = Traced { own, beyond };
    let reflected = busy.take(by_macroblock(ranks, width, height, Scratch::default, |scratch, columns, rows| {
        let mut reflections = Reflections { prepared: frame, scratch, points: visible.points, shadow_rays: 0, known };
        let mut pixels = Vec::with_capacity(columns.len() * rows.len());
        for (x, y) in places(columns, rows) {
            let is_lit = is_lit(x, y) && !visible.has_stopped();
            pixels.push(if is_lit { traced.reflected(&mut reflections, seen, x, y) } else { Reflected::default() });
        }
        shadow_rays.fetch_add(reflections.shadow_rays, Ordering::Relaxed);
        pixels
    }));
    (traced.own, reflected)
}

/// Light of a frame's pixels from their own rays.
struct Traced {
    own: Plane<Lobe>,
    /// Excess of each pixel's light over the typical light of nearby pixels.
    beyond: Plane<Vec3>,
}

impl Traced {
    /// Returns a pixel's light from its own rays and the rays of nearby pixels.
    fn reflected(&self, reflections: &mut Reflections, seen: &GBuffer, x: usize, y: usize) -> Reflected {
        let lobe = self.own.get(x, y);
        if !lobe.has_rays() {
            return Reflected { light: lobe.known, ..Reflected::default() };
        }
        let (mut brought, enough) = shared(&self.own, &self.beyond, x, y);
        // Trace further rays of the pixel if similar neighbors have too few. One of many samples needs few rays.
        let is_alone = reflections.points == LightPoints::All;
        if is_alone
            && !enough
            && let Some(coated) = coated(reflections, seen, x, y)
        {
            let rough = usize::from(coated.is_rough());
            let points = Points::of_pixel(x, y).rest(OWN_RAYS[rough], RAYS[rough]);
            brought.add(1.0, &more_rays(reflections, &coated, points, RAYS[rough]));
        }
        let (light, spark) = brought.mean();
        let (noise, nearness) = (brought.noise(), brought.mean_nearness());
        Reflected { light: lobe.known + lobe.albedo * light, spark: lobe.albedo * spark, noise, nearness }
    }
}

/// Returns the coat of a pixel; `None` if the pixel has none.
fn coated(reflections: &Reflections, seen: &GBuffer, x: usize, y: usize) -> Option<Coated> {
    let Frame { surfaces, epsilon, .. } = reflections.prepared;
    Coated::of_pixel(&seen.pixels.get(x, y), seen, surfaces, *epsilon)
}

/// Computes the light of a coat with the pixel's own rays.
fn own_rays(reflections: &mut Reflections, coated: &Coated, x: usize, y: usize) -> Lobe {
    let transmitted = reflections.transmitted(coated, reflections.points_of(x, y));
    let rays = coated.clearcoat_rays();
    let clearcoat = reflections.clearcoat(coated, reflections.points_of(x, y).first(rays), rays);
    let known = reflections.sources(coated) + transmitted + clearcoat;
    // Trace a single ray for a mirror: its lobe is about as wide as a pixel.
    if coated.is_mirror() {
        return Lobe::without_rays(known + reflections.mirrored(coated));
    }
    let rough = usize::from(coated.is_rough());
    let own = match reflections.points {
        LightPoints::All => OWN_RAYS[rough],
        LightPoints::Quarter(_) => RAYS[rough] / 4,
    };
    let points = reflections.points_of(x, y).first(own);
    let mut brought = Brought::default();
    reflections.lobe(coated, points, RAYS[rough]).for_each(|ray| brought.add(1.0, &ray));
    Lobe::new(coated, known, brought)
}

/// Traces rays with the given points, and marks light that is much brighter than typical.
fn more_rays(reflections: &mut Reflections, coated: &Coated, points: impl Iterator<Item = Vec2>, rays: u32) -> Brought {
    // Derive typical light from the new rays: too few neighbors are similar.
    let (mut sum, mut typical) = (Brought::default(), Typical::default());
    let brought: Vec<Brought> = reflections.lobe(coated, points, rays).collect();
    brought.iter().for_each(|ray| typical.add(1.0, ray.luminance()));
    let typical = typical.luminance().unwrap_or_default();
    brought.iter().for_each(|ray| sum.add(1.0, &ray.with_excess(ray.excess_over(typical))));
    sum
}

/// Light that a pixel's coat reflects.
#[derive(Clone, Copy, Debug, Default)]
struct Reflected {
    /// Reflected radiance without the excess \[W·m⁻²·sr⁻¹\].
    light: Vec3,
    /// Excess radiance of single rays, to be spread over nearby pixels \[W·m⁻²·sr⁻¹\].
    spark: Vec3,
    /// Standard deviation of the luminance of the rays' mean radiance \[W·m⁻²·sr⁻¹\].
    noise: f32,
    /// Mean of 1/t over the rays of the pixel and its neighbors \[1/m\].
    nearness: f32,
}

portable!(Reflected { light, spark, noise, nearness });

#[cfg(test)]
mod tests;
