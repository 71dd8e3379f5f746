//! Conversion of a binary tree to a tree with eight boxes per node, at minimum expected cost.
//!
//! For each subtree of the binary tree, the minimum cost as a forest of at most i trees is computed for i = 1…7. A node
//! with eight children is the cheapest distribution of its eight slots over the forests of both children. Costs are
//! weighted by surface area. Ylitie, Karras & Laine (2017, section 3.1) describe the method, after Wald, Benthin &
//! Boulos (2008).

use super::{Child, LANES, Tree, WideNode};
use obvhs::{aabb::Aabb, bvh2::Bvh2};

/// Costs of a leaf, in units of the cost of a node.
pub(in super::super) struct Costs {
    /// Cost of a leaf without primitives.
    pub(in super::super) leaf: f32,
    /// Cost of each primitive in a leaf.
    pub(in super::super) primitive: f32,
    /// Maximum number of primitives in a leaf.
    pub(in super::super) most: usize,
}

/// Minimum costs of a subtree of the binary tree.
#[derive(Clone, Copy)]
struct Subtree {
    primitives: u32,
    /// Minimum cost as a forest of at most i + 1 trees, for each i.
    cost: [f32; LANES],
    /// Number of the i + 1 slots that the first child receives, or 0 if i slots are as cheap.
    first_share: [u8; LANES],
    /// Whether the subtree is a leaf in a forest of one tree.
    leaf: bool,
    /// Number of the node's eight slots that the first child receives.
    node_share: u8,
}

/// Slack of boxes, as a fraction of the largest coordinate. It equals the maximum error of the arithmetic in
/// [`super::super::triangles`].
const SLACK: f32 = 1.0 / (1 << 20) as f32;

impl Tree {
    /// Converts the `binary` tree. `leaf` accepts the primitives of each leaf and returns the content of the leaf,
    /// below 2³¹.
    pub(in super::super) fn new(binary: &Bvh2, costs: &Costs, mut leaf: impl FnMut(&[u32]) -> u32) -> Self {
        let mut tree = Self { nodes: Vec::new() };
        // Represent an empty tree by a root without boxes.
        if binary.primitive_indices.is_empty() {
            tree.nodes.push(WideNode::EMPTY);
            return tree;
        }
        // Widen the boxes by the rounding error of the triangle test.
        let root = binary.nodes[0].aabb();
        let slack = root.min.abs().max(root.max.abs()).max_element() * SLACK;
        let subtrees = subtrees(binary, costs);
        let mut primitives = Vec::new();
        // List the subtrees to convert, each with the slot of the node that will refer to it.
        let mut open: Vec<(u32, Option<(usize, usize)>)> = vec![(0, None)];
        while let Some((top, place)) = open.pop() {
            let index = tree.nodes.len();
            if let Some((parent, lane)) = place {
                tree.nodes[parent].children[lane] = Child(index as u32);
            }
            tree.nodes.push(WideNode::EMPTY);
            // Fill the slots of the node. Leaves are complete; subtrees remain open.
            for (lane, child) in children(binary, &subtrees, top).into_iter().enumerate() {
                tree.nodes[index].set_box(lane, binary.nodes[child as usize].aabb(), slack);
                if subtrees[child as usize].leaf {
                    primitives.clear();
                    gather(binary, child, &mut primitives);
                    tree.nodes[index].children[lane] = Child(Child::LEAF | leaf(&primitives));
                } else {
                    open.push((child, Some((index, lane))));
                }
            }
        }
        tree
    }
}

impl WideNode {
    const EMPTY: Self = Self {
        planes: [
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
        ],
        children: [Child(Child::LEAF); LANES],
    };

    fn set_box(&mut self, lane: usize, aabb: &Aabb, slack: f32) {
        let (min, max) = ((aabb.min - slack).to_array(), (aabb.max + slack).to_array());
        for axis in 0..3 {
            self.planes[axis][lane] = min[axis];
            self.planes[axis + 3][lane] = max[axis];
        }
    }
}

/// Returns the binary nodes that become the children of the wide node for the subtree `top`.
fn children(binary: &Bvh2, subtrees: &[Subtree], top: u32) -> Vec<u32> {
    let mut out = Vec::with_capacity(LANES);
    let subtree = &subtrees[top as usize];
    if subtree.leaf {
        // Return a root that is a leaf, because only the root can be visited as a node and still be a leaf.
        out.push(top);
    } else {
        let first = binary.nodes[top as usize].first_index;
        roots(binary, subtrees, first, subtree.node_share, &mut out);
        roots(binary, subtrees, first + 1, LANES as u8 - subtree.node_share, &mut out);
    }
    out
}

/// Collects the roots of the cheapest forest of at most `places` trees for the subtree `top`.
fn roots(binary: &Bvh2, subtrees: &[Subtree], top: u32, places: u8, out: &mut Vec<u32>) {
    let share = subtrees[top as usize].first_share[places as usize - 1];
    match places {
        1 => out.push(top),
        _ if share == 0 => roots(binary, subtrees, top, places - 1, out),
        _ => {
            let first = binary.nodes[top as usize].first_index;
            roots(binary, subtrees, first, share, out);
            roots(binary, subtrees, first + 1, places - share, out);
        }
    }
}

