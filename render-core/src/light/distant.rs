//! What lights share that are infinitely far away: photons, and direct light of a disc.

use super::emission::{Ball, EmittedPhoton, Facing, PhotonEmitter, SeenLight, Space, Start};
use super::receiver::ShadingPoint;
use super::sampled::{Brdf, Lamp, Sampled, Source, Traced};
use super::tile::ReceiverTile;
use crate::accel::Shadows;
use crate::sampling::{concentric_disc, disc_to_square, frame};
use glam::{Vec2, Vec3, Vec3A, Vec4};
use std::any::Any;

/// A light that is infinitely far away.
pub(crate) trait DistantLight: Sync {
    /// Integral of its radiance over all directions \[W·m⁻²\], linear RGB.
    fn fluence(&self) -> Vec3;

    /// Whether it moves at any time.
    fn moves(&self) -> bool {
        false
    }

    /// A direction towards it, for `u` in the unit square.
    fn draw(&self, u: Vec2) -> DistantSample;
}

/// A direction towards a light that is infinitely far away.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DistantSample {
    /// Unit vector.
    pub towards: Vec3A,
    /// Linear RGB \[W·m⁻²·sr⁻¹\]. Without a density: irradiance \[W·m⁻²\] of a surface that faces the light.
    pub radiance: Vec3,
    /// Density over solid angle \[sr⁻¹\]; `None` for light that no ray meets.
    pub pdf: Option<f32>,
}

impl DistantSample {
    /// Irradiance that it represents \[W·m⁻²\].
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

        // The inverse of the way that a photon starts.
        let (x, y) = frame(towards.into());
        let to = at.position - ball.center;
        let on_disc = Vec2::new(to.dot(x.into()), to.dot(y.into())) / ball.radius;
        let place = disc_to_square(on_disc).clamp(Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON));
        Some(SeenLight { irradiance, towards, end: None, start: Vec4::new(place.x, place.y, way.x, way.y) })
    }
}

/// A disc in the sky that shadow rays go to.
#[derive(Debug)]
pub(super) struct DistantDisc {
    /// Of a surface that faces it \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Unit vector to its middle.
    pub towards: Vec3A,
    /// Half the angle that it spans \[rad\].
    pub angular_radius: f32,
    /// Towards points of the disc, each for the same share of its light.
    pub directions: Vec<Vec3A>,
    /// Towards points of its border.
    pub border: [Vec3A; 8],
}

impl DistantDisc {
    /// Sample points of the disc.
    pub const SAMPLES: usize = 32;
    /// Sample points that shadow rays are traced to first, after the border.
    const FIRST_SAMPLES: usize = 2;
    /// Points of the unit square that go to the border of a disc, an eighth of a turn apart.
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
    /// All of it or none is visible where its border and the first few of its points agree.
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]) {
        let share = self.irradiance / self.directions.len() as f32;
        for (receiver, sum) in tile.receivers().iter().zip(sums) {
            // Irradiance from a point of the disc, and the share of it that arrives.
            let given = |towards: Vec3A| {
                let above = receiver.geometric_normal.dot(towards) > 0.0;
                share * if above { receiver.normal.dot(towards).max(0.0) } else { 0.0 }
            };
            let visible = |towards: Vec3A| tile.visible_towards(receiver, towards);

            // The border of the disc first: its points give nothing, and show whether the disc is partly hidden.
            let mut votes = Votes::default();
            for towards in self.border {
                if given(towards) != Vec3::ZERO && !(votes.lit && votes.dark) {
                    votes.add(Vec3::ZERO, visible(towards));
                }
            }

            // Then points of the disc, each with its share of E cos θ. Once all votes agree the rest follows without rays.
            for (index, &towards) in self.directions.iter().enumerate() {
                let e = given(towards);
                if e != Vec3::ZERO {
                    let is_known = index >= Self::FIRST_SAMPLES && votes.agree();
                    let known = if votes.dark { 0.0 } else { 1.0 };
                    votes.add(e, if is_known { known } else { visible(towards) });
                }
            }
            *sum += votes.sum;
        }
    }

    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3> {
        // L = f E cos θ, none from below the horizon of the normal or of the triangle.
        let given =
            brdf(self.towards, self.angular_radius) * self.irradiance * receiver.normal.dot(self.towards).max(0.0);
        if given == Vec3::ZERO || receiver.geometric_normal.dot(self.towards) <= 0.0 {
            return Traced::default();
        }

        // The visible share of the disc is that of its first points.
        let first = &self.directions[..Self::FIRST_SAMPLES];
        let seen: f32 = first.iter().map(|&towards| shadows.visible_towards(receiver.position, towards)).sum();
        Traced { value: given * (seen / first.len() as f32), shadow_rays: first.len() as u64 }
    }

    fn source(&self) -> Source {
        Source::Disc { towards: self.towards, angular_radius: self.angular_radius }
    }

    fn lamp(&self) -> Lamp {
        Lamp::Towards(self.towards)
    }

    fn is_same(&self, other: &dyn Sampled) -> bool {
        // Its points follow from these.
        let light = |disc: &Self| (disc.irradiance, disc.towards, disc.angular_radius);
        (other as &dyn Any).downcast_ref().is_some_and(|other| light(self) == light(other))
    }
}

/// Shadow rays of the samples of a disc at one receiver so far.
#[derive(Clone, Copy, Default)]
struct Votes {
    lit: bool,
    dark: bool,
    /// Irradiance from those that were lit \[W·m⁻²\].
    sum: Vec3,
}

impl Votes {
    /// Adds a sample that gives `e`, of which this `share` arrives.
    fn add(&mut self, e: Vec3, share: f32) {
        self.dark |= share < 1.0;
        self.lit |= share > 0.0;
        self.sum += e * share;
    }

    /// Whether all agreed. Without a vote there is no agreement, as when the first few samples all lie below the horizon.
    fn agree(&self) -> bool {
        self.lit != self.dark
    }
}
