//! Exposure: places of a surface that light can leave, and how far it gets from there.
//!
//! Much of the area of a modeled scene is out of reach: the floor under a column, a wall behind its molding, the outside
//! of a shell. An anchor there would take its share of the energy that photons leave around it, and lose that.

use super::{Anchor, Anchors, Shares};
use crate::accel::Accelerator;
use crate::sampling::{centered_sobol, cosine_hemisphere, hash_unit};
use crate::surface::Surfaces;
use glam::Vec2;
use rayon::prelude::*;
use std::f32::consts::PI;

/// A place is exposed if at least one ray in this number gets out.
const ONE_IN: u64 = 8;

/// How far light gets from a point, by cosine-distributed rays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Outlook {
    /// Share of the rays beyond the reach of the geometry term's bound s: mean of r² / (r² + s).
    pub openness: f32,
    /// Whether enough of them get out.
    pub exposed: bool,
    /// Number of rays.
    rays: u8,
    /// Rays by length, [`OCTAVES`] to a bin; the last holds those that meet nothing.
    lengths: [u8; BINS],
}

const BINS: usize = 12;
/// Octaves of distance in a bin.
const OCTAVES: f32 = 2.0;
/// log₂ of the length from which on the second bin begins, in radii of a kernel of surfels: no surfel is exposed that does not
/// see four times as far.
const FIRST: f32 = -6.0;
/// Weight of light that came as far as none of the rays of a place go, as a share of them.
const UNLIKELY: f32 = 1.0 / 256.0;

impl Outlook {
    /// The bin of a length, in radii of a kernel of surfels: that of the disc that an anchor stands for.
    #[inline]
    pub fn bin(length: f32) -> usize {
        // Negative values become 0; infinity the last.
        (((length.log2() - FIRST) / OCTAVES + 1.0) as usize).min(BINS - 1)
    }

    /// How likely light arrives from about as far as `bin` says, up to a factor: the rays of this bin and those beside it,
    /// and never zero.
    #[inline]
    pub fn likelihood_of(&self, bin: usize) -> f32 {
        // Few rays fill a bin by chance. With those beside it the count is smoother.
        let about = &self.lengths[bin.saturating_sub(1)..(bin + 2).min(BINS)];
        about.iter().map(|&rays| f32::from(rays)).sum::<f32>() + UNLIKELY * f32::from(self.rays)
    }
}

/// Those of `places` that are exposed by their `outlooks`, and these.
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

/// Rays that measure how exposed a point is.
pub(super) struct Eye<'a> {
    pub surfaces: &'a Surfaces<'a>,
    pub accelerator: &'a Accelerator,
    /// Shares of the anchors.
    pub shares: Shares,
    /// Bound of the anchors' geometry term \[m²\].
    pub bound: f32,
    /// How far rays have to go to get out, in sides.
    pub near: f32,
    /// Rays from a place.
    pub rays: u8,
}

impl<'a> Eye<'a> {
    /// Measures by `rays` rays from each point, over the distances that matter to `anchors`. A ray gets out if it is longer than
    /// `near` times the side of an anchor's share.
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

    pub fn outlooks(&self, places: &[Anchor]) -> Vec<Outlook> {
        places.par_iter().enumerate().map(|(index, place)| self.outlook(place, index as u64)).collect()
    }

    /// The outlook from `place`, by rays turned by an angle that follows from `index`. What ends on a side that does not
    /// reflect is lost.
    fn outlook(&self, place: &Anchor, index: u64) -> Outlook {
        // The radius is that of a disc of an anchor's share. All places have the same rays, each turned by an angle of its own.
        let side = self.shares.at(place.position).sqrt();
        let (near, radius) = (self.near * side, side / PI.sqrt());
        let turn = hash_unit(index, 0, 0);
        let (mut found, mut out, mut openness) = (Outlook { rays: self.rays, ..Outlook::default() }, 0, 0.0);
        for u in centered_sobol(self.rays.into()) {
            let direction = cosine_hemisphere(place.normal.into(), Vec2::new(u.x, (u.y + turn).fract())).into();
            // A ray that meets nothing gets out. One that meets a back side, as within a shell, does not.
            let (length, reflects) = match self.accelerator.closest(place.position, direction) {
                None => (f32::INFINITY, true),
                Some(hit) => (hit.distance, !self.surfaces.meet(&hit, direction, 0.0).is_back()),
            };

            // o = mean of 1 / (1 + s / r²), which is that of r² / (r² + s). An infinite r counts as 1.
            if reflects {
                out += u64::from(length >= near);
                openness += 1.0 / (1.0 + self.bound / (length * length));
                found.lengths[Outlook::bin(length / radius)] += 1;
            }
        }

        // Exposed is a place that at least one ray in eight leaves.
        found.openness = openness / f32::from(self.rays);
        found.exposed = out * ONE_IN >= u64::from(self.rays);
        found
    }
}
