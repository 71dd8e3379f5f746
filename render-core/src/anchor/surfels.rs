//! Surfels: the receivers of photon energy.
//!
//! Anchors are few, because each anchor is a light. Light varies on a finer scale: at the edge of a sunlit patch, in
//! the fold of a molding, in the gap above a lamp. Photon energy is therefore distributed among surfels, which are
//! denser:
//!
//! ```text
//! Φ_a = Σ Φ_j · o_j / o_a                    sum over the surfels j that anchor a owns
//! L_j = Σ w_jk Φ_k / (π Σ w_jk A_k)          radiance around surfel j, from the surfels k around it
//!   o     fraction of light that leaves the neighborhood: mean of r² / (r² + s) over rays of length r
//!   s     bound of the geometry term
//!   w_jk  kernel            A_k  area from which surfel k receives photons, Σ_i A_i w_ik
//! ```
//!
//! Anchors light distant surfaces; nearby surfaces use the surfels directly ([`crate::gather`]). The ratio o_j / o_a
//! accounts for light trapped in folds and gaps. Without it, an anchor outside a fold would emit this light.

mod moved;

use super::exposure::{Eye, Outlook, exposed};
use super::grid::{LEAST_COSINE, SplatScratch, Spot, kernel_radius};
use super::{Anchor, Anchors, DynamicAnchor, Grid, Patches, Shares, Sight, Zones};
use crate::PosedScene;
use crate::Units;
use crate::ranks::{Alone, Ranks, portable, share_blocks};
use crate::surface::Surfaces;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::Arc;

use moved::Movable;
pub use moved::Moved;

/// Number of surfels per anchor. The expected number of surfels in a kernel is eight, which is the area of two anchors.
///
/// With 40 000 anchors, 8 surfels per anchor take twice the memory of 4. They do not bring pictures of Sponza, a
/// conference room and an office closer to path tracing. With 2, FLIP is a tenth to a fifth larger.
const PER_ANCHOR: f32 = 4.0;
/// Maximum ratio of the light of an anchor to the light of a surfel, if the anchor is deeper in a fold.
const MOST_RATIO: f32 = 2.0;
/// Minimum length of a ray from a surfel that counts as free, as a multiple of the side of an anchor's area share. It
/// is the value for anchors, scaled to the smaller area of surfels.
const NEAR: f32 = 0.03;

/// Number of rays that measure the exposure of a surfel. Eight suffice because kernels average over eight surfels.
const OUTLOOK_RAYS: u8 = 8;

/// The surfels of a scene.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Surfels {
    /// Surfels of static surfaces.
    pub fixed: Arc<SurfelMap>,
    dynamic: Vec<DynamicAnchor>,
    dynamic_area_share: f32,
    dynamic_owners: Vec<Owner>,
}

/// Surfels at a given time.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SurfelMap {
    grid: Grid,
    owners: Vec<Owner>,
    /// First entry of each surfel in `around`, and the total number of entries at the end.
    first: Vec<u32>,
    /// Neighboring surfels, and their contributions to the radiance per unit of flux \[m⁻²·sr⁻¹\].
    around: Vec<(u32, f32)>,
    /// A_k of each surfel k \[m²\].
    areas: Vec<f32>,
    /// Area A_i of each surfel i, by position \[m²\].
    shares: Shares,
    /// Surfels near the paths of moving geometry, if any.
    movable: Option<Arc<Movable>>,
}

/// Positions of surfels, and the outlook from each position if measured.
#[derive(Clone, Copy)]
struct SurfelPoints<'a> {
    points: &'a [Anchor],
    outlooks: &'a [Outlook],
}

/// Visibility tests whose rays several ranks share.
#[derive(Clone, Copy)]
struct SharedSight<'a> {
    sight: &'a Sight<'a>,
    ranks: &'a dyn Ranks,
}

/// Number of surfels that a thread processes together.
const AT_ONCE: usize = 64;

/// Anchor that emits the energy of a surfel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Owner {
    anchor: Option<u32>,
    /// Factor on the surfel's energy.
    share: f32,
}

portable!(Owner { anchor, share });

impl Surfels {
    /// Creates surfels on the surfaces of `anchors`, all assumed to be open.
    pub fn of(anchors: &Anchors, surfaces: &Surfaces, units: &Units) -> Self {
        let points = Self::points(surfaces, units, anchors);
        let surfels = SurfelPoints { points: &points, outlooks: &[] };
        let owners = Self::owners(anchors, surfels, &[], None, &Alone);
        let fixed = SurfelMap::new(surfels, owners, shares(anchors), false, None);
        Self::with_dynamic(fixed, anchors, surfaces, units)
    }

