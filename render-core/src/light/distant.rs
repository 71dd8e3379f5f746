//! Lights at infinity: photons, and direct light from a disc.

use super::emission::{Ball, EmittedPhoton, Facing, PhotonEmitter, SeenLight, Space, Start};
use super::receiver::ShadingPoint;
use super::sampled::{Brdf, Lamp, Sampled, Source, Traced};
use super::tile::ReceiverTile;
use crate::accel::Shadows;
use crate::sampling::{concentric_disc, disc_to_square, frame};
use glam::{Vec2, Vec3, Vec3A, Vec4};
use std::any::Any;

/// Infinitely distant light.
pub(crate) trait DistantLight: Sync {
    /// Returns the integral of the light's radiance over all directions \[W·m⁻²\], linear RGB.
    fn fluence(&self) -> Vec3;

    /// Returns whether the light ever moves.
    fn moves(&self) -> bool {
        false
    }

    /// Draws a direction towards the light, for `u` in the unit square.
    fn draw(&self, u: Vec2) -> DistantSample;
}

/// Direction towards a distant light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DistantSample {
    /// Direction towards the light, a unit vector.
    pub towards: Vec3A,
    /// Radiance \[W·m⁻²·sr⁻¹\], linear RGB. Without a density, the irradiance of a surface that faces the light
    /// \[W·m⁻²\].
    pub radiance: Vec3,
    /// Density over solid angle \[sr⁻¹\]; `None` for light that rays cannot hit.
    pub pdf: Option<f32>,
}

impl DistantSample {
    /// Returns the irradiance that the sample represents \[W·m⁻²\].
    fn irradiance(&self) -> Vec3 {
        self.pdf.map_or(self.radiance, |pdf| self.radiance / pdf)
    }
}

impl<L: DistantLight> PhotonEmitter for L {
    fn is_distant(&self) -> bool {
        true
    }

    fn power(&self, ball: &Ball) -> Vec3 {
        self.fluence() * ball.disc_area()
    }

    fn emit(&self, Space { ball, .. }: Space, Start { place, way, .. }: Start, share: f32) -> EmittedPhoton {
        // Start on a disc as wide as the scene, just outside the bounding sphere.
        let sample = self.draw(way);
        let (towards, flux) = (sample.towards, sample.irradiance() * (ball.disc_area() * share));
        let (x, y) = frame(towards.into());
        let on_disc = concentric_disc(place) * ball.radius;
        let origin = ball.center + towards * (ball.radius * 1.01) + Vec3A::from(x * on_disc.x + y * on_disc.y);
        EmittedPhoton { origin, direction: -towards, flux, from_moving: self.moves(), distant: true }
    }

    fn towards(&self, Space { ball, .. }: Space, at: Facing, [_, way]: [Vec2; 2]) -> Option<SeenLight> {
        let sample = self.draw(way);
        let towards = sample.towards;
        let irradiance = sample.irradiance() * at.cosine(towards)?;

        // Invert the mapping that starts a photon.
        let (x, y) = frame(towards.into());
        let to = at.position - ball.center;
        let on_disc = Vec2::new(to.dot(x.into()), to.dot(y.into())) / ball.radius;
        let place = disc_to_square(on_disc).clamp(Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON));
        Some(SeenLight { irradiance, towards, end: None, start: Vec4::new(place.x, place.y, way.x, way.y) })
    }
}

/// Disc in the sky, sampled with shadow rays.
#[derive(Debug)]
pub(super) struct DistantDisc {
    /// Irradiance of a surface that faces the disc \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Direction to the disc's center, a unit vector.
    pub towards: Vec3A,
    /// Half the angular diameter of the disc \[rad\].
    pub angular_radius: f32,
    /// Directions to sample points. Each represents an equal fraction of the disc's light.
    pub directions: Vec<Vec3A>,
    /// Directions to points on the border of the disc.
    pub border: [Vec3A; 8],
}

impl DistantDisc {
    /// Number of sample points of the disc.
    pub const SAMPLES: usize = 32;
    /// Number of sample points that are traced first, after the border.
    const FIRST_SAMPLES: usize = 2;
    /// Points of the unit square that map to the border of a disc, 45° apart.
    pub const BORDER: [Vec2; 8] = [
        Vec2::new(0.0, 0.0),
        Vec2::new(1.0, 1.0),
        Vec2::new(1.0, 0.0),
        Vec2::new(0.0, 1.0),
        Vec2::new(0.5, 0.0),
        Vec2::new(0.5, 1.0),
        Vec2::new(1.0, 0.5),
        Vec2::new(0.0, 0.5),
    ];
}

