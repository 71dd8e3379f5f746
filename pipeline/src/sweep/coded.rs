//! Films through the encoder.

use super::film::Film;
use crate::compare::{Picture, Pictures};
use anyhow::{Context, Result, bail};
use mpeg2enc::{Frame, MotionField};
use render_core::Busy;
use serde::Serialize;
use std::{path::Path, sync::Arc};

/// A coded picture.
pub struct CodedFrame {
    /// What a decoder shows.
    pub decoded: Frame,
    /// Of the picture, headers included.
    pub bits: u64,
    /// CPU seconds.
    pub seconds: f64,
}

/// A film in its stream.
pub struct Coded {
    /// In order.
    pub frames: Vec<CodedFrame>,
    /// All of it.
    pub stream: Vec<u8>,
}

/// Encodes `film` as the driver does, with quantiser `qscale`.
///
/// # Errors
/// Settings that fit no encoder; or, of a film that was rendered with this quantiser, another stream than the driver wrote.
pub fn encode(film: &Film, qscale: u32) -> Result<Coded> {
    let mut settings = film.settings.clone();
    settings.qscale = qscale;
    let mut encoder = settings.encoder_config()?.encoder()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("a thread cannot be started")?;
    let (mut frames, mut stream) = (Vec::new(), Vec::new());
    for frame in &film.frames {
        let motion = frame.motion.as_ref().filter(|_| settings.motion).map(|known| MotionField::new(known.clone()));
        let busy = Busy::default();
        let packet = pool.install(|| busy.measure(|| encoder.push(&frame.picture, motion.as_ref())));
        stream.extend_from_slice(&packet.data);
        let decoded = Arc::unwrap_or_clone(packet.reconstruction);
        frames.push(CodedFrame { decoded, bits: packet.bits, seconds: busy.seconds() });
    }
    stream.extend(encoder.finish());
    if let Some(written) = film.stream.as_ref().filter(|_| film.settings.qscale == qscale)
        && *written != stream
    {
        bail!("the sweep's stream is not the one that the run wrote: a fault of this program");
    }
    Ok(Coded { frames, stream })
}

/// What another decoder makes of a stream.
#[derive(Clone, Debug, Serialize)]
pub struct DecoderCheck {
    /// Which one.
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

/// Decodes `coded` with ffmpeg, and compares with the encoder's own reconstruction; nothing where there is no ffmpeg.
///
/// # Errors
/// The pictures are others.
pub fn check_with_ffmpeg(coded: &Coded, folder: &Path) -> Result<Option<DecoderCheck>> {
    if std::process::Command::new("ffmpeg").arg("-version").output().is_err() {
        return Ok(None);
    }
    let path = folder.join("check.m2v");
    std::fs::write(&path, &coded.stream).with_context(|| format!("{} cannot be written", path.display()))?;
    let mut decoded = Pictures::open(&path)?;
    let (mut largest, mut equal, mut count) = (0, 0usize, 0usize);
    for frame in &coded.frames {
        let Some(Picture::Video(other)) = decoded.next().transpose()? else {
            bail!("ffmpeg finds fewer pictures than were coded")
        };
        for (&a, &b) in frame.decoded.luma.samples().iter().zip(other.luma.samples()) {
            largest = largest.max(a.abs_diff(b));
            equal += usize::from(a == b);
            count += 1;
        }
    }
    if largest > MOST_DIFFERENCE {
        bail!(
            "ffmpeg decodes other pictures than the encoder reconstructs, by {largest} code values: a fault of this program"
        );
    }
    let equal_share = equal as f64 / count.max(1) as f64;
    Ok(Some(DecoderCheck { decoder: "ffmpeg", frames: coded.frames.len(), largest_difference: largest, equal_share }))
}
