//! Nodes of the tree, one cache line each.

use glam::Vec3;

use crate::bounds::Cone;
use crate::light::{DIRECTIONAL, Light, StoredSite};

/// A cluster of lights in one cache line.
///
/// Node 0 is the root. The two children of a node are adjacent, at an odd index and the following even index. They
/// always follow their parent, so a pass over the array from its end visits children before parents.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Smallest corner of the box of positions \[m\], or of the unit directions to directional lights.
    pub low: Vec3,
    /// Index of the child with the same representative, or 0 in a leaf.
    pub representative_child: u32,
    pub high: Vec3,
    /// Index of the representative light. A leaf's representative is its only light.
    pub representative: u32,
    /// Cone of emission axes: axis, cosine and sine of its half-angle. The cosine is −1 for all directions and
    /// [`DIRECTIONAL`] for directional lights.
    pub axis: Vec3,
    pub cone_cosine: f32,
    /// Sum of the intensities of the cluster's lights.
    pub intensity: Vec3,
    pub cone_sine: f32,
}

impl Node {
    /// A leaf without a light.
    pub const BLANK: Self = Self {
        low: Vec3::ZERO,
        representative_child: 0,
        high: Vec3::ZERO,
        representative: 0,
        axis: Vec3::Z,
        cone_cosine: 1.0,
        intensity: Vec3::ZERO,
        cone_sine: 0.0,
    };

    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.representative_child == 0
    }

    /// Index of the first child. The second child follows the first.
    #[inline]
    pub fn children(&self) -> usize {
        first_of_pair(self.representative_child as usize)
    }

    /// Returns whether the lights of this node are directional.
    #[inline]
    pub fn is_directional(&self) -> bool {
        self.cone_cosine == DIRECTIONAL
    }

    /// Sets the bounds of a leaf to the position and axis of its light.
    pub fn set_light(&mut self, light: &Light) {
        let site = StoredSite::new(light);
        (self.low, self.high, self.intensity) = (site.position, site.position, light.intensity);
        (self.axis, self.cone_cosine, self.cone_sine) = (site.axis, site.kind, 0.0);
    }

    pub fn set_cone(&mut self, cone: Cone) {
        let (sine, cosine) = cone.half_angle.sin_cos();
        self.axis = cone.axis.as_vec3();
        self.cone_cosine = if cone.half_angle >= std::f64::consts::PI { -1.0 } else { cosine as f32 };
        self.cone_sine = (sine as f32).max(0.0);
    }
}

/// Returns the index of the first child in the pair that contains `child`.
#[inline]
pub(crate) fn first_of_pair(child: usize) -> usize {
    (child - 1) | 1
}

/// Returns the index of the other child in the pair.
#[inline]
pub(crate) fn sibling(child: usize) -> usize {
    ((child - 1) ^ 1) + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_a_cache_line() {
        assert_eq!((size_of::<Node>(), align_of::<Node>()), (64, 64));
    }

    #[test]
    fn pairs() {
        assert_eq!([1, 2, 3, 4, 5].map(first_of_pair), [1, 1, 3, 3, 5]);
        assert_eq!([1, 2, 3, 4].map(sibling), [2, 1, 4, 3]);
    }
}
