//! Choices of a run: [`Options`] as they are made, [`Settings`] with every default filled in for a scene.

mod aspect;
mod chunks;
mod coded_rate;
mod container;
mod emphasis;
mod frame_list;
mod options;
mod preset;
mod render;
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
use perceptual::{ColorMatrix, ToneMap};
use render_core::scene::Scene;
use serde::Serialize;
use std::ops::Range;
use std::path::PathBuf;

/// Every choice of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// The scene file.
    pub scene: PathBuf,
    /// The video file.
    pub output: PathBuf,
    /// Pictures to make.
    pub frames: u32,
    /// The frame of the scene that the film begins with.
    #[serde(skip_serializing_if = "is_zero")]
    pub from: u32,
    /// Frames of the scene from one picture of the film to the next.
    #[serde(skip_serializing_if = "is_one")]
    pub every: u32,
    /// Frames of a chunk, where the film is made in chunks that do not depend on each other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunk: Option<u32>,
    /// The frames to make; all of the film when not stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<FrameRange>,
    /// Pictures a second.
    pub fps: f64,
    /// Size of the picture.
    pub size: Size,
    /// Shape of the displayed picture.
    #[serde(skip_serializing_if = "PictureAspect::is_square")]
    pub aspect: PictureAspect,
    /// The standard's quantiser_scale, 1…112.
    pub qscale: u32,
    /// Choice of the macroblocks that are quantised finer than others.
    pub aq: AdaptiveQuantiser,
    /// Pictures from one I picture to the next.
    pub gop: u32,
    /// The most bits a second, or with `cbr` just as many; no bound when not stated.
    pub bitrate: Option<BitRate>,
    /// Whether the bit rate is constant.
    pub cbr: bool,
    /// The most B pictures in a row.
    pub bframes: u32,
    /// How much the encoder tries.
    pub effort: Effort,
    /// Whether the video is MPEG-1.
    pub mpeg1: bool,
    /// Where thresholds come from.
    pub thresholds: Thresholds,
    /// Multiplier on what masking allows; 1 is the paper's.
    pub kappa: f32,
    /// When cuts end.
    pub stopping: Stopping,
    /// Share of pixels that calibrated stopping keeps within their thresholds.
    pub within: f64,
    /// Which pixels are lit.
    pub shading: PixelShading,
    /// Weights of the maps that say where people look, if they are to steer anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub importance: Option<Importance>,
    /// Factor on thresholds between the most and the mean importance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub importance_gain: Option<f32>,
    /// Tiles that ranks take on demand, if they do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<TileSettings>,
    /// Samples of visibility and light to the pixel, at most.
    pub samples: u32,
    /// Whether pixels that outlines cross blend the surfaces of their area.
    pub antialiasing: bool,
    /// Reflections of light on its way, at most; no limit when not stated.
    pub bounces: Option<u32>,
    /// How indirect light is computed.
    pub lighting: Lighting,
    /// File of baked light, where there is to be any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baked: Option<PathBuf>,
    /// Whether indirect light is cached on surfaces and interpolated.
    pub cache: bool,
    /// Whether bias compensation restores the light that softened virtual lights lose close by.
    pub compensation: bool,
    /// Anchor lights on surfaces at rest.
    pub vpls: usize,
    /// Anchor lights on surfaces that move.
    pub moving_vpls: usize,
    /// Photons a frame.
    pub photons: u64,
    /// Seed of photons and representatives.
    pub seed: u64,
    /// Leave out what the scene does not need.
    pub leave_out: bool,
    /// Give the encoder the renderer's motion.
    pub motion: bool,
    /// How radiance becomes light on a display.
    pub tone_map: ToneMap,
    /// Whether the first frame sets the exposure.
    pub auto_exposure: bool,
    /// Folder for frames as PNG, if wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub png: Option<PathBuf>,
    /// Folder for linear frames as OpenEXR, if wanted.
    pub exr: Option<PathBuf>,
    /// Bits of the colors in these files; [`ExrDepth::Half`] when not stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exr_depth: Option<ExrDepth>,
    /// Further layers of a frame's OpenEXR file.
    pub aov: Vec<Aov>,
    /// File for the frames before compression, if wanted.
    pub y4m: Option<PathBuf>,
    /// Whether that file has the matrix of the film, for readers that expect it.
    #[serde(skip)]
    pub y4m_is_coded: bool,
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

fn is_one(number: &u32) -> bool {
    *number == 1
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
        self.range.map_or(0..self.frames, |FrameRange { first, last }| first..last + 1)
    }

    /// Whether the film is made in chunks that do not depend on each other: by `chunk`, or each range by itself.
    #[must_use]
    pub fn is_in_chunks(&self) -> bool {
        self.chunk.is_some() || self.range.is_some()
    }

    /// Container of the video.
    pub fn container(&self) -> Container {
        container_of(&self.output, self.range).unwrap_or_default()
    }

    /// Whether pictures may wait for later ones before they are coded: the frame that thresholds are derived from is then
    /// not coded yet.
    pub fn looks_ahead(&self) -> bool {
        self.bitrate.is_some() || self.bframes > 0
    }

    /// Matrix of the film: MPEG-1 states none, and decoders assume BT.601 (11172-2, 2.4.1).
    #[must_use]
    pub fn matrix(&self) -> ColorMatrix {
        if self.mpeg1 { ColorMatrix::Bt601 } else { ColorMatrix::Bt709 }
    }

    /// Configuration of the encoder for these settings.
    ///
    /// # Errors
    /// A size, rate, quantiser or group of pictures that the standard does not have; the message names what it has.
    pub fn encoder_config(&self) -> Result<mpeg2enc::Config> {
        let CodedRate { rate: frame_rate, pictures } = CodedRate::of(self.fps)?;
        let is_disc = self.container() == Container::Disc;
        let pulldown = is_disc && frame_rate == mpeg2enc::FrameRate::from_fps(24_000.0 / 1001.0)?;
        let rate = match self.bitrate {
            None => Rate::ConstantQuantiser,
            Some(BitRate(bits_per_second)) => {
                let buffer_bits = (bits_per_second / 2).clamp(SMALLEST_BUFFER, LARGEST_BUFFER);
                match self.cbr {
                    true => Rate::Constant { bits_per_second, buffer_bits },
                    false => Rate::Capped { bits_per_second, buffer_bits },
                }
            }
        };
        let config = mpeg2enc::Config::new(self.size.width, self.size.height, frame_rate)
            .with_standard(if self.mpeg1 { Standard::Mpeg1 } else { Standard::Mpeg2 })
            .with_gop(coded_group(self.gop, pictures))
            .with_aspect(self.aspect.ratio())
            .with_pulldown(pulldown)
            .with_quantiser_scale(self.qscale)
            .with_lookahead(if self.looks_ahead() { mpeg2enc::Config::LOOKAHEAD_MAX } else { 0 })
            .with_b_pictures(self.bframes)
            .with_rate(rate)
            .with_effort(self.effort);
        config.validate()?;
        // DVD-Video has Main Level.
        let stated = if pulldown { 30_000.0 / 1001.0 } else { frame_rate.fps() };
        let lowest = Level::lowest(self.size.width, self.size.height, stated);
        if is_disc && lowest.is_some_and(|lowest| lowest <= Level::Main) {
            return Ok(config.with_level(Level::Main));
        }
        if !self.is_in_chunks() {
            return Ok(config);
        }
        // Chunks are coded apart: none may choose a level by its pictures.
        let pixels = (self.size.width * self.size.height) as u64;
        let bits = if self.qscale < FINE { pixels * BUSY_BITS / u64::from(self.qscale.max(1)) } else { 0 };
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
