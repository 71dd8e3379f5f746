//! Images that visible surfaces use.

use super::accessor::Buffers;
use super::image_decoder::decode;
use super::image_limits::Texels;
use super::{LoadError, Loader};
use crate::scene::{Encoding, Scene, Texture, Wrap};
use std::collections::{BTreeMap, HashMap};

/// Most texels of all textures together, 2 GB of them: a few bytes may stand for a large image, and many textures for one file.
const MOST_TEXELS: usize = 1 << 29;

impl Loader<'_> {
    /// Decodes the images that a material of a shown mesh uses, and renumbers the slots to match. An image that is both
    /// color and data is held twice: its mip levels differ.
    pub(super) fn textures(
        &self,
        document: &gltf::Document,
        buffers: &Buffers,
        plain_images: &BTreeMap<usize, usize>,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        let images: Vec<gltf::Image> = document.images().collect();
        let mut shown = vec![false; scene.materials.len()];
        for instance in &scene.instances {
            shown[scene.meshes[instance.mesh].material] = true;
        }
        let files: Vec<gltf::Texture> = document.textures().collect();
        let mut texels = 0;
        let mut place_of: HashMap<(usize, [Wrap; 2], Encoding, bool), usize> = HashMap::new();
        let Scene { materials, textures, warnings, .. } = scene;
        for (material, _) in materials.iter_mut().zip(shown).filter(|(_, shown)| *shown) {
            let color = [&mut material.base_color_texture, &mut material.emission_texture].into_iter().flatten();
            let data = material.metallic_roughness_texture.iter_mut();
            let data = data.chain(material.normal_texture.iter_mut().map(|(slot, _)| slot));
            let slots = color.map(|slot| (slot, Encoding::Srgb)).chain(data.map(|slot| (slot, Encoding::Linear)));
            for (slot, encoding) in slots {
                let Some(texture) = files.get(slot.texture) else { return self.bad("a texture index is out of range") };
                let key = (texture.source().index(), wrap(texture), encoding, is_blocky(texture));
                slot.texture = match place_of.get(&key) {
                    Some(&place) => place,
                    None => {
                        let plain = plain_images.get(&texture.index()).and_then(|&plain| images.get(plain));
                        let (width, height, colors) = match (self.image(&texture.source(), buffers), plain) {
                            (Err(error), Some(plain)) => {
                                warnings.push(format!("{}; image {} is shown", without_path(&error), plain.index()));
                                self.image(plain, buffers)?
                            }
                            (read, _) => read?,
                        };
                        let read = Texture::with_encoding(width, height, colors, wrap(texture), encoding);
                        let read = if is_blocky(texture) { read.blocky() } else { read };
                        let size = read.size();
                        texels += size.x as usize * size.y as usize;
                        if texels > MOST_TEXELS {
                            return self.bad(format!(
                                "its images have more than {MOST_TEXELS} texels together; make them smaller"
                            ));
                        }
                        textures.push(read);
                        place_of.insert(key, textures.len() - 1);
                        textures.len() - 1
                    }
                };
            }
        }
        Ok(())
    }

    fn image(&self, image: &gltf::Image, buffers: &Buffers) -> Result<Texels, LoadError> {
        let what = format!("image {}", image.index());
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => match buffers.view(&view) {
                Some(bytes) => bytes.to_vec(),
                None => return self.bad(format!("{what} lies outside of its buffer")),
            },
            gltf::image::Source::Uri { uri, .. } => self.resource(&what, uri)?,
        };
        let texels = decode(bytes).or_else(|why| self.bad(format!("{what}: {why}")))?;
        if texels.0 == 0 || texels.1 == 0 {
            return self.bad(format!("{what} is empty"));
        }
        Ok(texels)
    }
}

/// An error's text for a note, which the scene's path precedes.
fn without_path(error: &LoadError) -> String {
    match error {
        LoadError::Malformed { what, .. } => what.clone(),
        LoadError::Resource { what, uri, why, .. } => format!("{what} \"{uri}\" cannot be read ({why})"),
        error => error.to_string(),
    }
}

/// Whether its texels are to be seen from nearby. Of its other filters none is needed: textures have their own.
fn is_blocky(texture: &gltf::Texture) -> bool {
    texture.sampler().mag_filter() == Some(gltf::texture::MagFilter::Nearest)
}

/// How the texture is continued.
fn wrap(texture: &gltf::Texture) -> [Wrap; 2] {
    let sampler = texture.sampler();
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
        gltf::texture::WrappingMode::MirroredRepeat => Wrap::Mirror,
        gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
    })
}
