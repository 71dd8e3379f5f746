//! Page of a baked scene: one HTML file that shows the scene in real time in a browser with WebGL 2, without a network.
//!
//! ```text
//! geometry    vertices of all instances at time 0, with their places in the atlas
//! light       irradiance of the atlas as a picture, and the light of coats in compact form
//! lamps       points of the lamps, and their visible fraction at coated texels
//! materials   reflectance, emission and images of the materials
//! camera      camera of the film's first frame, and the sky
//! picture     picture of the atlas
//! payload     blocks of bytes, compressed and in base64
//! page.html, style.css, *.js, *.vert, *.frag, *.glsl       the page
//! ```
//!
//! ```text
//! L = ρ/π E + C M(ω) + L_e        display = curve(exposure · L)
//!   ρ    albedo below the coat toward the viewer        E  irradiance, bilinear between four texels
//!   C    albedo of the coat toward the viewer           M  mean radiance that the coat reflects in the direction ω
//!   L_e  emission                                       ω  mirror direction
//! ```
//!
//! # Coats
//! ```text
//! roughness        light other than lamps                 lamps
//! 0.35 or more     compact light of the texels            lobes of lamp points
//! 0.2 to 0.35      rays, without lamps at their hits      lobes of lamp points
//! below 0.2        rays, with lamps at their hits         lobes of points, spots and suns
//! ```
//! Rays meet the triangles of the page, with the mean color of each material and the irradiance of the texels. The page
//! builds their hierarchy when it loads. The visible fraction of the lamps at a texel is the ratio of baked direct light
//! to unshadowed light. Films blend layers of a pixel before the tone curve, and so does the page.
//!
//! # Differences from films
//! - Direct light has the resolution of the texels, except in live texels of still pictures. It ignores normal maps.
//! - Live texels have indirect light of the texel's own normal.
//! - All lamps have the same visible fraction at a texel. Lamps of sky images are in the sky only.
//! - Surfaces at the hits of rays have no textures. Rays pass through blended surfaces.
//! - Dynamic surfaces have their pose at time 0, and the mean irradiance of all texels.

mod camera;
mod geometry;
mod lamps;
mod light;
mod materials;
mod payload;
mod picture;

use super::export::tone_map;
use crate::settings::RenderSettings;
use crate::texels::BakedTexels;
use geometry::ViewGeometry;
use lamps::ViewLamps;
use light::ViewLight;
use materials::ViewMaterials;
use payload::Payload;
use perceptual::{Display, Operator, ToneMap};
use pipeline::error::{Error, Result};
use pipeline::output::Output;
use render_core::scene::Scene;
use render_core::{Surfaces, Units};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// Page of a scene with its baked light.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ViewPage {
    /// Text of the HTML file.
    pub html: String,
    /// Tone curve of the page, including its exposure.
    pub tone_map: ToneMap,
    /// Size of the images in the page \[bytes\]. Files of baked light contain no images.
    pub image_bytes: usize,
    /// Number of texels with compact light of coats.
    pub coat_texels: usize,
    /// Mean size of a coat's texel \[bytes\].
    pub coat_bytes_per_texel: f64,
    /// Mean of the relative RMS errors of coats' texels.
    pub coat_error: f64,
    /// Number of coats' texels with errors above the tolerance.
    pub coarse_coats: usize,
}

/// Creates the page of a `scene`, which was loaded from `path`, with the light of `baked`. Equal bakes produce equal
/// bytes for any number of threads.
///
/// # Errors
/// If the scene's file or one of its images cannot be read again.
pub fn view(scene: &Scene, path: &Path, settings: &RenderSettings, baked: &Arc<BakedTexels>) -> Result<ViewPage> {
    let tone_map = tone_map(scene, settings, baked)?;
    let pose = scene.pose(0.0);
    let surfaces = Surfaces::new(scene, &pose);
    let mut payload = Payload::default();

    // Add geometry, light and materials as blocks, each with a description.
    let lamps = ViewLamps::new(&surfaces, &pose, tone_map.exposure);
    let light = ViewLight::new(baked, &surfaces, &lamps, tone_map.exposure);
    let geometry = ViewGeometry::new(&surfaces, &pose, &baked.atlas);
    let materials = ViewMaterials::new(scene, path, tone_map.exposure)?;
    let description = json!({
        "batches": geometry.add_to(&mut payload),
        "light": light.add_to(&mut payload),
        "lamps": lamps.add_to(&mut payload),
        "materials": materials.add_to(&mut payload, |material| lamps.has_material(&surfaces, material)),
        "epsilon": Units::of(scene).epsilon,
        "camera": camera::camera(scene, &pose),
        "bounds": camera::bounds(scene, &pose),
        "sky": camera::sky(scene, tone_map.exposure, &mut payload),
        "curve": curve(&tone_map),
        "blocks": payload.list(),
    });
    let name = path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let coats = light.coats();
    Ok(ViewPage {
        html: page(&name, &description, &payload.base64()?),
        tone_map,
        image_bytes: materials.image_bytes(),
        coat_texels: coats.texels(),
        coat_bytes_per_texel: coats.bytes_per_texel(),
        coat_error: coats.mean_error(),
        coarse_coats: coats.coarse(),
    })
}

