//! A hit made into a surface: where it is, which way it faces, what colour it has.

use crate::accel::Hit;
use crate::scene::{Material, Mesh, Pose, Scene, TextureSlot, mesh_interpolate as interpolate, normal_matrix};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World space, metres.
    pub position: Vec3A,
    /// Unit normal of the triangle, on the side of the ray's origin.
    pub geometric_normal: Vec3A,
    /// Unit normal to shade with, on the same side.
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
}

impl<'a> Surfaces<'a> {
    /// Prepares the transforms of all instances.
    pub fn new(scene: &'a Scene, pose: &Pose) -> Self {
        let world: Vec<Affine3A> = scene.instances.iter().map(|instance| pose.world[instance.node]).collect();
        let normals = world.iter().map(normal_matrix).collect();
        Self { scene, world, normals }
    }

    /// Evaluates `hit` for a ray in the unit `direction` whose footprint is `width` metres across at the hit.
    pub fn at(&self, hit: &Hit, direction: Vec3A, width: f32) -> Surface {
        let instance = hit.instance as usize;
        let mesh = &self.scene.meshes[self.scene.instances[instance].mesh];
        let material = &self.scene.materials[mesh.material];
        let world = &self.world[instance];
        let corners = mesh.corners(hit.triangle as usize).map(|corner| world.transform_point3a(corner.into()));
        let [a, b, c] = corners;
        let position = a + (b - a) * hit.u + (c - a) * hit.v;
        let area_vector = (b - a).cross(c - a);
        // A mirroring transform turns the corners round; the file's front stays the front.
        let mirrored = if world.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let outward = (area_vector * mirrored).try_normalize().unwrap_or(-direction);
        let front = outward.dot(direction) <= 0.0;
        let geometric_normal = if front { outward } else { -outward };
        let shading_normal = self.shading_normal(mesh, hit, instance, geometric_normal, direction);
        let cos = geometric_normal.dot(direction).abs().max(0.1);
        let (base, emission) = self.colors(mesh, material, hit, corners, width / cos);
        let (albedo, specular) = Material::split(base, material.metallic, material.roughness);
        let emits = front || material.double_sided || material.unlit;
        Surface {
            position,
            geometric_normal,
            shading_normal,
            albedo: if material.unlit { Vec3::ZERO } else { albedo },
            specular: if material.unlit { Vec3::ZERO } else { specular },
            roughness: material.roughness,
            emission: if material.unlit {
                base
            } else if emits {
                emission
            } else {
                Vec3::ZERO
            },
            front,
            double_sided: material.double_sided,
        }
    }

    fn shading_normal(&self, mesh: &Mesh, hit: &Hit, instance: usize, geometric: Vec3A, direction: Vec3A) -> Vec3A {
        let smooth = interpolate(&mesh.normals, mesh.triangles[hit.triangle as usize], hit.u, hit.v);
        let Some(normal) = smooth.and_then(|n| (self.normals[instance] * Vec3A::from(n)).try_normalize()) else {
            return geometric;
        };
        let normal = if normal.dot(geometric) < 0.0 { -normal } else { normal };
        // At a silhouette a smooth normal may turn away from the viewer: bend it back until it just grazes.
        let away = normal.dot(direction);
        if away < 0.0 { normal } else { (normal - direction * (away + 1e-3)).normalize() }
    }

    /// Reflectance and emission with textures blurred to `width` metres.
    fn colors(&self, mesh: &Mesh, material: &Material, hit: &Hit, corners: [Vec3A; 3], width: f32) -> (Vec3, Vec3) {
        let indices = mesh.triangles[hit.triangle as usize];
        let look_up = |slot: &Option<TextureSlot>| -> Vec3 {
            let Some(slot) = slot else { return Vec3::ONE };
            let texture = &self.scene.textures[slot.texture];
            let uvs = &mesh.uvs[slot.uv_set];
            let Some(uv) = interpolate(uvs, indices, hit.u, hit.v) else { return Vec3::ONE };
            let [p, q, r] = indices.map(|vertex| slot.map(uvs[vertex as usize]) * texture.size());
            let texels = (q - p).perp_dot(r - p).abs();
            let metres = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let footprint = if metres > 0.0 { width * (texels / metres).sqrt() } else { 1.0 };
            texture.sample(slot.map(uv), footprint).0
        };
        let vertex = interpolate(&mesh.colors, indices, hit.u, hit.v).unwrap_or(Vec3::ONE);
        let albedo =
            (material.base_color * vertex * look_up(&material.base_color_texture)).clamp(Vec3::ZERO, Vec3::ONE);
        let emission =
            if material.emits() { material.emission * look_up(&material.emission_texture) } else { Vec3::ZERO };
        (albedo, emission)
    }

    /// World-space corners of a triangle.
    pub fn corners(&self, instance: usize, triangle: usize) -> [Vec3A; 3] {
        let mesh = &self.scene.meshes[self.scene.instances[instance].mesh];
        mesh.corners(triangle).map(|corner| self.world[instance].transform_point3a(corner.into()))
    }

    /// The scene these surfaces belong to.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// World from local of an instance.
    pub fn world(&self, instance: usize) -> &Affine3A {
        &self.world[instance]
    }
}
