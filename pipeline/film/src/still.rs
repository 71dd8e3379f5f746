//! Single frames of a scene, as tone-mapped codes and as linear light.

use crate::error::Result;
use crate::picture_file::{PictureFormat, shown, write_shown, write_transparent};
use crate::settings::{ExrDepth, Settings};
use crate::stages::linear::write_linear;
use crate::transparency::{Background, Transparent, coverage, transparent};
use perceptual::luminance_plane;
use pipeline::exposure::{exposure_for, exposure_for_luminances};
use pipeline::stage::{Channels, LastThresholds, Shade, Shaded};
use plane::Plane;
use render_core::NOTHING;
use render_core::image_file::FrameHeader;
use render_core::scene::Scene;
use renderer::plan::Plan;
use renderer::{Frame, Preparation, Shading, exposure_of_first_frame, exposure_of_lit_frames};
use std::path::Path;

/// Rendered picture of one frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Still {
    /// Radiance in linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Tone-mapped picture: red, green and blue of sRGB as 8-bit codes.
    pub shown: Plane<[u8; 3]>,
    /// Picture without its background, if requested.
    pub transparent: Option<Transparent>,
    /// Further channels, as the settings request.
    pub channels: Channels,
    /// Attributes in the header of an OpenEXR file.
    pub header: FrameHeader,
}

/// Returns the automatic exposure for a picture without its background.
fn exposure_of_surfaces(frame: &Frame, shaded: &Shaded) -> f32 {
    let pixels = &frame.seen.pixels;
    let mut is_surface: Vec<bool> = pixels.samples().iter().map(|pixel| pixel.instance != NOTHING).collect();
    // Omit pixels at outlines next to the background, which contain its light.
    for outline in &shaded.outlines {
        let (x, y) = (outline.pixel % pixels.width(), outline.pixel / pixels.width());
        let rows = y.saturating_sub(1)..pixels.height().min(y + 2);
        let columns = x.saturating_sub(1)..pixels.width().min(x + 2);
        let mut around = rows.flat_map(|v| columns.clone().map(move |u| pixels.row(v)[u].instance));
        is_surface[outline.pixel] &= around.all(|instance| instance != NOTHING);
    }
    let luminances = luminance_plane(&shaded.radiance);
    let pixels = luminances.samples().iter().zip(is_surface);
    let of_surfaces: Vec<f32> = pixels.filter(|(_, is_surface)| *is_surface).map(|(&y, _)| y).collect();
    exposure_for_luminances(&of_surfaces).unwrap_or(1.0)
}

impl Still {
    /// Renders frame `frame` of `scene`, counted from 0. Like the first frame of a film, the picture has no thresholds.
    #[must_use]
    pub fn render(scene: &Scene, settings: &Settings, frame: u32) -> Self {
        let mut stills = Vec::new();
        let keep = |_, still| {
            stills.push(still);
            Ok(())
        };
        Self::render_each(scene, settings, &[frame], false, keep).expect("keeping a picture never fails");
        stills.pop().expect("one frame gives one picture")
    }

    /// Renders frames of `scene` one by one, and passes each with its number to `take`. The frames share the scene's
    /// light. `is_transparent` is whether to separate pictures from the scene's background.
    ///
    /// # Errors
    /// If `take` fails.
    pub fn render_each(
        scene: &Scene,
        settings: &Settings,
        frames: &[u32],
        is_transparent: bool,
        mut take: impl FnMut(u32, Self) -> Result<()>,
    ) -> Result<()> {
        // Render the frames alone; thresholds would need the coded previous frame.
        let renderer = settings.render.clone();
        let plan = Plan::new(scene, &renderer);
        let mut preparation = Preparation::new(scene, &renderer, &plan);

        // Derive automatic exposure from the film's lit frames, or else from the film's first frame.
        let is_auto = settings.render.auto_exposure;
        let of_lit_frames = is_auto.then(|| exposure_of_lit_frames(scene, &renderer)).flatten();
        let is_later = is_auto && of_lit_frames.is_none() && frames.iter().any(|&frame| frame > 0);
        let of_first_frame =
            is_later.then(|| exposure_of_first_frame(&mut preparation, |settings, plan| Shading::new(settings, plan)));
        // Behind a background, the surfaces of the first picture determine the exposure.
        let mut of_surfaces = None;
        for &frame in frames {
            let prepared = preparation.frame(frame);
            let shaded = Shading::new(&renderer, &plan).step(&prepared, LastThresholds::none());
            let exposure = match of_lit_frames.or(of_first_frame.filter(|_| frame > 0 && scene.background.is_none())) {
                Some(exposure) => exposure,
                None if is_auto && scene.background.is_some() => {
                    *of_surfaces.get_or_insert_with(|| exposure_of_surfaces(&prepared.frame, &shaded))
                }
                None if is_auto => exposure_for(&luminance_plane(&shaded.radiance)),
                None => settings.render.tone_map.exposure,
            };
            let tone_map = settings.render.tone_map.with_exposure(exposure);
            let shown = shown(&shaded.blended(&tone_map), &tone_map);
            let covered = is_transparent.then(|| coverage(&prepared.frame));
            let radiance = scene.background.unwrap_or_default().to_array();
            let background = Background { radiance, shown: radiance.map(|linear| tone_map.encode(linear)) };
            let transparent = covered.map(|covered| transparent(&shown, &shaded.radiance, &covered, background));
            let (radiance, channels, header) = (shaded.radiance, shaded.channels, shaded.header);
            take(frame, Self { radiance, shown, transparent, channels, header })?;
        }
        Ok(())
    }

    /// Writes the picture tone mapped for display (`.png`, `.webp`, `.jpg`), or as linear light (`.exr`) in 16-bit
    /// floats where these suffice, with the further channels. Without its background, linear light has the channel A.
    ///
    /// # Errors
    /// If the ending is unknown or the file cannot be written, or if a JPEG file would have to be transparent.
    pub fn write(&self, path: &Path) -> Result<()> {
        match (PictureFormat::of(path)?, &self.transparent) {
            (PictureFormat::Linear, None) => {
                Ok(write_linear(path, &self.header, &self.radiance, self.channels.clone(), ExrDepth::Half)?)
            }
            (PictureFormat::Linear, Some(picture)) => {
                let mut channels = self.channels.clone();
                channels.push(("A".into(), picture.opacity.samples().to_vec()));
                Ok(write_linear(path, &self.header, &picture.radiance, channels, ExrDepth::Half)?)
            }
            (PictureFormat::Shown(_), None) => write_shown(path, &self.shown),
            (PictureFormat::Shown(_), Some(picture)) => write_transparent(path, &picture.shown),
        }
    }
}
