//! Frames as linear light, in OpenEXR files.

#[cfg(not(feature = "exr"))]
use crate::error::Error;
use crate::error::Result;
use crate::parts::Channels;
use crate::settings::ExrDepth;
use plane::Plane;
use render_core::image_file::{FrameChannel, FrameHeader, SampleDepth};
use std::path::Path;

/// Layers of colors and normals, which halves hold to more than eyes and compositing ask for. All others are numbers that are
/// measured with: places, distances, ids and counts.
const HALF_LAYERS: [&str; 5] = ["", "direct", "indirect", "albedo", "normal"];

/// A frame on its way into a file.
pub(crate) struct LinearFrame<'a> {
    header: &'a FrameHeader,
    /// Width and height.
    size: (usize, usize),
    channels: Vec<FrameChannel>,
}

impl<'a> LinearFrame<'a> {
    /// Radiance \[W·m⁻²·sr⁻¹\] as the channels R, G, B, with `further` channels; colors have this `depth`.
    pub fn of(header: &'a FrameHeader, radiance: &Plane<[f32; 3]>, further: Channels, depth: ExrDepth) -> Self {
        let mut channels: Vec<FrameChannel> = Vec::new();
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            let samples = radiance.samples().iter().map(|rgb| rgb[c]).collect();
            channels.push(FrameChannel { name: name.to_owned(), samples, depth: depth_of("", depth) });
        }
        for (name, samples) in further {
            let depth = depth_of(name.rsplit_once('.').map_or("", |(layer, _)| layer), depth);
            channels.push(FrameChannel { name, samples, depth });
        }
        Self { header, size: (radiance.width(), radiance.height()), channels }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    #[cfg(feature = "exr")]
    pub fn write(self, path: &Path) -> Result<()> {
        let written = render_core::image_file::write_frame(path, self.size, self.header, self.channels);
        written.map_err(crate::error::Error::other)
    }

    /// Writes nothing.
    ///
    /// # Errors
    /// Always: this build has no OpenEXR.
    #[cfg(not(feature = "exr"))]
    pub fn write(self, path: &Path) -> Result<()> {
        let Self { header: _, size: _, channels: _ } = self;
        Err(Error::content(path, ": this build writes no OpenEXR; build it with the feature exr"))
    }
}

/// Bits of the samples of `layer`.
fn depth_of(layer: &str, depth: ExrDepth) -> SampleDepth {
    match depth {
        ExrDepth::Half if HALF_LAYERS.contains(&layer) => SampleDepth::Half,
        _ => SampleDepth::Float,
    }
}
