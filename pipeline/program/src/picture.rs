//! Options of commands that render single pictures: `still` and `views`.

use super::overwrite::Overwrite;
use super::source::{MemoryLimit, Reading};
use clap::Args;
use render_core::glam::Vec3;
use render_core::scene::Scene;
use render2mpeg::Options;
use render2mpeg::settings::Preset;
use renderer::settings::{SampleCount, Size};

/// Quality of pictures, and options of their scene and run.
#[derive(Args)]
pub(crate) struct PictureArguments {
    /// Quality preset: draft, good or final, as for films
    #[arg(long, value_enum, value_name = "HOW")]
    preset: Option<Preset>,
    /// Picture size in pixels [default: 512x512 pixels in the camera's shape, such as 682x384]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// SampleCount per pixel: "auto" has 1, and 4 or 8 where light changes within a pixel; N has N everywhere [default:
    /// auto, or 4 with --preset final]
    #[arg(long, value_name = "auto|N")]
    samples: Option<SampleCount>,
    /// Options for reading the scene: folders, camera, animation and scene settings.
    #[command(flatten)]
    pub reading: Reading,
    /// Limit on memory.
    #[command(flatten)]
    pub memory: MemoryLimit,
    /// Permission to replace pictures.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Number of threads; the result does not depend on it [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

/// Radiance behind the surfaces of a transparent picture before the background is removed.
const PLAIN_BACKGROUND: Vec3 = Vec3::splat(0.4);

impl PictureArguments {
    /// Returns the options of a film of `frames` frames at the finest quantiser, which contains the pictures.
    pub fn film(&self, frames: u32) -> Options {
        let (preset, size, samples) = (self.preset, self.size, self.samples);
        Options { preset, size, samples, frames: Some(frames), qscale: Some(1), ..Options::default() }
    }
}

/// Replaces the sky that cameras see by a gray, unless the scene has a background. The background can then be removed.
pub(crate) fn set_plain_background(scene: &mut Scene) {
    scene.background.get_or_insert(PLAIN_BACKGROUND);
}
