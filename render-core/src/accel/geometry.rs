//! The trees that rays walk: everything that never moves is one, every moving instance has its own; built once.

use super::{Accelerator, Placed};
use crate::scene::{Pose, Scene};
use glam::{Affine3A, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::builder::build_bvh2,
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    rt_triangle::RtTriangle,
    triangle::Triangle,
};
use std::{sync::Arc, time::Duration};

/// A bottom-level tree and what its triangles belong to.
pub(super) struct Group {
    pub(super) bvh: CwBvh,
    /// In the order of the tree's leaves.
    pub(super) triangles: Vec<RtTriangle>,
    /// (instance, triangle) of each, likewise.
    pub(super) owners: Vec<(u32, u32)>,
    pub(super) bounds: Aabb,
}

/// The parts that never change while a scene is rendered.
pub struct Geometry {
    groups: Vec<Arc<Group>>,
    /// Node that carries each group; `None` for the group that never moves.
    carriers: Vec<Option<usize>>,
    scale: f32,
}

impl Group {
    fn new(triangles: Vec<Triangle>, owners: Vec<(u32, u32)>) -> Self {
        let bvh = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let order = &bvh.primitive_indices;
        let bounds = if triangles.is_empty() { Aabb::empty() } else { bvh.total_aabb };
        Self {
            triangles: order.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect(),
            owners: order.iter().map(|&i| owners[i as usize]).collect(),
            bounds,
            bvh,
        }
    }
}

impl Geometry {
    /// Builds the trees of everything in `scene`; instances under a moving node get one each.
    pub fn new(scene: &Scene) -> Self {
        let pose = scene.pose(0.0);
        let moving = scene.moving_nodes();
        let extent = scene.bounds(&pose).map_or(1.0, |(min, max)| (max - min).max_element());
        let scale = if extent > 0.0 && extent.is_finite() { (64.0 / extent).log2().ceil().exp2() } else { 1.0 };
        let mut fixed = (Vec::new(), Vec::new());
        let (mut groups, mut carriers) = (Vec::new(), Vec::new());
        for (index, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            let to_tree = if moving[instance.node] {
                Affine3A::IDENTITY
            } else {
                Affine3A::from_scale(glam::Vec3::splat(scale)) * pose.world[instance.node]
            };
            let mut own = (Vec::new(), Vec::new());
            let (triangles, owners) = if moving[instance.node] { &mut own } else { &mut fixed };
            for t in 0..mesh.triangles.len() {
                let [v0, v1, v2] = mesh.corners(t).map(|corner| to_tree.transform_point3a(corner.into()));
                // Triangles without area can never be hit, and only spoil the tree.
                if (v1 - v0).cross(v2 - v0).length_squared() > 0.0 {
                    triangles.push(Triangle { v0, v1, v2 });
                    owners.push((index as u32, t as u32));
                }
            }
            if moving[instance.node] && !own.0.is_empty() {
                groups.push(Arc::new(Group::new(own.0, own.1)));
                carriers.push(Some(instance.node));
            }
        }
        if !fixed.0.is_empty() {
            groups.push(Arc::new(Group::new(fixed.0, fixed.1)));
            carriers.push(None);
        }
        Self { groups, carriers, scale }
    }

    /// Places the trees as `pose` says and builds the top level over them.
    pub fn place(&self, pose: &Pose) -> Accelerator {
        let scaling = Affine3A::from_scale(glam::Vec3::splat(self.scale));
        let mut groups = Vec::new();
        for (group, carrier) in self.groups.iter().zip(&self.carriers) {
            let (to_local, bounds) = match carrier {
                None => (None, group.bounds),
                Some(node) => {
                    let to_world = scaling * pose.world[*node];
                    // An object squeezed flat by its animation has no inside to shoot at.
                    if to_world.matrix3.determinant() == 0.0 || !to_world.is_finite() {
                        continue;
                    }
                    let (min, max) = (group.bounds.min, group.bounds.max);
                    let corners: Vec<Vec3A> = (0..8)
                        .map(|i| Vec3A::select(glam::BVec3A::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), min, max))
                        .map(|corner| to_world.transform_point3a(corner))
                        .collect();
                    (Some(to_world.inverse()), Aabb::from_points(&corners))
                }
            };
            groups.push(Placed { group: group.clone(), to_local, bounds });
        }
        let boxes: Vec<Aabb> = groups.iter().map(|placed| placed.bounds).collect();
        let top = build_bvh2(&boxes, BvhBuildParams::fastest_build(), &mut Duration::default());
        Accelerator { groups, top, scale: self.scale }
    }
}
