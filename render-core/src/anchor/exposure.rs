//! Which places of a surface light can leave at all.
//!
//! Much of the area of a modelled scene is out of reach: the floor under a column, a wall behind its moulding, the outside
//! of a shell. An anchor there would take its share of the energy that photons leave around it, and never give it back.

use super::{Anchor, Anchors};
use crate::Units;
use crate::accel::Accelerator;
use crate::sampling::{cosine_hemisphere, sobol_point};
use crate::scene::Scene;
use crate::surface::Surfaces;
use rayon::prelude::*;

/// Rays that look out from a place.
const LOOKS: u64 = 32;
/// A place is exposed if at least one in so many of them gets out.
const ONE_IN: usize = 8;
/// A ray gets out if it goes at least this far, in units of the side of an anchor's share: it is nearer things that stand
/// between an anchor and the neighbours it shares energy with.
const NEAR: f32 = 0.1;

impl Anchors {
    /// As [`Anchors::spread`], over the exposed parts of what stands still: as many of the `fixed` anchors as can be, each
    /// standing for the same share of them.
    pub fn spread_exposed(
        scene: &Scene,
        surfaces: &Surfaces,
        accelerator: &Accelerator,
        units: &Units,
        fixed: usize,
        carried: usize,
    ) -> Self {
        let first = Self::spread(scene, surfaces, units, fixed, carried).only_exposed(surfaces, accelerator);
        if first.fixed.len() == fixed || first.fixed.is_empty() {
            return first;
        }
        // The share that is exposed is known now: so many more anchors, and about the number asked for remains.
        let more = (fixed as f64 * fixed as f64 / first.fixed.len() as f64).round() as usize;
        Self::spread(scene, surfaces, units, more, carried).only_exposed(surfaces, accelerator)
    }

    fn only_exposed(mut self, surfaces: &Surfaces, accelerator: &Accelerator) -> Self {
        let near = NEAR * self.area_share.sqrt();
        let exposed: Vec<bool> =
            self.fixed.par_iter().map(|anchor| is_exposed(anchor, surfaces, accelerator, near)).collect();
        let mut exposed = exposed.into_iter();
        self.fixed.retain(|_| exposed.next().unwrap_or(true));
        self
    }
}

/// Whether enough of the rays from `anchor` go farther than `near` and end in the open or on a side that reflects.
fn is_exposed(anchor: &Anchor, surfaces: &Surfaces, accelerator: &Accelerator, near: f32) -> bool {
    let gets_out = |index: &u64| {
        let direction = cosine_hemisphere(anchor.normal.into(), sobol_point(*index)).into();
        let Some(hit) = accelerator.closest(anchor.position, direction) else { return true };
        let surface = surfaces.at(&hit, direction, 0.0);
        hit.distance >= near && (surface.front || surface.double_sided)
    };
    (0..LOOKS).filter(gets_out).count() * ONE_IN >= LOOKS as usize
}
