//! Command-line options and the settings made from them.

use super::{output::is_stream, y4m::Format};
use anyhow::{Context, Result, bail};
use clap::{
    Parser,
    builder::{PossibleValuesParser, TypedValueParser},
    value_parser,
};
use mpeg2enc::{
    AspectRatio, CoefficientTable, ColorDescription, ColorPrimaries, Config, ConfigError, Container, Effort,
    MatrixCoefficients, Rate, Standard, TransferCharacteristics, quantiser_scale_code,
};
use std::{
    fmt,
    path::{Path, PathBuf},
};

/// Maximum kbit/s or kbit of an option; the value in bits still fits a setting.
const KILOBITS_MAX: i64 = (u32::MAX / 1000) as i64;
/// Minimum size of the decoder's buffer that a stream can code, in kbit.
const BUFFER_MIN: u32 = 17;

/// An error in the arguments, with its own exit code.
#[derive(Debug)]
pub struct WrongArguments(pub String);

impl fmt::Display for WrongArguments {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongArguments {}

/// Encodes a YUV4MPEG2 file to MPEG-2
#[derive(Parser)]
#[command(name = "mpeg2enc")]
pub struct Arguments {
    /// YUV4MPEG2, 4:2:0, 8 bits, progressive; - for standard input
    pub input: PathBuf,
    /// Output file: .m2v (elementary), .mpg (program), .vob (program, for authoring), .ts (transport), .mp4 or .mkv; - for
    /// standard output
    #[arg(short, long)]
    pub output: PathBuf,
    /// Container; overrides the extension of the output
    #[arg(long, value_parser = container())]
    pub container: Option<Container>,
    /// quantiser_scale: 1 to 8, even values to 62, 64, multiples of 8 to 112
    #[arg(short, long, value_parser = quantiser_scale, default_value_t = 8)]
    pub qscale: u32,
    /// Constant bit rate in kbit/s instead of a constant quantiser
    #[arg(short, long, value_parser = value_parser!(u32).range(1..=KILOBITS_MAX))]
    pub bitrate: Option<u32>,
    /// Maximum kbit/s that a decoder reads; uses the quantiser of --qscale where that is enough
    #[arg(long, value_parser = value_parser!(u32).range(1..=KILOBITS_MAX))]
    pub maxrate: Option<u32>,
    /// Encode repeatedly at constant quality, starting from --qscale, until the whole clip has --bitrate; only --maxrate limits
    /// peaks
    #[arg(long, requires = "bitrate", conflicts_with = "zero_delay")]
    pub two_pass: bool,
    /// Decoder's buffer in kbit, at least 17; the default is half a second of the rate
    #[arg(long, value_parser = value_parser!(u32).range(i64::from(BUFFER_MIN)..=KILOBITS_MAX))]
    vbv: Option<u32>,
    /// Computation spent to save bits
    #[arg(short, long, value_parser = named(Effort::ALL, Effort::name), default_value_t = Effort::Balanced)]
    effort: Effort,
    /// Maximum distance between I pictures, 1 to 132
    #[arg(short, long, value_parser = value_parser!(u32).range(1..=132), default_value_t = 15)]
    gop: u32,
    /// Maximum number of consecutive B pictures, 0 to 7
    #[arg(long, value_parser = value_parser!(u32).range(0..=7), default_value_t = 2)]
    bframes: u32,
    /// Closed groups of pictures: none depends on the previous group
    #[arg(long)]
    closed: bool,
    /// No I pictures at shot changes, only at the distance of --gop
    #[arg(long)]
    no_scene_cuts: bool,
    /// Same quantiser for all macroblocks of I and P pictures
    #[arg(long)]
    uniform: bool,
    /// Adaptive quantisation: finer in smooth areas, coarser in busy ones
    #[arg(long, conflicts_with = "uniform")]
    adaptive: bool,
    /// No reordering and no delay: only I and P pictures
    #[arg(long, conflicts_with_all = ["bitrate", "maxrate"])]
    zero_delay: bool,
    /// Alternate scan, Figure 7-3
    #[arg(long)]
    alternate_scan: bool,
    /// Table B.14 for intra blocks instead of Table B.15
    #[arg(long)]
    no_intra_vlc: bool,
    /// Bits of the intra DC coefficient, 8 to 11
    #[arg(long, value_parser = value_parser!(u32).range(8..=11), default_value_t = 8)]
    dc: u32,
    /// Aspect ratio of the displayed picture, or square samples; the default comes from the clip
    #[arg(long, value_parser = named(AspectRatio::ALL, AspectRatio::name))]
    aspect: Option<AspectRatio>,
    /// colour_primaries of the stream; YUV4MPEG2 does not contain them
    #[arg(long, value_parser = named(ColorPrimaries::ALL, ColorPrimaries::name), default_value_t = ColorPrimaries::Bt709)]
    primaries: ColorPrimaries,
    /// transfer_characteristics of the stream
    #[arg(
        long,
        value_parser = named(TransferCharacteristics::ALL, TransferCharacteristics::name),
        default_value_t = TransferCharacteristics::Bt709
    )]
    transfer: TransferCharacteristics,
    /// matrix_coefficients of the stream; the default is BT.601, which programs assume for YUV4MPEG2
    #[arg(long, value_parser = named(MatrixCoefficients::ALL, MatrixCoefficients::name))]
    matrix: Option<MatrixCoefficients>,
    /// Motion to the previous frame: i16 pairs per pixel, little endian, in 64ths of a pixel, frame by frame
    #[arg(short, long)]
    pub motion: Option<PathBuf>,
    /// Motion to the next frame, in the same format
    #[arg(long)]
    pub motion_next: Option<PathBuf>,
    /// MPEG-1 instead of MPEG-2
    #[arg(long)]
    mpeg1: bool,
    /// Number of threads, 0 for one per processor
    #[arg(short, long, value_parser = threads, default_value_t = 1)]
    pub threads: usize,
    /// Print a line for each picture
    #[arg(short, long)]
    pub verbose: bool,
}