    /// Creates surfels on the exposed surfaces. `outlooks` are the outlooks of the fixed anchors. Adds anchors in rooms
    /// without anchors. The `ranks` share the rays.
    pub fn of_exposed(
        anchors: &mut Anchors,
        outlooks: &[Outlook],
        PosedScene { accelerator, surfaces }: PosedScene,
        units: &Units,
        ranks: &dyn Ranks,
    ) -> Self {
        // Drop enclosed surfels: they would receive energy of photons around them and lose it.
        let points = Self::points(surfaces, units, anchors);
        let eye = Eye::of(anchors, surfaces, accelerator, NEAR, OUTLOOK_RAYS);
        let seen = eye.outlooks(&points, ranks);
        let (points, seen) = exposed(&points, seen);
        let surfels = SurfelPoints { points: &points, outlooks: &seen };

        // Restrict owners and distribution to one room: a surfel and its owner must not be separated by walls.
        let sight = Some(&Sight { accelerator, epsilon: units.epsilon });
        let mut owners = Self::owners(anchors, surfels, outlooks, sight, ranks);
        add_anchors(&mut owners, surfels, anchors, &Sight { accelerator, epsilon: units.epsilon });
        let fixed =
            SurfelMap::new(surfels, owners, shares(anchors), false, sight.map(|sight| SharedSight { sight, ranks }));
        Self::with_dynamic(fixed, anchors, surfaces, units)
    }

    /// Distributes points over static surfaces. Returns no points if the scene has no anchors.
    fn points(surfaces: &Surfaces, units: &Units, anchors: &Anchors) -> Vec<Anchor> {
        let Some(patches) = Patches::of(surfaces, false, &anchors.zones).filter(|_| !anchors.fixed.is_empty()) else {
            return Vec::new();
        };
        let count = (PER_ANCHOR * patches.area() / anchors.area_share).round() as usize;
        patches.spread(count, units).iter().map(|point| point.in_world(surfaces)).collect()
    }

    /// Finds the owners of fixed `surfels`. `seen_by_anchors` are the outlooks of the anchors.
    fn owners(
        anchors: &Anchors,
        surfels: SurfelPoints,
        seen_by_anchors: &[Outlook],
        sight: Option<&Sight>,
        ranks: &dyn Ranks,
    ) -> Vec<Owner> {
        let grid = Grid::new(&anchors.fixed, &[], anchors.shares());
        let SurfelPoints { points, outlooks } = surfels;
        let owner = |j: usize| Owner::of(&points[j], openness(outlooks, j), &grid, seen_by_anchors, sight);
        share_blocks(ranks, points.len(), AT_ONCE, owner).value
    }

    /// Combines the `fixed` surfels with new surfels on moving or deforming surfaces.
    fn with_dynamic(fixed: SurfelMap, anchors: &Anchors, surfaces: &Surfaces, units: &Units) -> Self {
        // Distribute points over the moving surfaces if these have anchors.
        let count = (PER_ANCHOR * anchors.dynamic.len() as f32) as usize;
        let patches = Patches::of(surfaces, true, &Zones::default()).filter(|_| !anchors.dynamic.is_empty());
        let dynamic = patches.map_or(Vec::new(), |patches| patches.spread(count, units));

        // Select the best anchor on the surfel's instance as owner. It stays the owner, because both move with the
        // surface.
        let grid = Grid::new(&anchors.dynamic_in_world(surfaces), &[], anchors.dynamic_area_share);
        let mut dynamic_owners = Vec::with_capacity(dynamic.len());
        for point in &dynamic {
            let anchor = grid.best(&Spot::of(&point.in_world(surfaces), true), None, |_| 1.0);
            dynamic_owners.push(Owner { anchor: anchor.map(|a| a as u32), share: 1.0 });
        }
        let dynamic_area_share = anchors.dynamic_area_share / PER_ANCHOR;
        Self { fixed: Arc::new(fixed), dynamic, dynamic_area_share, dynamic_owners }
    }

    /// Returns the surfels of moving surfaces at the pose of `surfaces`.
    pub fn dynamic_in_world(&self, surfaces: &Surfaces) -> SurfelMap {
        let points: Vec<Anchor> = self.dynamic.iter().map(|point| point.in_world(surfaces)).collect();
        let surfels = SurfelPoints { points: &points, outlooks: &[] };
        SurfelMap::new(surfels, self.dynamic_owners.clone(), self.dynamic_area_share.into(), true, None)
    }
}

/// Returns the area shares of the fixed surfels.
fn shares(anchors: &Anchors) -> Shares {
    Shares::new(anchors.area_share / PER_ANCHOR, &anchors.zones)
}

/// Returns the openness o of point i; 1 if not measured.
fn openness(outlooks: &[Outlook], i: usize) -> f32 {
    outlooks.get(i).map_or(1.0, |outlook| outlook.openness)
}

