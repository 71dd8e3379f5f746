//! Tree of triangles with a common transform, and the intersection of rays with these triangles.

use super::cut_outs::{CutOuts, Sheets};
use super::panes::Panes;
use super::ray::Ray;
use super::reach::Reach;
use super::tree::{Costs, Tree, Visit, VisitAny};
use super::triangles::{BLOCK, Leaf, Owner, TriangleBlock};
use lanes::{LANES, Lanes};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::builder::build_bvh2_from_tris, triangle::Triangle};
use std::{sync::Arc, time::Duration};

/// Costs of leaves, in units of a node visit. A single ray tests eight triangles as fast as two, but a packet tests
/// them one by one. On Sponza, values of 0.3…1.5 per leaf and 0…0.12 per triangle change the number of visited nodes
/// and leaves by at most 3 %.
const COSTS: Costs = Costs { leaf: 0.6, primitive: 0.12, most: LANES };

/// Maximum mean number of pieces per triangle. Large triangles are split, so a triangle may be in several leaves.
const MOST_REFERENCES: usize = 2;

/// Bottom-level tree, with the owners of its triangles.
pub(super) struct Group {
    /// Tree over the triangles. The contents of the leaves are indices into `blocks`, see [`Group::leaf`].
    pub(super) tree: Tree,
    pub(super) blocks: Vec<TriangleBlock>,
    /// Owner of each triangle in the scene. The instance of an owner is ignored if the mesh is shared, see
    /// [`Group::owner`].
    pub(super) owners: Vec<Owner>,
    pub(super) bounds: Aabb,
    /// Opacity of the triangles, or `None` if all of them are opaque.
    pub(super) cut_outs: Option<Arc<CutOuts>>,
    /// Transmittance of the triangles for shadow rays, or `None` if light passes none of them. Other rays stop at them.
    pub(super) panes: Option<Arc<Panes>>,
    /// Whether all triangles belong to blended surfaces. A group contains either blended surfaces only, or none.
    pub(super) is_blended: bool,
}

/// Triangle hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Met {
    /// Distance, in lengths of the ray's direction.
    pub(super) t: f32,
    /// Index into [`Group::owners`].
    pub(super) triangle: u32,
    /// Barycentric weight of the second corner; `v` is the weight of the third corner.
    pub(super) u: f32,
    pub(super) v: f32,
}

impl Met {
    /// Value that represents no hit.
    pub(super) const NOTHING: Self = Self { t: f32::MAX, triangle: NO_TRIANGLE, u: 0.0, v: 0.0 };

    pub(super) fn is_something(&self) -> bool {
        self.triangle != NO_TRIANGLE
    }
}

/// Index that represents no triangle: the maximum index, also if read as a signed number.
pub(super) const NO_TRIANGLE: u32 = u32::MAX >> 1;
/// Index that is less than every other index if read as a signed number.
pub(super) const BEFORE_ALL: u32 = u32::MAX;

/// Nearest hit of a traversal so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    pub(super) met: Met,
    /// Whether the ray hits another triangle within `reach` of the nearest hit.
    pub(super) contested: bool,
    pub(super) reach: Reach,
}

impl Nearest {
    /// Returns the state before the first hit.
    #[inline(always)]
    pub(super) fn nothing(reach: Reach) -> Self {
        Self { met: Met::NOTHING, contested: false, reach }
    }

    /// Updates the nearest hit with another hit within reach.
    #[inline(always)]
    fn take(&mut self, met: Met) {
        let best = self.met;
        // Break ties by the lower index, so that the order of visits has no effect.
        let is_other = met.triangle != best.triangle;
        let is_nearer = met.t < best.t || met.t == best.t && (met.triangle as i32) < best.triangle as i32;
        if is_nearer {
            self.met = met;
            if is_other {
                // The previous best hit contests the new one if it is within reach.
                self.contested = best.t <= self.reach.of(met.t);
            }
        } else {
            self.contested |= is_other;
        }
    }
}

