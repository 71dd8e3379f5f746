//! Choices of a run: [`Options`] as they are made, [`Settings`] with every default filled in for a scene.

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

/// Every choice of a run.
///
/// Serialized as one flat table, in the order of `--print-config` and of `report.json`.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The scene file.
    pub scene: PathBuf,
    /// The video file.
    pub output: PathBuf,
    /// The frames to make; all of the film when not stated.
    pub range: Option<FrameRange>,
    /// Shape of the displayed picture.
    pub aspect: PictureAspect,
    /// Length, rate and size of the film, and its light.
    pub render: RenderSettings,
    /// The encoder's choices, besides `qscale` and `bframes` of `render`.
    pub coding: CodingSettings,
    /// Files besides scene and video.
    pub files: FileSettings,
}

/// Choices of a film that the encoder alone reads.
#[derive(Clone, Debug)]
pub struct CodingSettings {
    /// Macroblocks that are quantised finer than others.
    pub aq: AdaptiveQuantiser,
    /// Pictures from one I picture to the next.
    pub gop: u32,
    /// Most bits a second, or with `cbr` exactly these; no bound when not stated.
    pub bitrate: Option<BitRate>,
    /// Whether the bit rate is constant.
    pub cbr: bool,
    /// Thoroughness of the encoder's search.
    pub effort: Effort,
    /// Whether the video is MPEG-1.
    pub mpeg1: bool,
}

/// Files that a film reads or writes besides scene and video.
#[derive(Clone, Debug, Default)]
pub struct FileSettings {
    /// File of baked light, with [`Lighting::Baked`].
    pub baked: Option<PathBuf>,
    /// Folder for frames as PNG.
    pub png: Option<PathBuf>,
    /// Folder for linear frames as OpenEXR.
    pub exr: Option<PathBuf>,
    /// Bits of the colors in these files; [`ExrDepth::Half`] when not stated.
    pub exr_depth: Option<ExrDepth>,
    /// File for the frames before compression.
    pub y4m: Option<PathBuf>,
    /// Whether that file has the film's matrix, for readers that expect it.
    pub y4m_is_coded: bool,
}

impl Settings {
    /// Settings for `scene`, loaded from `path`: `options`, with a default for what they leave open.
    ///
    /// # Errors
    /// An option, or a setting of the scene, is out of its range or contradicts another; the message says what works.
    pub fn new(path: PathBuf, scene: &Scene, options: &Options) -> Result<Self> {
        options.clone().fill_in(path, scene)
    }

    /// The frames to make: all of the film, or those of its range.
    #[must_use]
    pub fn frame_range(&self) -> Range<u32> {
        self.range.map_or(0..self.render.frames, |FrameRange { first, last }| first..last + 1)
    }

    /// Whether the film is made in chunks that do not depend on each other: by `chunk`, or each range by itself.
    #[must_use]
    pub fn is_in_chunks(&self) -> bool {
        self.render.chunk.is_some() || self.range.is_some()
    }

    /// Container of the video.
    pub fn container(&self) -> Container {
        container_of(&self.output, self.range).unwrap_or_default()
    }

    /// Whether pictures may wait for later ones before they are coded: the frame that thresholds are derived from is then
    /// not coded yet.
    pub fn looks_ahead(&self) -> bool {
        self.coding.bitrate.is_some() || self.render.bframes > 0
    }

    /// Matrix of the film: MPEG-1 states none, and decoders assume BT.601 (11172-2, 2.4.1).
    #[must_use]
    pub fn matrix(&self) -> ColorMatrix {
        if self.coding.mpeg1 { ColorMatrix::Bt601 } else { ColorMatrix::Bt709 }
    }

    /// Configuration of the encoder for these settings.
    ///
    /// # Errors
    /// A size, rate, quantiser or group of pictures that the standard does not have; the message names what it has.
    pub fn encoder_config(&self) -> Result<mpeg2enc::Config> {
        let CodedRate { rate: frame_rate, pictures } = CodedRate::of(self.render.fps)?;
        let is_disc = self.container() == Container::Disc;
        let pulldown = is_disc && frame_rate == mpeg2enc::FrameRate::from_fps(24_000.0 / 1001.0)?;
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
        // DVD-Video has Main Level.
        let stated = if pulldown { 30_000.0 / 1001.0 } else { frame_rate.fps() };
        let lowest = Level::lowest(self.render.size.width, self.render.size.height, stated);
        if is_disc && lowest.is_some_and(|lowest| lowest <= Level::Main) {
            return Ok(config.with_level(Level::Main));
        }
        if !self.is_in_chunks() {
            return Ok(config);
        }
        // Chunks are coded apart: none may choose a level by its pictures.
        let pixels = (self.render.size.width * self.render.size.height) as u64;
        let bits =
            if self.render.qscale < FINE { pixels * BUSY_BITS / u64::from(self.render.qscale.max(1)) } else { 0 };
        Ok(config.with_level_for(bits))
    }
}

/// Pictures from one I picture to the next, of groups of `gop` frames with some `pictures` each: I pictures are first ones.
fn coded_group(gop: u32, pictures: u32) -> u32 {
    if pictures == 1 || gop > LONGEST_GROUP {
        return gop;
    }
    gop.saturating_mul(pictures).min(LONGEST_GROUP / pictures * pictures)
}

/// Films in chunks at finer quantisers than this state a level for busy pictures.
const FINE: u32 = 8;
/// Bits of a pixel of noise at quantiser_scale 1; ours, about those of full range. At others it is this divided by them.
const BUSY_BITS: u64 = 12;
/// The most pictures from one I picture to the next, as [`mpeg2enc::Config::with_gop`] has it.
const LONGEST_GROUP: u32 = 132;
/// A decoder buffers half a second, within what High Level allows.
const SMALLEST_BUFFER: u32 = 16_384;
const LARGEST_BUFFER: u32 = 9_781_248;
