//! Search for the nearest point with a given orientation. A bounding volume hierarchy over the points excludes distant
//! points and points that face away.

use super::{Grid, OTHER_FARTHER, Spot};
use crate::anchor::Anchor;
use crate::steps;
use glam::Vec3A;

/// Maximum number of points in a leaf.
const LEAF: usize = 8;

/// Bounding volume hierarchy over the points of a grid.
#[derive(Clone, Debug, Default)]
pub(super) struct Boxes {
    /// Indices into [`Grid::points`]. The points of a node are contiguous.
    order: Vec<u32>,
    /// Nodes with parents before children. The first child of a node directly follows it.
    nodes: Vec<PointNode>,
}

/// Bounds of the positions, normals and instances of a node's points.
#[derive(Clone, Debug)]
struct PointNode {
    positions: [Vec3A; 2],
    normals: [Vec3A; 2],
    instances: [u32; 2],
    /// Range of the node's points in [`Boxes::order`].
    points: std::ops::Range<u32>,
    /// Index of the second child in [`Boxes::nodes`], or 0 for a leaf.
    second: u32,
}

impl Boxes {
    /// Builds the hierarchy by splitting the points at the median of their widest axis.
    pub fn over(points: &[Anchor]) -> Self {
        let mut boxes = Self { order: (0..points.len() as u32).collect(), nodes: Vec::new() };
        // List the ranges without a node, each with its parent if it is a second child.
        let mut open = vec![(0..points.len(), None)];
        while let Some((range, parent)) = open.pop() {
            if range.is_empty() {
                continue;
            }

            // Append the node, and set the link of the parent to its second child.
            let place = boxes.nodes.len();
            if let Some(parent) = parent {
                let parent: &mut PointNode = &mut boxes.nodes[parent];
                parent.second = place as u32;
            }
            let own = &mut boxes.order[range.clone()];
            let node = PointNode::around(points, own, range.start as u32);
            let extent = (node.positions[1] - node.positions[0]).to_array();
            boxes.nodes.push(node);
            // Push the lower half last, so that its node follows this node.
            if own.len() > LEAF {
                let axis = (1..3).fold(0, |widest, axis| if extent[axis] > extent[widest] { axis } else { widest });
                let along = |&p: &u32| points[p as usize].position[axis];
                let half = own.len() / 2;
                own.select_nth_unstable_by(half, |a, b| along(a).total_cmp(&along(b)));
                open.push((range.start + half..range.end, Some(place)));
                open.push((range.start..range.start + half, None));
            }
        }
        boxes
    }

    /// Returns the nearest of the `grid`'s points that `spot` may use. The point faces the side of `spot`, or away from
    /// it if `facing` is false. At equal distances, the first point wins.
    fn nearest(&self, grid: &Grid, spot: &Spot, facing: bool) -> Option<usize> {
        let mut best: Option<(f32, u32)> = None;
        let mut open = vec![0u32];
        while let Some(place) = open.pop() {
            // Skip nodes that are too far away or contain no suitable point.
            steps::count(1);
            let Some(node) = self.nodes.get(place as usize) else { continue };
            let distance2 = node.distance2(spot);
            if best.is_some_and(|(least, _)| distance2 > least) || !node.may_hold(spot, facing) {
                continue;
            }

            // Visit the nearer child first, because its points may exclude the other child.
            if node.second != 0 {
                let children = [place + 1, node.second];
                let [a, b] = children.map(|child| self.nodes[child as usize].distance2(spot));
                open.extend(if a <= b { [children[1], children[0]] } else { children });
                continue;
            }

            // Compare the points of a leaf with the best point so far.
            for &p in &self.order[node.points.start as usize..node.points.end as usize] {
                steps::count(1);
                let point = &grid.points[p as usize];
                let is_own = spot.instance == point.instance;
                if ((spot.normal * point.normal).element_sum() > 0.0) != facing || (spot.only_own && !is_own) {
                    continue;
                }
                let found = (point.position.distance_squared(spot.position) * farther(is_own), p);
                if best.is_none_or(|best| found < best) {
                    best = Some(found);
                }
            }
        }
        best.map(|(_, p)| p as usize)
    }
}

