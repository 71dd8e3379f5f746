//! Photons on their way out of lights, and the same ways backwards: how a light gets to a place.

use super::area::Detail;
use super::{Emitters, LightId};
use crate::environment::{Environment, SkySample};
use crate::sampling::{Distribution, concentric_disc, cosine_hemisphere, disc_to_square, frame, uniform_sphere};
use crate::scene::{PunctualKind, Scene};
use crate::surface::Surfaces;
use glam::{Vec2, Vec3, Vec3A, Vec4};

/// A photon on its way out.
#[derive(Clone, Copy, Debug)]
pub struct EmittedPhoton {
    /// Where it starts, a little off the surface.
    pub origin: Vec3A,
    /// Unit vector.
    pub direction: Vec3A,
    /// Linear RGB flux \[W\].
    pub flux: Vec3,
    /// Whether its light moves through the scene.
    pub from_moving: bool,
    /// Whether its light is infinitely far away.
    pub distant: bool,
}

/// Dimensions of the Halton sequence that an emission uses.
pub const EMISSION_DIMENSIONS: usize = 5;

/// How a photon starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    /// Index into [`PhotonSource::lights`].
    pub light: usize,
    /// Left of the number that chose the light, 0…1.
    pub rest: f64,
    pub place: Vec2,
    pub way: Vec2,
    /// Probability density of all that.
    pub density: f32,
}

/// How a surface is lit straight by a light, and how a photon would start to get there.
pub(crate) struct SeenLight {
    /// On the surface, without shadows \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Unit vector towards the light.
    pub towards: Vec3A,
    /// A little off the light; `None` if that is infinitely far away.
    pub end: Option<Vec3A>,
    /// Place and way of the photon; for lights that are infinitely far away.
    pub start: Vec4,
}

/// Solid angle that the light of a cone would fill at full intensity.
pub(super) fn cone_solid_angle(kind: PunctualKind) -> f32 {
    match kind {
        PunctualKind::Spot { outer, .. } => {
            let steps = 256;
            let outer_cos = outer.cos();
            let step = (1.0 - outer_cos) / steps as f32;
            let sum: f32 = (0..steps).map(|i| kind.falloff(outer_cos + (i as f32 + 0.5) * step)).sum();
            std::f32::consts::TAU * sum * step
        }
        _ => 4.0 * std::f32::consts::PI,
    }
}

/// Emits photons with probability in proportion to power.
pub struct PhotonSource<'a> {
    pub(super) emitters: &'a Emitters,
    pub(super) scene: &'a Scene,
    pub(super) lights: Vec<LightId>,
    /// Of each of the lights \[W\].
    pub(super) powers: Vec<Vec3>,
    pub(super) choice: Distribution,
    pub(super) center: Vec3A,
    pub(super) radius: f32,
}

impl std::fmt::Debug for PhotonSource<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("PhotonSource").field("powers", &self.powers).finish_non_exhaustive()
    }
}

