//! Values of a ray that are computed before the first box or triangle test.

use glam::Vec3A;

/// Minimum magnitude of a direction component. It replaces smaller components, because rays within a plane would
/// otherwise compute 0 · ∞. Over the length of a scene (2⁷ units, see [`super`]) the displacement is below any rounding
/// error.
pub(super) const LEAST_COMPONENT: f32 = 1e-20;

/// Factor on the distances to the far planes of boxes. The product is never shorter than the exact distance (Ize 2013,
/// section 3: three roundings each way).
pub(super) const LENGTHENING: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Octant and main axis of a direction. All rays of a packet have the same octant and main axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Octant {
    /// Bits 0…2: signs of x, y and z (1 = negative). Bits 3…4: index of the largest component.
    code: u8,
}

impl Octant {
    #[inline(always)]
    pub(super) fn of(direction: Vec3A) -> Self {
        // Choose the largest component as the main axis; ties go to the earlier axis.
        let [x, y, z] = direction.abs().to_array();
        let most = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        Self { code: direction.is_negative_bitmask() as u8 & 7 | most << 3 }
    }

    #[inline(always)]
    pub(super) fn goes_down(self, axis: usize) -> bool {
        self.code >> axis & 1 == 1
    }

    /// Returns the indices of the planes of a [`super::tree::WideNode`] that a ray crosses first, by axis.
    #[inline(always)]
    pub(super) fn near_planes(self) -> [usize; 3] {
        std::array::from_fn(|axis| axis + if self.goes_down(axis) { 3 } else { 0 })
    }

    /// Returns the axes in cyclic order, with the main axis last.
    #[inline(always)]
    pub(super) fn axes(self) -> [usize; 3] {
        Self::axes_of(usize::from(self.code >> 3))
    }

    /// Returns the axes in cyclic order, with axis `main` last.
    #[inline(always)]
    pub(super) fn axes_of(main: usize) -> [usize; 3] {
        match main {
            0 => [1, 2, 0],
            1 => [2, 0, 1],
            _ => [0, 1, 2],
        }
    }
}

/// Single ray with precomputed values.
pub(super) struct Ray {
    pub(super) origin: Vec3A,
    /// Reciprocals of the direction's components.
    pub(super) inverse_near: [f32; 3],
    /// `inverse_near` times [`LENGTHENING`].
    pub(super) inverse_far: [f32; 3],
    /// Result of [`Octant::near_planes`].
    pub(super) near_plane: [usize; 3],
    /// Result of [`Octant::axes`].
    pub(super) axes: [usize; 3],
    /// Shear that maps the direction to the last of `axes` with length 1 (Woop, Benthin & Wald 2013). It contains the
    /// ratios of the first two components to the last, and 1 / the last component.
    pub(super) shear: [f32; 3],
}

impl Ray {
    #[inline(always)]
    pub(super) fn new(origin: Vec3A, direction: Vec3A) -> Self {
        let octant = Octant::of(direction);
        let components = direction.to_array();
        // Replace tiny components, so that no inverse is infinite.
        let inverse_near =
            components.map(|x| 1.0 / if x.abs() < LEAST_COMPONENT { LEAST_COMPONENT.copysign(x) } else { x });
        let axes = octant.axes();
        // Compute the shear of the watertight triangle test.
        let along = inverse_near[axes[2]];
        Self {
            origin,
            inverse_near,
            inverse_far: inverse_near.map(|x| x * LENGTHENING),
            near_plane: octant.near_planes(),
            axes,
            shear: [components[axes[0]] * along, components[axes[1]] * along, along],
        }
    }
}