fn gather(binary: &Bvh2, top: u32, out: &mut Vec<u32>) {
    let mut open = vec![top];
    while let Some(index) = open.pop() {
        let node = &binary.nodes[index as usize];
        if node.is_leaf() {
            let first = node.first_index as usize;
            out.extend(&binary.primitive_indices[first..first + node.prim_count as usize]);
        } else {
            open.extend([node.first_index + 1, node.first_index]);
        }
    }
}

/// Returns the minimum costs of all subtrees, computed bottom-up.
fn subtrees(binary: &Bvh2, costs: &Costs) -> Vec<Subtree> {
    // List all nodes, parents before children.
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut open = vec![0u32];
    while let Some(index) = open.pop() {
        order.push(index);
        let node = &binary.nodes[index as usize];
        if !node.is_leaf() {
            open.extend([node.first_index, node.first_index + 1]);
        }
    }
    let unknown =
        Subtree { primitives: 0, cost: [f32::INFINITY; LANES], first_share: [0; LANES], leaf: true, node_share: 1 };
    let mut subtrees = vec![unknown; binary.nodes.len()];
    // Visit children before parents. The order contains parents first, so it is reversed.
    for &index in order.iter().rev() {
        let node = &binary.nodes[index as usize];
        let area = node.aabb().half_area();
        let leaf_cost = |primitives: u32| area * (costs.leaf + costs.primitive * primitives as f32);
        // A leaf costs the same at any number of slots.
        subtrees[index as usize] = if node.is_leaf() {
            Subtree { primitives: node.prim_count, cost: [leaf_cost(node.prim_count); LANES], ..unknown }
        } else {
            let (a, b) = (subtrees[node.first_index as usize], subtrees[node.first_index as usize + 1]);
            let mut own = Subtree { primitives: a.primitives + b.primitives, ..unknown };
            // Find the cheapest distribution of the slots over both children.
            let best_share = |places: usize| {
                (1..places)
                    .map(|share| (a.cost[share - 1] + b.cost[places - share - 1], share as u8))
                    .min_by(|x, y| x.0.total_cmp(&y.0))
                    .expect("two places or more can be shared")
            };
            let (below, share) = best_share(LANES);
            own.node_share = share;
            // Choose between one leaf and one node with eight slots.
            own.cost[0] = area + below;
            own.leaf = own.primitives as usize <= costs.most && leaf_cost(own.primitives) <= own.cost[0];
            if own.leaf {
                own.cost[0] = leaf_cost(own.primitives);
            }
            // Choose the cheapest forest for each number of slots.
            for places in 2..=LANES {
                let (cost, share) = best_share(places);
                let fewer = own.cost[places - 2];
                (own.cost[places - 1], own.first_share[places - 1]) =
                    if cost < fewer { (cost, share) } else { (fewer, 0) };
            }
            own
        };
    }
    subtrees
}

#[cfg(test)]
mod tests {
    use super::super::ChildKind;
    use super::*;
    use crate::sampling::hash_unit;
    use glam::Vec3A;
    use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2};

    fn boxes(count: u64) -> Vec<Aabb> {
        let random = |k, d| Vec3A::new(hash_unit(k, d, 0), hash_unit(k, d, 1), hash_unit(k, d, 2));
        (0..count).map(|k| Aabb::from_points(&[random(k, 0), random(k, 0) + random(k, 1) * 0.1])).collect()
    }

    #[test]
    fn every_primitive_is_in_one_leaf_and_in_all_boxes_above() {
        for count in [0, 1, 2, 7, 8, 9, 64, 65, 1000] {
            let boxes = boxes(count);
            let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
            let binary = build_bvh2(&boxes, params, &mut std::time::Duration::default());
            let mut leaves: Vec<Vec<u32>> = Vec::new();
            let costs = Costs { leaf: 0.5, primitive: 0.1, most: 5 };
            let tree = Tree::new(&binary, &costs, |primitives| {
                leaves.push(primitives.to_vec());
                leaves.len() as u32 - 1
            });
            let mut seen = vec![0; boxes.len()];
            let mut open = vec![(0, Vec::<(Vec3A, Vec3A)>::new())];
            let mut nodes = 0;
            while let Some((index, above)) = open.pop() {
                nodes += 1;
                let node = &tree.nodes[index];
                for lane in 0..LANES {
                    let corner =
                        |first: usize| Vec3A::from_array(std::array::from_fn(|k| node.planes[first + k][lane]));
                    if corner(0).x > corner(3).x {
                        continue;
                    }
                    let mut within = above.clone();
                    within.push((corner(0), corner(3)));
                    match node.children[lane].kind() {
                        ChildKind::Node(child) => open.push((child, within)),
                        ChildKind::Leaf(content) => {
                            assert!((1..=costs.most).contains(&leaves[content as usize].len()));
                            for &primitive in &leaves[content as usize] {
                                seen[primitive as usize] += 1;
                                let aabb = &boxes[primitive as usize];
                                for (min, max) in &within {
                                    assert!(min.cmple(aabb.min).all() && max.cmpge(aabb.max).all());
                                }
                            }
                        }
                    }
                }
            }
            assert!(seen.iter().all(|&times| times == 1), "{count} primitives");
            assert_eq!(nodes, tree.nodes.len(), "no node is left over");
        }
    }
}
