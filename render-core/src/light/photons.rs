//! Photon emission by all lights, and sampling of light that arrives at given points.

use super::emission::{Ball, EmittedPhoton, Facing, PhotonEmitter, SeenLight, Space, Start};
use super::emitters::Emitters;
use crate::luminance;
use crate::sampling::Distribution;
use crate::scene::Scene;
use crate::surface::Surfaces;
use glam::{Vec2, Vec3};

/// Source of photons that selects lights with probability proportional to power.
pub struct PhotonSource<'a> {
    lights: Vec<&'a dyn PhotonEmitter>,
    /// Flux of each light \[W\].
    powers: Vec<Vec3>,
    choice: Distribution,
    ball: Ball,
}

impl std::fmt::Debug for PhotonSource<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("PhotonSource").field("powers", &self.powers).finish_non_exhaustive()
    }
}

impl Emitters {
    /// Builds a source of photons. Identical lights produce identical photons. Returns `None` if no light emits.
    pub fn photons<'a>(&'a self, scene: &'a Scene) -> Option<PhotonSource<'a>> {
        let (lights, ball) = (self.emissions(scene.sky.as_ref()), self.ball);
        let powers: Vec<Vec3> = lights.iter().map(|light| light.power(&ball)).collect();
        let choice = Distribution::new(powers.iter().map(|&power| f64::from(luminance(power))))?;
        Some(PhotonSource { lights, powers, choice, ball })
    }
}

impl PhotonSource<'_> {
    /// Returns the radiant flux of each light \[W\].
    #[must_use]
    pub fn powers(&self) -> &[Vec3] {
        &self.powers
    }

    /// Returns the distribution of lights by power.
    pub(crate) fn choice(&self) -> &Distribution {
        &self.choice
    }

    /// Returns the number of lights that are not distant. These lights are first in the list.
    pub(crate) fn near_lights(&self) -> usize {
        self.lights.iter().filter(|light| !light.is_distant()).count()
    }

    /// Returns the photon with this start, one of `count` photons.
    pub(crate) fn emit(&self, surfaces: &Surfaces, start: Start, count: u64) -> EmittedPhoton {
        let share = 1.0 / (start.density * count as f32);
        self.lights[start.light].emit(Space { surfaces, ball: self.ball }, start, share)
    }

    /// Returns one near light, chosen by `which` (0…1), and all distant lights, each with its probability. The
    /// probability of the near light is the mean of a distribution by power and a uniform one. Distant lights have
    /// probability 1.
    pub(crate) fn some_lights(&self, which: f32) -> impl Iterator<Item = (usize, f64)> + use<> {
        // Mix both distributions, so that faint lights close to a receiver are drawn often enough.
        let near = self.near_lights();
        let power: f64 = (0..near).map(|light| self.choice.probability(light)).sum();
        let count = near as f64;
        let chance = |light: usize| {
            0.5 / count + if power > 0.0 { 0.5 * self.choice.probability(light) / power } else { 0.5 / count }
        };

        // Invert the cumulative distribution. Rounding may leave the last light.
        let (mut left, mut chosen) = (f64::from(which), None);
        for light in 0..near {
            chosen = Some((light, chance(light)));
            left -= chance(light);
            if left < 0.0 {
                break;
            }
        }

        chosen.into_iter().chain((near..self.lights.len()).map(|light| (light, 1.0)))
    }

    /// Returns the light at a point from the light with index `light`. `drawn` contains two pairs of numbers in 0…1:
    /// `place` and `way` of a start. Returns `None` if no light arrives.
    pub(crate) fn towards(&self, surfaces: &Surfaces, light: usize, at: Facing, drawn: [Vec2; 2]) -> Option<SeenLight> {
        self.lights[light].towards(Space { surfaces, ball: self.ball }, at, drawn)
    }
}