impl PointNode {
    /// Creates a leaf with the points `own`.
    fn around(points: &[Anchor], own: &[u32], first: u32) -> Self {
        let mut node = Self {
            positions: [Vec3A::INFINITY, Vec3A::NEG_INFINITY],
            normals: [Vec3A::INFINITY, Vec3A::NEG_INFINITY],
            instances: [u32::MAX, 0],
            points: first..first + own.len() as u32,
            second: 0,
        };
        for &p in own {
            let Anchor { position, normal, instance } = points[p as usize];
            node.positions = [node.positions[0].min(position), node.positions[1].max(position)];
            node.normals = [node.normals[0].min(normal), node.normals[1].max(normal)];
            node.instances = [node.instances[0].min(instance), node.instances[1].max(instance)];
        }
        node
    }

    fn may_hold_own(&self, spot: &Spot) -> bool {
        (self.instances[0]..=self.instances[1]).contains(&spot.instance)
    }

    /// Returns a lower bound of the squared distance of the node's points. Points on other instances count as farther.
    fn distance2(&self, spot: &Spot) -> f32 {
        let closest = spot.position.clamp(self.positions[0], self.positions[1]);
        closest.distance_squared(spot.position) * farther(self.may_hold_own(spot))
    }

    /// Returns whether the node may contain a point that faces the side of `spot` (or away from it) and that `spot` may
    /// use.
    fn may_hold(&self, spot: &Spot, facing: bool) -> bool {
        // Bound n · m for all normals m in a box by the sums of the smallest and of the largest terms. The bounds are
        // also valid under rounding.
        let (a, b) = (spot.normal * self.normals[0], spot.normal * self.normals[1]);
        let (least, greatest) = (a.min(b).element_sum(), a.max(b).element_sum());
        let faces = if facing { greatest > 0.0 } else { least <= 0.0 };
        faces && (!spot.only_own || self.may_hold_own(spot))
    }
}

/// Returns the factor on the squared distance to a point. Another sheet may be nearer than the next point on the spot's
/// sheet.
fn farther(is_own: bool) -> f32 {
    if is_own { 1.0 } else { OTHER_FARTHER }
}

impl Grid {
    /// Returns the nearest point that faces the side of `spot`, or the nearest point if none faces this side. Points on
    /// other instances count as farther.
    pub(super) fn nearest(&self, spot: &Spot) -> Option<usize> {
        let boxes = self.boxes.get_or_init(|| Boxes::over(&self.points));
        boxes.nearest(self, spot, true).or_else(|| boxes.nearest(self, spot, false))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash_unit;

    /// Returns a pseudorandom point of the unit square in the plane y = 0.
    fn on_plane(key: u64, count: u64) -> Vec3A {
        Vec3A::new(hash_unit(count, key, 0), 0.0, hash_unit(count, key, 1))
    }

    fn points(count: u64, normal: impl Fn(u64) -> Vec3A) -> Vec<Anchor> {
        let point = |k| Anchor { position: on_plane(k, count), normal: normal(k), instance: (k * 4 / count) as u32 };
        (0..count).map(point).collect()
    }

    fn spot(key: u64, normal: Vec3A) -> Spot {
        let position = on_plane(key, 77) + Vec3A::Y * 0.1 * (key % 3) as f32;
        Spot { position, normal, instance: (key % 5) as u32, only_own: key.is_multiple_of(2), came: None }
    }

    #[test]
    fn searches_look_at_few_of_many_points() {
        // Search from above, below and the side of a plane that faces up. Half of the searches are for one instance,
        // and one in five of these for an instance without points.
        for normal in [Vec3A::Y, Vec3A::NEG_Y, Vec3A::X] {
            let mean_steps = |count| {
                let grid = Grid::new(&points(count, |_| Vec3A::Y), &[], 1.0 / count as f32);
                grid.boxes.get_or_init(|| Boxes::over(&grid.points));
                let search = || assert_eq!((0..200).filter_map(|k| grid.nearest(&spot(k, normal))).count(), 180);
                steps::taken(search) / 200
            };
            // Mix points of four instances, so that searches visit four times as many points as with one instance.
            let (few, many) = (mean_steps(1000), mean_steps(64_000));
            assert!(many <= few + 400 && many < 600, "{normal}: {few} and {many} steps");
        }
    }

    #[test]
    fn of_points_that_all_face_away_the_nearest_is_found() {
        let points = points(500, |_| Vec3A::Y);
        let grid = Grid::new(&points, &[], 0.01);
        for key in 0..100 {
            let spot = Spot { only_own: false, instance: 9, ..spot(key, Vec3A::NEG_Y) };
            let nearest = points.iter().map(|p| p.position.distance_squared(spot.position)).fold(f32::MAX, f32::min);
            let found = &grid.points[grid.nearest(&spot).unwrap()];
            assert_eq!(found.position.distance_squared(spot.position), nearest);
        }
    }
}
