//! Transparent surfaces, which shadow rays pass straight.
//!
//! Shadow rays to sampled lights and to lights of the tree are not refracted: glass transmits a fraction of the light
//! along them.
//!
//! ```text
//! T = τ (1 − F(θ)) tint          per surface        exp(−σ d) over the distance d between two surfaces of a volume
//! ```
//! Rays from the camera, photons and reflection rays hit these surfaces.

use super::triangles::Owner;
use crate::bsdf::dielectric_reflectance;
use crate::scene::{Alpha, Material, Mesh, Scene, Texture, TextureSlot};
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// Transmittance of all transparent instances.
pub(crate) struct Panes(Vec<Option<Arc<Pane>>>);

/// Transmittance of a mesh.
struct Pane {
    /// Fraction of the surface that is glass, τ.
    factor: f32,
    ior: f32,
    /// Linear RGB factor on light that passes the surface once.
    tint: Vec3,
    /// Texture of the tint, with the coordinates of the triangles' corners.
    texture: Option<(Texture, Vec<[Vec2; 3]>)>,
    /// Attenuation coefficient \[1/m\] of a volume; `None` for a thin wall.
    attenuation: Option<Vec3>,
}

impl Panes {
    /// Collects the transparent instances of a scene, or returns `None` if it has none. Surfaces with holes are not
    /// included.
    pub(super) fn new(scene: &Scene) -> Option<Self> {
        let mut of_mesh: Vec<Option<Arc<Pane>>> = Vec::with_capacity(scene.meshes.len());
        for mesh in &scene.meshes {
            of_mesh.push(Pane::new(scene, mesh, &scene.materials[mesh.material]).map(Arc::new));
        }
        let panes: Vec<_> = scene.instances.iter().map(|instance| of_mesh[instance.mesh].clone()).collect();
        panes.iter().any(Option::is_some).then_some(Self(panes))
    }

    /// Returns whether an instance transmits light.
    pub(super) fn has_pane(&self, instance: usize) -> bool {
        self.0[instance].is_some()
    }

    /// Returns the fraction of light that a triangle transmits at a point, linear RGB. `at` contains the barycentric
    /// weights of the second and third corner, and `cos` is the cosine between ray and normal.
    pub(super) fn transmittance(&self, owner: Owner, at: [f32; 2], cos: f32) -> Vec3 {
        let Some(pane) = &self.0[owner.instance as usize] else { return Vec3::ZERO };
        pane.tint_at(owner.triangle as usize, at) * (pane.factor * (1.0 - dielectric_reflectance(cos, pane.ior)))
    }

    /// Returns the attenuation coefficient of an instance's volume \[1/m\], or `None` for thin walls.
    pub(super) fn attenuation(&self, instance: u32) -> Option<Vec3> {
        self.0[instance as usize].as_ref()?.attenuation
    }
}

impl Pane {
    fn new(scene: &Scene, mesh: &Mesh, material: &Material) -> Option<Self> {
        let lobes = material.lobes.as_ref().filter(|_| material.alpha == Alpha::Opaque)?;
        let factor = lobes.transmission.factor * (1.0 - material.metallic);
        if factor <= 0.0 {
            return None;
        }
        let coordinates = |slot: &TextureSlot| {
            let uvs = &mesh.uvs[slot.uv_set];
            let corners = |triangle: &[u32; 3]| triangle.map(|vertex| slot.map(uvs[vertex as usize]));
            (!uvs.is_empty()).then(|| mesh.triangles.iter().map(corners).collect())
        };
        let texture = material
            .base_color_texture
            .as_ref()
            .and_then(|slot| Some((scene.textures[slot.texture].clone(), coordinates(slot)?)));
        let attenuation = lobes.transmission.volume.map(|volume| volume.attenuation);
        Some(Self { factor, ior: lobes.ior, tint: material.base_color, texture, attenuation })
    }

    /// Returns the tint at a point of a triangle.
    fn tint_at(&self, triangle: usize, [u, v]: [f32; 2]) -> Vec3 {
        let mut tint = self.tint;
        if let Some((texture, coordinates)) = &self.texture {
            let [a, b, c] = coordinates[triangle];
            tint *= texture.sample(a * (1.0 - u - v) + b * u + c * v, 0.0).color;
        }
        // Light passes two surfaces of a volume, and each has half of the effect.
        if self.attenuation.is_some() { tint.max(Vec3::ZERO).map(f32::sqrt) } else { tint }
    }
}
