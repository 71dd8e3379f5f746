//! Options, and the settings that they make.

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

/// The most kbit/s or kbit whose bits a setting can hold.
const KILOBITS_MAX: i64 = (u32::MAX / 1000) as i64;
/// The smallest buffer that a stream can state, in kbit.
const BUFFER_MIN: u32 = 17;

/// The arguments are wrong: the exit code says so.
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
    /// The stream to be written: .m2v (elementary), .mpg (program), .vob (program, for authoring), .ts (transport), .mp4 or .mkv;
    /// - for standard output
    #[arg(short, long)]
    pub output: PathBuf,
    /// The kind of stream, whatever the output's name says
    #[arg(long, value_parser = container())]
    pub container: Option<Container>,
    /// quantiser_scale: 1 to 8, even values to 62, 64, multiples of 8 to 112
    #[arg(short, long, value_parser = quantiser_scale, default_value_t = 8)]
    pub qscale: u32,
    /// Constant bit rate in kbit/s instead of a constant quantiser
    #[arg(short, long, value_parser = value_parser!(u32).range(1..=KILOBITS_MAX))]
    pub bitrate: Option<u32>,
    /// The most kbit/s that a decoder reads, with the quantiser of --qscale where that is enough
    #[arg(long, value_parser = value_parser!(u32).range(1..=KILOBITS_MAX))]
    pub maxrate: Option<u32>,
    /// Codes the clip again and again, from --qscale on, until the whole takes --bitrate at constant quality, which only
    /// --maxrate bounds then
    #[arg(long, requires = "bitrate", conflicts_with = "zero_delay")]
    pub two_pass: bool,
    /// The decoder's buffer in kbit, 17 at least; half a second of the rate if not given
    #[arg(long, value_parser = value_parser!(u32).range(i64::from(BUFFER_MIN)..=KILOBITS_MAX))]
    vbv: Option<u32>,
    /// The work that is done for few bits
    #[arg(short, long, value_parser = named(Effort::ALL, Effort::name), default_value_t = Effort::Balanced)]
    effort: Effort,
    /// The longest distance of I pictures, 1 to 132
    #[arg(short, long, value_parser = value_parser!(u32).range(1..=132), default_value_t = 15)]
    gop: u32,
    /// The most B pictures in a row, 0 to 7
    #[arg(long, value_parser = value_parser!(u32).range(0..=7), default_value_t = 2)]
    bframes: u32,
    /// No group of pictures needs the group before
    #[arg(long)]
    closed: bool,
    /// No I pictures besides those of --gop
    #[arg(long)]
    no_scene_cuts: bool,
    /// One quantiser for all macroblocks of I and P pictures
    #[arg(long)]
    uniform: bool,
    /// Finer quantisers where the picture is smooth, coarser ones where it is busy
    #[arg(long, conflicts_with = "uniform")]
    adaptive: bool,
    /// No reordering and no waiting: I and P pictures only
    #[arg(long, conflicts_with_all = ["bitrate", "maxrate"])]
    zero_delay: bool,
    /// The scan of Figure 7-3
    #[arg(long)]
    alternate_scan: bool,
    /// Table B.14 for intra blocks instead of Table B.15
    #[arg(long)]
    no_intra_vlc: bool,
    /// Bits of the intra DC coefficient, 8 to 11
    #[arg(long, value_parser = value_parser!(u32).range(8..=11), default_value_t = 8)]
    dc: u32,
    /// Shape of the displayed picture, or square samples; that of the clip if not given
    #[arg(long, value_parser = named(AspectRatio::ALL, AspectRatio::name))]
    aspect: Option<AspectRatio>,
    /// colour_primaries to be stated, which YUV4MPEG2 does not tell
    #[arg(long, value_parser = named(ColorPrimaries::ALL, ColorPrimaries::name), default_value_t = ColorPrimaries::Bt709)]
    primaries: ColorPrimaries,
    /// transfer_characteristics to be stated
    #[arg(
        long,
        value_parser = named(TransferCharacteristics::ALL, TransferCharacteristics::name),
        default_value_t = TransferCharacteristics::Bt709
    )]
    transfer: TransferCharacteristics,
    /// matrix_coefficients to be stated; that of BT.601 if not given, which programs assume in YUV4MPEG2
    #[arg(long, value_parser = named(MatrixCoefficients::ALL, MatrixCoefficients::name))]
    matrix: Option<MatrixCoefficients>,
    /// Motion to the frame before: i16 pairs, little endian, in 64ths of a pixel, frame after frame
    #[arg(short, long)]
    pub motion: Option<PathBuf>,
    /// Motion to the frame after, in the same form
    #[arg(long)]
    pub motion_next: Option<PathBuf>,
    /// MPEG-1 instead of MPEG-2
    #[arg(long)]
    mpeg1: bool,
    /// Threads to encode with, 0 for as many as there are processors
    #[arg(short, long, value_parser = threads, default_value_t = 1)]
    pub threads: usize,
    /// Prints a line for each picture
    #[arg(short, long)]
    pub verbose: bool,
}

