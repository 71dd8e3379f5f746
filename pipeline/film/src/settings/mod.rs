//! Options and settings of a run: [`Options`] as given by the user, and [`Settings`] with every default filled in for a
//! scene.

mod aspect;
mod chunks;
mod coded_rate;
mod container;
mod emphasis;
mod frame_list;
mod listed;
mod options;
mod preset;
mod resolve;
mod values;

pub use aspect::PictureAspect;
pub use chunks::FrameRange;
pub use coded_rate::CodedRate;
pub use coded_rate::parse_fps;
pub use container::{check_disc, container_of, unknown_ending};
pub use emphasis::AdaptiveQuantiser;
pub use frame_list::FrameList;
pub use mpeg2enc::Effort;
pub use options::Options;
pub use preset::Preset;
pub use renderer::settings::{Aov, Importance, Lighting, PixelShading, Size, Stopping, Thresholds, TileSettings};
pub use resolve::read_tone_map;
pub use values::{BitRate, CheckpointEvery, ExrDepth, MemorySize, Switch};

use crate::error::Result;
use mpeg2enc::{Container, Level, Rate, Standard};
use perceptual::ColorMatrix;
use render_core::scene::Scene;
use renderer::settings::RenderSettings;
use std::ops::Range;
use std::path::PathBuf;

/// Settings of a run, with every default filled in.
///
/// Settings are serialized as one flat table, in the order of `report.json`.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Path of the scene file.
    pub scene: PathBuf,
    /// Path of the video file.
    pub output: PathBuf,
    /// Range of frames to make; `None` for the whole film.
    pub range: Option<FrameRange>,
    /// Display aspect ratio.
    pub aspect: PictureAspect,
    /// Length, rate, size and lighting of the film.
    pub render: RenderSettings,
    /// Encoder settings in addition to `qscale` and `bframes` of `render`.
    pub coding: CodingSettings,
    /// Paths of additional files, other than scene and video.
    pub files: FileSettings,
}

/// Settings that only the encoder reads.
#[derive(Clone, Debug)]
pub struct CodingSettings {
    /// Adaptive quantisation.
    pub aq: AdaptiveQuantiser,
    /// Distance from one I picture to the next \[pictures\].
    pub gop: u32,
    /// Maximum bit rate, or the exact rate with `cbr`; `None` for no limit.
    pub bitrate: Option<BitRate>,
    /// Whether the bit rate is constant.
    pub cbr: bool,
    /// Thoroughness of the encoder's search.
    pub effort: Effort,
    /// Whether the video is MPEG-1.
    pub mpeg1: bool,
}

/// Files that a film reads or writes in addition to scene and video; `None` for files that are not used.
#[derive(Clone, Debug, Default)]
pub struct FileSettings {
    /// File of baked light, for [`Lighting::Baked`].
    pub baked: Option<PathBuf>,
    /// File of the film's light, read if it exists, otherwise written.
    pub light: Option<PathBuf>,
    /// Folder for frames as PNG files.
    pub png: Option<PathBuf>,
    /// Folder for frames as linear OpenEXR files.
    pub exr: Option<PathBuf>,
    /// Bit depth of colors in OpenEXR files; `None` means [`ExrDepth::Half`].
    pub exr_depth: Option<ExrDepth>,
    /// File for uncompressed frames, as YUV4MPEG2.
    pub y4m: Option<PathBuf>,
    /// Whether the YUV4MPEG2 file uses the film's color matrix, for readers that expect this matrix.
    pub y4m_is_coded: bool,
}

impl Settings {
    /// Returns the settings for `scene`, loaded from `path`. Options missing in `options` have their defaults.
    ///
    /// # Errors
    /// If an option or a scene setting is out of range or contradicts another. The message names valid values.
    pub fn new(path: PathBuf, scene: &Scene, options: &Options) -> Result<Self> {
        options.clone().fill_in(path, scene)
    }

    /// Returns the frames to make: all frames of the film, or its range.
    #[must_use]
    pub fn frame_range(&self) -> Range<u32> {
        self.range.map_or(0..self.render.frames, |FrameRange { first, last }| first..last + 1)
    }

    /// Returns whether the film consists of independent chunks: with `chunk`, or with a range, which is one chunk.
    #[must_use]
    pub fn is_in_chunks(&self) -> bool {
        self.render.chunk.is_some() || self.range.is_some()
    }

    /// Returns the container of the video.
    pub fn container(&self) -> Container {
        container_of(&self.output, self.range).unwrap_or_default()
    }

