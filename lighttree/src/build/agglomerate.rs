//! Bottom-up greedy clustering: the two clusters whose union costs least become one, until one is left.
//!
//! `[Walter05]` B. Walter, S. Fernandez, A. Arbree, K. Bala, M. Donikian, D. P. Greenberg: Lightcuts: a scalable
//! approach to illumination. SIGGRAPH 2005, section 5.
//! `[Walter08]` B. Walter, K. Bala, M. Kulkarni, K. Pingali: Fast agglomerative clustering for rendering. RT 2008.
//!
//! ```text
//! cost = I · (α² + c² (1 − cos β)²)
//!   I  luminance of the cluster          α  diagonal of its box
//!   β  half-angle of its cone            c  diagonal of the scene
//! ```
//!
//! The cost of a union never falls when a part grows. So a cluster's nearest partner, once found, is a lower bound
//! for ever, and a heap of such bounds, corrected only when the partner is gone, gives the exact greedy order.
//!
//! # Differs from the papers
//!
//! * Omni and oriented lights share one tree (directional ones have their own). A cluster of both has a cone of all directions (β = 180°), the largest
//!   cost there is, so that they meet near the root; c is zero for clusters of omni lights alone.
//! * c is the diagonal of the oriented lights' box: a far dome of omni lights must not make orientation dear.
//! * I has a floor of [`LUMINANCE_FLOOR`] of the mean light, so that lights which are dark now still find sensible
//!   neighbours; α² has one of [`COINCIDENCE`]² of the scene's, so that coincident lights merge dimmest first, into
//!   a balanced tree. Neither touches intensities or representatives.
//! * The nearest-partner search uses a static median-split tree that is made anew each time the clusters have halved.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::cluster::{Cluster, Metric};
use super::nearest::Neighborhood;
use crate::bounds::Cone;

/// Fewer first searches than these are done before another thread wakes \[lights\].
const PARALLEL: usize = 4096;

/// Merges until one cluster is left, and names the merges from `first_merge` on. The exact greedy order, ties aside.
pub(super) fn agglomerate(leaves: Vec<Cluster>, metric: &Metric, first_merge: u32) -> Vec<[u32; 2]> {
    let leaf_count = leaves.len();
    if leaf_count == 0 {
        return Vec::new();
    }
    let mut merges = Vec::with_capacity(leaf_count - 1);
    let names = first_merge as usize + leaf_count;
    let mut cones = vec![Cone::SPHERE; names];
    for leaf in &leaves {
        cones[leaf.id as usize] = leaf.leaf_cone();
    }
    let mut partner = vec![u32::MAX; names];
    let ids: Vec<u32> = leaves.iter().map(|leaf| leaf.id).collect();
    let mut neighborhood = Neighborhood::new(leaves, names, metric);
    // Costs are not negative, so their bits sort as they do; the cluster's number breaks ties.
    let key = |cost: f32, id: u32| Reverse(u64::from(cost.to_bits()) << 32 | u64::from(id));
    let nearest: Vec<Option<(f32, u32)>> = if leaf_count < PARALLEL {
        ids.iter().map(|&id| neighborhood.nearest(id)).collect()
    } else {
        ids.par_iter().map(|&id| neighborhood.nearest(id)).collect()
    };
    let mut heap = BinaryHeap::with_capacity(leaf_count);
    for (&id, nearest) in ids.iter().zip(nearest) {
        if let Some((cost, other)) = nearest {
            partner[id as usize] = other;
            heap.push(key(cost, id));
        }
    }
    while let Some(Reverse(top)) = heap.pop() {
        let id = top as u32;
        if !neighborhood.is_alive(id) {
            continue;
        }
        let nearest = partner[id as usize];
        let searching = if neighborhood.is_alive(nearest) {
            let merged = first_merge + merges.len() as u32;
            let cone = cones[id as usize].union(cones[nearest as usize]);
            cones[merged as usize] = cone;
            merges.push([id, nearest]);
            neighborhood.merge(id, nearest, merged, cone);
            if neighborhood.is_sparse() {
                neighborhood.rebuild();
            }
            merged
        } else {
            id
        };
        if let Some((cost, other)) = neighborhood.nearest(searching) {
            partner[searching as usize] = other;
            heap.push(key(cost, searching));
        }
    }
    merges
}
