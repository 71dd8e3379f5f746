//! Materials of the page, with their images.

use super::super::export::document::{Document, number};
use super::super::export::{image_kind, png};
use super::geometry::{has_same_coordinates, slots};
use super::payload::Payload;
use glam::Vec3;
use pipeline::error::{Error, Result};
use render_core::scene::{Alpha, Material, Scene, Texture, TextureSlot, Wrap};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

/// Image of a texture as bytes of a file.
struct Image {
    kind: &'static str,
    bytes: Vec<u8>,
}

/// Descriptions of all materials, and the images that they use.
pub(super) struct ViewMaterials<'a> {
    scene: &'a Scene,
    exposure: f32,
    /// Images by index of the scene's texture.
    images: BTreeMap<usize, Image>,
}

impl<'a> ViewMaterials<'a> {
    /// Reads the images of the materials in use from the scene's file again.
    pub fn new(scene: &'a Scene, path: &Path, exposure: f32) -> Result<Self> {
        let mut materials = Self { scene, exposure, images: BTreeMap::new() };
        // Scenes without textures need no second reading.
        if scene.textures.is_empty() {
            return Ok(materials);
        }
        let document = Document::read(path, scene.origin.reach)?;
        for instance in &scene.instances {
            let index = scene.meshes[instance.mesh].material;
            let material = &scene.materials[index];
            for (place, slot) in used(material) {
                if let Entry::Vacant(entry) = materials.images.entry(slot.texture) {
                    let texture = &scene.textures[slot.texture];
                    let source = original(&document, index, place, texture);
                    entry.insert(source.map_or_else(|| encoded(texture), Ok)?);
                }
            }
        }
        Ok(materials)
    }

    /// Returns the size of all images \[bytes\].
    pub fn image_bytes(&self) -> usize {
        self.images.values().map(|image| image.bytes.len()).sum()
    }

    /// Adds the images to the page and returns the descriptions of materials and textures.
    ///
    /// `is_lamp` returns whether a material has surfaces that are sampled as lamps.
    pub fn add_to(&self, payload: &mut Payload, is_lamp: impl Fn(usize) -> bool) -> Value {
        let mut textures = Vec::new();
        let mut number_of: BTreeMap<usize, usize> = BTreeMap::new();
        for (&texture, image) in &self.images {
            let name = format!("image{texture}");
            payload.add_raw(&name, &image.bytes);
            number_of.insert(texture, textures.len());
            let sampled = &self.scene.textures[texture];
            textures.push(json!({
                "block": name,
                "kind": image.kind,
                "wrap": sampled.wrap().map(|wrap| match wrap {
                    Wrap::Repeat => 0,
                    Wrap::Mirror => 1,
                    Wrap::Clamp => 2,
                }),
                "blocky": sampled.is_blocky(),
            }));
        }
        let mut list = Vec::new();
        for (index, material) in self.scene.materials.iter().enumerate() {
            let mut description = self.description(material, &number_of);
            description["lamp"] = json!(is_lamp(index));
            list.push(description);
        }
        json!({ "list": list, "textures": textures })
    }

    /// Returns the mean base color of a material, for its reflections.
    fn mean_color(&self, material: &Material) -> Vec3 {
        let texture = material.base_color_texture.as_ref().map(|slot| self.scene.textures[slot.texture].mean());
        material.base_color * texture.unwrap_or(Vec3::ONE)
    }

    /// Describes a material. `number_of` contains the number in the page of each texture of the scene.
    fn description(&self, material: &Material, number_of: &BTreeMap<usize, usize>) -> Value {
        let sets = slots(material);
        let slot = |slot: &Option<TextureSlot>| {
            let slot = slot.as_ref()?;
            let set = sets.iter().position(|known| has_same_coordinates(known, slot))?;
            Some(json!({ "texture": number_of.get(&slot.texture)?, "set": set }))
        };
        let (alpha, cutoff) = match material.alpha {
            Alpha::Opaque => (0, 0.0),
            Alpha::Mask { cutoff } => (1, cutoff),
            Alpha::Blend => (2, 0.0),
        };
        // The color of an unlit surface is its radiance, so it needs the exposure.
        let emission = if material.unlit { Vec3::splat(self.exposure) } else { material.emission * self.exposure };
        json!({
            "base": material.base_color.to_array(),
            "opacity": material.opacity,
            "alpha": alpha,
            "cutoff": cutoff,
            "metallic": material.metallic,
            "roughness": material.roughness,
            "f0": material.dielectric_f0.to_array(),
            "emission": emission.to_array(),
            "coat": material.may_have_coat(),
            "baseTexture": slot(&material.base_color_texture),
            "roughTexture": slot(&material.metallic_roughness_texture),
            "emissionTexture": slot(&material.emission_texture),
            "mean": self.mean_color(material).to_array(),
            "twoSided": material.double_sided,
        })
    }
}

