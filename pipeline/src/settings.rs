//! What is meant: every choice of a run, checked and with its default filled in.

use crate::error::{Error, Result};
use lighttree::Calibration;
use mpeg2enc::{Container, Rate, Standard};
use perceptual::ToneMap;
use render_core::scene::Scene;
use serde::Serialize;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

/// Returns an [`Error::Options`].
macro_rules! fail {
    ($($text:tt)*) => { return Err(Error::Options(format!($($text)*))) };
}

/// How indirect light is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Lighting {
    /// A cut through the light tree for each pixel, as fine as its threshold asks for.
    Lightcuts,
    /// Every light at every pixel: slow, the reference that cuts are measured against.
    AllLights,
}

/// How often what a killed run needs to go on is written, as typed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CheckpointEvery {
    /// Seconds; 0 for each frame.
    Seconds(f64),
    /// Never.
    Off,
}

impl CheckpointEvery {
    /// As a duration; none for never.
    pub fn duration(self) -> Option<Duration> {
        match self {
            Self::Seconds(seconds) => Some(Duration::from_secs_f64(seconds)),
            Self::Off => None,
        }
    }
}

impl std::fmt::Display for CheckpointEvery {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Seconds(seconds) => write!(f, "{seconds}"),
            Self::Off => write!(f, "off"),
        }
    }
}

impl FromStr for CheckpointEvery {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "off" {
            return Ok(Self::Off);
        }
        let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=1e6).contains(seconds));
        seconds.map(Self::Seconds).ok_or_else(|| {
            format!("\"{text}\" is neither \"off\" nor a number of seconds such as 60; 0 is after each frame")
        })
    }
}

/// On or off, as typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Switch {
    /// Do it.
    On,
    /// Leave it.
    Off,
}

impl Switch {
    /// Whether it is [`Switch::On`].
    pub fn is_on(self) -> bool {
        self == Self::On
    }
}

/// What else of a frame can be written into its OpenEXR file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Aov {
    /// direct.R, .G, .B: emitted light, and light reflected straight from its source.
    Direct,
    /// indirect.R, .G, .B: all other light.
    Indirect,
    /// albedo.R, .G, .B: diffuse reflectance.
    Albedo,
    /// normal.X, .Y, .Z: the unit normal that is shaded with, in the world.
    Normal,
    /// depth.Z: metres along the camera's axis.
    Depth,
    /// motion.X, .Y: pixels from here to the same point in the frame before; motion.A: 1 where it was visible there.
    Motion,
    /// cut.size: clusters of the pixel's cut, with the cache of the records' cuts at their pixels.
    CutSize,
    /// threshold.Y: luminance that the pixel may be wrong by; 0 where 2 % of its own hold.
    Threshold,
    /// cache.records: records of the irradiance cache in use at the pixel.
    Cache,
}

/// Where the error that a pixel may have comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thresholds {
    /// From the masking model, one frame later.
    Perceptual,
    /// The same from the picture as it was decoded, and not along the motion \[Herzog08, 5.3, first strategy\]: for films in
    /// which little moves.
    Quantised,
    /// From what the encoder really did, or will do where it looks ahead, one frame later.
    Codec,
    /// A share of the luminance that each pixel had one frame before: as far as thresholds can be let go if all are let go
    /// alike, with all that is gained by knowing them beforehand.
    Uniform(f32),
    /// A fixed share of each pixel's luminance; 0.02 is the original Lightcuts.
    Fixed(f32),
}

impl Thresholds {
    /// Whether masking wants to see what the encoder made of each picture.
    pub fn follow_coding(self) -> bool {
        matches!(self, Self::Codec | Self::Quantised)
    }
}