/// Creates anchors at surfels without a visible anchor nearby, for example in a room smaller than an anchor's area
/// share.
fn add_anchors(owners: &mut [Owner], surfels: SurfelPoints, anchors: &mut Anchors, sight: &Sight) {
    let SurfelPoints { points, outlooks } = surfels;
    let radius_in_zone_0 = kernel_radius(anchors.area_share);
    // List the surfels that became anchors, with the indices of these anchors.
    let mut added: Vec<(usize, usize)> = Vec::new();
    for (j, (owner, point)) in owners.iter_mut().zip(points).enumerate() {
        if owner.anchor.is_some() {
            continue;
        }

        // Try the anchors added earlier, which may be in the same room.
        let spot = Spot::of(point, false);
        let radius = radius_in_zone_0 * anchors.zones.scale(point.position);
        let is_near = |(surfel, _): &&(usize, usize)| {
            let other = &points[*surfel];
            let is_seen = || sight.hidden(spot.position, spot.normal, std::slice::from_ref(other), radius) == 0;
            spot.is_beside(other, radius) && is_seen()
        };
        let (surfel, anchor) = added.iter().find(is_near).copied().unwrap_or_else(|| {
            anchors.fixed.push(*point);
            added.push((j, anchors.fixed.len() - 1));
            (j, anchors.fixed.len() - 1)
        });
        *owner = Owner::with_openness(anchor, openness(outlooks, j), openness(outlooks, surfel));
    }
}

impl Owner {
    /// Selects the owner in `grid` for a surfel at `point` with openness `own`.
    fn of(point: &Anchor, own: f32, grid: &Grid, seen_by_anchors: &[Outlook], sight: Option<&Sight>) -> Self {
        // Prefer an anchor with the surfel's openness to an anchor deep in a fold nearby.
        let rating = |a: usize| (openness(seen_by_anchors, a) / own.max(f32::MIN_POSITIVE)).min(1.0);
        let anchor = grid.best(&Spot::of(point, false), sight, rating);

        let nobody = Self { anchor: None, share: 0.0 };
        anchor.map_or(nobody, |a| Self::with_openness(a, own, openness(seen_by_anchors, a)))
    }

    /// Creates the owner of a surfel with openness `own`. `of_anchor` is the openness of the anchor.
    fn with_openness(anchor: usize, own: f32, of_anchor: f32) -> Self {
        // Scale by o_j / o_a: most light of a surfel deep in a fold stays in it and adds little to an open anchor.
        Self { anchor: Some(anchor as u32), share: (own / of_anchor).min(MOST_RATIO) }
    }
}

impl Spot {
    /// Returns whether `point` is within `radius` meters of the spot and has the orientation of its surface.
    fn is_beside(&self, point: &Anchor, radius: f32) -> bool {
        point.position.distance_squared(self.position) < radius * radius && point.normal.dot(self.normal) > LEAST_COSINE
    }

    /// Returns the spot at `point`, restricted to the point's instance if `only_own`.
    pub(super) fn of(point: &Anchor, only_own: bool) -> Self {
        let Anchor { position, normal, instance } = *point;
        Self { position, normal, instance, only_own, came: None }
    }
}

impl SurfelMap {
    fn new(
        surfels: SurfelPoints,
        owners: Vec<Owner>,
        shares: Shares,
        own_instance: bool,
        shared: Option<SharedSight>,
    ) -> Self {
        let (sight, ranks): (_, &dyn Ranks) =
            shared.map_or((None, &Alone), |SharedSight { sight, ranks }| (Some(sight), ranks));
        // Collect w_jk of the surfels k around each surfel j, without surfels hidden by walls.
        let SurfelPoints { points, outlooks } = surfels;
        let mut grid = Grid::new(points, outlooks, shares.clone());
        grid.find_walls(sight, ranks);
        let weights_of = |point: &Anchor| {
            let mut near = Vec::new();
            grid.splat(&Spot::of(point, own_instance), sight, |k, weight| near.push((k as u32, weight)));
            near
        };
        let weights: Vec<Vec<(u32, f32)>> = points.par_iter().map(weights_of).collect();

        // Compute A_k = Σ_i A_i w_ik, the area from which surfel k receives photons.
        let mut areas = vec![0.0f32; points.len()];
        for (point, near) in points.iter().zip(&weights) {
            let share = shares.at(point.position);
            for &(k, weight) in near {
                areas[k as usize] += weight * share;
            }
        }

        // Prepare L_j = Σ w_jk Φ_k / (π Σ w_jk A_k). All factors except Φ_k are constant and stored as one.
        let (mut first, mut around) = (vec![0], Vec::new());
        for near in &weights {
            let area: f32 = near.iter().map(|&(k, weight)| weight * areas[k as usize]).sum();
            let per_flux = 1.0 / (PI * area.max(f32::MIN_POSITIVE));
            for &(k, weight) in near {
                around.push((k, weight * per_flux));
            }
            first.push(around.len() as u32);
        }
        Self { grid, owners, first, around, areas, shares, movable: None }
    }