impl Sampled for DistantDisc {
    /// Adds all of the disc's light, or none, if the border and the first few points agree. Otherwise adds the visible
    /// fraction.
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]) {
        let share = self.irradiance / self.directions.len() as f32;
        for (receiver, sum) in tile.receivers().iter().zip(sums) {
            // Compute the irradiance from one sample point, and the visible fraction of the point.
            let given = |towards: Vec3A| {
                let above = receiver.geometric_normal.dot(towards) > 0.0;
                share * if above { receiver.normal.dot(towards).max(0.0) } else { 0.0 }
            };
            let visible = |towards: Vec3A| tile.visible_towards(receiver, towards);

            // Trace only a quarter of the points for one of many samples of a pixel.
            if let Some(quarter) = tile.points.quarter(&self.directions) {
                let seen = |&towards: &Vec3A| match given(towards) {
                    Vec3::ZERO => Vec3::ZERO,
                    e => e * visible(towards),
                };
                let part = self.directions.len() as f32 / quarter.len() as f32;
                *sum += part * quarter.iter().map(seen).sum::<Vec3>();
                continue;
            }

            // Trace the border first. Its points emit no light, but detect partial occlusion.
            let mut votes = Votes::default();
            for towards in self.border {
                if given(towards) != Vec3::ZERO && !(votes.lit && votes.dark) {
                    votes.add(Vec3::ZERO, visible(towards));
                }
            }

            // Trace the sample points, each with its fraction of E cos θ. Once all votes agree, the remaining points
            // need no rays.
            for (index, &towards) in self.directions.iter().enumerate() {
                let e = given(towards);
                if e != Vec3::ZERO {
                    let is_known = index >= Self::FIRST_SAMPLES && votes.agree();
                    let known = if votes.dark { Vec3::ZERO } else { Vec3::ONE };
                    votes.add(e, if is_known { known } else { visible(towards) });
                }
            }
            *sum += votes.sum;
        }
    }

    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3> {
        // L = f E cos θ, or 0 below the horizon of the shading normal or of the triangle.
        let given =
            brdf(self.towards, self.angular_radius) * self.irradiance * receiver.normal.dot(self.towards).max(0.0);
        if given == Vec3::ZERO || receiver.geometric_normal.dot(self.towards) <= 0.0 {
            return Traced::default();
        }

        // The first points determine the visible fraction of the disc.
        let first = &self.directions[..Self::FIRST_SAMPLES];
        let seen: Vec3 = first.iter().map(|&towards| shadows.visible_towards(receiver.position, towards)).sum();
        Traced { value: given * (seen / first.len() as f32), shadow_rays: first.len() as u64 }
    }

    fn source(&self) -> Source {
        Source::Disc { towards: self.towards, angular_radius: self.angular_radius }
    }

    fn lamp(&self) -> Lamp {
        Lamp::Towards(self.towards)
    }

    fn is_same(&self, other: &dyn Sampled) -> bool {
        // These values determine the sample points.
        let light = |disc: &Self| (disc.irradiance, disc.towards, disc.angular_radius);
        (other as &dyn Any).downcast_ref().is_some_and(|other| light(self) == light(other))
    }
}

/// Accumulated results of a disc's shadow rays at one receiver.
#[derive(Clone, Copy, Default)]
struct Votes {
    lit: bool,
    dark: bool,
    /// Irradiance from the visible samples \[W·m⁻²\].
    sum: Vec3,
}

impl Votes {
    /// Adds a sample with irradiance `e`, of which the fraction `share` arrives, linear RGB.
    fn add(&mut self, e: Vec3, share: Vec3) {
        self.dark |= share.min_element() < 1.0;
        self.lit |= share.max_element() > 0.0;
        self.sum += e * share;
    }

    /// Returns whether all votes agree. Returns false without votes, for instance if the first few samples are below the
    /// horizon.
    fn agree(&self) -> bool {
        self.lit != self.dark
    }
}
