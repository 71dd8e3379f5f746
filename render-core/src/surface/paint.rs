//! Surface properties that depend neither on light nor on the viewer.

use super::Surfaces;
use super::site::{Footprint, TrianglePoint};
use crate::accel::Hit;
use crate::bsdf::Bsdf;
use glam::{Vec3, Vec3A};

/// Cosine of the assumed viewing angle of coats.
const SLANT: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Reflectance, emission and opacity of a point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// Linear RGB reflectance, 0…1: the fraction of light reflected in all directions together. Coats and metals are
    /// evaluated for a viewer at 45°. No other single angle represents all angles better.
    pub reflectance: Vec3,
    /// Emitted radiance \[W·m⁻²·sr⁻¹\], zero for unlit surfaces.
    pub emission: Vec3,
    /// Opacity, 0…1, regardless of its meaning in the material.
    pub opacity: f32,
}

impl Surfaces<'_> {
    /// Returns the mean paint of a disk on a surface, `width` meters across, centered at the point of `hit`.
    #[must_use]
    pub fn paint(&self, hit: &Hit, width: f32) -> Paint {
        let (instance, triangle) = (hit.instance as usize, hit.triangle as usize);
        let mesh = self.mesh(instance);
        let material = self.material(instance);
        let corners = self.corners(instance, triangle);
        let [a, b, c] = corners;
        let outward = (b - a).cross(c - a).try_normalize().unwrap_or(Vec3A::Y);

        // A cone from directly above intersects the surface in a disk.
        let footprint = Footprint::ellipse(-outward, outward, width);
        let indices = mesh.triangles[triangle];
        let site = TrianglePoint { scene: self.scene, mesh, indices, u: hit.u, v: hit.v, corners, outward, footprint };
        let emission = if material.emits() && !material.unlit { site.emission(material) } else { Vec3::ZERO };
        let (metallic, roughness) = site.metallic_roughness(material);
        let (albedo, specular) = if material.lobes.is_some() {
            let surface = self.at(hit, -outward, width);
            (surface.albedo, surface.specular)
        } else {
            material.split(site.base_color(material), metallic, roughness)
        };
        // Evaluate a coat at a fixed angle, because the paint is independent of the viewer.
        let reflectance = match specular {
            Vec3::ZERO => albedo,
            _ => Bsdf::new(albedo, specular, roughness).directional_albedo(SLANT),
        };
        Paint { reflectance, emission, opacity: site.opacity(material) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Alpha, Material, Mesh, Scene};
    use glam::{vec3, vec4};

    /// A matte surface reflects its base color, and a metal nearly its base color. The opacity combines material and
    /// vertices.
    #[test]
    fn paint_is_what_the_material_says() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            colors: vec![vec4(1.0, 0.5, 1.0, 0.5); 3],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let material = Material {
            base_color: vec3(0.8, 0.6, 0.4),
            opacity: 0.5,
            alpha: Alpha::Blend,
            emission: vec3(1.0, 2.0, 3.0),
            ..Material::default()
        };
        let mut scene = Scene::of_mesh(mesh, material);
        let hit = Hit { distance: 0.0, instance: 0, triangle: 0, u: 0.25, v: 0.25 };
        let painted = |scene: &Scene| Surfaces::new(scene, &scene.pose(0.0)).paint(&hit, 0.1);
        let color = vec3(0.8, 0.3, 0.4);
        let expected = Paint { reflectance: color, emission: vec3(1.0, 2.0, 3.0), opacity: 0.25 };
        assert_eq!(painted(&scene), expected);
        (scene.materials[0].metallic, scene.materials[0].roughness) = (1.0, 0.3);
        let metal = painted(&scene).reflectance;
        assert!((metal - color).abs().max_element() < 0.03, "{metal}");
        scene.materials[0] = Material { unlit: true, metallic: 0.0, roughness: 1.0, ..scene.materials[0].clone() };
        assert_eq!(painted(&scene), Paint { emission: Vec3::ZERO, ..expected });
    }
}
