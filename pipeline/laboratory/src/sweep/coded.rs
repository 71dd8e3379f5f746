//! Films through the encoder.

use super::film::{Film, FilmFrame};
use crate::compare::{Picture, Pictures};
use mpeg2enc::Encoder;
use pipeline::output::Output;
use render_core::Busy;
use render2mpeg::error::{Context, Error, Result};
use render2mpeg::settings::Settings;
use render2mpeg::stages::display::Y4m;
use serde::Serialize;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A coded picture.
pub(super) struct CodedFrame {
    /// The picture that a decoder shows.
    pub decoded: Arc<plane::Picture>,
    /// Size of the picture, headers included.
    pub bits: u64,
    /// CPU seconds.
    pub seconds: f64,
}

/// Encodes a film as the driver does, with one quantiser.
pub struct Coder {
    settings: Settings,
    encoder: Encoder,
    pool: rayon::ThreadPool,
    sinks: Sinks,
}

/// Where bytes go.
struct Sinks {
    /// The stream that the driver wrote, of a film that was rendered with this quantiser.
    written: Option<BufReader<File>>,
    copy: Option<Copy>,
}

impl Coder {
    /// For `film` with `qscale`.
    ///
    /// # Errors
    /// Settings that fit no encoder.
    pub fn new(film: &Film, qscale: u32) -> Result<Self> {
        let mut settings = film.settings.clone();
        settings.render.qscale = qscale;
        let encoder = settings.encoder_config()?.with_lookahead(0).encoder()?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("a thread cannot be started")?;
        let written = film.stream.as_ref().filter(|_| film.settings.render.qscale == qscale);
        let open = |path: &PathBuf| File::open(path).map_err(Error::file(path, "cannot be read"));
        let sinks = Sinks { written: written.map(open).transpose()?.map(BufReader::new), copy: None };
        Ok(Self { settings, encoder, pool, sinks })
    }

    /// Keeps the stream and what it decodes to below `workspace`, for [`Coder::finish`] to compare with another decoder's.
    ///
    /// # Errors
    /// Files cannot be written there.
    pub fn check_below(&mut self, workspace: &Path) -> Result<()> {
        self.sinks.copy = Some(Copy::new(workspace, &self.settings)?);
        Ok(())
    }

    /// The next picture.
    ///
    /// # Errors
    /// Another stream than the driver wrote.
    pub fn push(&mut self, frame: &FilmFrame) -> Result<CodedFrame> {
        let known = frame.known.as_ref().filter(|_| self.settings.render.motion);
        let busy = Busy::default();
        let Self { encoder, pool, .. } = self;
        let mut packets = pool.install(|| busy.measure(|| encoder.push(&frame.picture, known.into())));
        let packet = packets.pop().ok_or_else(|| Error::fault("a frame without a packet"))?;
        self.sinks.take(&packet.data)?;
        let decoded = packet.reconstruction;
        if let Some(copy) = &mut self.sinks.copy {
            copy.decoded.write(&decoded)?;
        }
        Ok(CodedFrame { decoded, bits: packet.bits, seconds: busy.seconds() })
    }

    /// The end of the stream, and the check by another decoder where that was requested and there is one.
    ///
    /// # Errors
    /// Another stream than the driver wrote, or another decoder shows other pictures.
    pub fn finish(self) -> Result<Option<DecoderCheck>> {
        let Self { encoder, mut sinks, .. } = self;
        sinks.take(&encoder.finish().end)?;
        if sinks.written.as_mut().is_some_and(|written| written.read(&mut [0]).map_or(true, |more| more > 0)) {
            return Err(Error::fault(ANOTHER_STREAM));
        }
        sinks.copy.map_or(Ok(None), Copy::check)
    }
}

impl Sinks {
    /// Bytes of the stream: they are those that the driver wrote, and go to the other decoder.
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

const ANOTHER_STREAM: &str = "the sweep's stream is not the one that the run wrote: a fault of this program";

/// A stream, and what the encoder says that it decodes to.
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

    /// Decodes with ffmpeg, and compares; nothing where there is no ffmpeg.
    fn check(self) -> Result<Option<DecoderCheck>> {
        let Self { stream, decoded, paths } = self;
        stream.finish()?;
        decoded.finish()?;
        let found = match std::process::Command::new("ffmpeg").arg("-version").output() {
            Ok(_) => check_with_ffmpeg(&paths[0], &paths[1]).map(Some),
            Err(_) => Ok(None),
        };
        // They lie in a folder that goes anyway.
        paths.iter().for_each(|path| drop(std::fs::remove_file(path)));
        found
    }
}

/// A stream, checked by another decoder.
#[derive(Clone, Debug, Serialize)]
pub struct DecoderCheck {
    /// Name of the decoder.
    pub decoder: &'static str,
    /// Pictures that were compared.
    pub frames: usize,
    /// Largest difference of a luma sample, in code values: inverse transforms may round differently.
    pub largest_difference: u8,
    /// Share of luma samples that are equal.
    pub equal_share: f64,
}

/// Largest difference from rounding that adds up over a group of pictures.
const MOST_DIFFERENCE: u8 = 4;

/// Lets ffmpeg decode `stream`, and compares with `decoded`, the encoder's own reconstruction.
fn check_with_ffmpeg(stream: &Path, decoded: &Path) -> Result<DecoderCheck> {
    let (mut others, own) = (Pictures::open(stream)?, Pictures::open(decoded)?);
    let (mut largest, mut equal, mut count, mut frames) = (0, 0usize, 0usize, 0);
    for own in own {
        let (Picture::Video(own, _), Some(Picture::Video(other, _))) = (own?, others.next().transpose()?) else {
            return Err(Error::Comparison("ffmpeg finds fewer pictures than were coded".into()));
        };
        for (&a, &b) in own.luma().samples().iter().zip(other.luma().samples()) {
            largest = largest.max(a.abs_diff(b));
            equal += usize::from(a == b);
            count += 1;
        }
        frames += 1;
    }
    if largest > MOST_DIFFERENCE {
        return Err(Error::fault(format!(
            "ffmpeg decodes other pictures than the encoder reconstructs, by {largest} code values: a fault of this program"
        )));
    }
    let equal_share = equal as f64 / count.max(1) as f64;
    Ok(DecoderCheck { decoder: "ffmpeg", frames, largest_difference: largest, equal_share })
}
