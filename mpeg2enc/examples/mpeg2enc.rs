//! Encodes a YUV4MPEG2 file (4:2:0, 8 bits) to MPEG-2, as elementary, program or transport stream:
//!
//! ```text
//! ffmpeg -f lavfi -i testsrc2=size=512x512:rate=25:duration=2 -pix_fmt yuv420p clip.y4m
//! cargo run --release -p mpeg2enc --example mpeg2enc -- clip.y4m -o clip.m2v --qscale 8
//! ```
//! `--help` names all options.

use anyhow::{Context, Result, bail, ensure};
use clap::{
    Parser,
    builder::{PossibleValuesParser, TypedValueParser},
};
use mpeg2enc::{
    CoefficientTable, Config, Container, Effort, FrameRate, KnownMotion, Multiplexer, Packet, Passes, Picture, Rate,
    Standard,
};
use plane::{Correspondence, Plane};
use std::{
    fs::File,
    io::{BufRead, BufReader, BufWriter, Read, Write},
    path::PathBuf,
};

/// Encodes a YUV4MPEG2 file to MPEG-2
#[derive(Parser)]
struct Arguments {
    /// YUV4MPEG2, 4:2:0, 8 bits
    input: PathBuf,
    /// The stream to be written: .m2v (elementary), .mpg (program) or .ts (transport)
    #[arg(short, long)]
    output: PathBuf,
    /// quantiser_scale: 1 to 8, even values to 62, 64, multiples of 8 to 112
    #[arg(short, long, default_value_t = 8)]
    qscale: u32,
    /// Constant bit rate in kbit/s instead of a constant quantiser
    #[arg(short, long)]
    bitrate: Option<u32>,
    /// The most kbit/s that a decoder reads, with the quantiser of --qscale where that is enough
    #[arg(long)]
    maxrate: Option<u32>,
    /// Codes the clip again and again, from --qscale on, until the whole takes --bitrate at constant quality, which only
    /// --maxrate bounds then
    #[arg(long, requires = "bitrate", conflicts_with = "zero_delay")]
    two_pass: bool,
    /// The decoder's buffer in kbit; half a second of the rate if not given
    #[arg(long)]
    vbv: Option<u32>,
    /// How much is tried for few bits
    #[arg(short, long, value_parser = effort(), default_value_t = Effort::Balanced)]
    effort: Effort,
    /// The longest distance of I pictures, 1 to 132
    #[arg(short, long, default_value_t = 15)]
    gop: u32,
    /// The most B pictures in a row, 0 to 7
    #[arg(long, default_value_t = 2)]
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
    #[arg(long)]
    zero_delay: bool,
    /// The scan of Figure 7-3
    #[arg(long)]
    alternate_scan: bool,
    /// Table B.14 for intra blocks instead of Table B.15
    #[arg(long)]
    no_intra_vlc: bool,
    /// Bits of the intra DC coefficient, 8 to 11
    #[arg(long, default_value_t = 8)]
    dc: u32,
    /// Motion to the frame before: i16 pairs, little endian, in 64ths of a pixel, frame after frame
    #[arg(short, long)]
    motion: Option<PathBuf>,
    /// Motion to the frame after, in the same form
    #[arg(long)]
    motion_next: Option<PathBuf>,
    /// MPEG-1 instead of MPEG-2
    #[arg(long)]
    mpeg1: bool,
    /// Threads to encode with
    #[arg(short, long, default_value_t = 1)]
    threads: usize,
    /// Prints a line for each picture
    #[arg(short, long)]
    verbose: bool,
}

/// Parser of the names of efforts.
fn effort() -> impl TypedValueParser<Value = Effort> {
    let parsed = |name: String| Effort::ALL.iter().copied().find(|effort| effort.name() == name).expect("one of them");
    PossibleValuesParser::new(Effort::ALL.iter().map(|effort| effort.name())).map(parsed)
}

/// Bytes that are read at once.
const BUFFER: usize = 1 << 16;

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build()?;
    pool.install(|| encode(&arguments))
}

