//! A hit made into a surface: where it is, which way it faces, what color it has.

mod interaction;
mod normal_map;
mod paint;
mod site;

pub(crate) use interaction::Interaction;
pub use paint::Paint;
use site::Footprint;

use crate::accel::Hit;
use crate::scene::{DeformedMesh, Material, Mesh, Pose, Scene, normal_matrix};
use glam::{Affine3A, Mat3A, Vec3, Vec3A, Vec4};
use std::sync::Arc;

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World space, meters.
    pub position: Vec3A,
    /// Unit normal of the triangle, on the side of the ray's origin.
    pub geometric_normal: Vec3A,
    /// Unit normal to shade with: smooth, bent by the normal map, and never turned away from the ray's origin.
    pub shading_normal: Vec3A,
    /// Linear RGB reflectance of the diffuse base, 0…1.
    pub albedo: Vec3,
    /// Linear RGB reflectance of the GGX coat at normal incidence, 0…1; zero for a Lambert surface.
    pub specular: Vec3,
    /// Perceptual roughness of the coat, 0…1: the square root of GGX's α.
    pub roughness: f32,
    /// Emitted radiance towards the ray's origin \[W·m⁻²·sr⁻¹\].
    pub emission: Vec3,
    /// Whether the ray met the side that the file calls the front.
    pub front: bool,
    /// Whether the material reflects on both sides.
    pub double_sided: bool,
}

/// The scene at one time, with what turning hits into surfaces needs.
pub struct Surfaces<'a> {
    scene: &'a Scene,
    world: Vec<Affine3A>,
    normals: Vec<Mat3A>,
    /// As in the pose: empty where nothing is deformed.
    deformed: Vec<Option<Arc<DeformedMesh>>>,
    moving: Arc<[bool]>,
    /// As in the pose: empty where none is animated.
    materials: Arc<[Material]>,
}

impl std::fmt::Debug for Surfaces<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Surfaces").field("instances", &self.world.len()).finish_non_exhaustive()
    }
}

/// The vertices of an instance, as its mesh has them or as they are bent.
struct Shape<'a> {
    positions: &'a [Vec3],
    normals: &'a [Vec3],
    tangents: &'a [Vec4],
}

impl<'a> Surfaces<'a> {
    /// Prepares the transforms of all instances.
    pub fn new(scene: &'a Scene, pose: &Pose) -> Self {
        let instances = 0..scene.instances.len();
        let world: Vec<Affine3A> = instances.map(|instance| scene.instance_world(pose, instance)).collect();
        let normals = world.iter().map(normal_matrix).collect();
        let moving = scene.moving_instances().into();
        let (deformed, materials) = (pose.all_deformed().to_vec(), pose.animated_materials().clone());
        Self { scene, world, normals, deformed, moving, materials }
    }

    /// Evaluates `hit` for a ray in the unit `direction` whose cone is `width` meters across at the hit.
    ///
    /// Textures are filtered over the ellipse that the cone meets, however slanted the surface is.
    #[must_use]
    pub fn at(&self, hit: &Hit, direction: Vec3A, width: f32) -> Surface {
        self.point(hit, direction, width).surface()
    }

    /// The same, with its material looked up on demand.
    pub(crate) fn point(&self, hit: &Hit, direction: Vec3A, width: f32) -> Interaction<'_> {
        Interaction::new(self, hit, direction, |direction, normal| Footprint::ellipse(direction, normal, width))
    }

    /// The same for a ray of indirect light: its material is looked up on demand, once, over a disk of the ellipse's length.
    pub(crate) fn meet(&self, hit: &Hit, direction: Vec3A, width: f32) -> Interaction<'_> {
        Interaction::new(self, hit, direction, |direction, normal| Footprint::disk(direction, normal, width))
    }

    /// Whether a ray in the unit `direction` met the side of `hit` that the file calls the front.
    #[must_use]
    pub fn is_front(&self, hit: &Hit, direction: Vec3A) -> bool {
        self.meet(hit, direction, 0.0).front
    }

    /// Whether a ray in the unit `direction` met the back of a surface that reflects on its front alone.
    #[must_use]
    pub fn is_back(&self, hit: &Hit, direction: Vec3A) -> bool {
        self.meet(hit, direction, 0.0).is_back()
    }

    fn mesh(&self, instance: usize) -> &'a Mesh {
        &self.scene.meshes[self.scene.instances[instance].mesh]
    }

    fn shape(&self, instance: usize) -> Shape<'_> {
        match self.deformed(instance) {
            Some(bent) => Shape { positions: &bent.positions, normals: &bent.normals, tangents: &bent.tangents },
            None => {
                let mesh = self.mesh(instance);
                Shape { positions: &mesh.positions, normals: &mesh.normals, tangents: &mesh.tangents }
            }
        }
    }

    /// World-space corners of a triangle.
    #[must_use]
    pub fn corners(&self, instance: usize, triangle: usize) -> [Vec3A; 3] {
        let positions = self.shape(instance).positions;
        self.mesh(instance).triangles[triangle]
            .map(|vertex| self.world[instance].transform_point3a(positions[vertex as usize].into()))
    }

    /// The scene these surfaces belong to.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// The material of an instance at that time.
    #[must_use]
    pub fn material(&self, instance: usize) -> &Material {
        let material = self.mesh(instance).material;
        self.materials.get(material).unwrap_or(&self.scene.materials[material])
    }

    /// By instance, whether it ever moves or changes its shape or material ([`Scene::moving_instances`]).
    #[must_use]
    pub fn moving(&self) -> &Arc<[bool]> {
        &self.moving
    }

    /// World from the space of an instance's vertices.
    #[must_use]
    pub fn world(&self, instance: usize) -> &Affine3A {
        &self.world[instance]
    }

    /// One per instance, or none at all where nothing is bent.
    pub(crate) fn all_deformed(&self) -> &[Option<Arc<DeformedMesh>>] {
        &self.deformed
    }

    /// The vertices of an instance that a skin or morph targets bend.
    #[must_use]
    pub fn deformed(&self, instance: usize) -> Option<&Arc<DeformedMesh>> {
        self.deformed.get(instance)?.as_ref()
    }
}