impl FromStr for Thresholds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let share = |share: &str| share.parse::<f32>().ok().filter(|share| (0.0..=1.0).contains(share));
        let known = match text.split_once(':') {
            None if text == "perceptual" => Some(Self::Perceptual),
            None if text == "quantised" => Some(Self::Quantised),
            None if text == "codec" => Some(Self::Codec),
            Some(("fixed", text)) => share(text).map(Self::Fixed),
            Some(("uniform", text)) => share(text).map(Self::Uniform),
            _ => None,
        };
        known.ok_or_else(|| {
            format!(
                "\"{text}\" is none of \"codec\", \"perceptual\" and \"quantised\", nor \"fixed:SHARE\" or \"uniform:SHARE\" with a share of 0 to 1, such as fixed:0.02"
            )
        })
    }
}

impl Serialize for Thresholds {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Perceptual => serializer.serialize_str("perceptual"),
            Self::Quantised => serializer.serialize_str("quantised"),
            Self::Codec => serializer.serialize_str("codec"),
            Self::Uniform(share) => serializer.serialize_str(&format!("uniform:{share}")),
            Self::Fixed(share) => serializer.serialize_str(&format!("fixed:{share}")),
        }
    }
}

/// When the cut of a pixel ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Stopping {
    /// When no cluster's error bound exceeds the threshold, as in the paper.
    Bound,
    /// When measured errors say that 95 % of the pixels are within it, or another share.
    Calibrated,
}

/// Width and height of the picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Largest side that the size fields of the sequence header and its extension hold (6.2.2.1, 6.2.2.3).
const LARGEST_SIDE: usize = 16383;

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("\"{text}\" is not a size such as 512x512, with sides of 1 to {LARGEST_SIDE} pixels");
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
        let side = |text: &str| text.parse::<usize>().ok().filter(|side| (1..=LARGEST_SIDE).contains(side));
        Ok(Self { width: side(width).ok_or_else(wrong)?, height: side(height).ok_or_else(wrong)? })
    }
}

/// Bits a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct BitRate(pub u32);

/// A smaller rate is a slip: even MPEG-1's smallest pictures need more.
const LEAST_BIT_RATE: f64 = 10_000.0;

impl FromStr for BitRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit) = match text.as_bytes().last() {
            Some(b'k' | b'K') => (&text[..text.len() - 1], 1e3),
            Some(b'm' | b'M') => (&text[..text.len() - 1], 1e6),
            _ => (text, 1.0),
        };
        let rate = number.parse::<f64>().ok().map(|number| number * unit);
        let rate = rate.filter(|rate| (LEAST_BIT_RATE..=1e9).contains(rate));
        rate.map(|rate| Self(rate.round() as u32))
            .ok_or_else(|| format!("\"{text}\" is not a bit rate such as 1500k or 2M, from 10k to 1000M bits a second"))
    }
}

/// How much the encoder tries for few bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Effort {
    /// Least time; with a bit rate, no frame waits for later ones.
    Fast,
    /// Few bits.
    #[default]
    Balanced,
    /// Fewest bits.
    Best,
}

/// Every choice of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// The scene file.
    pub scene: PathBuf,
    /// The video file.
    pub output: PathBuf,
    /// Pictures to make.
    pub frames: u32,
    /// Pictures a second.
    pub fps: f64,
    /// Of the picture.
    pub size: Size,
    /// The standard's quantiser_scale, 1…112.
    pub qscale: u32,
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
    /// Samples of visibility and direct light to the pixel.
    pub samples: u32,
    /// Reflections of light on its way, at most; no limit when not stated.
    pub bounces: Option<u32>,
    /// How indirect light is computed.
    pub lighting: Lighting,
    /// Whether indirect light is cached on surfaces and interpolated.
    pub cache: bool,
    /// Whether the light that softened virtual lights lose close by is given back.
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
    /// Folder for linear frames as OpenEXR, if wanted.
    pub exr: Option<PathBuf>,
    /// What else of a frame goes into its OpenEXR file.
    pub aov: Vec<Aov>,
    /// File for the frames before compression, if wanted.
    pub y4m: Option<PathBuf>,
}

