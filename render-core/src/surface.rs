//! Evaluation of hits: position, normals, color and emission of surfaces.

mod interaction;
mod lobes;
mod normal_map;
mod paint;
mod site;

pub(crate) use interaction::Interaction;
pub use paint::Paint;
use site::Footprint;

use crate::accel::Hit;
use crate::bsdf::SurfaceLobes;
use crate::scene::{DeformedMesh, Material, Mesh, Pose, Scene, normal_matrix};
use glam::{Affine3A, Mat3A, Vec3, Vec3A, Vec4};
use std::sync::Arc;

/// Point on a surface.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Position in world space \[m\].
    pub position: Vec3A,
    /// Normal of the triangle on the side of the ray's origin, a unit vector.
    pub geometric_normal: Vec3A,
    /// Shading normal, a unit vector: smooth, modified by the normal map, and never facing away from the ray's origin.
    pub shading_normal: Vec3A,
    /// Linear RGB reflectance of the diffuse base, 0…1.
    pub albedo: Vec3,
    /// Linear RGB reflectance of the GGX coat at normal incidence, 0…1; zero for a Lambert surface.
    pub specular: Vec3,
    /// Perceptual roughness of the coat, 0…1: the square root of GGX's α.
    pub roughness: f32,
    /// Emitted radiance towards the ray's origin \[W·m⁻²·sr⁻¹\].
    pub emission: Vec3,
    /// Whether the ray hit the front, as the file defines it.
    pub front: bool,
    /// Whether the material reflects on both sides.
    pub double_sided: bool,
    /// Lobes of material extensions; `None` for plain materials. Then albedo and coat describe the whole surface.
    pub lobes: Option<Box<SurfaceLobes>>,
}

/// Scene at one time, with the data for evaluating hits.
pub struct Surfaces<'a> {
    scene: &'a Scene,
    world: Vec<Affine3A>,
    normals: Vec<Mat3A>,
    /// Deformed meshes of the pose. Empty if no mesh is deformed.
    deformed: Vec<Option<Arc<DeformedMesh>>>,
    moving: Arc<[bool]>,
    /// Materials of the pose. Empty if no material is animated.
    materials: Arc<[Material]>,
}

impl std::fmt::Debug for Surfaces<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Surfaces").field("instances", &self.world.len()).finish_non_exhaustive()
    }
}

/// Vertices of an instance, from its mesh or deformed.
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

    /// Evaluates `hit` for a ray in the unit `direction`, with a cone `width` meters wide at the hit.
    ///
    /// Filters textures over the ellipse in which the cone intersects the surface, at any slant.
    #[must_use]
    pub fn at(&self, hit: &Hit, direction: Vec3A, width: f32) -> Surface {
        self.point(hit, direction, width).surface()
    }

    /// Evaluates a hit of an indirect ray like [`Surfaces::at`], but samples each texture once, over a disk.
    #[must_use]
    pub fn at_indirect(&self, hit: &Hit, direction: Vec3A, width: f32) -> Surface {
        self.meet(hit, direction, width).surface()
    }

    /// Evaluates a hit like [`Surfaces::at`], but samples the hit's material on demand.
    pub(crate) fn point(&self, hit: &Hit, direction: Vec3A, width: f32) -> Interaction<'_> {
        Interaction::new(self, hit, direction, |direction, normal| Footprint::ellipse(direction, normal, width))
    }

    /// Evaluates a hit of an indirect ray. Samples the material on demand, once per texture, over a disk as wide as the
    /// ellipse is long.
    pub(crate) fn meet(&self, hit: &Hit, direction: Vec3A, width: f32) -> Interaction<'_> {
        Interaction::new(self, hit, direction, |direction, normal| Footprint::disk(direction, normal, width))
    }

    /// Returns the hit of a ray from `origin` at a known `position` on a triangle, both in world space \[m\].
    #[must_use]
    pub fn hit_at(&self, instance: u32, triangle: u32, position: Vec3A, origin: Vec3A) -> Hit {
        let [a, b, c] = self.corners(instance as usize, triangle as usize);
        let (ab, ac, at) = (b - a, c - a, position - a);
        // Barycentric weights are fractions of the triangle's area, measured along its normal.
        let area = ab.cross(ac);
        let whole = area.length_squared().max(f32::MIN_POSITIVE);
        let (u, v) = (at.cross(ac).dot(area) / whole, ab.cross(at).dot(area) / whole);
        Hit { distance: position.distance(origin), instance, triangle, u, v }
    }

    /// Returns whether a ray in the unit `direction` hit the front, as the file defines it.
    #[must_use]
    pub fn is_front(&self, hit: &Hit, direction: Vec3A) -> bool {
        self.meet(hit, direction, 0.0).front
    }

    /// Returns whether a ray in the unit `direction` hit the back of a single-sided surface.
    #[must_use]
    pub fn is_back(&self, hit: &Hit, direction: Vec3A) -> bool {
        self.meet(hit, direction, 0.0).is_back()
    }

    /// Returns whether light may pass straight through some surfaces: clear thin walls.
    pub(crate) fn has_clear_walls(&self) -> bool {
        (0..self.world.len()).any(|instance| self.may_be_clear(instance as u32))
    }

    /// Returns whether an instance may be a clear thin wall.
    pub(crate) fn may_be_clear(&self, instance: u32) -> bool {
        let lobes = self.material(instance as usize).lobes.as_ref();
        lobes.is_some_and(|lobes| lobes.transmission.factor > 0.0 && lobes.transmission.volume.is_none())
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

    /// Returns the world-space corners of a triangle.
    #[must_use]
    pub fn corners(&self, instance: usize, triangle: usize) -> [Vec3A; 3] {
        let positions = self.shape(instance).positions;
        self.mesh(instance).triangles[triangle]
            .map(|vertex| self.world[instance].transform_point3a(positions[vertex as usize].into()))
    }

    /// Returns the number of triangles of an instance.
    #[must_use]
    pub fn triangle_count(&self, instance: usize) -> usize {
        self.mesh(instance).triangles.len()
    }

    /// Returns the scene of these surfaces.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Returns the material of an instance at the time of the pose.
    #[must_use]
    pub fn material(&self, instance: usize) -> &Material {
        let material = self.mesh(instance).material;
        self.materials.get(material).unwrap_or(&self.scene.materials[material])
    }

    /// Returns, for each instance, whether its transform, shape or material ever changes ([`Scene::moving_instances`]).
    #[must_use]
    pub fn moving(&self) -> &Arc<[bool]> {
        &self.moving
    }

    /// Returns the transform from the space of an instance's vertices to world space.
    #[must_use]
    pub fn world(&self, instance: usize) -> &Affine3A {
        &self.world[instance]
    }

    /// Returns the deformed meshes, one per instance. The list is empty if no mesh is deformed.
    pub(crate) fn all_deformed(&self) -> &[Option<Arc<DeformedMesh>>] {
        &self.deformed
    }

    /// Returns the deformed vertices of an instance, or `None` without skin and morph targets.
    #[must_use]
    pub fn deformed(&self, instance: usize) -> Option<&Arc<DeformedMesh>> {
        self.deformed.get(instance)?.as_ref()
    }
}
