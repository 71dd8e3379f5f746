//! Transparent volumes that contain a ray.
//!
//! Files define neither the order of nested volumes nor their priority, and surfaces of a liquid and its glass may
//! overlap. The volume that a path entered last contains it: a surface of another volume inside it has no effect.

use crate::bsdf::GlassLobe;
use glam::Vec3;

/// Transparent volumes that a ray has entered and not left, in order.
#[derive(Clone, Debug, Default)]
pub struct Media {
    inside: Vec<Medium>,
}

#[derive(Clone, Copy, Debug)]
struct Medium {
    instance: u32,
    ior: f32,
    attenuation: Vec3,
}

/// Index of refraction outside all volumes.
const AIR: f32 = 1.0;

impl Media {
    /// Returns the fraction of light that the current volume transmits over a `distance` \[m\].
    #[must_use]
    pub fn transmittance(&self, distance: f32) -> Vec3 {
        match self.inside.last() {
            Some(medium) if medium.attenuation != Vec3::ZERO => (medium.attenuation * -distance).exp(),
            _ => Vec3::ONE,
        }
    }

    /// Returns the index of refraction on the far side of a surface of `instance` divided by the index on the near
    /// side, or `None` if the surface has no effect. `ior` is the index of the instance's interior.
    #[must_use]
    pub fn eta(&self, instance: u32, is_front: bool, ior: f32) -> Option<f32> {
        if is_front {
            return Some(ior / self.inside.last().map_or(AIR, |medium| medium.ior));
        }
        match self.inside.iter().rposition(|medium| medium.instance == instance) {
            // Paths that start inside a volume have not entered it.
            None => Some(self.inside.last().map_or(AIR, |medium| medium.ior) / ior),
            Some(place) if place + 1 < self.inside.len() => None,
            Some(place) => Some(place.checked_sub(1).map_or(AIR, |below| self.inside[below].ior) / ior),
        }
    }

    /// Records that the path has crossed a surface of `instance`.
    pub fn cross(&mut self, instance: u32, is_front: bool, glass: &GlassLobe, ior: f32) {
        if is_front {
            self.inside.push(Medium { instance, ior, attenuation: glass.attenuation });
        } else if let Some(place) = self.inside.iter().rposition(|medium| medium.instance == instance) {
            self.inside.remove(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A path into glass and into the water that overlaps it refracts at the water's surface, and the glass has no
    /// effect inside the water.
    #[test]
    fn the_last_volume_contains_the_path() {
        let mut media = Media::default();
        assert_eq!(media.eta(0, true, 1.5), Some(1.5));
        media.cross(0, true, &GlassLobe::of_ior(1.5), 1.5);
        assert_eq!(media.eta(1, true, 1.33), Some(1.33 / 1.5));
        media.cross(1, true, &GlassLobe::of_ior(1.33), 1.33);
        // The inner side of the glass is inside the water.
        assert_eq!(media.eta(0, false, 1.5), None);
        media.cross(0, false, &GlassLobe::of_ior(1.5), 1.5);
        assert_eq!(media.eta(1, false, 1.33), Some(1.0 / 1.33));
        media.cross(1, false, &GlassLobe::of_ior(1.33), 1.33);
        assert_eq!(media.transmittance(1.0), Vec3::ONE);
        // A path that starts in the glass leaves into air.
        assert_eq!(media.eta(0, false, 1.5), Some(1.0 / 1.5));
    }
}