fn encode(arguments: &Arguments) -> Result<()> {
    let clip = Clip::open(arguments)?;
    let (width, height, fps) = clip.format;
    let config = Config::new(width, height, FrameRate::from_fps(fps)?)
        .with_quantiser_scale(arguments.qscale)
        .with_standard(if arguments.mpeg1 { Standard::Mpeg1 } else { Standard::Mpeg2 })
        .with_gop(arguments.gop)
        .with_lookahead(if arguments.zero_delay { 0 } else { Config::LOOKAHEAD_MAX })
        .with_b_pictures(if arguments.zero_delay { 0 } else { arguments.bframes })
        .with_closed_gop(arguments.closed)
        .with_scene_cuts(!arguments.no_scene_cuts)
        .with_uniform_quantiser(arguments.uniform)
        .with_adaptive_quantisation(arguments.adaptive)
        .with_alternate_scan(arguments.alternate_scan)
        .with_intra_table(if arguments.no_intra_vlc { CoefficientTable::Zero } else { CoefficientTable::One })
        .with_intra_dc_precision(arguments.dc)
        .with_rate(rate(arguments)?)
        .with_effort(arguments.effort);
    let totals = match arguments.bitrate.filter(|_| arguments.two_pass) {
        Some(kbps) => encode_in_passes(arguments, clip, &config, 1000 * kbps)?,
        None => encode_once(arguments, clip, config)?,
    };
    println!(
        "{} frames, {:.1} kbit/s, {:.3} dB (PSNR of luma, all frames together)",
        totals.count,
        totals.bits_per_second(fps) / 1000.0,
        10.0 * (255.0f64.powi(2) * totals.count.max(1) as f64 / totals.error).log10()
    );
    Ok(())
}

fn rate(arguments: &Arguments) -> Result<Rate> {
    let buffer = |kbps: u32| 1000 * arguments.vbv.unwrap_or(kbps / 2);
    Ok(match (arguments.bitrate.filter(|_| !arguments.two_pass), arguments.maxrate) {
        (Some(_), Some(_)) => bail!("a constant rate has no other maximum: leave out --maxrate, or add --two-pass"),
        (Some(kbps), None) => Rate::Constant { bits_per_second: 1000 * kbps, buffer_bits: buffer(kbps) },
        (None, Some(kbps)) => Rate::Capped { bits_per_second: 1000 * kbps, buffer_bits: buffer(kbps) },
        (None, None) => Rate::ConstantQuantiser,
    })
}

/// Each pass takes the place of the one before.
fn encode_in_passes(arguments: &Arguments, first: Clip, config: &Config, bits_per_second: u32) -> Result<Totals> {
    let (fps, mut passes) = (first.format.2, Passes::new(bits_per_second));
    let (mut quantiser_scale, mut clip) = (f64::from(arguments.qscale), Some(first));
    loop {
        let clip = clip.take().map_or_else(|| Clip::open(arguments), Ok)?;
        let totals = encode_once(arguments, clip, config.clone().with_mean_quantiser_scale(quantiser_scale))?;
        let came_to = totals.bits_per_second(fps);
        eprintln!("quantiser_scale {quantiser_scale:.2}: {:.1} kbit/s", came_to / 1000.0);
        match passes.next(quantiser_scale, came_to) {
            Some(next) => quantiser_scale = next,
            None => return Ok(totals),
        }
    }
}

fn encode_once(arguments: &Arguments, clip: Clip, config: Config) -> Result<Totals> {
    let container = Container::of(&arguments.output)
        .with_context(|| format!("{}: name the output .m2v, .mpg or .ts", arguments.output.display()))?;
    let multiplexer = Multiplexer::new(container, &config);
    let create =
        || File::create(&arguments.output).with_context(|| format!("{} cannot be written", arguments.output.display()));
    let sink =
        |file| Sink { file: BufWriter::new(file), multiplexer, verbose: arguments.verbose, totals: Totals::default() };
    let mut encoder = config.encoder()?;
    let mut output = sink(create()?);
    clip.for_each(|frame, motion| encoder.push(frame, motion).into_iter().try_for_each(|packet| output.take(packet)))?;
    let finish = encoder.finish();
    finish.packets.into_iter().try_for_each(|packet| output.take(packet))?;
    output.finish(&finish.end)
}

/// The files that are encoded, from their first frames on.
struct Clip {
    input: BufReader<File>,
    motion: [Option<File>; 2],
    /// Width, height, frames a second.
    format: (usize, usize, f64),
}

impl Clip {
    fn open(arguments: &Arguments) -> Result<Self> {
        let open = |path: &PathBuf| File::open(path).with_context(|| format!("{} cannot be read", path.display()));
        let mut input = BufReader::with_capacity(BUFFER, open(&arguments.input)?);
        let format = parse_header(&read_line(&mut input)?)
            .with_context(|| format!("{} cannot be encoded", arguments.input.display()))?;
        let motion =
            [arguments.motion.as_ref().map(open).transpose()?, arguments.motion_next.as_ref().map(open).transpose()?];
        Ok(Self { input, motion, format })
    }

    /// Gives `take` each frame, and what is known of its motion.
    fn for_each(mut self, mut take: impl FnMut(&Picture, KnownMotion) -> Result<()>) -> Result<()> {
        let (width, height, _) = self.format;
        let (mut frame, mut known) = (Picture::black(width, height), [None, None]);
        while read_frame(&mut self.input, &mut frame)? {
            read_motion(&mut self.motion, &mut known, (width, height))?;
            take(&frame, KnownMotion { to_previous: known[0].as_ref(), to_next: known[1].as_ref() })?;
        }
        Ok(())
    }
}