/// What a user may leave open, and what then holds.
#[derive(Clone, Debug, Default)]
pub struct Wishes {
    /// See [`Settings`] for each.
    pub output: Option<PathBuf>,
    /// Default: what the scene's TOML file says, else its animation's length, else 100.
    pub frames: Option<u32>,
    /// Default: what the scene's TOML file says, else 25.
    pub fps: Option<f64>,
    /// Default: 512x512, as in the paper.
    pub size: Option<Size>,
    /// Default: 8.
    pub qscale: Option<u32>,
    /// Default: 15.
    pub gop: Option<u32>,
    /// Default: no bound.
    pub bitrate: Option<BitRate>,
    /// Default: the rate is a bound.
    pub cbr: bool,
    /// Default: 0.
    pub bframes: Option<u32>,
    /// Default: balanced.
    pub effort: Option<Effort>,
    /// Default: MPEG-2.
    pub mpeg1: bool,
    /// Default: perceptual.
    pub thresholds: Option<Thresholds>,
    /// Default: 0.25.
    pub kappa: Option<f32>,
    /// Default: bound.
    pub stopping: Option<Stopping>,
    /// Default: 0.95; stated, cuts are calibrated.
    pub within: Option<f64>,
    /// Default: 1.
    pub samples: Option<u32>,
    /// Default: no limit.
    pub bounces: Option<u32>,
    /// Default: lightcuts.
    pub lighting: Option<Lighting>,
    /// Default: on.
    pub cache: Option<Switch>,
    /// Default: on.
    pub compensation: Option<Switch>,
    /// Default: 2000 for a box to 9000 for a building.
    pub vpls: Option<usize>,
    /// Default: 150 for each anchor light, as in the paper.
    pub photons: Option<u64>,
    /// Default: 1.
    pub seed: Option<u64>,
    /// Default: leave out.
    pub run_everything: bool,
    /// Default: the encoder is given the motion.
    pub no_motion: bool,
    /// See [`Settings`].
    pub exr: Option<PathBuf>,
    /// See [`Settings`]; given without a folder for OpenEXR files, an error.
    pub aov: Vec<Aov>,
    /// See [`Settings`].
    pub y4m: Option<PathBuf>,
}

/// Most samples to the pixel.
const MOST_SAMPLES: u32 = 64;
/// Photons for each anchor light: 3·10⁵ for 2000 in table 1 of \[Herzog08\].
const PHOTONS_PER_ANCHOR: u64 = 150;
/// Anchor lights on moving things, each asked at every record. With 24, two or three to a side of a block, `cornell`
/// is 1.6·10⁻³ off the path tracer's in relative MSE; with 96 it is 4.5·10⁻⁴, for 2 % more shadow rays.
const MOVING_ANCHORS: usize = 96;

/// κ of [`perceptual::Feedback::with_kappa`]. Ours: with 1 the decoded luma of `cornell` at quantiser_scale 48 lies 0.4 dB
/// below that of cuts at 2 %, with 1/4 less than 0.1 dB (`cargo run --release -p tests --example closed_loop`).
const KAPPA: f32 = 0.25;
/// The same of [`perceptual::Feedback::observe_coded`], which counts what errors do to the decoded picture itself. On `cornell`,
/// 256×256, 1 costs less than 0.06 dB and 1.3 % of bits at quantisers from 8 to 48; 2 costs 0.16 dB and 3.9 %.
const CODEC_KAPPA: f32 = 1.0;

