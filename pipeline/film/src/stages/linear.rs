//! OpenEXR files that store frames as linear light.

use crate::settings::ExrDepth;
use pipeline::error::{Error, Result};
use pipeline::stage::Channels;
use plane::Plane;
use render_core::image_file::FrameHeader;
#[cfg(feature = "exr")]
use render_core::image_file::{FrameChannel, SampleDepth, write_frame};
use std::path::Path;

/// Layers of colors and normals, for which 16-bit floats exceed the precision of vision and compositing. All other
/// layers contain positions, distances, ids or counts, and need 32 bits.
#[cfg(feature = "exr")]
const HALF_LAYERS: [&str; 5] = ["", "direct", "indirect", "albedo", "normal"];

/// Writes radiance \[W·m⁻²·sr⁻¹\] as channels R, G, B, and the `further` channels. Color layers have the given `depth`.
///
/// # Errors
/// If the file cannot be written.
#[cfg(feature = "exr")]
pub fn write_linear(
    path: &Path,
    header: &FrameHeader,
    radiance: &Plane<[f32; 3]>,
    further: Channels,
    depth: ExrDepth,
) -> Result<()> {
    // Store the radiance in the unnamed layer, which viewers display by default.
    let mut channels: Vec<FrameChannel> = Vec::new();
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let samples = radiance.samples().iter().map(|rgb| rgb[c]).collect();
        channels.push(FrameChannel { name: name.to_owned(), samples, depth: depth_of("", depth) });
    }
    // Derive the sample depth of each further channel from its layer, the name before the last dot.
    for (name, samples) in further {
        let depth = depth_of(name.rsplit_once('.').map_or("", |(layer, _)| layer), depth);
        channels.push(FrameChannel { name, samples, depth });
    }
    write_frame(path, (radiance.width(), radiance.height()), header, channels).map_err(Error::other)
}

/// Returns the sample depth of `layer`.
#[cfg(feature = "exr")]
fn depth_of(layer: &str, depth: ExrDepth) -> SampleDepth {
    match depth {
        ExrDepth::Half if HALF_LAYERS.contains(&layer) => SampleDepth::Half,
        _ => SampleDepth::Float,
    }
}

/// Returns an error, because this build lacks the feature `exr`.
#[cfg(not(feature = "exr"))]
pub fn write_linear(path: &Path, _: &FrameHeader, _: &Plane<[f32; 3]>, _: Channels, _: ExrDepth) -> Result<()> {
    Err(Error::content(path, ": this build writes no OpenEXR; build it with the feature exr"))
}
