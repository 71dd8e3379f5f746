//! A hit on its triangle, of whose material only what is asked for is looked up: most of what a ray costs after its walk is
//! textures and normals, and a photon that is absorbed needs neither a normal to go on from nor what glows where it ends.

use super::site::Site;
use super::{Surface, Surfaces, normal_map};
use crate::accel::Hit;
use crate::scene::{Material, mesh_interpolate as interpolate};
use glam::{Vec3, Vec3A};

/// Where a ray met a surface.
pub(crate) struct Interaction<'a> {
    surfaces: &'a Surfaces<'a>,
    material: &'a Material,
    site: Site<'a>,
    /// Of the ray.
    direction: Vec3A,
    pub instance: u32,
    /// World space, metres.
    pub position: Vec3A,
    /// Unit normal of the triangle, on the side of the ray's origin.
    pub geometric_normal: Vec3A,
    /// Whether the ray met the side that the file calls the front.
    pub front: bool,
}

impl<'a> Interaction<'a> {
    pub(super) fn new(surfaces: &'a Surfaces<'a>, hit: &Hit, direction: Vec3A, width: f32) -> Self {
        let instance = hit.instance as usize;
        let mesh = surfaces.mesh(instance);
        let material = &surfaces.scene.materials[mesh.material];
        let world = &surfaces.world[instance];
        let corners = surfaces.corners(instance, hit.triangle as usize);
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
        let site =
            Site { scene: surfaces.scene, mesh, indices, u: hit.u, v: hit.v, corners, outward, width: width / cos };
        Self { surfaces, material, site, direction, instance: hit.instance, position, geometric_normal, front }
    }

    /// Whether this is the back of a surface that reflects on its front alone.
    pub fn is_back(&self) -> bool {
        !self.front && !self.material.double_sided
    }

    /// [`Surface::albedo`].
    pub fn albedo(&self) -> Vec3 {
        let Self { material, site, .. } = self;
        if material.unlit {
            return Vec3::ZERO;
        }
        // How rough the coat is says nothing about the base.
        let (metallic, roughness) = site.metallic_roughness(material);
        material.split(site.base_color(material), metallic, roughness).0
    }

    /// [`Surface::emission`].
    pub fn emission(&self) -> Vec3 {
        let Self { material, site, .. } = self;
        if material.unlit {
            site.base_color(material)
        } else if material.emits() && !self.is_back() {
            site.emission(material)
        } else {
            Vec3::ZERO
        }
    }

    /// [`Surface::shading_normal`].
    pub fn shading_normal(&self) -> Vec3A {
        if self.material.unlit { self.geometric_normal } else { self.normal_and_unevenness().0 }
    }

    /// All of it.
    pub fn surface(&self) -> Surface {
        let Self { material, site, position, geometric_normal, front, .. } = self;
        let dark = Surface {
            position: *position,
            geometric_normal: *geometric_normal,
            shading_normal: *geometric_normal,
            albedo: Vec3::ZERO,
            specular: Vec3::ZERO,
            roughness: 1.0,
            emission: self.emission(),
            front: *front,
            double_sided: material.double_sided,
        };
        if material.unlit {
            return dark;
        }
        let (shading_normal, unevenness) = self.normal_and_unevenness();
        let (metallic, roughness) = site.metallic_roughness(material);
        let roughness = normal_map::roughened(roughness, unevenness);
        let (albedo, specular) = material.split(site.base_color(material), metallic, roughness);
        Surface { shading_normal, albedo, specular, roughness, ..dark }
    }

    /// The normal to shade with, and how uneven the normal map is within the footprint.
    fn normal_and_unevenness(&self) -> (Vec3A, f32) {
        let Self { surfaces, material, site, direction, .. } = self;
        let instance = self.instance as usize;
        let shape = surfaces.shape(instance);
        let local = interpolate(shape.normals, site.indices, site.u, site.v);
        let smooth = local.and_then(|n| (surfaces.normals[instance] * Vec3A::from(n)).try_normalize());
        // Normals belong to the front; seen from behind, the whole frame of the normal map turns round with them.
        let outward = smooth.unwrap_or(site.outward);
        let side = if outward.dot(self.geometric_normal) < 0.0 { -1.0 } else { 1.0 };
        let (normal, unevenness) = match &material.normal_texture {
            None => (outward, 0.0),
            Some((slot, scale)) => {
                let tangent = interpolate(shape.tangents, site.indices, site.u, site.v);
                let given = local.zip(tangent).and_then(|(n, t)| normal_map::given(&surfaces.world[instance], n, t));
                site.mapped_normal(slot, *scale, outward, given)
            }
        };
        let normal = normal * side;
        // At a silhouette a normal may turn away from the viewer: bend it back until it just grazes.
        let away = normal.dot(*direction);
        (if away < 0.0 { normal } else { (normal - *direction * (away + 1e-3)).normalize() }, unevenness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Geometry;
    use crate::sampling::{sobol_point, uniform_sphere};
    use crate::scene::load;
    use std::path::Path;

    /// What is asked for piece by piece is what a whole surface has, on every material of a scene and on both sides.
    #[test]
    fn pieces_are_those_of_the_whole() {
        let scene = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell/cornell.glb")).unwrap();
        let pose = scene.pose(0.0);
        let surfaces = Surfaces::new(&scene, &pose);
        let accelerator = Geometry::new(&scene).place(&pose);
        let mut met = 0;
        for k in 0..4000 {
            let direction = Vec3A::from(uniform_sphere(sobol_point(k)));
            let Some(hit) = accelerator.closest(Vec3A::new(0.0, 0.27, -0.1), direction) else { continue };
            let whole = surfaces.at(&hit, direction, 0.01);
            let piece = surfaces.meet(&hit, direction, 0.01);
            met += 1;
            assert_eq!(piece.albedo(), whole.albedo);
            assert_eq!(piece.emission(), whole.emission);
            assert_eq!(piece.shading_normal(), whole.shading_normal);
            assert_eq!(piece.is_back(), !(whole.front || whole.double_sided));
        }
        assert!(met > 1000, "{met}");
    }
}
