//! Light that coats reflect: metals, and the gloss on what is painted or polished.
//!
//! A coat's single scattering is taken from its sources in three ways, each light by one of them alone:
//!
//! ```text
//! point and spot lights, the sun       their direction and a shadow ray
//! glowing surfaces that pixels sample  from roughness 0.2 on by the points that direct light samples; below, by reflection rays
//! everything else                      reflection rays: glowing surfaces of the light tree, the sky, whatever is lit
//! ```
//!
//! Reflection rays are drawn by the microfacets that the viewer sees \[Dupuy23\], with points that depend on the pixel alone:
//! noise stands still. The mean of what they bring is weighted by the albedo of the coat, which is known, and not
//! by what the samples happen to add up to:
//!
//! ```text
//! L = C(θ_o) · Σ wᵢ Lᵢ / Σ wᵢ            w = F·G₂/G₁   C  albedo of the coat
//! ```
//! A coat in even light is even, then, however few the rays.
//!
//! A pixel traces few rays of its own and shares those of the pixels around it (`neighbors.rs`); where these differ, it traces
//! more. Where the light of rough coats is baked they look it up, and trace no such rays (`texel.rs`). A reflection is coarser than what the viewer sees directly (`reflections.rs`): coats of roughness 0.2 and above show the
//! radiance of surfels, which photons have left there; in smoother ones surfaces are lit by direct light and a loose cut. A
//! smooth coat that is seen in a smooth coat shows its sources by their lobes, and of everything else the mirrored direction.

mod coated;
mod neighbors;
mod reflections;
mod sparks;
#[cfg(feature = "bake")]
mod texel;

use super::layer::{Layer, Lit, Visible};
use super::macroblock::{by_macroblock, places};
use super::tolerance::Tolerance;
#[cfg(feature = "bake")]
use crate::BAKED_ROUGHNESS;
#[cfg(feature = "bake")]
use crate::texels::BakedTexels;
use coated::{Coated, Points};
use glam::{Vec2, Vec3};
use lighttree::Scratch;
use neighbors::{Lobe, excess, shared};
use plane::Plane;
use ranks::portable;
use reflections::{Brought, Reflections, Typical};
use render_core::ranks::Alone;
use render_core::{Busy, GBuffer, PixelSurface};
#[cfg(feature = "bake")]
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
#[cfg(feature = "bake")]
pub(crate) use texel::{KnownScene, TexelCoat};

/// Reflection rays that each pixel traces, in smooth coats and in rough ones. On a flat coat, two and those of the pixels around
/// leave as much noise as 36.
const OWN_RAYS: [u32; 2] = [4, 2];
/// Reflection rays of a pixel that shares too few with others.
const RAYS: [u32; 2] = [8, 16];

/// `seen` with the albedo that is left under the coats, towards the viewer, for all light that [`Coats`] do not reflect.
/// Where there is no coat it stays the same.
pub(super) fn below_coats(seen: &GBuffer) -> GBuffer {
    let pixels = seen.pixels.map(|pixel| match Coated::of_pixel(&pixel, seen, 0.0) {
        Some(coated) => PixelSurface { albedo: coated.diffuse_albedo().into(), ..pixel },
        None => pixel,
    });
    GBuffer { pixels, ..seen.clone() }
}

/// Radiance that coats reflect towards the viewer, single scattering.
#[derive(Default)]
pub(super) struct Coats {
    /// Light of the coats that stand still, if it is baked.
    #[cfg(feature = "bake")]
    baked: Option<Arc<BakedTexels>>,
}

#[cfg(feature = "bake")]
impl Coats {
    /// Coats that look up what they reflect, but for sources of light, where `texels` have it.
    pub fn baked(texels: Arc<BakedTexels>) -> Self {
        Self { baked: Some(texels) }
    }
}

impl Coats {
    /// Light of a pixel that needs no reflection rays; none if it does.
    #[cfg(feature = "bake")]
    fn looked_up(&self, reflections: &mut Reflections, coated: &Coated, pixel: &PixelSurface) -> Option<Lobe> {
        let texels = self.baked.as_ref().filter(|_| pixel.roughness >= BAKED_ROUGHNESS)?;
        let light = texels.coat_at(pixel, &reflections.prepared.surfaces, coated.middle().into())?;
        Some(Lobe::without_rays(reflections.sources(coated) + coated.albedo() * light))
    }

    #[cfg(not(feature = "bake"))]
    fn looked_up(&self, _: &mut Reflections, _: &Coated, _: &PixelSurface) -> Option<Lobe> {
        None
    }

    /// Light of a pixel, as far as its own rays find it; nothing where there is no coat.
    fn own_lobe(&self, reflections: &mut Reflections, seen: &GBuffer, x: usize, y: usize) -> Lobe {
        let Some(coated) = coated(reflections, seen, x, y) else { return Lobe::default() };
        let pixel = seen.pixels.get(x, y);
        self.looked_up(reflections, &coated, &pixel).unwrap_or_else(|| own_rays(reflections, &coated, x, y))
    }
}

