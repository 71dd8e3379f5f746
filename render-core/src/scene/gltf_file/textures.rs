//! Images that visible surfaces use.

use super::accessor::Buffers;
use super::image_decoder::decode;
use super::materials::Older;
use super::specular_glossiness::{self, OlderFactors};
use super::{LoadError, Loader, Source};
use crate::scene::{Encoding, Scene, Texture, TextureSlot, Wrap};
use std::cell::Cell;
use std::collections::HashMap;

/// Most texels of all textures together, 2 GB of them: a few bytes may stand for a large image, and many textures for one file.
const MOST_TEXELS: usize = 1 << 29;

impl Loader<'_> {
    /// Decodes the images that a material of a shown mesh uses, and renumbers the slots to match. An image that is both
    /// color and data is held twice: its mip levels differ.
    pub(super) fn textures(
        &self,
        Source { document, buffers, .. }: Source,
        older: &Older,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        let mut shown = vec![false; scene.materials.len()];
        for instance in &scene.instances {
            shown[scene.meshes[instance.mesh].material] = true;
        }
        let files: Vec<gltf::Texture> = document.textures().collect();
        let texels = Cell::new(0);
        let count = |texture: &Texture| {
            let size = texture.size();
            texels.set(texels.get() + size.x as usize * size.y as usize);
            if texels.get() > MOST_TEXELS {
                return self.bad(format!("its images have more than {MOST_TEXELS} texels together; make them smaller"));
            }
            Ok(())
        };
        let mut place_of: HashMap<(usize, [Wrap; 2], Encoding), usize> = HashMap::new();
        // Gives a slot the number of its decoded image.
        let mut place = |slot: &mut TextureSlot, encoding: Encoding, textures: &mut Vec<Texture>| {
            let Some(texture) = files.get(slot.texture) else { return self.bad("a texture index is out of range") };
            let key = (texture.source().index(), wrap(texture), encoding);
            slot.texture = match place_of.get(&key) {
                Some(&place) => place,
                None => {
                    let read = self.texture(texture, encoding, buffers)?;
                    count(&read)?;
                    textures.push(read);
                    place_of.insert(key, textures.len() - 1);
                    textures.len() - 1
                }
            };
            Ok(())
        };
        let Scene { materials, textures, .. } = scene;
        for (index, (material, _)) in materials.iter_mut().zip(shown).enumerate().filter(|(_, (_, shown))| *shown) {
            // Textures of the older model are converted together.
            if let (Some(&factors), Some(glossy)) = (older.get(&index), material.metallic_roughness_texture) {
                let diffuse = material.base_color_texture;
                let made = self.converted(&files, [diffuse, Some(glossy)], factors, buffers)?;
                count(&made[0])?;
                count(&made[1])?;
                let slot = |texture: usize| Some(TextureSlot { texture, ..glossy });
                let first = textures.len();
                textures.extend(made);
                (material.base_color_texture, material.metallic_roughness_texture) = (slot(first), slot(first + 1));
                let others = material.emission_texture.iter_mut().map(|slot| (slot, Encoding::Srgb));
                let normals = material.normal_texture.iter_mut().map(|(slot, _)| (slot, Encoding::Linear));
                for (slot, encoding) in others.chain(normals) {
                    place(slot, encoding, textures)?;
                }
                continue;
            }
            let color = [&mut material.base_color_texture, &mut material.emission_texture].into_iter().flatten();
            let data = material.metallic_roughness_texture.iter_mut();
            let data = data.chain(material.normal_texture.iter_mut().map(|(slot, _)| slot));
            let slots = color.map(|slot| (slot, Encoding::Srgb)).chain(data.map(|slot| (slot, Encoding::Linear)));
            for (slot, encoding) in slots {
                place(slot, encoding, textures)?;
            }
        }
        Ok(())
    }

    /// Textures of base color, and of metalness and roughness, of these diffuse and glossy slots of the older model.
    fn converted(
        &self,
        files: &[gltf::Texture],
        slots: [Option<TextureSlot>; 2],
        factors: OlderFactors,
        buffers: &Buffers,
    ) -> Result<[Texture; 2], LoadError> {
        let mut images = [None, None];
        let mut wraps = [Wrap::Repeat; 2];
        for (image, slot) in images.iter_mut().zip(slots) {
            let Some(slot) = slot else { continue };
            let Some(file) = files.get(slot.texture) else { return self.bad("a texture index is out of range") };
            *image = Some(self.texture(file, Encoding::Srgb, buffers)?);
            wraps = wrap(file);
        }
        let [diffuse, glossy] = images;
        let Some(glossy) = glossy else { return self.bad("a texture index is out of range") };
        Ok(specular_glossiness::textures(diffuse.as_ref(), &glossy, factors, wraps))
    }

    fn texture(&self, texture: &gltf::Texture, encoding: Encoding, buffers: &Buffers) -> Result<Texture, LoadError> {
        let image = texture.source();
        let what = format!("image {}", image.index());
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => match buffers.view(&view) {
                Some(bytes) => bytes.to_vec(),
                None => return self.bad(format!("{what} lies outside of its buffer")),
            },
            gltf::image::Source::Uri { uri, .. } => self.resource(&what, uri)?,
        };
        let (width, height, texels) = decode(bytes).or_else(|why| self.bad(format!("{what}: {why}")))?;
        if width == 0 || height == 0 {
            return self.bad(format!("{what} is empty"));
        }
        Ok(Texture::with_encoding(width, height, texels, wrap(texture), encoding))
    }
}

/// How the texture is continued; its filters are hints that a renderer with its own filter does not need.
fn wrap(texture: &gltf::Texture) -> [Wrap; 2] {
    let sampler = texture.sampler();
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
        gltf::texture::WrappingMode::MirroredRepeat => Wrap::Mirror,
        gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
    })
}
