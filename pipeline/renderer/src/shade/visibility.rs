//! Rays of indirect light: between receivers and lamps, and to what is around.

use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use lighttree::Light;
use render_core::sampling::{centered_sobol, concentric_disc, frame};
use render_core::{Accelerator, GatherDirections, Gathered, Hit, PACKET, PixelSurface, PosedScene, ShadingPoint};

/// Rays of a final gather. With as many, films of `cornell` and `nave` at 256×256 came no less near to paths when anchors were
/// softened over eight shares and more of the light was left to these rays.
pub(crate) const GATHER_RAYS: usize = 64;

/// Rays that feel how open a pixel is. On `nave` 8 leave a tenth more error than 16 and need one record in a hundred more, 12 leave
/// one in a hundred more; in a simulation, 32 leave 3 % less than 16.
const FEELERS: usize = 16;

/// Rays in the scene of a frame, cast by many threads at once.
pub(crate) struct Visibility<'a> {
    frame: &'a Frame<'a>,
    /// Directions of a final gather.
    directions: GatherDirections,
    /// Cosine-distributed about +z.
    feelers: [Vec3; FEELERS],
}

impl<'a> Visibility<'a> {
    /// In the scene of `frame`, with `gather_rays` to a final gather.
    pub fn new(frame: &'a Frame, gather_rays: usize) -> Self {
        // A point of the unit disc, moved up onto the hemisphere, is cosine-distributed.
        let mut feelers = [Vec3::Z; FEELERS];
        for (feeler, u) in feelers.iter_mut().zip(centered_sobol(FEELERS)) {
            let p = concentric_disc(u);
            *feeler = p.extend((1.0 - p.length_squared()).max(0.0).sqrt());
        }
        Self { frame, directions: GatherDirections::new(gather_rays), feelers }
    }

    /// Whether light from `lamp` arrives at `receiver`.
    #[inline]
    pub fn sees(&self, receiver: &ShadingPoint, lamp: &Light) -> bool {
        sees(&self.frame.accelerator, receiver, lamp)
    }

    /// Finds, among the first [`PACKET`] `lamps` whose bits are set in `active`, those whose light arrives from their `place`.
    pub fn seen_among<T>(&self, receiver: &ShadingPoint, lamps: &[T], place: impl Fn(&T) -> Vec3A, active: u64) -> u64 {
        if active == 0 {
            return 0;
        }
        // Lamps below the surface get no ray.
        let mut ends = [Vec3A::ZERO; PACKET];
        let mut above = 0;
        for (i, (end, lamp)) in ends.iter_mut().zip(lamps).enumerate() {
            *end = place(lamp);
            above |= u64::from(is_above(receiver, *end)) << i;
        }
        // All others share their origin: one packet.
        let active = active & above;
        active & !self.frame.accelerator.hidden_lamps(receiver.position, &ends[..lamps.len()], active)
    }

    /// Finds, among the `receivers` whose bits are set in `active`, those that light from `lamp` arrives at; `positions` are theirs.
    pub fn lit_among<'r>(
        &self,
        lamp: &Light,
        receivers: impl Iterator<Item = &'r ShadingPoint>,
        positions: &[Vec3A],
        active: u64,
    ) -> u64 {
        let place = Vec3A::from(lamp.position);
        let mut above = 0;
        for (k, receiver) in receivers.enumerate() {
            above |= u64::from(is_above(receiver, place)) << k;
        }
        // Rays from the light share their origin: one packet.
        let active = active & above;
        active & !self.frame.accelerator.lamp_hidden(place, positions, active)
    }

    /// Final gather at `receiver`; `key` turns its rays.
    pub fn final_gather(&self, receiver: &ShadingPoint, key: u64) -> Gathered {
        let Frame { accelerator, surfaces, gather, .. } = self.frame;
        gather.gather(PosedScene::new(accelerator, surfaces), receiver, &self.directions, key)
    }

    /// Mean of d / (d + `scale`) for the distances d of the surfaces around, 0 for those that `encloses` names; the same
    /// directions about the same normal.
    pub fn openness(&self, receiver: &ShadingPoint, scale: f32, encloses: impl Fn(&Hit, Vec3A) -> bool) -> f32 {
        let (mut sum, mut count) = (0.0, 0);
        for (direction, met) in self.felt(receiver) {
            sum += match met {
                None => 1.0,
                Some(hit) if encloses(&hit, direction) => 0.0,
                Some(hit) => hit.distance / (hit.distance + scale),
            };
            count += 1;
        }
        if count == 0 { 1.0 } else { sum / count as f32 }
    }

    /// Directions around `receiver`, and the surface that a ray meets in each; the same about the same normal.
    pub fn felt(&self, receiver: &ShadingPoint) -> impl Iterator<Item = (Vec3A, Option<Hit>)> {
        let normal = Vec3::from(receiver.normal);
        let (x, y) = frame(normal);
        let &ShadingPoint { position, geometric_normal, .. } = receiver;
        let around = self.feelers.iter().map(move |local| Vec3A::from(x * local.x + y * local.y + normal * local.z));
        // Smooth normals lean: directions below the triangle itself feel nothing.
        let above = around.filter(move |direction| direction.dot(geometric_normal) > 0.0);
        above.map(move |direction| (direction, self.frame.accelerator.closest(position, direction)))
    }
}

/// Whether light from `lamp` arrives at `receiver`.
#[inline]
pub(super) fn sees(accelerator: &Accelerator, receiver: &ShadingPoint, lamp: &Light) -> bool {
    let lamp = Vec3A::from(lamp.position);
    is_above(receiver, lamp) && !accelerator.hides_lamp(lamp, receiver.position)
}

/// A light below the triangle's own plane is hidden by it, whatever the smooth normal says.
#[inline]
fn is_above(receiver: &ShadingPoint, lamp: Vec3A) -> bool {
    receiver.geometric_normal.dot(lamp - receiver.position) > 0.0
}

/// The place of a pixel's surface where rays start.
pub(super) fn receiver(pixel: &PixelSurface, epsilon: f32) -> ShadingPoint {
    let normals = [pixel.shading_normal.into(), pixel.geometric_normal.into()];
    ShadingPoint::off_surface(pixel.position.into(), normals, epsilon)
}