impl Group {
    /// Builds the tree. `owners` contains the owner of each of the `triangles` in the scene. All coordinates must be
    /// finite.
    pub(super) fn new(
        triangles: &[Triangle],
        owners: Vec<Owner>,
        params: BvhBuildParams,
        cut_outs: Option<Arc<CutOuts>>,
    ) -> Self {
        // Build single-triangle leaves; the conversion to wide nodes merges them.
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..params };
        let build = |params| build_bvh2_from_tris(triangles, params, &mut Duration::default());
        // Rebuild without splitting if splitting increases the number of triangles too much.
        let mut binary = build(params);
        if params.pre_split && binary.primitive_indices.len() > MOST_REFERENCES * triangles.len() {
            binary = build(BvhBuildParams { pre_split: false, ..params });
        }
        let mut blocks = Vec::new();
        let tree = Tree::new(&binary, &COSTS, |members| {
            let first = blocks.len();
            // Remove duplicates: a leaf may contain several pieces of a split triangle.
            let mut members = members.to_vec();
            members.sort_unstable();
            members.dedup();
            // Pack the triangles of the leaf into blocks.
            for part in members.chunks(BLOCK) {
                let mut block = TriangleBlock::EMPTY;
                for (lane, &index) in part.iter().enumerate() {
                    let Triangle { v0, v1, v2 } = triangles[index as usize];
                    block.set(lane, index, [v0, v1, v2]);
                }
                blocks.push(block);
            }
            // Encode the first block and the number of triangles in one number.
            (first * LANES + members.len() - 1) as u32
        });
        let bounds = if triangles.is_empty() { Aabb::empty() } else { *binary.nodes[0].aabb() };
        // Treat the group as blended only if every triangle is.
        let blends = |cut_outs: &Arc<CutOuts>| owners.iter().all(|owner| cut_outs.is_blended(owner.instance as usize));
        let is_blended = cut_outs.as_ref().is_some_and(blends);
        Self { tree, blocks, owners, bounds, cut_outs, panes: None, is_blended }
    }

    /// Returns the group as transparent surfaces.
    pub(super) fn with_panes(self, panes: Option<Arc<Panes>>) -> Self {
        Self { panes, ..self }
    }

    /// Returns whether shadow rays may pass some triangles partially.
    pub(super) fn passes_light(&self) -> bool {
        self.is_blended || self.panes.is_some()
    }

    /// Returns the group with different holes.
    pub(super) fn with_cut_outs(&self, cut_outs: Arc<CutOuts>) -> Self {
        let Self { tree, blocks, owners, bounds, panes, is_blended, .. } = self;
        let (tree, blocks, owners) = (tree.clone(), blocks.clone(), owners.clone());
        let panes = panes.clone();
        Self { tree, blocks, owners, bounds: *bounds, cut_outs: Some(cut_outs), panes, is_blended: *is_blended }
    }

    /// Returns the triangles of a leaf with the given `content`.
    #[inline(always)]
    pub(super) fn leaf(&self, content: u32) -> Leaf<'_> {
        Leaf::new(&self.blocks[content as usize / LANES..], content as usize % LANES + 1)
    }

    /// Returns the owner of a triangle in the scene. `shown` replaces the instance of the owner if the group represents
    /// one instance.
    #[inline(always)]
    pub(super) fn owner(&self, triangle: u32, shown: Option<u32>) -> Owner {
        let owner = self.owners[triangle as usize];
        Owner { instance: shown.unwrap_or(owner.instance), ..owner }
    }

    /// Returns the first triangle before `best` that stops the ray ([`Group::is_there`]). `shown` contains the instance
    /// of the group, if it represents one, and the rule for sheets.
    #[inline(always)]
    pub(super) fn closest<L: Lanes>(
        &self,
        lanes: L,
        ray: &Ray,
        best: Nearest,
        shown: (Option<u32>, Sheets),
    ) -> Nearest {
        match &self.cut_outs {
            None => self.closest_where(lanes, ray, best, |_, _, _, _| true),
            Some(_) => self.closest_where(lanes, ray, best, |leaf, lane, u, v| {
                self.is_there(leaf.triangle(lane), [u, v], shown.0, shown.1)
            }),
        }
    }

    /// Returns whether a triangle stops a ray at a point under the rule `sheets`. `at` contains the barycentric weights
    /// of the second and third corner.
    #[inline(always)]
    pub(super) fn is_there(&self, triangle: u32, at: [f32; 2], shown: Option<u32>, sheets: Sheets) -> bool {
        self.cut_outs.as_ref().is_none_or(|cut_outs| cut_outs.stops(self.owner(triangle, shown), at, sheets))
    }

    /// Returns whether any triangle stops the ray ([`Group::is_there`]) before `limit`.
    #[inline(always)]
    pub(super) fn blocks<L: Lanes>(&self, lanes: L, ray: &Ray, limit: f32, shown: (Option<u32>, Sheets)) -> bool {
        match &self.cut_outs {
            None => self.blocks_where(lanes, ray, limit, |_, _, _| true),
            Some(_) => {
                self.blocks_where(lanes, ray, limit, |triangle, u, v| self.is_there(triangle, [u, v], shown.0, shown.1))
            }
        }
    }

    /// Returns the first triangle before `best` for which `accept(leaf, lane, u, v)` is true.
    #[inline(always)]
    pub(super) fn closest_where<L: Lanes>(
        &self,
        lanes: L,
        ray: &Ray,
        best: Nearest,
        accept: impl Fn(&Leaf, usize, f32, f32) -> bool,
    ) -> Nearest {
        let mut visitor = ClosestOf { group: self, ray, best, accept };
        self.tree.walk(lanes, ray, best.reach.of(best.met.t), &mut visitor);
        visitor.best
    }

    /// Calls `each(leaf, lane, hit)` for all triangles hit within `limit`. The return value of each call is the new
    /// limit.
    #[inline(always)]
    pub(super) fn each_within<L: Lanes>(
        &self,
        lanes: L,
        ray: &Ray,
        limit: f32,
        each: impl FnMut(&Leaf, usize, Met) -> f32,
    ) {
        self.tree.walk(lanes, ray, limit, &mut EachOf { group: self, ray, each });
    }

    /// Returns whether the ray hits a triangle before `limit` for which `accept(index, u, v)` is true.
    #[inline(always)]
    fn blocks_where<L: Lanes>(&self, lanes: L, ray: &Ray, limit: f32, accept: impl Fn(u32, f32, f32) -> bool) -> bool {
        self.tree.stops(lanes, ray, limit, &AnyOf { group: self, ray, limit, accept })
    }
}

