//! A hit made into a surface: where it is, which way it faces, what colour it has.

mod normal_map;
mod site;

use crate::accel::Hit;
use crate::scene::{DeformedMesh, Material, Mesh, Pose, Scene, mesh_interpolate as interpolate, normal_matrix};
use glam::{Affine3A, Mat3A, Vec3, Vec3A, Vec4};
use site::Site;
use std::sync::Arc;

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World space, metres.
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

impl Surface {
    /// Whether this is the back of a surface that reflects on its front alone.
    pub(crate) fn is_back(&self) -> bool {
        !self.front && !self.double_sided
    }
}

/// The scene at one time, with what turning hits into surfaces needs.
pub struct Surfaces<'a> {
    scene: &'a Scene,
    world: Vec<Affine3A>,
    normals: Vec<Mat3A>,
    /// As in the pose: empty where nothing is deformed.
    deformed: Vec<Option<Arc<DeformedMesh>>>,
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
        Self { scene, world, normals, deformed: pose.all_deformed().to_vec() }
    }

    /// Evaluates `hit` for a ray in the unit `direction` whose footprint is `width` metres across at the hit.
    pub fn at(&self, hit: &Hit, direction: Vec3A, width: f32) -> Surface {
        let instance = hit.instance as usize;
        let mesh = self.mesh(instance);
        let material = &self.scene.materials[mesh.material];
        let world = &self.world[instance];
        let corners = self.corners(instance, hit.triangle as usize);
        let [a, b, c] = corners;
        let position = a + (b - a) * hit.u + (c - a) * hit.v;
        let area_vector = (b - a).cross(c - a);
        // A mirroring transform turns the corners round; the file's front stays the front.
        let mirrored = if world.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let outward = (area_vector * mirrored).try_normalize().unwrap_or(-direction);
        let front = outward.dot(direction) <= 0.0;
        let geometric_normal = if front { outward } else { -outward };
        let cos = geometric_normal.dot(direction).abs().max(0.1);
        let indices = mesh.triangles[hit.triangle as usize];
        let site = Site { scene: self.scene, mesh, indices, u: hit.u, v: hit.v, corners, outward, width: width / cos };

        let base = site.base_color(material);
        if material.unlit {
            return Surface {
                position,
                geometric_normal,
                shading_normal: geometric_normal,
                albedo: Vec3::ZERO,
                specular: Vec3::ZERO,
                roughness: 1.0,
                emission: base,
                front,
                double_sided: material.double_sided,
            };
        }
        let (shading_normal, unevenness) = self.shading_normal(&site, material, instance, geometric_normal, direction);
        let (metallic, roughness) = site.metallic_roughness(material);
        let roughness = normal_map::roughened(roughness, unevenness);
        let (albedo, specular) = material.split(base, metallic, roughness);
        let emits = material.emits() && (front || material.double_sided);
        Surface {
            position,
            geometric_normal,
            shading_normal,
            albedo,
            specular,
            roughness,
            emission: if emits { site.emission(material) } else { Vec3::ZERO },
            front,
            double_sided: material.double_sided,
        }
    }

    /// The normal to shade with, and how uneven the normal map is within the footprint.
    fn shading_normal(
        &self,
        site: &Site,
        material: &Material,
        instance: usize,
        geometric: Vec3A,
        direction: Vec3A,
    ) -> (Vec3A, f32) {
        let shape = self.shape(instance);
        let local = interpolate(shape.normals, site.indices, site.u, site.v);
        let smooth = local.and_then(|n| (self.normals[instance] * Vec3A::from(n)).try_normalize());
        // Normals belong to the front; seen from behind, the whole frame of the normal map turns round with them.
        let outward = smooth.unwrap_or(site.outward);
        let side = if outward.dot(geometric) < 0.0 { -1.0 } else { 1.0 };
        let (normal, unevenness) = match &material.normal_texture {
            None => (outward, 0.0),
            Some((slot, scale)) => {
                let tangent = interpolate(shape.tangents, site.indices, site.u, site.v);
                let given = local.zip(tangent).and_then(|(n, t)| normal_map::given(&self.world[instance], n, t));
                site.mapped_normal(slot, *scale, outward, given)
            }
        };
        let normal = normal * side;
        // At a silhouette a normal may turn away from the viewer: bend it back until it just grazes.
        let away = normal.dot(direction);
        (if away < 0.0 { normal } else { (normal - direction * (away + 1e-3)).normalize() }, unevenness)
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
    pub fn corners(&self, instance: usize, triangle: usize) -> [Vec3A; 3] {
        let positions = self.shape(instance).positions;
        self.mesh(instance).triangles[triangle]
            .map(|vertex| self.world[instance].transform_point3a(positions[vertex as usize].into()))
    }

    /// The scene these surfaces belong to.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// World from the space of an instance's vertices.
    pub fn world(&self, instance: usize) -> &Affine3A {
        &self.world[instance]
    }

    /// One per instance, or none at all where nothing is bent.
    pub(crate) fn all_deformed(&self) -> &[Option<Arc<DeformedMesh>>] {
        &self.deformed
    }

    /// The vertices of an instance that a skin or morph targets bend.
    pub fn deformed(&self, instance: usize) -> Option<&Arc<DeformedMesh>> {
        self.deformed.get(instance)?.as_ref()
    }
}
