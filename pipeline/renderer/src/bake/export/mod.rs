//! Export of a scene with its baked light: a .glb file with the look of a film in any viewer.
//!
//! ```text
//! document, elements   the scene's document and buffers, read again; unknown data is kept
//! places               the node and primitive of each instance
//! tone, page, fill     the film's tone curve, and the image of the whole atlas
//! split, meshes        vertices split along charts, and texture coordinates for each node
//! apart                back faces, slightly behind their fronts
//! materials, lights    unlit materials with the image; punctual lights for dynamic surfaces
//! compact, glb         unreferenced objects removed, all bytes in one file
//! beside               settings for films of the export
//! ```
//!
//! Static surfaces are painted, on both sides if double-sided. Dynamic and unlit surfaces keep their materials. Coats and
//! metals are painted as if they were matte, because reflections depend on the viewer.

mod apart;
mod beside;
mod compact;
pub(super) mod document;
mod elements;
mod fill;
mod glb;
mod lights;
mod materials;
mod meshes;
mod page;
mod places;
mod split;
mod tone;

use crate::settings::RenderSettings;
use crate::texels::BakedTexels;
use document::Document;
pub(super) use glb::kind as image_kind;
use materials::Materials;
use meshes::Meshes;
use page::Painter;
pub(super) use page::png;
use perceptual::ToneMap;
use pipeline::error::{Error, Result};
use pipeline::output::Output;
use render_core::Surfaces;
use render_core::scene::{Alpha, Scene, SceneSettings};
pub(super) use split::{SideTriangles, Split};
use std::path::Path;
use std::sync::Arc;
pub(super) use tone::tone_map;

/// Default range of the longer side of the image \[texels\]. Within it, the image is four times as fine as the atlas.
const USUAL: std::ops::RangeInclusive<u32> = 2048..=4096;
/// Maximum side of an image \[texels\]; most viewers support less.
pub const LARGEST_SIDE: u32 = 16384;

/// Export of a scene with painted baked light.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Export {
    /// Bytes of the .glb file.
    pub file: Vec<u8>,
    /// Text of the settings file.
    pub settings: String,
    /// Size of the image \[texels\]: width and height.
    pub size: (u32, u32),
    /// Tone curve of the image, including its exposure.
    pub tone_map: ToneMap,
}

/// Paints the light of `baked` into `scene`, which was loaded from `path`. The longer side of the image has `side`
/// texels, by default four times the atlas's, and never fewer than the atlas. Equal bakes produce equal bytes for any
/// number of threads.
///
/// # Errors
/// If the side exceeds 16384, or the export exceeds the size of a .glb file. If the scene's file or one of its images
/// cannot be read again.
pub fn export(
    scene: &Scene,
    path: &Path,
    settings: &RenderSettings,
    baked: &Arc<BakedTexels>,
    side: Option<u32>,
) -> Result<Export> {
    // Choose the size: the image may be finer than the atlas, never coarser.
    let atlas = &baked.atlas;
    let (columns, rows) = atlas.size();
    let longer = columns.max(rows);
    let side = side_for(longer, side)?;
    let fine = atlas.fine(side as f32 / longer as f32);
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);

    // Paint the image.
    let tone_map = tone_map(scene, settings, baked)?;
    let picture = Painter { texels: &fine, baked, surfaces: &surfaces, tone_map }.painted();
    let has_alpha = scene.materials.iter().any(|material| material.alpha != Alpha::Opaque);
    let png = png(&picture, fine.width(), fine.height(), has_alpha)?;
    drop(picture);

    // Insert the image into the document.
    let mut document = Document::read(path, scene.origin.reach)?;
    let places = places::places(&document, scene)?;
    let materials = Materials::new(&mut document, png);
    let (document_of_meshes, texels) = (&mut document, &fine);
    Meshes { document: document_of_meshes, places: &places, surfaces: &surfaces, atlas, texels, materials }.write()?;
    // Remove all objects that the texture replaces, and move the rest into one file.
    lights::adapt(&mut document, scene, tone_map.exposure);
    compact::compact(&mut document)?;
    glb::take_images_in(&mut document)?;
    materials::list_extensions(&mut document);
    let file = glb::packed(document, path)?;
    let settings = beside::settings_text(scene, &tone_map);
    Ok(Export { file, settings, size: (fine.width(), fine.height()), tone_map })
}

/// Returns the longer side of the image \[texels\]: the requested side, but at least `least`, the longer side of the
/// atlas.
fn side_for(least: u32, wish: Option<u32>) -> Result<u32> {
    let side = wish.unwrap_or_else(|| (4 * least).clamp(*USUAL.start(), *USUAL.end())).max(least);
    if side > LARGEST_SIDE {
        let text = format!("--texture {side} must be at most {LARGEST_SIDE}; bake fewer --texels for a smaller one");
        return Err(Error::Options(text));
    }
    Ok(side)
}

impl Export {
    /// Writes the file to `path`, which ends in `.glb`, and the settings next to it. Returns the length of the .glb
    /// file in bytes.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, path: &Path) -> Result<u64> {
        let mut file = Output::create(path)?;
        file.write(&self.file)?;
        let length = file.written().length;
        let mut settings = Output::create(&SceneSettings::path_for(path))?;
        settings.write(self.settings.as_bytes())?;
        file.finish()?;
        settings.finish()?;
        Ok(length)
    }
}

/// Checks that an export to `path` can be written and overwrites neither the scene nor the scene's settings.
///
/// # Errors
/// If the name does not end in `.glb` or is the scene's name, or if the folder does not exist or is not writable.
pub fn check_path(path: &Path, scene: &Path) -> Result<()> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("glb")) {
        return Err(Error::Options(format!(
            "--gltf {}: the export is a binary file; its name must end in .glb",
            path.display()
        )));
    }
    // Open and discard the output, to detect missing folders and permissions early.
    drop(Output::create(path).map_err(|error| match error {
        Error::File { path, source, .. } => {
            Error::File { path, problem: "cannot be written; choose another path with --gltf".into(), source }
        }
        other => other,
    })?);
    // Compare names without extensions: files in one folder that differ only in their extension share their settings.
    let folder = |path: &Path| path.parent().filter(|folder| !folder.as_os_str().is_empty()).map(Path::to_owned);
    let same_folder = [path, scene].map(|path| folder(path).unwrap_or(".".into()).canonicalize().ok());
    if same_folder[0] == same_folder[1] && path.file_stem() == scene.file_stem() {
        let text =
            format!("--gltf {}: this would overwrite the scene or its settings; choose another name", path.display());
        return Err(Error::Options(text));
    }
    Ok(())
}
