//! Encoding of a sweep's films.

use super::film::{Film, FilmFrame};
use crate::compare::{Picture, Pictures};
use crate::page::PageStream;
use mpeg2enc::{Encoder, Packet};
use pipeline::output::Output;
use pipeline::stage::CodedUnit;
use render_core::Busy;
use render2mpeg::error::{Context, Error, Result};
use render2mpeg::settings::Settings;
use render2mpeg::stages::display::Y4m;
use serde::Serialize;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Coded picture.
pub(super) struct CodedFrame {
    /// Picture of the elementary stream.
    pub unit: CodedUnit,
    /// Picture as reconstructed by the decoder.
    pub decoded: Arc<plane::Picture>,
    /// Size of the picture including headers \[bits\].
    pub bits: u64,
    /// CPU seconds spent on encoding.
    pub seconds: f64,
}

/// Film encoder with a single quantiser; it encodes as the driver does.
pub struct Coder {
    settings: Settings,
    encoder: Encoder,
    pool: rayon::ThreadPool,
    sinks: Sinks,
}

/// Returns the stream of `film` at the finest quantiser, for a page.
///
/// # Errors
/// If frames cannot be read, or the stream differs from the stream that the driver wrote.
pub fn finest_stream(film: &Film, limit: usize) -> Result<PageStream> {
    let (mut coder, mut stream) = (Coder::new(film, 1)?, PageStream::new(limit));
    for frame in film.frames()? {
        stream.push(&coder.push(&frame?)?.unit);
    }
    Ok(stream)
}

/// Consumers of the stream's bytes.
struct Sinks {
    /// Stream that the driver wrote; `None` if the film was rendered with a different quantiser.
    written: Option<BufReader<File>>,
    copy: Option<Copy>,
}

impl Coder {
    /// Returns the encoder of `film` at quantiser_scale `qscale`.
    ///
    /// # Errors
    /// If no encoder supports the settings.
    pub fn new(film: &Film, qscale: u32) -> Result<Self> {
        let mut settings = film.settings.clone();
        settings.render.qscale = qscale;
        let encoder = settings.encoder_config()?.with_lookahead(0).encoder()?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("cannot start a thread")?;
        // Compare with the driver's stream only if both were encoded with the same quantiser.
        let written = film.stream.as_ref().filter(|_| film.settings.render.qscale == qscale);
        let open = |path: &PathBuf| File::open(path).map_err(Error::file(path, "cannot be read"));
        let sinks = Sinks { written: written.map(open).transpose()?.map(BufReader::new), copy: None };
        Ok(Self { settings, encoder, pool, sinks })
    }

    /// Stores the stream and the decoded pictures in `workspace`, where [`Coder::finish`] compares them with another
    /// decoder's output.
    ///
    /// # Errors
    /// If files cannot be written in `workspace`.
    pub fn check_below(&mut self, workspace: &Path) -> Result<()> {
        self.sinks.copy = Some(Copy::new(workspace, &self.settings)?);
        Ok(())
    }

    /// Encodes the next picture.
    ///
    /// # Errors
    /// If the stream differs from the stream that the driver wrote.
    pub fn push(&mut self, frame: &FilmFrame) -> Result<CodedFrame> {
        let known = frame.known.as_ref().filter(|_| self.settings.render.motion);
        let busy = Busy::default();
        let Self { encoder, pool, .. } = self;
        // Encode on one thread, and measure the CPU time.
        let mut packets = pool.install(|| busy.measure(|| encoder.push(&frame.picture, known.into())));
        let packet = packets.pop().ok_or_else(|| Error::fault("a frame without a packet"))?;
        self.sinks.take(&packet.data)?;
        let Packet { data: bytes, display_index: position, picture_type, reconstruction: decoded, bits, .. } = packet;
        if let Some(copy) = &mut self.sinks.copy {
            copy.decoded.write(&decoded)?;
        }
        let unit = CodedUnit { position, picture_type, bytes };
        Ok(CodedFrame { unit, decoded, bits, seconds: busy.seconds() })
    }