impl Arguments {
    /// Returns the settings for a clip of this name and format.
    pub fn config(&self, clip: &str, format: &Format) -> Result<Config> {
        // Programs assume BT.601 for YUV4MPEG2. MPEG-1 has no color description.
        let usual = if self.mpeg1 { MatrixCoefficients::default() } else { MatrixCoefficients::Smpte170M };
        let matrix = self.matrix.unwrap_or(usual);
        let color = ColorDescription { primaries: self.primaries, transfer: self.transfer, matrix };
        let aspect = match self.aspect {
            Some(aspect) => aspect,
            None => format.aspect().with_context(|| clip.to_owned())?,
        };
        let config = Config::new(format.width, format.height, format.frame_rate)
            .with_quantiser_scale(self.qscale)
            .with_standard(if self.mpeg1 { Standard::Mpeg1 } else { Standard::Mpeg2 })
            .with_gop(self.gop)
            .with_lookahead(if self.zero_delay { 0 } else { Config::LOOKAHEAD_MAX })
            .with_b_pictures(if self.zero_delay { 0 } else { self.bframes })
            .with_closed_gop(self.closed)
            .with_scene_cuts(!self.no_scene_cuts)
            .with_uniform_quantiser(self.uniform)
            .with_adaptive_quantisation(self.adaptive)
            .with_alternate_scan(self.alternate_scan)
            .with_intra_table(if self.no_intra_vlc { CoefficientTable::Zero } else { CoefficientTable::One })
            .with_intra_dc_precision(self.dc)
            .with_aspect(aspect)
            .with_color(color)
            .with_rate(self.rate()?)
            .with_effort(self.effort);
        // The clip determines the size, so a wrong size is not an argument error. All other errors are wrong arguments.
        config.validate().map_err(|error| match error {
            ConfigError::Size { .. } => anyhow::Error::new(error).context(clip.to_owned()),
            _ => WrongArguments(error.to_string()).into(),
        })?;
        Ok(config)
    }

    /// Returns the rate control of each pass. In two-pass mode only `--maxrate` bounds the rate.
    fn rate(&self) -> Result<Rate> {
        let wrong = |text: &str| Err(WrongArguments(text.into()).into());
        let buffer = |kbps: u32| 1000 * self.vbv.unwrap_or((kbps / 2).max(BUFFER_MIN));
        Ok(match (self.bitrate.filter(|_| !self.two_pass), self.maxrate) {
            (Some(_), Some(_)) => {
                return wrong("a constant rate has no separate maximum: omit --maxrate or add --two-pass");
            }
            (None, None) if self.vbv.is_some() => {
                return wrong("--vbv needs a rate: add --maxrate, or --bitrate without --two-pass");
            }
            (Some(kbps), None) => Rate::Constant { bits_per_second: 1000 * kbps, buffer_bits: buffer(kbps) },
            (None, Some(kbps)) => Rate::Capped { bits_per_second: 1000 * kbps, buffer_bits: buffer(kbps) },
            (None, None) => Rate::ConstantQuantiser,
        })
    }

    /// Returns the container from `--container` or the output's name. Standard output and devices default to an elementary
    /// stream.
    pub fn container(&self) -> Result<Container> {
        match self.container.or_else(|| Container::of(&self.output)) {
            Some(container) => Ok(container),
            None if is_stream(&self.output) => Ok(Container::Elementary),
            None => {
                let text = "use the extension .m2v, .mpg, .vob, .ts, .mp4 or .mkv, or add --container";
                bail!(WrongArguments(format!("{}: {text}", self.output.display())))
            }
        }
    }
}

/// Returns a parser for the names of `values`.
fn named<T>(values: &'static [T], name: fn(T) -> &'static str) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let parsed =
        move |text: String| values.iter().copied().find(|&value| name(value) == text).expect("one of the names");
    PossibleValuesParser::new(values.iter().map(|&value| name(value))).map(parsed)
}

/// Returns a parser for file extensions of containers.
fn container() -> impl TypedValueParser<Value = Container> {
    let parsed = |ending: String| Container::of(Path::new(&format!("film.{ending}"))).expect("a known extension");
    PossibleValuesParser::new(["m2v", "mpg", "vob", "ts", "mp4", "mkv"]).map(parsed)
}

/// Parses a quantiser_scale.
fn quantiser_scale(text: &str) -> Result<u32> {
    let value = text.parse()?;
    quantiser_scale_code(value)?;
    Ok(value)
}

/// Parses a number of threads.
fn threads(text: &str) -> Result<usize> {
    match text.parse()? {
        count @ 0..=1024 => Ok(count),
        count => bail!("{count} is not in 0..=1024"),
    }
}
