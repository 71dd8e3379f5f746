//! A scene with its baked light painted in: a .glb file that any viewer shows as a film does.
//!
//! ```text
//! document, elements   the scene's document and bytes, read once more: what is not understood here stays
//! places               which primitive of which node each instance is
//! tone, page, fill     the curve of the film, and a picture of the whole atlas by it
//! split, meshes        vertices split along charts, and coordinates in the picture for each node
//! apart                backs of sheets, a little behind their fronts
//! materials, lights    unlit materials of the picture; lamps stay for what moves
//! compact, glb         what is needed no more is left out, all other bytes become one file
//! beside               the settings for films of the export
//! ```
//!
//! Surfaces that stand still are painted, on both sides where they are double-sided. All that moves keeps its materials, as do
//! unlit surfaces. Coats and metals are painted as if they were matte: what they mirror depends on the viewer.

mod apart;
mod beside;
mod compact;
mod document;
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
use materials::Materials;
use meshes::Meshes;
use page::Painter;
use perceptual::ToneMap;
use pipeline::error::{Error, Result};
use pipeline::output::Output;
use render_core::Surfaces;
use render_core::scene::{Alpha, Scene, SceneSettings};
use std::path::Path;
use std::sync::Arc;

/// Sides of a picture that is not asked for by its size: four texels to each of the bake's within these \[texels\].
const USUAL: std::ops::RangeInclusive<u32> = 2048..=4096;
/// The largest side that is painted: more than most viewers show \[texels\].
pub const LARGEST_SIDE: u32 = 16384;

/// A scene with baked light painted in.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Export {
    /// The .glb file.
    pub file: Vec<u8>,
    /// The settings beside it.
    pub settings: String,
    /// Width and height of the picture of all light \[texels\].
    pub size: (u32, u32),
    /// The curve that light was painted by, with the exposure that was found.
    pub tone_map: ToneMap,
}

/// Paints the light of `baked` into `scene`, which was loaded from `path`. The picture's longer side has `side` texels, or a number that
/// suits the bake; never fewer than the bake itself. The same bake gives the same bytes, for any number of threads.
///
/// # Errors
/// The side would be more than 16384; the scene's file or an image of it cannot be read again; the
/// export would be larger than a .glb file may be.
pub fn export(
    scene: &Scene,
    path: &Path,
    settings: &RenderSettings,
    baked: &Arc<BakedTexels>,
    side: Option<u32>,
) -> Result<Export> {
    let atlas = &baked.atlas;
    let (columns, rows) = atlas.size();
    let longer = columns.max(rows);
    let side = side_for(longer, side)?;
    let fine = atlas.fine(side as f32 / longer as f32);
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);

    // The picture.
    let tone_map = tone::tone_map(scene, settings, baked)?;
    let picture = Painter { texels: &fine, baked, surfaces: &surfaces, tone_map }.painted();
    let has_alpha = scene.materials.iter().any(|material| material.alpha != Alpha::Opaque);
    let png = page::png(&picture, fine.width(), fine.height(), has_alpha)?;
    drop(picture);

    // The document around it.
    let mut document = Document::read(path, scene.origin.reach)?;
    let places = places::places(&document, scene)?;
    let materials = Materials::new(&mut document, png);
    let (document_of_meshes, texels) = (&mut document, &fine);
    Meshes { document: document_of_meshes, places: &places, surfaces: &surfaces, atlas, texels, materials }.write()?;
    lights::adapt(&mut document, scene, tone_map.exposure);
    compact::compact(&mut document)?;
    glb::take_images_in(&mut document)?;
    materials::list_extensions(&mut document);
    let file = glb::packed(document, path)?;
    let settings = beside::settings_text(scene, &tone_map);
    Ok(Export { file, settings, size: (fine.width(), fine.height()), tone_map })
}

/// The longer side of the picture of an atlas: as wished, but no less than `least`, that of the atlas.
fn side_for(least: u32, wish: Option<u32>) -> Result<u32> {
    let side = wish.unwrap_or_else(|| (4 * least).clamp(*USUAL.start(), *USUAL.end())).max(least);
    if side > LARGEST_SIDE {
        let text = format!("--texture {side}: {LARGEST_SIDE} is the most; with it goes light of fewer --texels");
        return Err(Error::Options(text));
    }
    Ok(side)
}

impl Export {
    /// Writes the file to `path`, which ends in `.glb`, and the settings beside it; returns the length of the file in bytes.
    ///
    /// # Errors
    /// A file cannot be written.
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

/// Checks that an export to `path` is a file that can be written, and is not the scene's own or its settings.
///
/// # Errors
/// The name does not end in `.glb`, or is that of the scene; the folder does not exist or may not be written to.
pub fn check_path(path: &Path, scene: &Path) -> Result<()> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("glb")) {
        return Err(Error::Options(format!("--gltf {}: the export is one binary file; name it .glb", path.display())));
    }
    drop(Output::create(path).map_err(|error| match error {
        Error::File { path, source, .. } => {
            Error::File { path, problem: "cannot be written; choose another place with --gltf".into(), source }
        }
        other => other,
    })?);
    // Two files in one folder share their settings if their names differ in the ending alone.
    let folder = |path: &Path| path.parent().filter(|folder| !folder.as_os_str().is_empty()).map(Path::to_owned);
    let same_folder = [path, scene].map(|path| folder(path).unwrap_or(".".into()).canonicalize().ok());
    if same_folder[0] == same_folder[1] && path.file_stem() == scene.file_stem() {
        let text = format!(
            "--gltf {}: this would take the place of the scene or its settings; choose another name",
            path.display()
        );
        return Err(Error::Options(text));
    }
    Ok(())
}
