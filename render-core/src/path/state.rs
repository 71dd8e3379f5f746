//! State of a path between two surfaces.

use super::hue::Hue;
use super::vertex::{Points, Vertex};
use crate::accel::Hit;
use crate::bsdf::{BsdfSample, GlassLobe};
use crate::luminance;
use crate::media::Media;
use crate::surface::Surface;
use glam::{Vec3, Vec3A};

/// Maximum probability of survival in Russian roulette. It is below 1, so that paths end even in a room with white
/// walls. At reflectances above the square root of this probability, 0.995, the variance is unbounded.
const HIGHEST_SURVIVAL: f32 = 0.99;
/// Maximum probability of passing a clear wall, and of not passing it, if both are possible.
const LIKELIEST: f32 = 0.95;

/// Ray of a path, and the light that the path carries.
pub(super) struct PathState {
    pub(super) origin: Vec3A,
    /// Direction of the ray, a unit vector.
    pub(super) direction: Vec3A,
    pub(super) throughput: Vec3,
    /// Density of the direction at the last vertex; `None` at the camera, because no other strategy samples lights
    /// there.
    pub(super) drawn: Option<f32>,
    /// Distance from the last vertex, through clear walls \[m\].
    pub(super) since_vertex: f32,
    /// Number of vertices.
    pub(super) bounces: u32,
    pub(super) media: Media,
    /// Color of the path after dispersive glass.
    hue: Option<Hue>,
    /// Product of η² over all refractions. Radiance has the inverse factor, which Russian roulette ignores.
    spread: f32,
}

/// Media on both sides of a surface.
pub(super) struct Interface {
    /// Index of refraction on the far side divided by the index on the near side.
    pub(super) eta: f32,
    /// Index of refraction of the volume, for the path's color.
    ior: f32,
}

impl PathState {
    /// Starts a path with a ray of the camera.
    pub(super) fn new(origin: Vec3A, direction: Vec3A) -> Self {
        Self {
            origin,
            direction,
            throughput: Vec3::ONE,
            drawn: None,
            since_vertex: 0.0,
            bounces: 0,
            media: Media::default(),
            hue: None,
            spread: 1.0,
        }
    }

    /// Moves to a surface at a `distance` \[m\]. The current volume attenuates the path's light.
    pub(super) fn advance(&mut self, distance: f32) {
        self.throughput *= self.media.transmittance(distance);
        self.since_vertex += distance;
    }

    /// Returns the media on both sides of a surface, or `None` if the path passes the surface without effect.
    pub(super) fn interface(&mut self, hit: &Hit, surface: &Surface, points: &mut Points) -> Option<Interface> {
        let Some(glass) = volume(surface) else { return Some(Interface { eta: 1.0, ior: 1.0 }) };
        // Choose one color for all refractions of the path.
        if glass.dispersion > 0.0 && self.hue.is_none() {
            let hue = Hue::new(points.next());
            self.throughput *= hue.weight();
            self.hue = Some(hue);
        }
        let ior = self.hue.map_or(glass.ior, |hue| hue.ior(glass));
        match self.media.eta(hit.instance, surface.front, ior) {
            Some(eta) => Some(Interface { eta, ior }),
            None => {
                self.media.cross(hit.instance, surface.front, glass, ior);
                None
            }
        }
    }

    /// Continues straight from `origin` on the far side of a surface.
    pub(super) fn pass(&mut self, origin: Vec3A) {
        self.origin = origin;
    }

    /// Passes a clear wall with a probability according to its transmittance, and returns whether it did. The rest of
    /// the wall's light is reflected.
    pub(super) fn passes_wall(&mut self, vertex: &Vertex, points: &mut Points) -> bool {
        let straight = vertex.bsdf.straight(vertex.outgoing.z);
        if straight == Vec3::ZERO {
            return false;
        }
        let rest = luminance(vertex.bsdf.directional_albedo(vertex.outgoing.z) - straight).max(0.0);
        let share = luminance(straight) / (luminance(straight) + rest);
        let probability = share.clamp(1.0 - LIKELIEST, LIKELIEST);
        if points.next().x >= probability {
            self.throughput /= 1.0 - probability;
            return false;
        }
        self.throughput *= straight / probability;
        self.pass(vertex.far_side());
        true
    }

    /// Leaves a vertex in a `direction` drawn from its BSDF.
    pub(super) fn reflect(&mut self, vertex: &Vertex, direction: Vec3A, drawn: &BsdfSample) {
        self.origin = vertex.origin(direction);
        self.direction = direction;
        self.throughput *= drawn.weight;
        self.drawn = Some(drawn.pdf);
        self.since_vertex = 0.0;
        self.bounces += 1;
    }

    /// Records that the path was refracted at a surface.
    pub(super) fn cross(&mut self, hit: &Hit, surface: &Surface, interface: &Interface) {
        if let Some(glass) = volume(surface) {
            self.media.cross(hit.instance, surface.front, glass, interface.ior);
            self.spread *= interface.eta * interface.eta;
        }
    }

    /// Decides by Russian roulette whether the path goes on, given a number in 0…1.
    pub(super) fn survives(&mut self, number: f32) -> bool {
        let throughput = self.throughput * self.spread;
        let survival = luminance(throughput).max(throughput.max_element() / 2.0).min(HIGHEST_SURVIVAL);
        self.throughput /= survival;
        number < survival
    }
}

/// Returns the glass of a surface that bounds a volume.
fn volume(surface: &Surface) -> Option<&GlassLobe> {
    surface.lobes.as_ref().map(|lobes| &lobes.glass).filter(|glass| glass.factor > 0.0 && !glass.is_thin)
}