/// Returns the parameters of a tone curve, without its exposure, which all light in the page already contains.
fn curve(tone_map: &ToneMap) -> Value {
    let operator = Operator::ALL.iter().position(|&operator| operator == tone_map.operator);
    let is_power = tone_map.operator == Operator::Gamma || tone_map.display == Display::Gamma;
    let has_own_transfer = matches!(tone_map.operator, Operator::Srgb);
    json!({
        "operator": operator,
        "white": tone_map.white,
        "gamma": if is_power && !has_own_transfer { tone_map.gamma } else { 0.0 },
    })
}

/// Assembles the page.
fn page(name: &str, description: &Value, data: &str) -> String {
    // Escape characters that would end a tag or an element.
    let name = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
    let description = description.to_string().replace('<', "\\u003c");
    let places = [
        ("{{style}}", include_str!("style.css")),
        ("{{surface.vert}}", include_str!("surface.vert")),
        ("{{surface.frag}}", include_str!("surface.frag")),
        ("{{sky.vert}}", include_str!("sky.vert")),
        ("{{sky.glsl}}", include_str!("sky.glsl")),
        ("{{light.glsl}}", include_str!("light.glsl")),
        ("{{coat.glsl}}", include_str!("coat.glsl")),
        ("{{rays.glsl}}", include_str!("rays.glsl")),
        ("{{lamps.glsl}}", include_str!("lamps.glsl")),
        ("{{reflections.glsl}}", include_str!("reflections.glsl")),
        ("{{sky.frag}}", include_str!("sky.frag")),
        ("{{screen.frag}}", include_str!("screen.frag")),
        ("{{tone.glsl}}", include_str!("tone.glsl")),
        ("{{page.js}}", include_str!("page.js")),
        ("{{rays.js}}", include_str!("rays.js")),
        ("{{renderer.js}}", include_str!("renderer.js")),
        ("{{camera.js}}", include_str!("camera.js")),
        ("{{controls.js}}", include_str!("controls.js")),
        ("{{name}}", &name),
        ("{{scene}}", &description),
        ("{{data}}", data),
    ];
    // Fill the places in order of the template. Inserted text is not searched again.
    let (mut page, mut rest) = (String::with_capacity(data.len() + (1 << 17)), include_str!("page.html"));
    while let Some(start) = rest.find("{{") {
        page.push_str(&rest[..start]);
        rest = &rest[start..];
        let known = places.iter().find(|(place, _)| rest.starts_with(place));
        let (place, text) = known.expect("the template has only known places");
        page.push_str(text);
        rest = &rest[place.len()..];
    }
    page + rest
}

impl ViewPage {
    /// Writes the page to `path` and returns its length in bytes.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<u64> {
        let mut file = Output::create(path)?;
        file.write(self.html.as_bytes())?;
        let length = file.written().length;
        file.finish()?;
        Ok(length)
    }
}

/// Checks that a page can be written to `path`.
///
/// # Errors
/// If the name does not end in `.html`, or if the folder does not exist or is not writable.
pub fn check_path(path: &Path) -> Result<()> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("html")) {
        let text = format!("--view {}: the page is an HTML file; its name must end in .html", path.display());
        return Err(Error::Options(text));
    }
    // Open and discard the output, to detect missing folders and permissions early.
    drop(Output::create(path).map_err(|error| match error {
        Error::File { path, source, .. } => {
            Error::File { path, problem: "cannot be written; choose another path with --view".into(), source }
        }
        other => other,
    })?);
    Ok(())
}
