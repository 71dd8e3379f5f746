//! Encodes frames to packets, and reports on them.

use super::{
    Streams,
    arguments::{Arguments, WrongArguments},
    clip::Clip,
    output::{Output, is_stream},
};
use anyhow::{Context, Result, bail};
use mpeg2enc::{BufferVerifier, Multiplexer, Packet, Passes};
use std::io::Write;

/// Encodes the clip and prints a summary.
pub fn encode(arguments: &Arguments, streams: &mut Streams) -> Result<()> {
    let totals = match arguments.bitrate.filter(|_| arguments.two_pass) {
        Some(kbps) => encode_in_passes(arguments, 1000 * kbps, streams)?,
        None => {
            let (totals, output) = encode_once(arguments, None, streams.borrowed())?;
            output.finish()?;
            totals
        }
    };

    // Print the summary to standard error if the film is written to standard output.
    let report: &mut dyn Write = if is_stream(&arguments.output) { streams.messages } else { streams.output };
    writeln!(
        report,
        "{} frames, {:.1} kbit/s, {:.3} dB (PSNR of luma, all frames together)",
        totals.count,
        totals.bits_per_second() / 1000.0,
        10.0 * (255.0f64.powi(2) * totals.count.max(1) as f64 / totals.error).log10()
    )
    .context("the film is complete, but its report cannot be written")?;
    for note in totals.notes() {
        writeln!(streams.messages, "mpeg2enc: {note}")?;
    }
    Ok(())
}

/// Encodes the clip in several passes; each replaces the previous output.
fn encode_in_passes(arguments: &Arguments, bits_per_second: u32, streams: &mut Streams) -> Result<Totals> {
    check_passes(arguments)?;
    let mut passes = Passes::new(bits_per_second);
    let mut quantiser_scale = f64::from(arguments.qscale);
    loop {
        let (totals, output) = encode_once(arguments, Some(quantiser_scale), streams.borrowed())?;
        let came_to = totals.bits_per_second();
        let next = passes.next(quantiser_scale, came_to);
        // Keep the file of the last pass only; dropping an output deletes its file.
        if next.is_none() {
            output.finish()?;
        } else {
            drop(output);
        }
        writeln!(streams.messages, "quantiser_scale {quantiser_scale:.2}: {:.1} kbit/s", came_to / 1000.0)?;
        match next {
            Some(next) => quantiser_scale = next,
            None => return Ok(totals),
        }
    }
}

/// Refuses inputs and outputs that cannot be used more than once.
fn check_passes(arguments: &Arguments) -> Result<()> {
    for path in [&arguments.input, &arguments.output] {
        if is_stream(path) {
            let text =
                "is not a file, but --two-pass reads and writes files several times: encode from a file into a file";
            bail!(WrongArguments(format!("{} {text}", path.display())));
        }
    }
    Ok(())
}