    /// Ends the stream, and runs the check by another decoder if requested.
    ///
    /// # Errors
    /// If the stream differs from the stream that the driver wrote, or the other decoder's pictures differ.
    pub fn finish(self) -> Result<Option<DecoderCheck>> {
        let Self { encoder, mut sinks, .. } = self;
        sinks.take(&encoder.finish().end)?;
        // Reject driver streams that continue after the end of this stream.
        if sinks.written.as_mut().is_some_and(|written| written.read(&mut [0]).map_or(true, |more| more > 0)) {
            return Err(Error::fault(ANOTHER_STREAM));
        }
        sinks.copy.map(Copy::check).transpose()
    }
}

impl Sinks {
    /// Compares the stream's bytes with the driver's bytes, and copies them for the other decoder.
    fn take(&mut self, bytes: &[u8]) -> Result<()> {
        if let Some(written) = &mut self.written {
            let mut same = vec![0; bytes.len()];
            if written.read_exact(&mut same).is_err() || same != bytes {
                return Err(Error::fault(ANOTHER_STREAM));
            }
        }
        self.copy.as_mut().map_or(Ok(()), |copy| Ok(copy.stream.write(bytes)?))
    }
}

const ANOTHER_STREAM: &str = "the sweep's stream differs from the run's: this is a bug";

/// Stream and the encoder's decoded pictures, stored in files.
struct Copy {
    stream: Output,
    decoded: Y4m,
    paths: [PathBuf; 2],
}

impl Copy {
    fn new(workspace: &Path, settings: &Settings) -> Result<Self> {
        let paths = ["check.m2v", "check.y4m"].map(|name| workspace.join(name));
        Ok(Self { stream: Output::create(&paths[0])?, decoded: Y4m::create(&paths[1], settings)?, paths })
    }

    /// Decodes the stream with ffmpeg, and compares the pictures. Without ffmpeg, decodes with `mpeg2dec`.
    fn check(self) -> Result<DecoderCheck> {
        let Self { stream, decoded, paths } = self;
        stream.finish()?;
        decoded.finish()?;
        let has_ffmpeg = std::process::Command::new("ffmpeg").arg("-version").output().is_ok();
        let found = match has_ffmpeg {
            true => Pictures::by_ffmpeg(&paths[0]).and_then(|pictures| compared("ffmpeg", pictures, &paths[1])),
            false => Pictures::open(&paths[0]).and_then(|pictures| compared(OWN_DECODER, pictures, &paths[1])),
        };
        // The folder is removed later anyway, so errors are ignored.
        paths.iter().for_each(|path| drop(std::fs::remove_file(path)));
        found
    }
}

/// Result of checking a stream with another decoder.
#[derive(Clone, Debug, Serialize)]
pub struct DecoderCheck {
    /// Name of the decoder.
    pub decoder: &'static str,
    /// Number of compared pictures.
    pub frames: usize,
    /// Maximum difference between luma samples \[code values\]. Inverse transforms may round differently.
    pub largest_difference: u8,
    /// Fraction of luma samples that are equal.
    pub equal_share: f64,
}

/// Maximum luma difference due to rounding, accumulated over a group of pictures \[code values\].
const MOST_DIFFERENCE: u8 = 4;

/// Name of the crate `mpeg2dec`, which differs from the name of libmpeg2's program.
const OWN_DECODER: &str = "render2mpeg";

/// Compares the pictures of another `decoder` with the file `decoded`, the encoder's own reconstruction.
fn compared(decoder: &'static str, mut others: Pictures, decoded: &Path) -> Result<DecoderCheck> {
    let own = Pictures::open(decoded)?;
    let (mut largest, mut equal, mut count, mut frames) = (0, 0usize, 0usize, 0);
    for own in own {
        let (Picture::Video(own, _), Some(Picture::Video(other, _))) = (own?, others.next().transpose()?) else {
            return Err(Error::Comparison(format!("{decoder} decodes fewer pictures than were coded")));
        };
        // Compare the luma of both pictures.
        for (&a, &b) in own.luma().samples().iter().zip(other.luma().samples()) {
            largest = largest.max(a.abs_diff(b));
            equal += usize::from(a == b);
            count += 1;
        }
        frames += 1;
    }
    // Inverse transforms may round differently; larger differences reveal a bug.
    if largest > MOST_DIFFERENCE {
        return Err(Error::fault(format!(
            "the pictures of {decoder} differ from the encoder's reconstruction by {largest} code values: this is a bug"
        )));
    }
    let equal_share = equal as f64 / count.max(1) as f64;
    Ok(DecoderCheck { decoder, frames, largest_difference: largest, equal_share })
}
