//! Rays of indirect light: shadow rays between receivers and lamps, and rays into the surroundings.

use crate::frame::Frame;
use glam::{Vec3, Vec3A};
use lighttree::Light;
use render_core::sampling::{centered_sobol, concentric_disc, frame};
use render_core::{Accelerator, GatherDirections, Gathered, Hit, PACKET, PixelSurface, PosedScene, ShadingPoint};

/// Number of rays per final gather. It suffices even if clamping leaves more light to the rays: with anchors softened
/// over eight shares, films of `cornell` and `nave` at 256×256 deviate no more from path tracing.
pub(crate) const GATHER_RAYS: usize = 64;

/// Number of rays that measure the openness around a pixel. On `nave`, 8 rays leave 10 % more error than 16 rays and
/// need 1 % more records; 12 rays leave 1 % more error. In a simulation, 32 rays leave 3 % less error than 16.
const FEELERS: usize = 16;

/// Rays in the scene of a frame, for use by several threads.
pub(crate) struct Visibility<'a> {
    frame: &'a Frame<'a>,
    /// Directions of the rays of a final gather.
    directions: GatherDirections,
    /// Cosine-distributed directions around +z.
    feelers: [Vec3; FEELERS],
}

impl<'a> Visibility<'a> {
    /// Creates rays in the scene of `frame`, with `gather_rays` rays per final gather.
    pub fn new(frame: &'a Frame, gather_rays: usize) -> Self {
        // Project evenly distributed points of the unit disc to the hemisphere: the directions are cosine-distributed.
        let mut feelers = [Vec3::Z; FEELERS];
        for (feeler, u) in feelers.iter_mut().zip(centered_sobol(FEELERS)) {
            let p = concentric_disc(u);
            *feeler = p.extend((1.0 - p.length_squared()).max(0.0).sqrt());
        }
        Self { frame, directions: GatherDirections::new(gather_rays), feelers }
    }

    /// Returns whether light from `lamp` reaches `receiver`.
    #[inline]
    pub fn sees(&self, receiver: &ShadingPoint, lamp: &Light) -> bool {
        sees(&self.frame.accelerator, receiver, lamp)
    }

    /// Returns the bits in `active` of the `lamps` visible from `receiver`, for at most [`PACKET`] lamps. `place`
    /// returns the position of a lamp.
    pub fn seen_among<T>(&self, receiver: &ShadingPoint, lamps: &[T], place: impl Fn(&T) -> Vec3A, active: u64) -> u64 {
        if active == 0 {
            return 0;
        }
        // Omit lamps below the surface: they need no ray.
        let mut ends = [Vec3A::ZERO; PACKET];
        let mut above = 0;
        for (i, (end, lamp)) in ends.iter_mut().zip(lamps).enumerate() {
            *end = place(lamp);
            above |= u64::from(is_above(receiver, *end)) << i;
        }
        // Trace the other rays as one packet: they share their origin.
        let active = active & above;
        active & !self.frame.accelerator.hidden_lamps(receiver.position, &ends[..lamps.len()], active)
    }

    /// Returns the bits in `active` of the `receivers` that light from `lamp` reaches. `positions` contains the
    /// position of each receiver.
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
        // Trace rays from the lamp as one packet: they share their origin.
        let active = active & above;
        active & !self.frame.accelerator.lamp_hidden(place, positions, active)
    }

    /// Traces a final gather at `receiver`. `key` determines the rotation of the rays.
    pub fn final_gather(&self, receiver: &ShadingPoint, key: u64) -> Gathered {
        let Frame { accelerator, surfaces, gather, .. } = self.frame;
        gather.gather(PosedScene::new(accelerator, surfaces), receiver, &self.directions, key)
    }

    /// Returns the mean of d / (d + `scale`), where d is the distance of surrounding surfaces \[m\], or 0 if `encloses`
    /// is true. Equal normals lead to equal directions.
    pub fn openness(&self, receiver: &ShadingPoint, scale: f32, encloses: impl Fn(&Hit, Vec3A) -> bool) -> f32 {
        let (mut sum, mut count) = (0.0, 0);
        for (direction, met) in self.felt(receiver) {
            // Count a miss as infinitely far, and an enclosing surface as touching.
            sum += match met {
                None => 1.0,
                Some(hit) if encloses(&hit, direction) => 0.0,
                Some(hit) => hit.distance / (hit.distance + scale),
            };
            count += 1;
        }
        if count == 0 { 1.0 } else { sum / count as f32 }
    }

    /// Returns directions around `receiver`, each with the nearest hit. Equal normals lead to equal directions.
    pub fn felt(&self, receiver: &ShadingPoint) -> impl Iterator<Item = (Vec3A, Option<Hit>)> {
        let normal = Vec3::from(receiver.normal);
        let (x, y) = frame(normal);
        let &ShadingPoint { position, geometric_normal, .. } = receiver;
        let around = self.feelers.iter().map(move |local| Vec3A::from(x * local.x + y * local.y + normal * local.z));
        // Omit directions below the triangle itself: smooth normals are tilted.
        let above = around.filter(move |direction| direction.dot(geometric_normal) > 0.0);
        above.map(move |direction| (direction, self.frame.accelerator.closest(position, direction)))
    }
}

/// Returns whether light from `lamp` reaches `receiver`.
#[inline]
pub(super) fn sees(accelerator: &Accelerator, receiver: &ShadingPoint, lamp: &Light) -> bool {
    let lamp = Vec3A::from(lamp.position);
    is_above(receiver, lamp) && !accelerator.hides_lamp(lamp, receiver.position)
}

/// Returns whether a lamp is above the plane of the triangle. Below it, the triangle hides the lamp for any smooth
/// normal.
#[inline]
fn is_above(receiver: &ShadingPoint, lamp: Vec3A) -> bool {
    receiver.geometric_normal.dot(lamp - receiver.position) > 0.0
}

/// Returns the origin of rays from a pixel's surface.
pub(super) fn receiver(pixel: &PixelSurface, epsilon: f32) -> ShadingPoint {
    let normals = [pixel.shading_normal.into(), pixel.geometric_normal.into()];
    ShadingPoint::off_surface(pixel.position.into(), normals, epsilon)
}