/// Returns the texture slots of a material that the page samples, with their positions in a document's material.
fn used(material: &Material) -> impl Iterator<Item = (&'static str, TextureSlot)> {
    let slots = [
        ("/pbrMetallicRoughness/baseColorTexture", material.base_color_texture),
        ("/pbrMetallicRoughness/metallicRoughnessTexture", material.metallic_roughness_texture),
        ("/emissiveTexture", material.emission_texture),
    ];
    slots.into_iter().filter_map(|(place, slot)| Some((place, slot?)))
}

/// Returns the image at `place` of a document's material, if browsers can show it and its size is the texture's.
fn original(document: &Document, material: usize, place: &str, texture: &Texture) -> Option<Image> {
    let material = document.list("materials").get(material)?;
    let index = number(&material.pointer(place)?["index"])?;
    let found = document.list("textures").get(index)?;
    // Prefer the image in WebP format, as the loader does.
    let webp = found.pointer("/extensions/EXT_texture_webp/source").and_then(number);
    let source = webp.or_else(|| number(&found["source"]))?;
    let image = document.list("images").get(source)?;
    let bytes = match image["uri"].as_str() {
        Some(uri) => document.resource(&format!("image {source}"), uri).ok()?,
        None => document.view(number(&image["bufferView"])?)?.to_vec(),
    };
    let kind = image_kind(&bytes)?;
    let size = texture.size().to_array().map(|side| side as usize);
    (kind == "image/png" && png_size(&bytes) == Some(size) || kind == "image/jpeg" && jpeg_size(&bytes) == Some(size))
        .then_some(Image { kind, bytes })
}

/// Returns the width and height of a PNG file \[pixels\].
fn png_size(bytes: &[u8]) -> Option<[usize; 2]> {
    let side = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    Some([side(16)?, side(20)?])
}

/// Returns the width and height of a JPEG file \[pixels\], from its frame header (ITU-T T.81, B.2.2).
fn jpeg_size(bytes: &[u8]) -> Option<[usize; 2]> {
    let word = |at: usize| Some(usize::from(u16::from_be_bytes(bytes.get(at..at + 2)?.try_into().ok()?)));
    let mut at = 2;
    loop {
        match word(at)? {
            // Frame headers of all processes, except the markers C4, C8 and CC.
            0xffc0..=0xffc3 | 0xffc5..=0xffc7 | 0xffc9..=0xffcb | 0xffcd..=0xffcf => {
                return Some([word(at + 7)?, word(at + 5)?]);
            }
            0xffff => at += 1,
            0xff00.. => at += 2 + word(at + 2)?,
            _ => return None,
        }
    }
}

/// Encodes a texture that has no image for browsers, such as a converted one.
fn encoded(texture: &Texture) -> Result<Image, Error> {
    let [width, height] = texture.size().to_array().map(|side| side as u32);
    Ok(Image { kind: "image/png", bytes: png(texture.texels(), width, height, true)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_from_headers() {
        let file = png(&[[0; 4]; 15], 5, 3, true).unwrap();
        assert_eq!(png_size(&file), Some([5, 3]));
        assert_eq!(png_size(&file[..20]), None);
        // A start, an application segment of four bytes, and a frame header of 640×480 pixels.
        let jpeg = [0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xc2, 0, 17, 8, 1, 0xe0, 2, 0x80, 3];
        assert_eq!(jpeg_size(&jpeg), Some([640, 480]));
        assert_eq!(jpeg_size(&jpeg[..12]), None);
        assert_eq!(jpeg_size(&[0xff, 0xd8, 0, 0, 0]), None);
    }
}