    /// Returns whether pictures may wait for later ones before coding. The frame from which thresholds are derived is
    /// then not coded yet.
    pub fn looks_ahead(&self) -> bool {
        self.coding.bitrate.is_some() || self.render.bframes > 0
    }

    /// Returns the color matrix of the film. MPEG-1 does not signal a matrix, and decoders assume BT.601 (11172-2,
    /// 2.4.1).
    #[must_use]
    pub fn matrix(&self) -> ColorMatrix {
        if self.coding.mpeg1 { ColorMatrix::Bt601 } else { ColorMatrix::Bt709 }
    }

    /// Returns the encoder's configuration for these settings.
    ///
    /// # Errors
    /// If the standard does not support the size, rate, quantiser or group of pictures. The message names valid values.
    pub fn encoder_config(&self) -> Result<mpeg2enc::Config> {
        let CodedRate { rate: frame_rate, pictures } = CodedRate::of(self.render.fps)?;
        // Enable pulldown at 23.976 pictures per second, where DVD-Video requires it.
        let is_disc = self.container() == Container::Disc;
        let pulldown = is_disc && frame_rate == mpeg2enc::FrameRate::from_fps(24_000.0 / 1001.0)?;

        // Choose the decoder buffer, which a bit rate needs.
        let rate = match self.coding.bitrate {
            None => Rate::ConstantQuantiser,
            Some(BitRate(bits_per_second)) => {
                let buffer_bits = (bits_per_second / 2).clamp(SMALLEST_BUFFER, LARGEST_BUFFER);
                match self.coding.cbr {
                    true => Rate::Constant { bits_per_second, buffer_bits },
                    false => Rate::Capped { bits_per_second, buffer_bits },
                }
            }
        };

        // Enable lookahead only for rate control and B pictures, because it delays coding and feedback.
        let config = mpeg2enc::Config::new(self.render.size.width, self.render.size.height, frame_rate)
            .with_standard(if self.coding.mpeg1 { Standard::Mpeg1 } else { Standard::Mpeg2 })
            .with_gop(coded_group(self.coding.gop, pictures))
            .with_aspect(self.aspect.ratio())
            .with_pulldown(pulldown)
            .with_quantiser_scale(self.render.qscale)
            .with_lookahead(if self.looks_ahead() { mpeg2enc::Config::LOOKAHEAD_MAX } else { 0 })
            .with_b_pictures(self.render.bframes)
            .with_rate(rate)
            .with_effort(self.coding.effort);
        config.validate()?;

        // Signal Main Level for DVD-Video, which requires it.
        let stated = if pulldown { 30_000.0 / 1001.0 } else { frame_rate.fps() };
        let lowest = Level::lowest(self.render.size.width, self.render.size.height, stated);
        if is_disc && lowest.is_some_and(|lowest| lowest <= Level::Main) {
            return Ok(config.with_level(Level::Main));
        }
        // Let the encoder choose the level of an undivided film.
        if !self.is_in_chunks() {
            return Ok(config);
        }
        // Choose one level for all chunks: they are coded independently, so none may derive its level from its own
        // pictures.
        let pixels = (self.render.size.width * self.render.size.height) as u64;
        let bits =
            if self.render.qscale < FINE { pixels * BUSY_BITS / u64::from(self.render.qscale.max(1)) } else { 0 };
        Ok(config.with_level_for(bits))
    }
}

/// Returns the distance between I pictures for groups of `gop` frames with `pictures` each. I pictures are the first
/// pictures of their frames.
fn coded_group(gop: u32, pictures: u32) -> u32 {
    // Leave an invalid distance unchanged, so that validation reports the user's own number.
    if pictures == 1 || gop > LONGEST_GROUP {
        return gop;
    }
    gop.saturating_mul(pictures).min(LONGEST_GROUP / pictures * pictures)
}

/// Quantiser below which films in chunks signal a level for pictures with many bits.
const FINE: u32 = 8;
/// Bits per pixel of noise over about the full range, at quantiser_scale 1 (ours). For other quantisers, this number is
/// divided by quantiser_scale.
const BUSY_BITS: u64 = 12;
/// Maximum distance from one I picture to the next, as in [`mpeg2enc::Config::with_gop`].
const LONGEST_GROUP: u32 = 132;
/// Minimum size of the decoder's buffer, which otherwise contains half a second of the stream \[bits\].
const SMALLEST_BUFFER: u32 = 16_384;
/// Maximum size of the decoder's buffer, the limit of High Level \[bits\].
const LARGEST_BUFFER: u32 = 9_781_248;
