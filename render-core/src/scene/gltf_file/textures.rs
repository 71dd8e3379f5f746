//! Loader of the images of visible surfaces.

use super::accessor::Buffers;
use super::image_decoder::decode;
use super::image_limits::Texels;
use super::materials::Older;
use super::specular_glossiness::{self, OlderFactors};
use super::{DocumentSource, LoadError, Loader};
use crate::scene::{Encoding, Material, Scene, Texture, TextureSlot, Wrap};
use std::collections::{BTreeMap, HashMap};

/// Maximum number of texels of all textures, 2 GB of memory. A few bytes may encode a large image, and many textures
/// may use one file.
const MOST_TEXELS: usize = 1 << 29;

impl Loader<'_> {
    /// Decodes the images of all visible materials and renumbers the slots to match. An image used as color and as data
    /// is stored twice, because the mip levels of the two uses differ.
    pub(super) fn textures(
        &self,
        DocumentSource { document, buffers, .. }: DocumentSource,
        plain_images: &BTreeMap<usize, usize>,
        older: &Older,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        // Read only textures of materials in use.
        let mut shown = vec![false; scene.materials.len()];
        for instance in &scene.instances {
            shown[scene.meshes[instance.mesh].material] = true;
        }
        let mut reading = Reading {
            loader: self,
            buffers,
            files: document.textures().collect(),
            images: document.images().collect(),
            plain_images,
            textures: Vec::new(),
            place_of: HashMap::new(),
            texels: 0,
            notes: Vec::new(),
        };
        for (index, material) in scene.materials.iter_mut().enumerate().filter(|(index, _)| shown[*index]) {
            reading.material(material, older.get(&index).copied())?;
        }
        scene.textures = reading.textures;
        scene.warnings.extend(reading.notes);
        Ok(())
    }

    fn image(&self, image: &gltf::Image, buffers: &Buffers) -> Result<Texels, LoadError> {
        // Read the image from its buffer view or its URI.
        let what = format!("image {}", image.index());
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => match buffers.view(&view) {
                Some(bytes) => bytes.to_vec(),
                None => return self.bad(format!("{what} is outside its buffer")),
            },
            gltf::image::Source::Uri { uri, .. } => self.resource(&what, uri)?,
        };
        // Decode the image. Zero-sized images cannot be sampled.
        let texels = decode(bytes).or_else(|why| self.bad(format!("{what}: {why}")))?;
        if texels.0 == 0 || texels.1 == 0 {
            return self.bad(format!("{what} is empty"));
        }
        Ok(texels)
    }
}

/// Key of a decoded texture: image, wrapping, encoding, and whether magnified texels have sharp borders.
type Key = (usize, [Wrap; 2], Encoding, bool);

/// Textures of a document read so far.
struct Reading<'a> {
    loader: &'a Loader<'a>,
    buffers: &'a Buffers,
    files: Vec<gltf::Texture<'a>>,
    images: Vec<gltf::Image<'a>>,
    /// Image that replaces a damaged image, by index of the texture.
    plain_images: &'a BTreeMap<usize, usize>,
    textures: Vec<Texture>,
    place_of: HashMap<Key, usize>,
    /// Total number of texels of all textures.
    texels: usize,
    notes: Vec<String>,
}

impl<'a> Reading<'a> {
    /// Reads the textures of a material. The two textures of a specular-glossiness material, whose factors are
    /// `older`, are converted together.
    fn material(&mut self, material: &mut Material, older: Option<OlderFactors>) -> Result<(), LoadError> {
        let Material { base_color_texture, metallic_roughness_texture, emission_texture, .. } = material;
        // Convert both textures of a specular-glossiness material. Read other base colors as sRGB.
        let rough = match (older, *metallic_roughness_texture) {
            (Some(factors), Some(glossy)) => {
                let [base, rough] = self.converted([*base_color_texture, Some(glossy)], factors)?;
                *base_color_texture = Some(TextureSlot { texture: self.add(base)?, ..glossy });
                *metallic_roughness_texture = Some(TextureSlot { texture: self.add(rough)?, ..glossy });
                None
            }
            _ => {
                self.place(base_color_texture.as_mut(), Encoding::Srgb)?;
                metallic_roughness_texture.as_mut()
            }
        };
        self.place(emission_texture.as_mut(), Encoding::Srgb)?;
        self.place(rough, Encoding::Linear)?;
        self.place(material.normal_texture.as_mut().map(|(slot, _)| slot), Encoding::Normal)?;
        let mut lobes = material.lobes.iter_mut().flat_map(|lobes| lobes.slots_mut());
        lobes.try_for_each(|(slot, encoding)| self.place(Some(slot), encoding))
    }

