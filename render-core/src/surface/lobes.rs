//! Evaluation of a material's lobes at a hit.

use super::interaction::{Interaction, TexturedFinish};
use crate::bsdf::{GlassLobe, SurfaceLobes};
use crate::scene::{Material, MaterialLobes, TextureSlot};
use glam::Vec3;

/// Reflectance of a surface with lobes that reflect no light.
const LEAST_COAT: f32 = 1e-6;

impl Interaction<'_> {
    /// Returns the lobes of material extensions on a surface with the shading `normal`, or `None` for plain materials.
    pub(super) fn lobes(&self, finish: &TexturedFinish) -> Option<Box<SurfaceLobes>> {
        let lobes = self.material.lobes.as_ref()?;
        Some(Box::new(self.evaluated(lobes, finish)))
    }

    fn evaluated(&self, lobes: &MaterialLobes, finish: &TexturedFinish) -> SurfaceLobes {
        let site = &self.site;
        let color = |slot: &Option<TextureSlot>| site.color(slot);
        let alpha = |slot: &Option<TextureSlot>| {
            slot.as_ref().and_then(|slot| site.look_up(slot)).map_or(1.0, |found| found.opacity)
        };
        let base_color = site.base_color(self.material);
        let (metallic, roughness) = (finish.metallic, finish.roughness);

        // Reflectance of the dielectric: `KHR_materials_specular`.
        let strength = alpha(&lobes.specular.texture);
        let dielectric = self.material.dielectric_f0 * color(&lobes.specular.color_texture) * strength;
        let grazing = lobes.specular.factor * strength;

        // Separate glass from the opaque rest, which contains all of the metal.
        let transmission = &lobes.transmission;
        let glassy = (1.0 - metallic) * transmission.factor * color(&transmission.texture).x;
        let metal = if glassy < 1.0 { (metallic / (1.0 - glassy)).min(1.0) } else { 1.0 };
        let plain = Material { dielectric_f0: dielectric, ..Material::default() };
        let (base, specular) = plain.split(base_color, metal, roughness);

        // Direction of the wider lobe, as long as the strength of the anisotropy.
        let anisotropy = &lobes.anisotropy;
        let wider = if anisotropy.strength > 0.0 {
            let [x, y] = self.tangent_axes(anisotropy.texture.as_ref(), finish.normal);
            let texel = anisotropy.texture.map_or(Vec3::new(1.0, 0.5, 1.0), |_| color(&anisotropy.texture));
            let along = anisotropy.at(texel);
            Vec3::from(x * along.x + y * along.y)
        } else {
            Vec3::ZERO
        };

        let (coat, film, leaf) = (&lobes.clearcoat, &lobes.iridescence, &lobes.diffuse_transmission);
        let [thinnest, thickest] = film.thickness;
        // Without a texture, the film has its maximum thickness.
        let thickness = film.thickness_texture.map_or(1.0, |_| color(&film.thickness_texture).y);
        SurfaceLobes {
            base,
            specular,
            roughness,
            grazing: grazing + (1.0 - grazing) * metal,
            anisotropy: wider.length().min(1.0),
            tangent: wider.normalize_or_zero(),
            clearcoat: coat.factor * color(&coat.texture).x,
            clearcoat_roughness: coat.roughness * color(&coat.roughness_texture).y,
            clearcoat_normal: self.normal_of(coat.normal_texture.as_ref()).into(),
            sheen: lobes.sheen.color * color(&lobes.sheen.color_texture),
            sheen_roughness: lobes.sheen.roughness * alpha(&lobes.sheen.roughness_texture),
            film: film.factor * color(&film.texture).x,
            film_ior: film.ior,
            film_thickness: thinnest + (thickest - thinnest) * thickness,
            glass: GlassLobe {
                factor: glassy,
                // The base color is a factor for light that passes an object, so each surface of a volume has its root.
                tint: if transmission.volume.is_some() { base_color.map(f32::sqrt) } else { base_color },
                specular: dielectric,
                ior: lobes.ior,
                is_thin: transmission.volume.is_none(),
                attenuation: transmission.volume.map_or(Vec3::ZERO, |volume| volume.attenuation),
                dispersion: transmission.dispersion,
            },
            diffuse_transmission: leaf.factor * alpha(&leaf.texture),
            diffuse_color: leaf.color * color(&leaf.color_texture) * (1.0 - metal),
        }
    }
}

impl SurfaceLobes {
    /// Returns the diffuse reflectance, and the reflectance of all glossy lobes at normal incidence.
    ///
    /// They describe the surface to computations that ignore further lobes.
    pub(super) fn summary(&self) -> (Vec3, Vec3) {
        let opaque = 1.0 - self.glass.factor;
        let albedo = self.base * (opaque * (1.0 - self.diffuse_transmission));
        // Clearcoat and sheen reflect about these fractions of uniform light.
        let layers = Vec3::splat(0.04 * self.clearcoat) + self.sheen * 0.05;
        let specular = self.specular * opaque + self.glass.specular * self.glass.factor + layers;
        // A transparent surface has a coat even without reflection, so that its light is computed.
        let specular = if specular == Vec3::ZERO { Vec3::splat(LEAST_COAT) } else { specular };
        (albedo, specular.min(Vec3::ONE))
    }
}