impl Layer for Coats {
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, _: &Tolerance<'_>) -> Lit {
        let Visible { frame, surfaces: seen, ranks, .. } = *visible;
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let (busy, shadow_rays) = (Busy::default(), AtomicU64::new(0));
        let is_wanted = |x, y| wanted.is_none_or(|wanted| wanted.get(x, y));

        // Each pixel traces a few rays of its own.
        let own = busy.take(by_macroblock(ranks, width, height, Scratch::default, |scratch, columns, rows| {
            let mut reflections = Reflections { prepared: frame, scratch, shadow_rays: 0 };
            let mut lobes = Vec::with_capacity(columns.len() * rows.len());
            for (x, y) in places(columns, rows) {
                lobes.push(if is_wanted(x, y) { self.own_lobe(&mut reflections, seen, x, y) } else { Lobe::default() });
            }
            shadow_rays.fetch_add(reflections.shadow_rays, Ordering::Relaxed);
            lobes
        }));

        // A part of its light may be far from what is typical around it.
        let beyond = busy.take(by_macroblock(
            &Alone,
            width,
            height,
            || (),
            |(), columns, rows| {
                let of = |(x, y)| if own.get(x, y).has_rays() { excess(&own, x, y) } else { Vec3::ZERO };
                places(columns, rows).map(of).collect()
            },
        ));

        // Pixels share their rays; where too few are alike, they trace more.
        let traced = Traced { own, beyond };
        let reflected = busy.take(by_macroblock(ranks, width, height, Scratch::default, |scratch, columns, rows| {
            let mut reflections = Reflections { prepared: frame, scratch, shadow_rays: 0 };
            let pixels = places(columns, rows).map(|(x, y)| traced.reflected(&mut reflections, seen, x, y)).collect();
            shadow_rays.fetch_add(reflections.shadow_rays, Ordering::Relaxed);
            pixels
        }));

        // Sparks go to the pixels around them.
        let sparks = sparks::spread(&reflected.map(|pixel| pixel.spark), seen, &busy);
        let radiance = Plane::from_fn(width, height, |x, y| reflected.get(x, y).light + sparks.get(x, y));
        Lit { radiance: Some(radiance), rays: shadow_rays.into_inner(), seconds: busy.seconds(), ..Lit::default() }
    }
}

/// Light that the pixels of a picture have found by their own rays.
struct Traced {
    own: Plane<Lobe>,
    /// Excess of each pixel's light over that of the pixels around.
    beyond: Plane<Vec3>,
}

impl Traced {
    /// Light of a pixel by its own rays and those of the pixels around.
    fn reflected(&self, reflections: &mut Reflections, seen: &GBuffer, x: usize, y: usize) -> Reflected {
        let lobe = self.own.get(x, y);
        if !lobe.has_rays() {
            return Reflected { light: lobe.known, spark: Vec3::ZERO };
        }
        let (mut brought, enough) = shared(&self.own, &self.beyond, x, y);
        if !enough && let Some(coated) = coated(reflections, seen, x, y) {
            let rough = usize::from(coated.is_rough());
            let points = Points::of_pixel(x, y).rest(OWN_RAYS[rough], RAYS[rough]);
            brought.add(1.0, &more_rays(reflections, &coated, points, RAYS[rough]));
        }
        let (light, spark) = brought.mean();
        Reflected { light: lobe.known + lobe.albedo * light, spark: lobe.albedo * spark }
    }
}

/// The coat that a pixel shows, if there is one.
fn coated(reflections: &Reflections, seen: &GBuffer, x: usize, y: usize) -> Option<Coated> {
    Coated::of_pixel(&seen.pixels.get(x, y), seen, reflections.prepared.epsilon)
}

/// Light of a coat by the own rays of its pixel alone.
fn own_rays(reflections: &mut Reflections, coated: &Coated, x: usize, y: usize) -> Lobe {
    let known = reflections.sources(coated);
    if coated.is_mirror() {
        return Lobe::without_rays(known + reflections.mirrored(coated));
    }
    let rough = usize::from(coated.is_rough());
    let points = Points::of_pixel(x, y).first(OWN_RAYS[rough]);
    let mut brought = Brought::default();
    reflections.lobe(coated, points, RAYS[rough]).for_each(|ray| brought.add(1.0, &ray));
    Lobe::new(coated, known, brought)
}

/// The rays with these points more, none of them far brighter than is typical.
fn more_rays(reflections: &mut Reflections, coated: &Coated, points: impl Iterator<Item = Vec2>, rays: u32) -> Brought {
    let (mut sum, mut typical) = (Brought::default(), Typical::default());
    let brought: Vec<Brought> = reflections.lobe(coated, points, rays).collect();
    brought.iter().for_each(|ray| typical.add(1.0, ray.luminance()));
    let typical = typical.luminance().unwrap_or_default();
    brought.iter().for_each(|ray| sum.add(1.0, &ray.with_excess(ray.excess_over(typical))));
    sum
}

/// Light of a pixel's coat.
#[derive(Clone, Copy, Debug, Default)]
struct Reflected {
    /// Radiance.
    light: Vec3,
    /// Radiance that a single ray brings in excess of the others, to be shared among the pixels around.
    spark: Vec3,
}

portable!(Reflected { light, spark });

#[cfg(test)]
mod tests;