impl Settings {
    /// Fills in `wishes` for `scene`, loaded from `path`.
    ///
    /// # Errors
    /// A wish, or a setting of the scene, that cannot be met; the message says what could.
    pub fn new(path: PathBuf, scene: &Scene, wishes: Wishes) -> Result<Self> {
        let output = match wishes.output {
            Some(output) => output,
            None => PathBuf::from(
                path.file_stem().ok_or_else(|| Error::Options("the scene's path has no file name".into()))?,
            )
            .with_extension("m2v"),
        };
        if Container::of(&output).is_none() {
            fail!("{}: such files are not written; name the output .m2v, .mpg or .ts", output.display());
        }
        if wishes.cbr && wishes.bitrate.is_none() {
            fail!("--cbr needs --bitrate, which says how many bits a second there are to be");
        }
        let video = scene.settings.video;
        let fps = wishes.fps.or(video.fps).unwrap_or(25.0);
        if !(fps.is_finite() && fps > 0.0) {
            fail!("--fps {fps} must be positive");
        }
        let animated = (f64::from(scene.duration()) * fps).round().clamp(0.0, 1e6) as u32;
        let frames = wishes.frames.or(video.frames).unwrap_or(if animated > 0 { animated } else { 100 });
        if frames == 0 {
            fail!("--frames 0: a video has at least one frame");
        }
        let thresholds = wishes.thresholds.unwrap_or(Thresholds::Codec);
        let kappa = wishes.kappa.unwrap_or(if thresholds == Thresholds::Codec { CODEC_KAPPA } else { KAPPA });
        if !(0.0..=100.0).contains(&kappa) {
            fail!("--kappa {kappa} must lie in 0..=100; 1 is the paper's");
        }
        if thresholds == Thresholds::Quantised
            && (wishes.bitrate.is_some() || wishes.bframes.is_some_and(|most| most > 0))
        {
            fail!(
                "--thresholds quantised needs pictures that are coded as they come: leave out --bitrate and --bframes, or take --thresholds codec"
            );
        }
        let stopping = wishes.stopping.unwrap_or(match wishes.within {
            Some(_) => Stopping::Calibrated,
            None => Stopping::Bound,
        });
        let within = wishes.within.unwrap_or(Calibration::DEFAULT_SHARE);
        if !(0.5..=0.999).contains(&within) {
            fail!(
                "--within {within} must lie in 0.5..=0.999; 0.95 lets one pixel in twenty be wrong by more than its threshold"
            );
        }
        if stopping == Stopping::Bound && wishes.within.is_some() {
            fail!("--within is measured where cuts are calibrated: leave out --stopping bound");
        }
        let samples = wishes.samples.unwrap_or(1);
        if !(1..=MOST_SAMPLES).contains(&samples) {
            fail!("--samples {samples} must lie in 1..={MOST_SAMPLES}; 1 is fast, 4 smooths edges");
        }
        if wishes.bounces == Some(0) {
            fail!("--bounces 0: light that is never reflected shows nothing but lamps; 1 is direct light alone");
        }
        if wishes.exr.is_some() && !cfg!(feature = "exr") {
            fail!("--exr: this build writes no OpenEXR; build it with the feature exr");
        }
        if !wishes.aov.is_empty() && wishes.exr.is_none() {
            fail!("--aov needs --exr DIR, the folder for the files that it adds to");
        }
        let vpls = wishes.vpls.unwrap_or_else(|| render_core::Anchors::default_count(scene));
        if !(1..=10_000_000).contains(&vpls) {
            fail!("--vpls {vpls} must lie in 1..=10000000");
        }
        let settings_file = render_core::scene::SceneSettings::path_for(&path);
        let (tone_map, auto_exposure) = match &scene.settings.tone_mapping {
            None => (ToneMap::default(), true),
            Some(table) => {
                let tone_map: ToneMap = table.clone().try_into().map_err(|error: toml::de::Error| {
                    Error::content(&settings_file, format!(": [tone_mapping] {}", error.message()))
                })?;
                tone_map.check().map_err(|error| Error::content(&settings_file, format!(": {error}")))?;
                (tone_map, !table.contains_key("exposure"))
            }
        };
        Ok(Self {
            scene: path,
            output,
            frames,
            fps,
            size: wishes.size.unwrap_or(Size { width: 512, height: 512 }),
            qscale: wishes.qscale.unwrap_or(8),
            gop: wishes.gop.unwrap_or(15),
            bitrate: wishes.bitrate,
            cbr: wishes.cbr,
            bframes: wishes.bframes.unwrap_or(0),
            effort: wishes.effort.unwrap_or_default(),
            mpeg1: wishes.mpeg1,
            thresholds,
            kappa,
            stopping,
            within,
            samples,
            bounces: wishes.bounces,
            lighting: wishes.lighting.unwrap_or(Lighting::Lightcuts),
            cache: wishes.cache.is_none_or(Switch::is_on),
            compensation: wishes.compensation.is_none_or(Switch::is_on),
            vpls,
            moving_vpls: MOVING_ANCHORS,
            photons: wishes.photons.unwrap_or(PHOTONS_PER_ANCHOR * vpls as u64),
            seed: wishes.seed.unwrap_or(1),
            leave_out: !wishes.run_everything,
            motion: !wishes.no_motion,
            tone_map,
            auto_exposure,
            exr: wishes.exr,
            aov: wishes.aov,
            y4m: wishes.y4m,
        })
    }

