//! Change of the indirect light on static surfaces by dynamic objects.
//!
//! Texels contain the light of the scene without its dynamic objects. An object hides the surfaces behind it and sends
//! its own light instead:
//!
//! ```text
//! ΔE(x) = ∫ (L_object − L_behind) cos θ dω        over the directions in which x sees a dynamic object
//! ```
//!
//! Directions are sampled in the cones around the bounding spheres of the objects. A direction in several cones is
//! weighted by the balance heuristic \[Veach97\]: with nₖ directions of density pₖ in cone k,
//!
//! ```text
//! ΔE ≈ Σ f(ωᵢ) / Σₖ nₖ pₖ(ωᵢ)
//! ```
//!
//! Objects also cast shadows and hide light from other surfaces, which then reflect less. Cosine-distributed directions
//! add this change of the reflected light:
//!
//! ```text
//! ΔE ≈ π/N Σ ρ(yᵢ)/π ((V − 1) E_direct + ΔE)(yᵢ)
//! ```

use super::movers::{Cone, Directions, LEAST_COVER, LEAST_DIRECTIONS, MOST_CONES};
use super::texel_light::TexelLight;
use crate::shade::movement::MovingBox;
use glam::{Vec2, Vec3, Vec3A, vec2};
use render_core::ShadingPoint;
use std::f32::consts::PI;

/// Factor of the number of directions in the hemisphere under a near object. With 64 directions, the light under a plate
/// deviates by up to 2 % of the unobstructed light.
const NEAR_FACTOR: usize = 2;

impl TexelLight<'_> {
    /// Estimates the change ΔE at `receiver` \[W·m⁻²\].
    pub(super) fn change_at(&self, receiver: &ShadingPoint, directions: Directions) -> Vec3 {
        let Directions { around, hemisphere, follows, shift } = directions;
        let (mut cones, mut whole) = (Vec::with_capacity(MOST_CONES), 0.0);
        for (cone, cover) in self.movers.cones(receiver) {
            whole += cover;
            cones.push((cone, cover));
        }

        // Shadows are near their objects, so they change little where the objects cover little.
        if whole < LEAST_COVER {
            return Vec3::ZERO;
        }

        // Divide the directions between the cones by their size.
        let mut counted = Vec::with_capacity(cones.len());
        for (cone, cover) in cones {
            // Near an object, each direction covers more of its outline.
            let around = if matches!(cone, Cone::Hemisphere) { NEAR_FACTOR * around } else { around };
            let count = (around as f32 * cover / whole).round() as usize;
            counted.push((cone, count.clamp(LEAST_DIRECTIONS, around)));
        }
        let mut change = Vec3::ZERO;
        for (cone, count) in &counted {
            for u in golden(*count) {
                let direction = cone.direction((u + shift).fract(), receiver.normal);
                let density = |(cone, count): &(Cone, usize)| *count as f32 * cone.density(direction, receiver.normal);
                let weight = counted.iter().map(density).sum::<f32>().max(f32::MIN_POSITIVE);
                change += self.of_object(receiver, direction) / weight;
            }
        }

        // Add the losses in shadows: cosine-distributed directions have equal weights.
        for u in golden(hemisphere) {
            let direction = Cone::Hemisphere.direction((u + shift).fract(), receiver.normal);
            change += self.of_shadow(receiver, direction, follows) * (PI / hemisphere as f32);
        }
        change
    }

    /// Returns (L_object − L_behind) cos θ for a direction \[W·m⁻²·sr⁻¹\]; zero if no object is visible there.
    fn of_object(&self, receiver: &ShadingPoint, direction: Vec3A) -> Vec3 {
        let &ShadingPoint { position, normal, geometric_normal } = receiver;
        let cosine = normal.dot(direction);
        if cosine <= 0.0 || geometric_normal.dot(direction) <= 0.0 {
            return Vec3::ZERO;
        }
        // Omit rays that pass by all objects.
        let meets = |thing: &MovingBox| thing.is_crossed(position, position + direction * thing.farthest(position));
        if !self.standing.iter().any(meets) {
            return Vec3::ZERO;
        }
        let first = self.frame.accelerator.closest(position, direction);
        let Some(hit) = first.filter(|hit| self.moves(hit.instance)) else { return Vec3::ZERO };
        (self.radiance(&hit, direction) - self.static_radiance(position, direction, hit.distance)) * cosine
    }

    /// Returns the change of the radiance that a static surface sends from a direction \[W·m⁻²·sr⁻¹\], with
    /// `follows` reflections between changed surfaces.
    fn of_shadow(&self, receiver: &ShadingPoint, direction: Vec3A, follows: usize) -> Vec3 {
        if receiver.geometric_normal.dot(direction) <= 0.0 {
            return Vec3::ZERO;
        }
        match self.frame.accelerator.closest(receiver.position, direction) {
            Some(hit) if !self.moves(hit.instance) => self.change_of_radiance(&hit, direction, follows),
            _ => Vec3::ZERO,
        }
    }
}

/// Returns `count` points of the unit square, whose second coordinate advances by the golden ratio. Directions made from
/// them are even, and unlike a lattice, they do not align with the outlines of boxes.
fn golden(count: usize) -> impl Iterator<Item = Vec2> {
    const RATIO: f32 = 0.618_034;
    (0..count).map(move |k| vec2((k as f32 + 0.5) / count as f32, (k as f32 * RATIO).fract()))
}
