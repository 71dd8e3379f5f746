//! Photons at transparent surfaces: they are reflected or refracted, and leave no light on glass.

use crate::bsdf::{Bsdf, SurfaceLobes};
use crate::luminance;
use crate::surface::Surface;
use glam::{Vec2, Vec3, Vec3A};

/// Direction in which a photon leaves glass.
pub(super) struct Passage {
    /// Unit vector in world space.
    pub direction: Vec3,
    /// Linear RGB factor on the photon's flux, with the survival probability divided out.
    pub weight: Vec3,
}

/// Chooses between the glass and the opaque fraction of a surface, for a number in 0…1. Returns the lobes of the glass.
pub(super) fn glass(surface: &Surface, choice: f32) -> Option<Box<SurfaceLobes>> {
    let mut lobes = surface.lobes.clone().filter(|lobes| choice < lobes.glass.factor)?;
    lobes.glass.factor = 1.0;
    Some(lobes)
}

/// Draws the direction in which a photon from the unit `direction` leaves glass, or `None` if the glass absorbs it.
///
/// `came` is the distance from the previous surface \[m\]. The three numbers are in 0…1. Flux is not scaled by the
/// index of refraction, unlike radiance.
pub(super) fn pass(
    surface: &Surface,
    lobes: &SurfaceLobes,
    direction: Vec3A,
    came: f32,
    [choice, u, v]: [f32; 3],
) -> Option<Passage> {
    let axes = lobes.axes(surface.shading_normal.into());
    let eta = lobes.eta(surface.front);
    let outgoing = Vec3::from_array(axes.map(|axis| -axis.dot(direction.into())));
    let bsdf = Bsdf::layered(lobes, axes, eta);
    // The volume that the photon leaves has attenuated its flux.
    let is_inside = !surface.front && !lobes.glass.is_thin;
    let left = if is_inside { (lobes.glass.attenuation * -came).exp() } else { Vec3::ONE };

    // Choose between light that passes straight and all other lobes.
    let straight = bsdf.straight(outgoing.z);
    let (through, rest) = (luminance(straight), luminance(bsdf.directional_albedo(outgoing.z) - straight));
    let share = through / (through + rest.max(0.0)).max(f32::MIN_POSITIVE);
    let (direction, weight) = if choice < share {
        (direction.into(), straight / share)
    } else {
        let drawn = bsdf.sample(outgoing, (choice - share) / (1.0 - share), Vec2::new(u, v))?;
        let [x, y, z] = axes;
        let next = (x * drawn.direction.x + y * drawn.direction.y + z * drawn.direction.z).normalize();
        let is_refracted = drawn.direction.z < 0.0;
        // The triangle and the shading normal must agree about the side.
        if (Vec3A::from(next).dot(surface.geometric_normal) < 0.0) != is_refracted {
            return None;
        }
        let scale = if is_refracted && !lobes.glass.is_thin { eta * eta } else { 1.0 };
        (next, drawn.weight * (scale / (1.0 - share)))
    };
    Some(Passage { direction, weight: weight * left })
}
