//! Error measure for groups of records in structure-of-arrays layout, which suits vector instructions.

use super::Vec3A;
use super::illumination::Site;
use super::picture::ShownSurface;
use super::tolerance::{ACROSS, NORMAL_TOLERANCE, OPENNESS_TOLERANCE};
use lanes::{Kernel, LANES, Lanes};

/// Parameters of the error measure for [`LANES`] records.
pub(super) struct RecordGroup {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    inverse_radius2: [f32; LANES],
    carrier: [u32; LANES],
    openness: [f32; LANES],
}

impl RecordGroup {
    /// Group of empty lanes, infinitely far from every pixel.
    pub const NOWHERE: Self = Self {
        position: [[1e18; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        inverse_radius2: [1.0; LANES],
        carrier: [0; LANES],
        openness: [0.0; LANES],
    };

    /// Returns e² of each record at a pixel:
    ///
    /// ```text
    /// e² = (|d|² + k² (d · n̄)²) / R² + (1 − n · nᵢ) / c + (o − oᵢ)² / t²
    ///   d  offset from the record        n̄  mean of the two normals        k  ACROSS     c  NORMAL_TOLERANCE
    ///   o  openness                                                                   t  OPENNESS_TOLERANCE
    /// ```
    #[inline(always)]
    fn error2(&self, shown: &ShownSurface) -> [f32; LANES] {
        let (p, n) = (shown.position().to_array(), shown.normal().to_array());
        let mut error2 = [0.0; LANES];
        // Compute |d|², d · (n + nᵢ) = 2 d · n̄, and n · nᵢ.
        for (k, error2) in error2.iter_mut().enumerate() {
            let (mut d2, mut along, mut cosine) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let d = p[axis] - self.position[axis][k];
                d2 += d * d;
                along += d * (n[axis] + self.normal[axis][k]);
                cosine += n[axis] * self.normal[axis][k];
            }
            // Add 2 to e² for a record on another instance, so that it has no weight.
            let other = if self.carrier[k] == shown.carrier { 0.0 } else { 2.0 };
            let opener = (shown.openness - self.openness[k]) * (1.0 / OPENNESS_TOLERANCE);
            *error2 = (d2 + ACROSS * ACROSS / 4.0 * along * along) * self.inverse_radius2[k]
                + (1.0 - cosine) * (1.0 / NORMAL_TOLERANCE)
                + opener * opener
                + other;
        }
        error2
    }
}

/// Returns the weight of a record for an error measure of `error2` = e².
#[inline(always)]
pub(super) fn weight(error2: f32) -> f32 {
    let rest = (1.0 - error2).max(0.0);
    rest * rest
}

/// Returns the weight at `to` of a record at `from` with this `radius`. It is comparable with
/// [`Tile::weights`](super::tile::Tile::weights).
pub(super) fn weight_between(from: &Site, radius: f32, to: &Site) -> f32 {
    let mut group = RecordGroup::NOWHERE;
    group.set(0, from, radius);
    weight(group.error2(&to.into())[0])
}

impl RecordGroup {
    /// Returns the squared distance of each record from `position` \[m²\].
    #[inline(always)]
    fn distance2(&self, position: [f32; 3]) -> [f32; LANES] {
        let mut distance2 = [0.0; LANES];
        for (axis, place) in self.position.iter().zip(position) {
            for (d2, at) in distance2.iter_mut().zip(axis) {
                let d = at - place;
                *d2 += d * d;
            }
        }
        distance2
    }

    pub fn set(&mut self, lane: usize, site: &Site, radius: f32) {
        for axis in 0..3 {
            self.position[axis][lane] = site.position[axis];
            self.normal[axis][lane] = site.normal[axis];
        }
        self.inverse_radius2[lane] = 1.0 / (radius * radius).max(f32::MIN_POSITIVE);
        self.carrier[lane] = site.carrier;
        self.openness[lane] = site.openness;
    }

    pub fn clear(&mut self, lane: usize) {
        for axis in 0..3 {
            self.position[axis][lane] = Self::NOWHERE.position[axis][lane];
        }
        self.inverse_radius2[lane] = Self::NOWHERE.inverse_radius2[lane];
    }
}

// The following loops over candidates are kernels although they use no vector types. Compiled for the processor's
// vector instructions, they take half the time.

/// Kernel of [`Tile::weights`](super::tile::Tile::weights).
pub(super) struct Weigh<'a> {
    pub groups: &'a [RecordGroup],
    pub shown: &'a ShownSurface,
    pub weights: &'a mut Vec<(usize, f32)>,
}

impl Kernel for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (g, group) in self.groups.iter().enumerate() {
            // Compute weights only for e² < 1, because most groups contain no record with a weight.
            let error2 = group.error2(self.shown);
            let mut bits = below(&error2, 1.0);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize % LANES;
                bits &= bits - 1;
                self.weights.push((g * LANES + lane, weight(error2[lane])));
            }
        }
    }
}

/// Kernel of [`Tile::is_covered`](super::tile::Tile::is_covered).
pub(super) struct SumUpTo<'a> {
    pub groups: &'a [RecordGroup],
    pub shown: &'a ShownSurface,
    pub enough: f32,
}

impl Kernel for SumUpTo<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> bool {
        let mut sum = 0.0;
        for group in self.groups {
            let error2 = group.error2(self.shown);
            // Sum all lanes without a branch per lane: lanes with e² ≥ 1 add 0.
            if below(&error2, 1.0) != 0 {
                for e in error2 {
                    sum += weight(e);
                }
                if sum >= self.enough {
                    return true;
                }
            }
        }
        false
    }
}

/// Factor on compared squared distances, because callers may round differently.
pub(super) const ROUNDING: f32 = 1.0001;

/// Kernel of [`Tile::candidates_near`](super::tile::Tile::candidates_near).
pub(super) struct NearRecords<'a> {
    pub groups: &'a [RecordGroup],
    pub candidates: &'a [u32],
    pub position: Vec3A,
    pub reach2: f32,
    pub near: &'a mut Vec<u32>,
}

impl Kernel for NearRecords<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let position = self.position.to_array();
        for (group, candidates) in self.groups.iter().zip(self.candidates.chunks(LANES)) {
            // Select the records within reach. Unused lanes are infinitely far away.
            let mut bits = below(&group.distance2(position), self.reach2);
            while bits != 0 {
                self.near.push(candidates[bits.trailing_zeros() as usize % LANES]);
                bits &= bits - 1;
            }
        }
    }
}

/// Kernel of [`Tile::candidates_in_use`](super::tile::Tile::candidates_in_use) for one group. `all` is the mask of the
/// group's used lanes.
pub(super) struct InUse<'a> {
    pub group: &'a RecordGroup,
    pub shown: &'a [ShownSurface],
    pub all: u32,
}

impl Kernel for InUse<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> u32 {
        let mut used = 0;
        for shown in self.shown {
            // Stop when all records of the group are in use.
            used |= below(&self.group.error2(shown), 1.0);
            if used & self.all == self.all {
                break;
            }
        }
        used & self.all
    }
}

/// Returns the mask of the lanes with values below `most`.
#[inline(always)]
fn below(values: &[f32; LANES], most: f32) -> u32 {
    let mut bits = 0;
    for (lane, &value) in values.iter().enumerate() {
        bits |= u32::from(value < most) << lane;
    }
    bits
}
