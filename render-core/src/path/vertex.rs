//! Surface on a path, and the random numbers of a path.

use crate::bsdf::Bsdf;
use crate::sampling::{frame, hash, owen_sobol_point};
use crate::surface::Surface;
use glam::{Vec2, Vec3, Vec3A};

/// Random numbers of one sample, as pairs. Each pair comes from a separate scrambled sequence.
pub(super) struct Points {
    pub(super) key: u64,
    pub(super) index: u32,
    pub(super) dimension: u64,
}

impl Points {
    pub(super) fn next(&mut self) -> Vec2 {
        self.dimension += 1;
        owen_sobol_point(self.index, hash(self.key, self.dimension, 0))
    }
}

/// Surface on a path, with its reflection.
pub(super) struct Vertex {
    /// Position slightly off the near side of the surface \[m\].
    pub(super) position: Vec3A,
    pub(super) geometric_normal: Vec3A,
    /// Offset of rays from the surface \[m\].
    epsilon: f32,
    /// World-space axes of the shading frame. The z axis is the normal.
    pub(super) axes: [Vec3; 3],
    /// Direction towards the previous vertex, in the shading frame.
    pub(super) outgoing: Vec3,
    pub(super) bsdf: Bsdf,
}

impl Vertex {
    /// Builds the vertex of a surface hit by a ray in the unit `direction`. `eta` is the index of refraction on the far
    /// side divided by the index on the near side.
    pub(super) fn new(surface: &Surface, direction: Vec3A, eta: f32, epsilon: f32) -> Self {
        // The BSDF is evaluated in the shading frame.
        let normal = Vec3::from(surface.shading_normal);
        let (axes, bsdf) = match &surface.lobes {
            None => {
                let (x, y) = frame(normal);
                ([x, y, normal], Bsdf::new(surface.albedo, surface.specular, surface.roughness))
            }
            Some(lobes) => {
                let axes = lobes.axes(normal);
                (axes, Bsdf::layered(lobes, axes, eta))
            }
        };
        Self {
            position: surface.position + surface.geometric_normal * epsilon,
            geometric_normal: surface.geometric_normal,
            epsilon,
            axes,
            outgoing: vector_in(axes, -Vec3::from(direction)),
            bsdf,
        }
    }

    /// Returns the origin of rays on the side of the surface where `direction` points \[m\].
    pub(super) fn origin(&self, direction: Vec3A) -> Vec3A {
        if self.is_above(direction) { self.position } else { self.far_side() }
    }

    /// Returns the position slightly off the far side of the surface \[m\].
    pub(super) fn far_side(&self) -> Vec3A {
        self.position - self.geometric_normal * (2.0 * self.epsilon)
    }

    /// Returns whether a direction points to the near side of the triangle's plane.
    pub(super) fn is_above(&self, direction: Vec3A) -> bool {
        self.geometric_normal.dot(direction) > 0.0
    }

    /// Returns BSDF times cosine, and the sampling density, for light from the unit `direction`. Both are zero if the
    /// triangle and the shading normal disagree about the side of the direction.
    pub(super) fn reflect(&self, direction: Vec3A) -> (Vec3, f32) {
        let above = self.is_above(direction);
        if !above && !self.bsdf.transmits() {
            return (Vec3::ZERO, 0.0);
        }
        let incoming = vector_in(self.axes, direction.into());
        if (incoming.z > 0.0) != above {
            return (Vec3::ZERO, 0.0);
        }
        (self.bsdf.evaluate(self.outgoing, incoming) * incoming.z.abs(), self.bsdf.pdf(self.outgoing, incoming))
    }
}

/// Returns the components of `v` along orthonormal axes.
fn vector_in(axes: [Vec3; 3], v: Vec3) -> Vec3 {
    Vec3::from_array(axes.map(|axis| axis.dot(v)))
}

/// Returns the weight of a sample with density `a`, if another strategy draws the same sample with density `b`.
pub(super) fn power_heuristic(a: f32, b: f32) -> f32 {
    // The squared densities of narrow lobes exceed the range of f32, but their ratio does not.
    if a <= 0.0 {
        return 0.0;
    }
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}
