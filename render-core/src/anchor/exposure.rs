//! Exposure of surface points: whether light can leave a point, and how far it travels.
//!
//! Many surfaces of a modeled scene are enclosed: the floor under a column, a wall behind its molding, the outside of a
//! shell. An anchor on an enclosed surface would receive energy of photons around it and lose this energy.

use super::{Anchor, Anchors, Shares};
use crate::accel::Accelerator;
use crate::ranks::{Ranks, portable, share_blocks};
use crate::sampling::{centered_sobol, cosine_hemisphere, hash_unit};
use crate::surface::Surfaces;
use glam::Vec2;
use std::f32::consts::PI;

/// Maximum ratio of all rays to free rays at an exposed point.
const ONE_IN: u64 = 8;

/// Distribution of the lengths of cosine-distributed rays from a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Outlook {
    /// Fraction of light from beyond the range of the geometry term's bound s: mean of r² / (r² + s) over rays of
    /// length r.
    pub openness: f32,
    /// Whether a sufficient fraction of the rays is free.
    pub exposed: bool,
    /// Number of rays traced.
    rays: u8,
    /// Histogram of ray lengths with [`OCTAVES`] octaves per bin. The last bin counts rays without a hit.
    lengths: [u8; BINS],
}

portable!(Outlook { openness, exposed, rays, lengths });

/// Number of points whose rays are traced together.
const AT_ONCE: usize = 64;
/// Number of bins in a histogram of ray lengths.
const BINS: usize = 12;
/// Width of a bin in octaves of distance.
const OCTAVES: f32 = 2.0;
/// log₂ of the minimum length in the second bin, in kernel radii of surfels. The free rays of an exposed surfel are at
/// least four times as long.
const FIRST: f32 = -6.0;
/// Weight of light from a distance at which no ray of a point ends, as a fraction of the rays.
const UNLIKELY: f32 = 1.0 / 256.0;

impl Outlook {
    /// Returns the bin of a `length`, in kernel radii of surfels. The kernel radius is the radius of a disc with the
    /// area of an anchor.
    #[inline]
    pub fn bin(length: f32) -> usize {
        // Casts map negative values to 0 and infinity to the maximum.
        (((length.log2() - FIRST) / OCTAVES + 1.0) as usize).min(BINS - 1)
    }

    /// Returns an unnormalized likelihood of light from about the distance of `bin`: the number of rays in this bin and
    /// its neighbors. The likelihood is never zero.
    #[inline]
    pub fn likelihood_of(&self, bin: usize) -> f32 {
        // Include the adjacent bins, because single bins contain few rays.
        let about = &self.lengths[bin.saturating_sub(1)..(bin + 2).min(BINS)];
        about.iter().map(|&rays| f32::from(rays)).sum::<f32>() + UNLIKELY * f32::from(self.rays)
    }
}

/// Returns the exposed points among `places`, with their `outlooks`.
pub(super) fn exposed(places: &[Anchor], outlooks: Vec<Outlook>) -> (Vec<Anchor>, Vec<Outlook>) {
    let (mut kept, mut seen) = (Vec::new(), Vec::new());
    for (&place, outlook) in places.iter().zip(outlooks) {
        if outlook.exposed {
            kept.push(place);
            seen.push(outlook);
        }
    }
    (kept, seen)
}

/// Ray tracing settings for exposure measurements.
pub(super) struct Eye<'a> {
    pub surfaces: &'a Surfaces<'a>,
    pub accelerator: &'a Accelerator,
    /// Area shares of the anchors.
    pub shares: Shares,
    /// Bound of the anchors' geometry term \[m²\].
    pub bound: f32,
    /// Minimum length of a free ray, as a multiple of the side of an area share.
    pub near: f32,
    /// Number of rays per point.
    pub rays: u8,
}

impl<'a> Eye<'a> {
    /// Creates the settings for `rays` rays from each point, with distances relevant to `anchors`. A ray is free if it
    /// is longer than `near` times the side of an anchor's area share.
    pub fn of(
        anchors: &Anchors,
        surfaces: &'a Surfaces<'a>,
        accelerator: &'a Accelerator,
        near: f32,
        rays: u8,
    ) -> Self {
        let (shares, bound) = (anchors.shares(), anchors.geometry_term_bound(true));
        Self { surfaces, accelerator, shares, bound, near, rays }
    }

    /// Measures the outlooks from `places`; the `ranks` share the rays.
    pub fn outlooks(&self, places: &[Anchor], ranks: &dyn Ranks) -> Vec<Outlook> {
        share_blocks(ranks, places.len(), AT_ONCE, |index| self.outlook(&places[index], index as u64)).value
    }

    /// Measures the outlook from `place`. `index` determines a rotation of the rays. Rays that hit a back side count
    /// as blocked, because back sides reflect no light.
    fn outlook(&self, place: &Anchor, index: u64) -> Outlook {
        // Compute the radius of the disc with an anchor's area. All points use one ray pattern with different
        // rotations.
        let side = self.shares.at(place.position).sqrt();
        let (near, radius) = (self.near * side, side / PI.sqrt());
        let turn = hash_unit(index, 0, 0);
        let (mut found, mut out, mut openness) = (Outlook { rays: self.rays, ..Outlook::default() }, 0, 0.0);
        for u in centered_sobol(self.rays.into()) {
            let direction = cosine_hemisphere(place.normal.into(), Vec2::new(u.x, (u.y + turn).fract())).into();
            // Count a ray without a hit as free. Exclude a ray that hits a back side, for example inside a shell.
            let (length, reflects) = match self.accelerator.closest(place.position, direction) {
                None => (f32::INFINITY, true),
                Some(hit) => (hit.distance, !self.surfaces.meet(&hit, direction, 0.0).is_back()),
            };

            // Compute o as the mean of 1 / (1 + s / r²) = r² / (r² + s). An infinite r counts as 1.
            if reflects {
                out += u64::from(length >= near);
                openness += 1.0 / (1.0 + self.bound / (length * length));
                found.lengths[Outlook::bin(length / radius)] += 1;
            }
        }

        // Mark a point as exposed if at least one ray in eight is free.
        found.openness = openness / f32::from(self.rays);
        found.exposed = out * ONE_IN >= u64::from(self.rays);
        found
    }
}
