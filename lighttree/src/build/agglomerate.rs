//! Bottom-up greedy clustering: repeatedly joins the two clusters with the cheapest union until one cluster remains.
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
//! The cost of a union never falls when one of its clusters grows. Two clusters that are each other's cheapest partners
//! therefore remain so until they are joined, and may be joined at once \[Walter08\]. The resulting tree is the tree of
//! the greedy order. For the same reason, the cheapest partner of a cluster remains the cheapest while it exists.
//!
//! # Differences from the papers
//!
//! * All pairs that are each other's cheapest partners are joined together, in rounds. Rounds visit clusters in the
//!   order of the search tree. Consecutive searches then share cached nodes. Searches of one round are independent.
//!   (An exact order with one heap took twice as long.) A cluster that has lost its partner searches again only when
//!   another cluster waits for it.
//! * Omni and oriented lights share one tree. Directional lights have a separate tree. A cluster with both omni and
//!   oriented lights has a cone of all directions (β = 180°). This is the largest possible cost, so such clusters are
//!   near the root. c is zero for clusters of only omni lights.
//! * c is the diagonal of the box of the oriented lights. A distant dome of omni lights must not raise the cost of
//!   orientation.
//! * I is at least [`LUMINANCE_FLOOR`](super::LUMINANCE_FLOOR) times the mean luminance, so that lights that are dark
//!   at build time still get near neighbors. α² is at least [`COINCIDENCE`](super::COINCIDENCE)² times the scene's
//!   squared diagonal, so that coincident lights merge dimmest first into a balanced tree. Neither limit affects
//!   intensities or representatives.
//! * The search uses a static median-split tree. It is rebuilt whenever a quarter of its clusters have been merged
//!   away.

use threads::prelude::*;

use super::SearchLoop;
use super::cluster::{Cluster, Metric};
use super::nearest::{DEAD, Neighborhood, Partner};
use crate::bounds::Cone;

/// Minimum number of searches for parallel execution. Fewer searches would finish before another thread wakes.
const PARALLEL: usize = 4096;

/// Runs searches on the threads of this process.
pub(super) fn on_threads(count: usize, search: &(dyn Fn(usize) -> u64 + Sync)) -> Vec<u64> {
    if count < PARALLEL { (0..count).map(search).collect() } else { (0..count).into_par_iter().map(search).collect() }
}

/// Merges clusters until one remains. The merges are numbered from `first_merge`.
///
/// Returns the greedy tree, except for ties. The merges are not in greedy order, but children precede their parents.
pub(super) fn agglomerate(
    leaves: Vec<Cluster>,
    metric: &Metric,
    first_merge: u32,
    searches: SearchLoop,
) -> Vec<[u32; 2]> {
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
        // Find partners. The searches of a round are independent.
        let search = |place: usize| {
            let id = searching[place];
            neighborhood.nearest(id, partners.hint(id, &neighborhood)).to_bits()
        };
        let found = searches(searching.len(), &search);
        for (&id, found) in searching.iter().zip(found) {
            partners.of[id as usize] = Partner::from_bits(found);
            partners.searches[id as usize] = false;
        }
        // Merge all mutual pairs of this round.
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
        // Prepare the next round. If no cluster is new, search again for all clusters that have lost their partner.
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

/// Partners of the clusters, indexed by cluster number.
struct Partners {
    of: Vec<Partner>,
    /// Union that contains each merged cluster.
    heir: Vec<u32>,
    /// Whether a cluster is in the next round of searches.
    searches: Vec<bool>,
}

impl Partners {
    /// Returns whether the cluster has no partner or a merged partner, and must search before it can be joined.
    fn is_alone(&self, id: u32, neighborhood: &Neighborhood) -> bool {
        let partner = self.of[id as usize].id;
        partner == DEAD || !neighborhood.is_alive(partner)
    }

    /// Returns the cluster that now contains the former partner of `id` and is not merged itself. It is usually close
    /// to `id`.
    fn hint(&self, id: u32, neighborhood: &Neighborhood) -> Option<u32> {
        let mut near = self.of[id as usize].id;
        while near != DEAD && !neighborhood.is_alive(near) {
            near = self.heir[near as usize];
        }
        (near != DEAD).then_some(near)
    }

    /// Makes partners mutual: if a cluster's partner has a more expensive partner of its own, both clusters choose each
    /// other.
    ///
    /// Costs are symmetric, but searches may break ties differently, and rounding may make a union cheaper than its
    /// child. With mutual partners, the cheapest pair always agrees. Clusters whose partner is missing or merged are
    /// added to `searching`, once each.
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

    /// Appends the pairs of clusters that are each other's partners.
    fn pairs(&self, neighborhood: &Neighborhood, pairs: &mut Vec<[u32; 2]>) {
        pairs.extend(neighborhood.alive().filter_map(|id| {
            let other = self.of[id as usize].id;
            (other != DEAD && id < other && self.of[other as usize].id == id).then_some([id, other])
        }));
    }
}