/// Where packets go, and what is told of them.
struct Sink {
    file: BufWriter<File>,
    multiplexer: Multiplexer,
    verbose: bool,
    totals: Totals,
}

#[derive(Default)]
struct Totals {
    /// Size of the elementary stream.
    bits: u64,
    count: u64,
    /// Sum of the mean squared errors of luma.
    error: f64,
}

impl Totals {
    fn bits_per_second(&self, fps: f64) -> f64 {
        self.bits as f64 / self.count.max(1) as f64 * fps
    }
}

impl Sink {
    fn take(&mut self, packet: Packet) -> Result<()> {
        self.totals.bits += packet.bits;
        self.totals.count += 1;
        self.totals.error += 255.0f64.powi(2) / 10.0f64.powf(packet.psnr_y / 10.0);
        if self.verbose {
            let scales = packet.quantiser_scales.samples();
            let mean = scales.iter().map(|&scale| f64::from(scale)).sum::<f64>() / scales.len() as f64;
            let s = packet.statistics;
            println!(
                "{:4} {:?} {:8} bits {:6.2} dB  scale {mean:5.2}  {} intra {} inter {} skipped, {} bits motion {} coefficients",
                packet.display_index,
                packet.picture_type,
                packet.bits,
                packet.psnr_y,
                s.intra,
                s.inter,
                s.skipped,
                s.motion_bits,
                s.coefficient_bits
            );
        }
        self.file.write_all(&self.multiplexer.push(packet))?;
        Ok(())
    }

    fn finish(mut self, sequence_end: &[u8]) -> Result<Totals> {
        self.file.write_all(&self.multiplexer.finish(sequence_end))?;
        self.file.flush()?;
        Ok(self.totals)
    }
}

/// Reads the next frame over the last one; false at the end of the file.
fn read_frame(input: &mut impl BufRead, frame: &mut Picture) -> Result<bool> {
    if !read_line(input)?.starts_with("FRAME") {
        return Ok(false);
    }
    for samples in frame.samples_mut() {
        input.read_exact(samples).context("the last frame is cut off")?;
    }
    Ok(true)
}

/// The motion of the next frame, given in 64ths of a pixel. The first frame of a file has none before it, which its
/// zeros do not harm.
fn read_motion(
    files: &mut [Option<File>; 2],
    known: &mut [Option<Correspondence>; 2],
    (width, height): (usize, usize),
) -> Result<()> {
    for (file, known) in files.iter_mut().zip(known) {
        if let Some(file) = file {
            let mut motion = Plane::filled(width, height, [0i16; 2]);
            let components = motion.samples_mut().as_flattened_mut();
            file.read_exact(bytemuck::cast_slice_mut(components))
                .context("a motion file has fewer frames than the clip")?;
            if cfg!(target_endian = "big") {
                components.iter_mut().for_each(|component| *component = i16::from_le(*component));
            }
            *known = Some(Correspondence::from_motion(motion.map(in_pixels)));
        }
    }
    Ok(())
}

/// A vector of a motion file in pixels; a component of `i16::MIN` says that the pixel was not visible.
fn in_pixels(vector_64ths: [i16; 2]) -> [f32; 2] {
    if vector_64ths.contains(&i16::MIN) { [f32::NAN; 2] } else { vector_64ths.map(|part| f32::from(part) / 64.0) }
}

fn read_line(input: &mut impl BufRead) -> Result<String> {
    let mut line = Vec::new();
    input.read_until(b'\n', &mut line)?;
    Ok(String::from_utf8_lossy(&line).trim_end().into())
}

/// Width, height and frames a second of a line such as `YUV4MPEG2 W512 H512 F25:1 Ip C420jpeg`.
fn parse_header(line: &str) -> Result<(usize, usize, f64)> {
    ensure!(line.starts_with("YUV4MPEG2"), "this is not a YUV4MPEG2 file");
    let value = |tag: char| line.split(' ').skip(1).find_map(|word| word.strip_prefix(tag));
    if value('C').is_some_and(|format| !format.starts_with("420") || format.starts_with("420p1")) {
        bail!("only 4:2:0 of 8 bits can be encoded");
    }
    let (numerator, denominator) =
        value('F').and_then(|rate| rate.split_once(':')).context("the file states no rate")?;
    let fps = numerator.parse::<f64>()? / denominator.parse::<f64>()?;
    Ok((
        value('W').context("the file states no width")?.parse()?,
        value('H').context("the file states no height")?.parse()?,
        fps,
    ))
}
