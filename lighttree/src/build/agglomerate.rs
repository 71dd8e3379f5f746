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
//! The cost of a union never falls when a part grows. So two clusters that are each other's cheapest partner stay that
//! until they are joined, whatever happens around them, and may be joined at once \[Walter08\]: the tree is that of the
//! greedy order. And a cluster's cheapest partner, once found, stays so as long as it is there.
//!
//! # Differs from the papers
//!
//! * All pairs that are each other's cheapest partners are joined together, in rounds, over clusters in the order of the
//!   search tree: neighbors search one after the other and find the tree in the cache, and a round's searches need not
//!   know of each other. (With one heap for the exact order it took twice as long.) A cluster that lost its partner
//!   searches again only when another one waits for it.
//! * Omni and oriented lights share one tree (directional ones have their own). A cluster of both has a cone of all
//!   directions (β = 180°), the largest cost there is, so that they meet near the root; c is zero for clusters of omni
//!   lights alone.
//! * c is the diagonal of the oriented lights' box: a far dome of omni lights must not make orientation dear.
//! * I has a floor of [`LUMINANCE_FLOOR`](super::LUMINANCE_FLOOR) of the mean light, so that lights which are dark now
//!   still find sensible neighbors; α² has one of [`COINCIDENCE`](super::COINCIDENCE)² of the scene's, so that coincident
//!   lights merge dimmest first, into a balanced tree. Neither touches intensities or representatives.
//! * The search uses a static median-split tree that is made anew each time the clusters have become fewer by a quarter.

use rayon::prelude::*;

use super::cluster::{Cluster, Metric};
use super::nearest::{DEAD, Neighborhood, Partner};
use crate::bounds::Cone;

/// Fewer searches than these are done before another thread wakes.
const PARALLEL: usize = 4096;

/// Merges until one cluster is left, and names the merges from `first_merge` on. The greedy tree, ties aside; the
/// merges are not in the greedy order, but a cluster's parts come before it.
pub(super) fn agglomerate(leaves: Vec<Cluster>, metric: &Metric, first_merge: u32) -> Vec<[u32; 2]> {
    let leaf_count = leaves.len();
    if leaf_count == 0 {
        return Vec::new();
    }
    let names = first_merge as usize + leaf_count;
    let mut cones = vec![Cone::SPHERE; names];
    for leaf in &leaves {
        cones[leaf.id as usize] = leaf.leaf_cone();
    }
    let mut partners = Partners { of: vec![NOBODY; names], heir: vec![DEAD; names], searches: vec![false; names] };
    let mut searching: Vec<u32> = Vec::with_capacity(leaf_count);
    let mut neighborhood = Neighborhood::new(leaves, names, metric);
    searching.extend(neighborhood.alive());
    let mut merges = Vec::with_capacity(leaf_count - 1);
    let mut pairs = Vec::new();
    while merges.len() + 1 < leaf_count {
        let search = |&id: &u32| neighborhood.nearest(id, partners.hint(id, &neighborhood));
        let found: Vec<Partner> = if searching.len() < PARALLEL {
            searching.iter().map(search).collect()
        } else {
            searching.par_iter().map(search).collect()
        };
        for (&id, found) in searching.iter().zip(found) {
            partners.of[id as usize] = found;
            partners.searches[id as usize] = false;
        }
        searching.clear();
        pairs.clear();
        partners.agree(&neighborhood, &mut searching);
        partners.pairs(&neighborhood, &mut pairs);
        for &[a, b] in &pairs {
            let merged = first_merge + merges.len() as u32;
            let cone = cones[a as usize].union(cones[b as usize]);
            cones[merged as usize] = cone;
            merges.push([a, b]);
            neighborhood.merge(a, b, merged, cone);
            partners.heir[a as usize] = merged;
            partners.heir[b as usize] = merged;
            searching.push(merged);
        }
        if neighborhood.is_sparse() {
            neighborhood.rebuild();
        }
        if searching.is_empty() {
            searching.extend(neighborhood.alive().filter(|&id| partners.is_alone(id, &neighborhood)));
        }
    }
    merges
}

const NOBODY: Partner = Partner { cost: f32::INFINITY, id: DEAD };

/// The clusters, by their numbers.
struct Partners {
    of: Vec<Partner>,
    /// The cluster that each has become part of.
    heir: Vec<u32>,
    /// Whether a cluster is among those that search next.
    searches: Vec<bool>,
}

impl Partners {
    /// Whether the cluster has to search before it can be joined.
    fn is_alone(&self, id: u32, neighborhood: &Neighborhood) -> bool {
        let partner = self.of[id as usize].id;
        partner == DEAD || !neighborhood.is_alive(partner)
    }

    /// For a cluster whose partner has become part of another: that other, which is not far.
    fn hint(&self, id: u32, neighborhood: &Neighborhood) -> Option<u32> {
        let mut near = self.of[id as usize].id;
        while near != DEAD && !neighborhood.is_alive(near) {
            near = self.heir[near as usize];
        }
        (near != DEAD).then_some(near)
    }

    /// Where one cluster has found a partner that it is cheaper for than the partner's own, both want each other: costs are
    /// the same from both sides, but the searches may choose differently among equal ones, and rounding may make a union
    /// cheaper than its part. So the cheapest pair of all always agrees. Partners that are alone go to `searching`, once.
    fn agree(&mut self, neighborhood: &Neighborhood, searching: &mut Vec<u32>) {
        for id in neighborhood.alive() {
            let Partner { cost, id: other } = self.of[id as usize];
            if other == DEAD || !neighborhood.is_alive(other) {
                continue;
            }
            if self.is_alone(other, neighborhood) {
                if !std::mem::replace(&mut self.searches[other as usize], true) {
                    searching.push(other);
                }
                continue;
            }
            let key = |cost: f32, a: u32, b: u32| (cost.to_bits(), a.min(b), a.max(b));
            let of_other = self.of[other as usize];
            if key(cost, id, other) < key(of_other.cost, other, of_other.id) {
                self.of[other as usize] = Partner { cost, id };
            }
        }
    }

    /// Pairs of clusters that are each other's partners.
    fn pairs(&self, neighborhood: &Neighborhood, pairs: &mut Vec<[u32; 2]>) {
        pairs.extend(neighborhood.alive().filter_map(|id| {
            let other = self.of[id as usize].id;
            (other != DEAD && id < other && self.of[other as usize].id == id).then_some([id, other])
        }));
    }
}
