//! Single frames of a scene, as tone-mapped codes and as linear light.

use crate::error::Result;
use crate::picture_file::{PictureFormat, shown, write_shown};
use crate::settings::{ExrDepth, Settings};
use crate::stages::linear::write_linear;
use perceptual::luminance_plane;
use pipeline::exposure::exposure_for;
use pipeline::stage::{LastThresholds, Shade};
use plane::Plane;
use render_core::image_file::FrameHeader;
use render_core::scene::Scene;
use renderer::plan::Plan;
use renderer::{Preparation, Shading, exposure_of_first_frame, exposure_of_lit_frames};
use std::path::Path;

/// Rendered picture of one frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Still {
    /// Radiance in linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Tone-mapped picture: red, green and blue of sRGB as 8-bit codes.
    pub shown: Plane<[u8; 3]>,
    /// Attributes in the header of an OpenEXR file.
    pub header: FrameHeader,
}

impl Still {
    /// Renders frame `frame` of `scene`, counted from 0. Like the first frame of a film, the picture has no thresholds.
    #[must_use]
    pub fn render(scene: &Scene, settings: &Settings, frame: u32) -> Self {
        // Render the frame alone; thresholds would need the coded previous frame.
        let renderer = settings.render.clone();
        let plan = Plan::new(scene, &renderer);
        let mut preparation = Preparation::new(scene, &renderer, &plan);

        // Derive automatic exposure from the film's lit frames, or else from the film's first frame.
        let is_auto = settings.render.auto_exposure;
        let of_lit_frames = is_auto.then(|| exposure_of_lit_frames(scene, &renderer)).flatten();
        let of_another_frame = of_lit_frames.or_else(|| {
            let is_later = is_auto && frame > 0;
            is_later.then(|| exposure_of_first_frame(&mut preparation, |settings, plan| Shading::new(settings, plan)))
        });
        let prepared = preparation.frame(frame);
        let shaded = Shading::new(&renderer, &plan).step(&prepared, LastThresholds::none());

        let exposure = match of_another_frame {
            Some(exposure) => exposure,
            None if is_auto => exposure_for(&luminance_plane(&shaded.radiance)),
            None => settings.render.tone_map.exposure,
        };
        let tone_map = settings.render.tone_map.with_exposure(exposure);
        let shown = shown(&shaded.blended(&tone_map), &tone_map);
        Self { radiance: shaded.radiance, shown, header: shaded.header }
    }

    /// Writes the picture tone mapped for display (`.png`, `.jpg`), or as linear light (`.exr`) in 16-bit floats where
    /// these suffice.
    ///
    /// # Errors
    /// If the ending is unknown or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        match PictureFormat::of(path)? {
            PictureFormat::Linear => Ok(write_linear(path, &self.header, &self.radiance, Vec::new(), ExrDepth::Half)?),
            PictureFormat::Shown(_) => write_shown(path, &self.shown),
        }
    }
}