/// Encodes the clip in one pass, optionally with a mean quantiser. The output is written but not finished.
///
/// If the clip is damaged, the frames before the damage are encoded, and their file keeps the extension `.part`.
fn encode_once<'a>(
    arguments: &Arguments,
    quantiser_scale: Option<f64>,
    streams: Streams<'a>,
) -> Result<(Totals, Output<'a>)> {
    let container = arguments.container()?;
    let mut clip = Clip::open(arguments, streams.input)?;
    let mut config = arguments.config(clip.name(), clip.format())?;
    if let Some(quantiser_scale) = quantiser_scale {
        config = config.with_mean_quantiser_scale(quantiser_scale);
    }

    // Keep the report out of a film on standard output.
    let (report, standard): (&mut (dyn Write + Send), _) = match is_stream(&arguments.output) {
        true => (streams.messages, Some(streams.output)),
        false => (streams.output, None),
    };
    let mut sink = Sink {
        output: Output::create(&arguments.output, standard)?,
        multiplexer: Multiplexer::new(container, &config),
        report: arguments.verbose.then_some(report),
        verifier: BufferVerifier::new(&config),
        totals: Totals::new(&clip),
    };

    // An output error ends the film immediately. After a clip error, frames before the error are still written.
    let mut encoder = config.encoder()?;
    let read = loop {
        match clip.next() {
            Ok(Some((frame, motion))) => {
                encoder.push(frame, motion).into_iter().try_for_each(|packet| sink.take(packet))?;
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    // Code the waiting frames even after a clip error.
    let finish = encoder.finish();
    finish.packets.into_iter().try_for_each(|packet| sink.take(packet))?;
    let (totals, output) = sink.finish(&finish.end)?;
    // Without any frame, the output is removed instead of kept.
    match read {
        Ok(()) => Ok((totals, output)),
        Err(error) if totals.count == 0 => Err(error),
        Err(error) => {
            let place = output.abandon()?.map_or("the output".into(), |part| part.display().to_string());
            bail!("{error:#}; {place} contains the first {} frames", totals.count)
        }
    }
}

/// Writes packets to the output and reports on them.
struct Sink<'a> {
    output: Output<'a>,
    multiplexer: Multiplexer,
    /// Receives a line for each picture.
    report: Option<&'a mut (dyn Write + Send)>,
    verifier: Option<BufferVerifier>,
    totals: Totals,
}

struct Totals {
    fps: f64,
    /// Size of the elementary stream, in bits.
    bits: u64,
    count: u64,
    /// Sum of the mean squared errors of luma.
    error: f64,
    /// Number of late pictures, and their maximum delay in seconds.
    late: (u64, f64),
    /// Name of the clip, if its sample range was converted.
    full_range: Option<String>,
}

impl Totals {
    fn new(clip: &Clip) -> Self {
        let format = clip.format();
        let full_range = format.is_full_range.then(|| clip.name().to_owned());
        Self { fps: format.frame_rate.fps(), bits: 0, count: 0, error: 0.0, late: (0, 0.0), full_range }
    }

    fn bits_per_second(&self) -> f64 {
        self.bits as f64 / self.count.max(1) as f64 * self.fps
    }

    /// Returns lines that report deviations from the request.
    fn notes(&self) -> Vec<String> {
        let full_range = self.full_range.as_ref().map(|clip| {
            format!("{clip} has full range, which MPEG-2 does not support: its samples were converted to limited range")
        });
        let late = (self.late.0 > 0).then(|| {
            let (late, seconds) = self.late;
            format!(
                "{late} of {} pictures are late, by up to {seconds:.2} s: the coarsest quantiser takes too many bits for this \
                 rate and buffer; raise --bitrate, --maxrate or --vbv",
                self.count
            )
        });
        full_range.into_iter().chain(late).collect()
    }
}

impl<'a> Sink<'a> {
    fn take(&mut self, packet: Packet) -> Result<()> {
        self.totals.bits += packet.bits;
        self.totals.count += 1;
        // Sum mean squared errors, because decibels cannot be averaged.
        self.totals.error += 255.0f64.powi(2) / 10.0f64.powf(packet.psnr_y / 10.0);
        if let Some(verifier) = &mut self.verifier {
            let late = verifier.take(packet.bits);
            self.totals.late.0 += u64::from(late > 0.0);
            self.totals.late.1 = self.totals.late.1.max(late);
        }
        if let Some(report) = &mut self.report {
            tell(report, &packet)?;
        }
        self.output.write(&self.multiplexer.push(packet))
    }

    fn finish(mut self, sequence_end: &[u8]) -> Result<(Totals, Output<'a>)> {
        self.output.write(&self.multiplexer.finish(sequence_end))?;
        Ok((self.totals, self.output))
    }
}

/// Writes the line of a picture.
fn tell(report: &mut dyn Write, packet: &Packet) -> Result<()> {
    let scales = packet.quantiser_scales.samples();
    let mean = scales.iter().map(|&scale| f64::from(scale)).sum::<f64>() / scales.len() as f64;
    let s = packet.statistics;
    writeln!(
        report,
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
    )?;
    Ok(())
}
