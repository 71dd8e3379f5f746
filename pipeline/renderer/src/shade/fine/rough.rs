//! Rough pixels: pixels whose light differs from a neighbor's, and no outline explains the difference.
//!
//! ```text
//! |V_p − V_q| > T  and  |V_p − V(E_p + (L_q − E_q) ρ_p / ρ_q)| > T       if p and q show the same surface
//! |V_p − V_q| > T'                                                       otherwise, if p borrows light
//!
//!   V  display code of the center's light L       E  emission       ρ  luminance of the albedo       q  pixels around p
//! ```
//! The second condition excludes textures, because these are filtered over the pixel. All other outlines are found by
//! denser rays. Where these hit a surface that no center shows, they borrow light of another surface.

use crate::settings::RenderSettings;
use glam::Vec3;
use perceptual::ToneMap;
use pipeline::exposure::exposure_for;
use plane::Plane;
use rayon::prelude::*;
use render_core::{Coverage, GBuffer, NOTHING, luminance};

/// Contrast T above which a pixel is rough \[codes\].
const CONTRAST: f32 = 16.0;
/// Contrast T' above which a pixel with borrowed light is rough \[codes\]. Below it, denser rays have less error.
const BORROWED_CONTRAST: f32 = 48.0;
/// Minimum fraction of a pixel with borrowed light, at which the light matters.
const LEAST_BORROWED: f32 = 0.125;
/// Minimum albedo for a comparison without texture.
const LEAST_ALBEDO: f32 = 0.02;

/// Returns the indices of the rough pixels of `seen`, ascending. `light` is the radiance of the pixel centers.
/// `coverage` contains the surfaces of pixels that outlines cross.
pub(in crate::shade) fn rough_pixels(
    seen: &GBuffer,
    light: &Plane<Vec3>,
    coverage: Option<&Coverage>,
    curve: &CodeCurve,
) -> Vec<u32> {
    // Mark pixels that show much of a surface without light of its own.
    let mut borrows = vec![false; light.samples().len()];
    for pixel in coverage.iter().flat_map(|coverage| coverage.pixels()) {
        let borrowed: f32 = pixel.parts.iter().filter(|part| part.is_borrowed).map(|part| part.share).sum();
        borrows[pixel.index] = borrowed > LEAST_BORROWED;
    }
    let centers = Centers { seen, codes: curve.codes(light), light, borrows, curve };
    let width = light.width();
    let is_rough = |index: &u32| centers.is_rough(*index as usize % width, *index as usize / width);
    (0..light.samples().len() as u32).into_par_iter().filter(is_rough).collect()
}

/// Tone curve with the exposure of the current frame.
pub(in crate::shade) struct CodeCurve(ToneMap);

impl CodeCurve {
    /// Creates the display of a frame with this `light`. The film sets the automatic exposure later.
    pub fn of(light: &Plane<Vec3>, settings: &RenderSettings) -> Self {
        Self(match settings.auto_exposure {
            true => settings.tone_map.with_exposure(exposure_for(&light.map(luminance))),
            false => settings.tone_map,
        })
    }

    /// Returns the display code of a luminance, 0…255.
    fn code(&self, luminance: f32) -> f32 {
        255.0 * self.0.encode(luminance)
    }

    /// Returns the display codes of the luminance of `light`.
    pub fn codes(&self, light: &Plane<Vec3>) -> Plane<f32> {
        light.map(|rgb| self.code(luminance(rgb)))
    }
}

/// Pixel centers of a frame, with their light.
struct Centers<'a> {
    seen: &'a GBuffer,
    light: &'a Plane<Vec3>,
    /// Display codes of the light.
    codes: Plane<f32>,
    /// Whether each pixel shows a surface without light of its own.
    borrows: Vec<bool>,
    curve: &'a CodeCurve,
}

impl Centers<'_> {
    /// Returns whether the light at a pixel's center differs from a neighbor that shows the same surface.
    fn is_rough(&self, x: usize, y: usize) -> bool {
        let (pixels, own) = (&self.seen.pixels, self.codes.get(x, y));
        let surface = &pixels.row(y)[x];
        if surface.instance == NOTHING || self.seen.is_layered(y * pixels.width() + x) {
            return false;
        }
        let rows = y.saturating_sub(1)..pixels.height().min(y + 2);
        let columns = x.saturating_sub(1)..pixels.width().min(x + 2);
        for (u, v) in rows.flat_map(|v| columns.clone().map(move |u| (u, v))) {
            // Compare display codes first, which most neighbors share.
            let contrast = (self.codes.get(u, v) - own).abs();
            if contrast <= CONTRAST {
                continue;
            }
            let other = &pixels.row(v)[u];
            let is_rough = match surface.shows_same(other) {
                true => self.without_texture(y * pixels.width() + x, v * pixels.width() + u) > CONTRAST,
                false => contrast > BORROWED_CONTRAST && self.borrows[y * pixels.width() + x],
            };
            if is_rough {
                return true;
            }
        }
        false
    }

    /// Returns the contrast of two pixels after the second receives albedo and emission of the first \[codes\].
    fn without_texture(&self, own: usize, other: usize) -> f32 {
        let [surface, there] = [own, other].map(|index| &self.seen.pixels.samples()[index]);
        let [albedo, albedo_there] = [surface, there].map(|pixel| luminance(pixel.albedo.into()));
        // Metals have no albedo.
        let ratio = if albedo.min(albedo_there) < LEAST_ALBEDO { 1.0 } else { albedo / albedo_there };
        let reflected = (self.light.samples()[other] - Vec3::from(there.emission)).max(Vec3::ZERO);
        let tinted = luminance(Vec3::from(surface.emission)) + luminance(reflected) * ratio;
        (self.curve.code(tinted) - self.codes.samples()[own]).abs()
    }
}