    /// Sets a slot to the index of its decoded image.
    fn place(&mut self, slot: Option<&mut TextureSlot>, encoding: Encoding) -> Result<(), LoadError> {
        // Decode each combination of image and sampling once.
        let Some(slot) = slot else { return Ok(()) };
        let file = self.file(slot)?;
        let key = (file.source().index(), wrap(&file), encoding, is_blocky(&file));
        slot.texture = match self.place_of.get(&key) {
            Some(&place) => place,
            None => {
                let read = self.texture(&file, encoding)?;
                let place = self.add(read)?;
                self.place_of.insert(key, place);
                place
            }
        };
        Ok(())
    }

    fn file(&self, slot: &TextureSlot) -> Result<gltf::Texture<'a>, LoadError> {
        self.files.get(slot.texture).cloned().map_or_else(|| self.loader.bad("a texture index is out of range"), Ok)
    }

    /// Adds a texture and returns its index.
    fn add(&mut self, texture: Texture) -> Result<usize, LoadError> {
        // Limit the total memory, because many textures may use one small file.
        let size = texture.size();
        self.texels += size.x as usize * size.y as usize;
        if self.texels > MOST_TEXELS {
            let what = format!("its images have more than {MOST_TEXELS} texels together; make them smaller");
            return self.loader.bad(what);
        }
        self.textures.push(texture);
        Ok(self.textures.len() - 1)
    }

    /// Decodes a texture of the file, or its plain replacement if the first image is damaged.
    fn texture(&mut self, file: &gltf::Texture, encoding: Encoding) -> Result<Texture, LoadError> {
        // Fall back to the plain image, with a note.
        let plain = self.plain_images.get(&file.index()).and_then(|&plain| self.images.get(plain));
        let (width, height, texels) = match (self.loader.image(&file.source(), self.buffers), plain) {
            (Err(error), Some(plain)) => {
                self.notes.push(format!("{}; image {} is shown", without_path(&error), plain.index()));
                self.loader.image(plain, self.buffers)?
            }
            (read, _) => read?,
        };
        let read = Texture::with_encoding(width, height, texels, wrap(file), encoding);
        Ok(if is_blocky(file) { read.blocky() } else { read })
    }

    /// Converts the diffuse and specular-glossiness textures to a base-color and a metallic-roughness texture.
    fn converted(&mut self, slots: [Option<TextureSlot>; 2], factors: OlderFactors) -> Result<[Texture; 2], LoadError> {
        let mut images = [None, None];
        // The glossy texture is last, so its sampler applies to both results.
        let (mut wraps, mut blocky) = ([Wrap::Repeat; 2], false);
        for (image, slot) in images.iter_mut().zip(slots) {
            let Some(slot) = slot else { continue };
            let file = self.file(&slot)?;
            *image = Some(self.texture(&file, Encoding::Srgb)?);
            (wraps, blocky) = (wrap(&file), is_blocky(&file));
        }
        let [diffuse, glossy] = images;
        let Some(glossy) = glossy else { return self.loader.bad("a texture index is out of range") };
        let made = specular_glossiness::textures(diffuse.as_ref(), &glossy, factors, wraps);
        Ok(if blocky { made.map(Texture::blocky) } else { made })
    }
}

/// Returns an error's text for a note, without the scene's path.
fn without_path(error: &LoadError) -> String {
    match error {
        LoadError::Malformed { what, .. } => what.clone(),
        LoadError::Resource { what, uri, why, .. } => format!("{what} \"{uri}\" cannot be read ({why})"),
        error => error.to_string(),
    }
}

/// Returns whether magnified texels have sharp borders. Other filters in the file are ignored, because textures use
/// filters of this crate.
fn is_blocky(texture: &gltf::Texture) -> bool {
    texture.sampler().mag_filter() == Some(gltf::texture::MagFilter::Nearest)
}

/// Returns the wrapping along both axes.
fn wrap(texture: &gltf::Texture) -> [Wrap; 2] {
    let sampler = texture.sampler();
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
        gltf::texture::WrappingMode::MirroredRepeat => Wrap::Mirror,
        gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
    })
}