    /// Seconds from the start of the animation to frame `n`.
    pub fn time(&self, n: u32) -> f32 {
        (f64::from(n) / self.fps) as f32
    }

    /// What the video is wrapped into.
    pub fn container(&self) -> Container {
        Container::of(&self.output).unwrap_or_default()
    }

    /// Whether pictures may wait for later ones before they are coded: the frame that thresholds are derived from is then
    /// not coded yet.
    pub fn looks_ahead(&self) -> bool {
        self.bitrate.is_some() || self.bframes > 0
    }

    /// The encoder that these settings ask for.
    ///
    /// # Errors
    /// A size, rate, quantiser or group of pictures that the standard does not have; the message names what it has.
    pub fn encoder_config(&self) -> Result<mpeg2enc::Config> {
        let frame_rate = mpeg2enc::FrameRate::from_fps(self.fps)?;
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
            .with_gop(self.gop)
            .with_quantiser_scale(self.qscale)
            .with_b_pictures(self.bframes)
            .with_rate(rate)
            .with_effort(match self.effort {
                Effort::Fast => mpeg2enc::Effort::Fast,
                Effort::Balanced => mpeg2enc::Effort::Balanced,
                Effort::Best => mpeg2enc::Effort::Best,
            });
        // Both check everything; what they would make is not needed here.
        if self.looks_ahead() {
            config.clone().lookahead_encoder()?;
        } else {
            config.clone().encoder()?;
        }
        Ok(config)
    }
}

/// A decoder buffers half a second, within what High Level allows.
const SMALLEST_BUFFER: u32 = 16_384;
const LARGEST_BUFFER: u32 = 9_781_248;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_rates_and_thresholds_are_read_or_explained() {
        assert_eq!("640x360".parse(), Ok(Size { width: 640, height: 360 }));
        for bad in ["0x0", "512", "x", "99999x1", "-1x5"] {
            assert!(bad.parse::<Size>().unwrap_err().contains("512x512"), "{bad}");
        }
        assert_eq!("fixed:0.02".parse(), Ok(Thresholds::Fixed(0.02)));
        assert_eq!("perceptual".parse(), Ok(Thresholds::Perceptual));
        for bad in ["fixed", "fixed:-1", "fixed:nan", "watson"] {
            assert!(bad.parse::<Thresholds>().unwrap_err().contains("fixed:0.02"), "{bad}");
        }
        for (text, rate) in [("1500k", 1_500_000), ("2M", 2_000_000), ("0.5m", 500_000), ("64000", 64_000)] {
            assert_eq!(text.parse(), Ok(BitRate(rate)), "{text}");
        }
        for bad in ["", "k", "2000", "-2M", "2G", "nank", "2000M", "\u{b5}"] {
            assert!(bad.parse::<BitRate>().unwrap_err().contains("1500k"), "{bad}");
        }
    }
}
