//! Point and spot lights, which have no size.

use super::emission::{Ball, EmittedPhoton, Facing, PhotonEmitter, SeenLight, Space, Start};
use super::receiver::ShadingPoint;
use super::sampled::{Brdf, Lamp, Sampled, Source, Traced};
use super::tile::{ReceiverTile, bits};
use crate::accel::{PACKET, Shadows};
use crate::sampling::{frame, uniform_sphere};
use crate::scene::{PunctualKind, PunctualLight};
use glam::{Vec2, Vec3, Vec3A, Vec4};
use std::any::Any;
use std::f32::consts::{PI, TAU};

/// Point or spot light at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position of the light \[m\].
    pub position: Vec3A,
    /// Axis of a spot light, a unit vector.
    pub axis: Vec3A,
    /// Intensity along the axis \[W·sr⁻¹\].
    pub intensity: Vec3,
    /// Shape of the emission: all directions, or the cone of a spot light.
    pub kind: PunctualKind,
    /// Whether the light ever moves.
    pub moves: bool,
}

impl PointLight {
    pub(super) fn new(light: &PunctualLight, position: Vec3A, axis: Vec3A, moves: bool) -> Self {
        Self { position, axis, intensity: light.color, kind: light.kind, moves }
    }

    /// Returns the intensity towards `point` \[W·sr⁻¹\].
    #[must_use]
    pub fn intensity_towards(&self, point: Vec3A) -> Vec3 {
        let direction = (point - self.position).normalize_or_zero();
        self.intensity * self.kind.falloff(direction.dot(self.axis))
    }
}

/// Returns the solid angle in which full intensity emits the flux of a light of this `kind` \[sr\].
fn cone_solid_angle(kind: PunctualKind) -> f32 {
    match kind {
        PunctualKind::Spot { outer, .. } => {
            let steps = 256;
            let outer_cos = outer.cos();
            let step = (1.0 - outer_cos) / steps as f32;
            let sum: f32 = (0..steps).map(|i| kind.falloff(outer_cos + (i as f32 + 0.5) * step)).sum();
            TAU * sum * step
        }
        _ => 4.0 * PI,
    }
}

impl PhotonEmitter for PointLight {
    fn power(&self, _: &Ball) -> Vec3 {
        self.intensity * cone_solid_angle(self.kind)
    }

    fn emit(&self, _: Space, Start { way, .. }: Start, share: f32) -> EmittedPhoton {
        // Sample the cone of a spot uniformly. The falloff becomes the weight of the photon.
        let solid_angle = cone_solid_angle(self.kind);
        let (direction, weight) = match self.kind {
            PunctualKind::Spot { outer, .. } => {
                let cos = 1.0 - way.x * (1.0 - outer.cos());
                let (x, y) = frame(self.axis.into());
                let (sin, angle) = ((1.0 - cos * cos).max(0.0).sqrt(), TAU * way.y);
                let direction = x * (sin * angle.cos()) + y * (sin * angle.sin()) + Vec3::from(self.axis) * cos;
                let cap = TAU * (1.0 - outer.cos());
                (direction, self.kind.falloff(cos) * cap / solid_angle)
            }
            _ => (uniform_sphere(way), 1.0),
        };
        let flux = self.intensity * (solid_angle * weight * share);
        let direction = direction.normalize().into();
        EmittedPhoton { origin: self.position, direction, flux, from_moving: self.moves, distant: false }
    }

    fn towards(&self, Space { ball, .. }: Space, at: Facing, _: [Vec2; 2]) -> Option<SeenLight> {
        let way = self.position - at.position;
        let towards = way.try_normalize()?;
        // The squared distance is bounded, otherwise a nearby point would outshine all other points.
        let least = (1e-3 * ball.radius).powi(2);
        let irradiance = self.intensity_towards(at.position) * (at.cosine(towards)? / (way.length_squared() + least));
        Some(SeenLight { irradiance, towards, end: Some(self.position), start: Vec4::ZERO })
    }
}

impl Sampled for PointLight {
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]) {
        // E = I(ω) cos θ / r² if unoccluded.
        let mut given = [Vec3::ZERO; PACKET];
        let mut active = 0;
        for (i, receiver) in tile.receivers().iter().enumerate() {
            let (cos, r2) = receiver.cosine_to(self.position);
            given[i] = self.intensity_towards(receiver.position) * (cos / r2.max(f32::MIN_POSITIVE));
            active |= u64::from(given[i] != Vec3::ZERO) << i;
        }

        // Trace shadow rays to the lit receivers.
        let hidden = tile.hidden(self.position, active, &tile.shafts(&[self.position]));
        bits(active & !hidden.whole).for_each(|i| sums[i] += given[i] * hidden.share(i));
    }

    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3> {
        // L = f I(ω) cos θ / r²
        let (cos, r2) = receiver.cosine_to(self.position);
        let towards = (self.position - receiver.position).try_normalize();
        let Some(towards) = towards.filter(|_| cos > 0.0) else { return Traced::default() };
        let given = brdf(towards, 0.0) * self.intensity_towards(receiver.position) * (cos / r2);

        // Outside a spot's cone or a mirror's highlight, no light arrives, so no shadow ray is needed.
        if given == Vec3::ZERO {
            return Traced::default();
        }
        Traced { value: given * shadows.visible(receiver.position, self.position), shadow_rays: 1 }
    }

    fn source(&self) -> Source {
        Source::Lamp { low: self.position, high: self.position }
    }

    fn lamp(&self) -> Lamp {
        Lamp::At(self.position)
    }

    fn is_same(&self, other: &dyn Sampled) -> bool {
        (other as &dyn Any).downcast_ref() == Some(self)
    }
}