struct ClosestOf<'a, F> {
    group: &'a Group,
    ray: &'a Ray,
    best: Nearest,
    accept: F,
}

impl<F: Fn(&Leaf, usize, f32, f32) -> bool> Visit for ClosestOf<'_, F> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, near: f32, limit: f32) -> f32 {
        let leaf = self.group.leaf(content);
        let Some((mut bits, meeting)) = leaf.meet(lanes, self.ray, near, limit) else { return limit };
        let (t, u, v) = (lanes.store(meeting.t), lanes.store(meeting.u), lanes.store(meeting.v));
        // Visit the lanes with hits, and shorten the ray after each accepted hit.
        let mut limit = limit;
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize & (LANES - 1);
            bits &= bits - 1;
            let met = Met { t: t[lane], triangle: leaf.triangle(lane), u: u[lane], v: v[lane] };
            if met.t <= limit && (self.accept)(&leaf, lane, met.u, met.v) {
                self.best.take(met);
                limit = self.best.reach.of(self.best.met.t);
            }
        }
        limit
    }
}

struct EachOf<'a, F> {
    group: &'a Group,
    ray: &'a Ray,
    each: F,
}

impl<F: FnMut(&Leaf, usize, Met) -> f32> Visit for EachOf<'_, F> {
    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, lanes: L, content: u32, near: f32, mut limit: f32) -> f32 {
        let leaf = self.group.leaf(content);
        if let Some((mut bits, meeting)) = leaf.meet(lanes, self.ray, near, limit) {
            let (t, u, v) = (lanes.store(meeting.t), lanes.store(meeting.u), lanes.store(meeting.v));
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & (LANES - 1);
                bits &= bits - 1;
                let met = Met { t: t[lane], triangle: leaf.triangle(lane), u: u[lane], v: v[lane] };
                limit = (self.each)(&leaf, lane, met);
            }
        }
        limit
    }
}

struct AnyOf<'a, F> {
    group: &'a Group,
    ray: &'a Ray,
    limit: f32,
    accept: F,
}

impl<F: Fn(u32, f32, f32) -> bool> VisitAny for AnyOf<'_, F> {
    #[inline(always)]
    fn stops<L: Lanes>(&self, lanes: L, content: u32) -> bool {
        // The ray enters the leaf's box within the limit, so that distances need no lower bound.
        let leaf = self.group.leaf(content);
        let Some((mut bits, meeting)) = leaf.meet(lanes, self.ray, 0.0, self.limit) else { return false };
        let (u, v) = (lanes.store(meeting.u), lanes.store(meeting.v));
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize & (LANES - 1);
            bits &= bits - 1;
            if (self.accept)(leaf.triangle(lane), u[lane], v[lane]) {
                return true;
            }
        }
        false
    }
}