    /// Returns the maximum distance over which energy is distributed \[m\].
    pub fn reach(&self) -> f32 {
        self.grid.reach()
    }

    /// Returns the number of surfels.
    pub fn len(&self) -> usize {
        self.grid.len()
    }

    /// Calls `give(surfel, weight)` for the surfels that receive energy from `spot`, with weights that sum to 1.
    /// Returns false if no surfel receives energy.
    #[inline]
    pub fn splat(&self, spot: &Spot, sight: Option<&Sight>, give: impl FnMut(usize, f32)) -> bool {
        self.grid.splat(spot, sight, give)
    }

    /// Returns the surfel that would receive the most energy from `spot`.
    #[inline]
    pub fn nearest(&self, spot: &Spot, sight: Option<&Sight>) -> Option<usize> {
        self.grid.best(spot, sight, |_| 1.0)
    }

    /// Distributes the energy of all `spots` by [`Grid::splat_all`].
    pub fn splat_all<T: Copy>(
        &self,
        spots: &[(Spot, T)],
        sight: Option<&Sight>,
        scratch: &mut SplatScratch,
        share: impl FnMut(T, &[(u32, f32)]),
    ) {
        self.grid.splat_all(spots, sight, scratch, share);
    }

    /// Reorders values from the indices of [`SurfelMap::splat_all`] to the order of the surfels.
    pub fn by_index<T: Clone>(&self, by_place: &[T]) -> Vec<T> {
        self.grid.by_index(by_place)
    }

    /// Replaces each of the `bright` anchors by anchors at its surfels. The first new anchor takes the index of the old
    /// anchor; the others are appended.
    pub fn promote(&mut self, anchors: &mut Vec<Anchor>, bright: &[bool]) {
        let points = self.grid.points_by_index();
        let mut is_taken = vec![false; bright.len()];
        for (owner, point) in self.owners.iter_mut().zip(points) {
            // Skip surfels without an owner, and surfels of anchors that are not bright.
            let Some(old) = owner.anchor.map(|anchor| anchor as usize) else { continue };
            if !bright[old] {
                continue;
            }

            // Store the first surfel at the index of the old anchor, so that other indices stay valid.
            let anchor = if std::mem::replace(&mut is_taken[old], true) {
                anchors.push(point);
                anchors.len() - 1
            } else {
                anchors[old] = point;
                old
            };
            // Make the surfel its own owner, so that the anchor emits exactly the surfel's energy.
            *owner = Owner { anchor: Some(anchor as u32), share: 1.0 };
        }
        self.take_anchors(anchors);
    }

    /// Returns the flux of each of `anchors` anchors \[W\], from the `flux` of the surfels. `moved` replaces the owners
    /// of some surfels.
    pub fn anchor_flux(&self, flux: &[Vec3], moved: &Moved, anchors: usize) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; anchors];
        let mut add = |owner: &Owner, flux: Vec3| {
            if let Some(anchor) = owner.anchor {
                sums[anchor as usize] += flux * owner.share;
            }
        };

        // Merge the owners with the changes of this frame. Both lists are ascending by surfel.
        let mut changes = moved.changes.iter().peekable();
        for (surfel, (owner, &flux)) in (0u32..).zip(self.owners.iter().zip(flux)) {
            match changes.next_if(|change| change.surfel == surfel) {
                Some(change) => add(&change.owner, flux),
                None => add(owner, flux),
            }
        }
        sums
    }

    /// Returns the radiance around each surfel \[W·m⁻²·sr⁻¹\], from the `flux` of all surfels \[W\] and the visibility
    /// changes in `moved`.
    pub fn radiance(&self, flux: &[Vec3], moved: &Moved) -> Vec<Vec3> {
        let mut radiance = self.radiance_at_rest(flux);
        self.set_moved_radiance(flux, moved, &mut radiance);
        radiance
    }

    /// Returns the radiance around each surfel without moving occluders \[W·m⁻²·sr⁻¹\].
    fn radiance_at_rest(&self, flux: &[Vec3]) -> Vec<Vec3> {
        let one = |bounds: &[u32]| {
            let around = &self.around[bounds[0] as usize..bounds[1] as usize];
            around.iter().map(|&(k, per_flux)| flux[k as usize] * per_flux).sum()
        };
        self.first.par_windows(2).with_min_len(1024).map(one).collect()
    }
}
