//! Effects of dynamic geometry on static surfels. For example, a closing door separates the light of two rooms.
//!
//! Moving geometry hides surfels from each other. In each frame, rays near the path of moving geometry determine which
//! surfels k around a surfel j are visible. The weights w_jk are restricted to visible surfels. Rays also test whether
//! a surfel still sees its owner.

use super::{AT_ONCE, Owner, SurfelMap};
use crate::anchor::grid::{Grid, Spot};
use crate::anchor::{Anchor, Shares, Sight};
use crate::ranks::{Ranks, portable, share_blocks};
use crate::swept::SweptVolume;
use glam::Vec3;
use std::collections::HashMap;
use std::f32::consts::PI;
use std::sync::Arc;

/// Surfels near the paths of moving geometry.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Movable {
    /// Indices of the surfels, ascending.
    surfels: Vec<u32>,
    /// Positions of all surfels, by index.
    points: Vec<Anchor>,
    anchors: Vec<Anchor>,
    anchor_grid: Grid,
    /// Area shares of the anchors \[m²\].
    anchor_shares: Shares,
}

/// Changes that moving geometry causes in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Moved {
    /// Changed surfels, ascending by index.
    pub(super) changes: Vec<Change>,
}

/// Change at a surfel near moving geometry.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Change {
    pub surfel: u32,
    pub owner: Owner,
    /// Mask of the neighboring surfels that are hidden from the surfel.
    hidden: u64,
}

portable!(Change { surfel, owner, hidden });

impl SurfelMap {
    /// Prepares for moving geometry within the `swept` space. `anchors` own the surfels and represent the areas
    /// `shares`.
    pub fn expect_movement(&mut self, swept: &SweptVolume, anchors: &[Anchor], shares: &Shares) {
        // Select the surfels within a kernel's reach of the swept volume.
        let points = self.grid.points_by_index();
        let near = swept.widened(self.reach());
        let may_meet: Vec<bool> = points.iter().map(|point| near.is_entered(point.position, point.position)).collect();
        self.grid.expect_movement(&may_meet);
        let mut surfels: Vec<u32> = Vec::new();
        for (surfel, &meets) in (0..).zip(&may_meet) {
            if meets {
                surfels.push(surfel);
            }
        }

        // Keep a copy of the anchors, among which surfels find new owners. Without movement, none is needed.
        self.movable = (!surfels.is_empty()).then(|| {
            let (anchors, anchor_grid) = (anchors.to_vec(), Grid::new(anchors, &[], shares.clone()));
            Arc::new(Movable { surfels, points, anchors, anchor_grid, anchor_shares: shares.clone() })
        });
    }

    /// Replaces the anchors after surfels have received new owners.
    pub(super) fn take_anchors(&mut self, anchors: &[Anchor]) {
        if let Some(movable) = &mut self.movable {
            let movable = Arc::make_mut(movable);
            movable.anchor_grid = Grid::new(anchors, &[], movable.anchor_shares.clone());
            movable.anchors = anchors.to_vec();
        }
    }

    /// Returns the changes at the time of `sight`. The `ranks` share the rays.
    pub fn moved(&self, sight: &Sight, ranks: &dyn Ranks) -> Moved {
        let Some(movable) = &self.movable else { return Moved::default() };
        let change = |place: usize| self.change(movable.surfels[place], movable, sight);
        let changes = share_blocks(ranks, movable.surfels.len(), AT_ONCE, change).value;
        Moved { changes: changes.into_iter().flatten().collect() }
    }

    fn change(&self, surfel: u32, movable: &Movable, sight: &Sight) -> Option<Change> {
        // Test which neighboring surfels are visible.
        let spot = Spot::of(&movable.points[surfel as usize], false);
        let around: Vec<Anchor> = self.row(surfel).iter().map(|&(k, _)| movable.points[k as usize]).collect();
        let hidden = sight.hidden(spot.position, spot.normal, &around, self.grid.height_at(spot.position));

        // Test whether the owner is visible; otherwise select a visible anchor.
        let mut owner = self.owners[surfel as usize];
        let sees = |anchor: u32| {
            let anchor = &movable.anchors[anchor as usize..=anchor as usize];
            let height = movable.anchor_grid.height_at(spot.position);
            sight.hidden(spot.position, spot.normal, anchor, height) == 0
        };
        if owner.anchor.is_some_and(|anchor| !sees(anchor)) {
            let other = movable.anchor_grid.best(&spot, Some(sight), |_| 1.0);
            owner = Owner { anchor: other.map(|anchor| anchor as u32), share: owner.share.min(1.0) };
        }
        let is_changed = hidden != 0 || owner != self.owners[surfel as usize];
        is_changed.then_some(Change { surfel, owner, hidden })
    }

    /// Returns the neighbors of a surfel, with their contributions to its radiance per unit of flux.
    fn row(&self, surfel: u32) -> &[(u32, f32)] {
        &self.around[self.first[surfel as usize] as usize..self.first[surfel as usize + 1] as usize]
    }

    /// Updates L_j of the changed surfels with w_jk and A_k of this frame.
    pub(super) fn set_moved_radiance(&self, flux: &[Vec3], moved: &Moved, radiance: &mut [Vec3]) {
        // Normalize w_jk over the visible surfels, which receive the photons of the hidden surfels.
        let mut rows: Vec<(u32, Vec<(u32, f32)>)> = Vec::new();
        for &Change { surfel, hidden, .. } in &moved.changes {
            if hidden == 0 {
                continue;
            }
            let mut row: Vec<(u32, f32)> = Vec::new();
            for (i, &part) in self.row(surfel).iter().enumerate() {
                if hidden >> i & 1 == 0 {
                    row.push(part);
                }
            }
            let sum: f32 = row.iter().map(|(_, weight)| weight).sum();
            for (_, weight) in &mut row {
                *weight /= sum.max(f32::MIN_POSITIVE);
            }
            rows.push((surfel, row));
        }

        // Update A_k = Σ_i A_i w_ik by the changes only.
        let Some(movable) = &self.movable else { return };
        let mut areas: HashMap<u32, f32> = HashMap::new();
        for (surfel, row) in &rows {
            let own = self.shares.at(movable.points[*surfel as usize].position);
            let sum: f32 = self.row(*surfel).iter().map(|(_, weight)| weight).sum();
            for &(k, weight) in self.row(*surfel) {
                *areas.entry(k).or_default() -= own * weight / sum;
            }
            for &(k, weight) in row {
                *areas.entry(k).or_default() += own * weight;
            }
        }

        // Recompute L_j = Σ w_jk Φ_k / (π Σ w_jk A_k).
        for (surfel, row) in &rows {
            let (mut light, mut area) = (Vec3::ZERO, 0.0);
            for &(k, weight) in row {
                light += flux[k as usize] * weight;
                area += weight * (self.areas[k as usize] + areas.get(&k).copied().unwrap_or(0.0));
            }
            // Set completely covered surfels to zero, because they are invisible.
            radiance[*surfel as usize] = if area > 0.0 { light / (PI * area) } else { Vec3::ZERO };
        }
    }
}
