//! Static instances that share a tree because they show the same mesh.
//!
//! Rays are fastest with one tree over all static geometry. But a small file may show one mesh a million times, and one
//! tree would store the triangles of every copy.

use crate::scene::{Instance, Pose, Scene};
use glam::Affine3A;

/// Maximum number of triangles in the common tree from meshes with several static instances, counted over all
/// instances. Building a tree of this size takes 400 MB.
const MOST_TOGETHER: usize = 1 << 20;
/// Minimum number of triangles of a shared mesh. An instance needs as much memory as this number of triangles.
const LEAST_TRIANGLES: usize = 16;
/// Minimum volume of a transformed unit cube, relative to the product of its edge lengths. Flatter meshes have no local
/// space.
const LEAST_VOLUME: f32 = 1e-3;

/// Whether the static instances of each mesh share a tree, by mesh.
pub(crate) struct Sharing(Vec<bool>);

impl Sharing {
    pub(crate) fn of(scene: &Scene, pose: &Pose) -> Self {
        // Count the static, undeformed instances of each mesh.
        let moving = scene.moving_instances();
        let mut shown = vec![0usize; scene.meshes.len()];
        for (index, &Instance { mesh, .. }) in scene.instances.iter().enumerate() {
            shown[mesh] += usize::from(!moving[index] && pose.deformed(index).is_none());
        }

        // Share the trees of meshes with several instances, but only if one common tree would become too large.
        let mut shared = Vec::with_capacity(shown.len());
        let mut together = 0usize;
        for (&times, mesh) in shown.iter().zip(&scene.meshes) {
            let triangles = mesh.triangles.len();
            let saves = times > 1 && triangles >= LEAST_TRIANGLES;
            together = together.saturating_add(if saves { times.saturating_mul(triangles) } else { 0 });
            shared.push(saves);
        }
        if together <= MOST_TOGETHER {
            shared.fill(false);
        }
        Self(shared)
    }

    /// Returns whether `instance` is static and uses the tree of its mesh.
    pub(crate) fn shares(&self, scene: &Scene, pose: &Pose, instance: usize) -> bool {
        let world = scene.instance_world(pose, instance);
        self.0[scene.instances[instance].mesh] && pose.deformed(instance).is_none() && has_volume(&world)
    }
}

/// Returns whether a transformed cube has a volume above the minimum.
fn has_volume(world: &Affine3A) -> bool {
    let m = &world.matrix3;
    let edges = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    edges.is_finite() && m.determinant().abs() > LEAST_VOLUME * edges && world.is_finite()
}

#[cfg(test)]
mod tests {
    use crate::accel::Geometry;
    use crate::sampling::hash_unit;
    use crate::scene::{Instance, Material, Mesh, Node, Scene, Transform};
    use crate::steps;
    use glam::{Quat, Vec3, Vec3A};

    fn random(key: u64, dimension: u64) -> Vec3 {
        Vec3::new(hash_unit(key, dimension, 0), hash_unit(key, dimension, 1), hash_unit(key, dimension, 2))
    }

    /// Returns a cloud of `triangles` triangles in the unit cube.
    fn cloud(triangles: u32) -> Mesh {
        let corner = |k| random(u64::from(k / 3), 0) + random(u64::from(k), 1) * 0.1;
        Mesh {
            positions: (0..3 * triangles).map(corner).collect(),
            triangles: (0..triangles).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            ..Mesh::default()
        }
    }

    /// Returns `times` clouds at random positions in a cube, rotated and scaled.
    fn many(triangles: u32, times: usize) -> Scene {
        let mut scene = Scene::of_mesh(cloud(triangles), Material::default());
        scene.instances.clear();
        for k in 0..times {
            let rest = Transform {
                translation: random(k as u64, 2) * 40.0,
                rotation: Quat::from_scaled_axis(random(k as u64, 3) * 3.0),
                scale: random(k as u64, 4) + 0.2,
            };
            scene.nodes.push(Node { name: String::new(), parent: None, rest });
            scene.instances.push(Instance { node: scene.nodes.len() - 1, mesh: 0 });
        }
        scene
    }

    #[test]
    fn a_mesh_shown_many_times_is_held_once_and_rays_meet_all_of_it() {
        let scene = many(2000, 600);
        let geometry = Geometry::new(&scene);
        assert_eq!(geometry.triangles_held(), 2000);
        assert_eq!(Geometry::triangles_to_hold(&scene), 2000);
        let accelerator = geometry.place(&scene.pose(0.0));
        for key in 0..24 {
            // Aim the ray at the center of a triangle, so that it hits this triangle or a nearer one.
            let (origin, instance) = (Vec3A::from(random(key, 5) * 40.0), 25 * key as usize);
            let middle = scene.meshes[0].corners(key as usize).into_iter().sum::<Vec3>() / 3.0;
            let towards = scene.instance_world(&scene.pose(0.0), instance).transform_point3a(middle.into());
            let direction = (towards - origin).normalize();
            let found = accelerator.closest(origin, direction).unwrap();
            let expected = accelerator.closest_by_exhaustion(origin, direction).unwrap();
            assert_eq!((found.instance, found.triangle), (expected.instance, expected.triangle));
            assert!(accelerator.occluded(origin, origin + direction * (found.distance * 1.01)));
        }
    }

    #[test]
    fn few_triangles_stand_in_one_tree_and_what_is_flat_is_not_lost() {
        assert_eq!(Geometry::new(&many(100, 20)).triangles_held(), 2000);
        let mut flat = many(2000, 600);
        flat.nodes[1].rest.scale.z = 0.0;
        assert_eq!(Geometry::new(&flat).triangles_held(), 4000);
        assert_eq!(Geometry::triangles_to_hold(&flat), 4000);
    }

    #[test]
    fn triangles_on_top_of_each_other_are_held_once() {
        let pile = |copies: usize| {
            let mut mesh = cloud(3);
            mesh.triangles = mesh.triangles.repeat(copies);
            Scene::of_mesh(mesh, Material::default())
        };
        // Allow n log n comparisons for sorting, but no other work per triangle.
        let steps = steps::taken(|| assert_eq!(Geometry::new(&pile(30_000)).triangles_held(), 3));
        assert!(steps < 90_000 * 20, "{steps} steps");

        // Check that rays hit the first triangle of each pile.
        let scene = pile(100);
        let accelerator = Geometry::new(&scene).place(&scene.pose(0.0));
        for t in 0..3 {
            let middle = Vec3A::from(scene.meshes[0].corners(t).into_iter().sum::<Vec3>() / 3.0);
            let from = Vec3A::new(0.3, 0.4, 9.0);
            let hit = accelerator.closest(from, (middle - from).normalize()).unwrap();
            assert!(hit.triangle < 3);
        }
    }
}