impl PhotonSource<'_> {
    /// Radiant flux of each light \[W\].
    #[must_use]
    pub fn powers(&self) -> &[Vec3] {
        &self.powers
    }

    /// Lights by power.
    pub(crate) fn choice(&self) -> &Distribution {
        &self.choice
    }

    /// How many lights are not infinitely far away; these come first.
    pub(crate) fn near_lights(&self) -> usize {
        self.lights.iter().filter(|light| !light.is_distant()).count()
    }

    fn sky(&self) -> &Environment {
        self.scene.sky.as_ref().expect("only a scene with a sky has its light")
    }

    /// The photon with this start, of `count`.
    pub(crate) fn emit(&self, surfaces: &Surfaces, start: Start, count: u64) -> EmittedPhoton {
        let Start { light, rest, place, way, density } = start;
        let share = 1.0 / (density * count as f32);
        let e = self.emitters;
        match self.lights[light] {
            LightId::Area(index) => {
                let area = &e.areas[index];
                let sample = area.sample(surfaces, area.point(rest, place), way.x, Detail::Point);
                // The same number chose the side; what it has left over is as good as new.
                let way = if area.is_double_sided() { Vec2::new((way.x * 2.0).fract(), way.y) } else { way };
                let direction = cosine_hemisphere(sample.normal.into(), way);
                // Radiance · area · π is the flux; the point was chosen with density radiance/area-weighted.
                let flux = sample.intensity * std::f32::consts::PI * share;
                let origin = sample.position;
                EmittedPhoton { origin, direction: direction.into(), flux, from_moving: area.moves, distant: false }
            }
            LightId::Point(index) => {
                let point = &e.points[index];
                let solid_angle = cone_solid_angle(point.kind);
                let (direction, weight) = match point.kind {
                    PunctualKind::Spot { outer, .. } => {
                        let cos = 1.0 - way.x * (1.0 - outer.cos());
                        let (x, y) = frame(point.axis.into());
                        let (sin, angle) = ((1.0 - cos * cos).max(0.0).sqrt(), std::f32::consts::TAU * way.y);
                        let across = x * (sin * angle.cos()) + y * (sin * angle.sin());
                        let cap = std::f32::consts::TAU * (1.0 - outer.cos());
                        (across + Vec3::from(point.axis) * cos, point.kind.falloff(cos) * cap / solid_angle)
                    }
                    _ => (uniform_sphere(way), 1.0),
                };
                let flux = point.intensity * (solid_angle * weight * share);
                let direction = direction.normalize().into();
                EmittedPhoton { origin: point.position, direction, flux, from_moving: point.moves, distant: false }
            }
            LightId::Sun(index) => {
                let sun = &e.suns[index];
                let photon = self.distant_photon(sun.direction(way), sun.irradiance, place, share);
                EmittedPhoton { from_moving: sun.moves, ..photon }
            }
            LightId::Sky => {
                let (towards, irradiance) = drawn_from(self.sky(), way);
                self.distant_photon(towards, irradiance, place, share)
            }
        }
    }

    /// A photon of a light that is infinitely far away and has this irradiance \[W·m⁻²\]. It starts at `place` of a disc as
    /// wide as the scene.
    fn distant_photon(&self, towards: Vec3A, irradiance: Vec3, place: Vec2, share: f32) -> EmittedPhoton {
        let disc_area = std::f32::consts::PI * self.radius * self.radius;
        let flux = irradiance * (disc_area * share);
        let (x, y) = frame(towards.into());
        let on_disc = concentric_disc(place) * self.radius;
        let origin = self.center + towards * (self.radius * 1.01) + Vec3A::from(x * on_disc.x + y * on_disc.y);
        EmittedPhoton { origin, direction: -towards, flux, from_moving: false, distant: true }
    }

    /// One of the lights close by with the chance that `which` (0…1) gives it, half by power and half evenly; and all lights
    /// that are infinitely far away.
    pub(crate) fn some_lights(&self, which: f32) -> impl Iterator<Item = (usize, f64)> + use<> {
        let near = self.near_lights();
        let power: f64 = (0..near).map(|light| self.choice.probability(light)).sum();
        let count = near as f64;
        let chance = |light: usize| {
            0.5 / count + if power > 0.0 { 0.5 * self.choice.probability(light) / power } else { 0.5 / count }
        };
        let (mut left, mut chosen) = (f64::from(which), None);
        for light in 0..near {
            chosen = Some((light, chance(light)));
            left -= chance(light);
            if left < 0.0 {
                break;
            }
        }
        chosen.into_iter().chain((near..self.powers.len()).map(|light| (light, 1.0)))
    }

    /// How `light` lights a place with this position and unit normal, by a point or direction drawn with two pairs of numbers in
    /// 0…1; `None` if it does not.
    pub(crate) fn towards(
        &self,
        surfaces: &Surfaces,
        light: usize,
        (position, normal): (Vec3A, Vec3A),
        (place, way): (Vec2, Vec2),
    ) -> Option<SeenLight> {
        let e = self.emitters;
        let facing = |towards: Vec3A| Some(towards.dot(normal)).filter(|cosine| *cosine > 0.0);
        let (towards, irradiance) = match self.lights[light] {
            LightId::Area(index) => {
                let area = &e.areas[index];
                let sample = area.sample(surfaces, area.point(f64::from(way.x), place), way.y, Detail::Point);
                let (distance, towards) =
                    ((sample.position - position).length(), (sample.position - position).try_normalize()?);
                let cosines = facing(towards)? * sample.normal.dot(-towards).max(0.0);
                // Bounded, as a point close by would outshine all others.
                let irradiance = sample.intensity * cosines / (distance * distance + area.area / std::f32::consts::PI);
                return Some(SeenLight { irradiance, towards, end: Some(sample.position), start: Vec4::ZERO });
            }
            LightId::Point(index) => {
                let point = &e.points[index];
                let way = point.position - position;
                let towards = way.try_normalize()?;
                let least = (1e-3 * self.radius).powi(2);
                let irradiance =
                    point.intensity_towards(position) * (facing(towards)? / (way.length_squared() + least));
                return Some(SeenLight { irradiance, towards, end: Some(point.position), start: Vec4::ZERO });
            }
            LightId::Sun(index) => (e.suns[index].direction(way), e.suns[index].irradiance),
            LightId::Sky => drawn_from(self.sky(), way),
        };

        // The inverse of the way that a photon starts.
        let irradiance = irradiance * facing(towards)?;
        let (x, y) = frame(towards.into());
        let to = position - self.center;
        let on_disc = Vec2::new(to.dot(x.into()), to.dot(y.into())) / self.radius;
        let place = disc_to_square(on_disc).clamp(Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON));
        let start = Vec4::new(place.x, place.y, way.x, way.y);
        Some(SeenLight { irradiance, towards, end: None, start })
    }
}

/// A direction towards the sky, drawn with `way`, and the irradiance from it \[W·m⁻²\].
fn drawn_from(sky: &Environment, way: Vec2) -> (Vec3A, Vec3) {
    let SkySample { direction, pdf } = sky.sample(way);
    (direction.into(), sky.radiance(direction) / pdf)
}