impl Arguments {
    /// The settings for a clip of this name and format.
    pub fn config(&self, clip: &str, format: &Format) -> Result<Config> {
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
        config.validate().map_err(|error| match error {
            ConfigError::Size { .. } => anyhow::Error::new(error).context(clip.to_owned()),
            _ => WrongArguments(error.to_string()).into(),
        })?;
        Ok(config)
    }

    /// The rate of each pass. Two passes keep to no bound but `--maxrate`.
    fn rate(&self) -> Result<Rate> {
        let wrong = |text: &str| Err(WrongArguments(text.into()).into());
        let buffer = |kbps: u32| 1000 * self.vbv.unwrap_or((kbps / 2).max(BUFFER_MIN));
        Ok(match (self.bitrate.filter(|_| !self.two_pass), self.maxrate) {
            (Some(_), Some(_)) => {
                return wrong("a constant rate has no other maximum: leave out --maxrate, or add --two-pass");
            }
            (None, None) if self.vbv.is_some() => {
                return wrong("--vbv is the buffer of a rate: add --maxrate, or --bitrate without --two-pass");
            }
            (Some(kbps), None) => Rate::Constant { bits_per_second: 1000 * kbps, buffer_bits: buffer(kbps) },
            (None, Some(kbps)) => Rate::Capped { bits_per_second: 1000 * kbps, buffer_bits: buffer(kbps) },
            (None, None) => Rate::ConstantQuantiser,
        })
    }

    /// The kind of stream, by `--container` or by the output's name. Standard output and devices have none, and take an elementary
    /// stream.
    pub fn container(&self) -> Result<Container> {
        match self.container.or_else(|| Container::of(&self.output)) {
            Some(container) => Ok(container),
            None if is_stream(&self.output) => Ok(Container::Elementary),
            None => {
                let text = "name the output .m2v, .mpg, .vob, .ts, .mp4 or .mkv, or say --container";
                bail!(WrongArguments(format!("{}: {text}", self.output.display())))
            }
        }
    }
}

/// Parser of the names of `values`.
fn named<T>(values: &'static [T], name: fn(T) -> &'static str) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let parsed = move |text: String| values.iter().copied().find(|&value| name(value) == text).expect("one of them");
    PossibleValuesParser::new(values.iter().map(|&value| name(value))).map(parsed)
}

/// Parser of the kinds of streams, by the endings of their files.
fn container() -> impl TypedValueParser<Value = Container> {
    let parsed = |ending: String| Container::of(Path::new(&format!("film.{ending}"))).expect("an ending");
    PossibleValuesParser::new(["m2v", "mpg", "vob", "ts", "mp4", "mkv"]).map(parsed)
}

/// Parser of quantiser_scale.
fn quantiser_scale(text: &str) -> Result<u32> {
    let value = text.parse()?;
    quantiser_scale_code(value)?;
    Ok(value)
}

/// Parser of a number of threads.
fn threads(text: &str) -> Result<usize> {
    match text.parse()? {
        count @ 0..=1024 => Ok(count),
        count => bail!("{count} is not in 0..=1024"),
    }
}
