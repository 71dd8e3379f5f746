//! Part of a film: an elementary stream and its report.

use crate::error::{Context, Error, Result};
use crate::report::{Summary, path_beside};
use crate::settings::{CodedRate, FrameRange, PictureAspect};
use mpeg2enc::{Config, ElementaryStream, Standard};
use pipeline::report::FrameReport;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::fs;
use std::path::{Path, PathBuf};

/// Complete part with a stream that matches its report.
#[derive(Debug)]
pub(super) struct WholePart {
    pub path: PathBuf,
    pub range: FrameRange,
    /// Number of frames of the whole film.
    pub film_frames: u32,
    /// Frame rate of the film \[frames per second\].
    pub fps: f64,
    /// Display aspect ratio of the film.
    pub aspect: PictureAspect,
    /// Number of pictures per frame.
    pub pictures: u32,
    /// Bytes of the stream's sequence header and extensions.
    pub sequence_header: Vec<u8>,
    pub report: PartReport,
}

/// Fields of a part's report that joining reads.
#[derive(Debug, Deserialize)]
pub(super) struct PartReport {
    pub schema: u32,
    pub program: String,
    pub scene: Value,
    pub settings: Map<String, Value>,
    pub plan: Value,
    pub frames: Vec<FrameReport>,
    pub summary: Summary,
    pub inputs: Option<u32>,
}

/// Settings of a part that the film's container needs.
#[derive(Deserialize)]
struct PartCoding {
    size: CodedSize,
    fps: f64,
    #[serde(default)]
    aspect: PictureAspect,
    mpeg1: bool,
    bframes: u32,
}

#[derive(Deserialize)]
struct CodedSize {
    width: usize,
    height: usize,
}

impl WholePart {
    /// Reads the stream at `path` and its report.
    ///
    /// # Errors
    /// If a file cannot be read, the stream is truncated or ended early, or the report describes another stream.
    pub fn read(path: &Path) -> Result<Self> {
        let stream = stream_at(path)?;
        let report = report_of(path)?;
        let wrong = |problem: String| Err(Error::content(path, problem));

        // Check that the part contains the requested frames.
        let range = report.settings.get("range").and_then(Value::as_str).and_then(|range| range.parse().ok());
        let frames = report.settings.get("frames").and_then(Value::as_u64).and_then(|frames| frames.try_into().ok());
        let (Some(range), Some(film_frames)) = (range, frames) else {
            return wrong(" is not a part of a film: make parts with render --range A-B".into());
        };
        let FrameRange { first, last } = range;
        let (made, wanted) = (report.frames.len() as u64, u64::from(last) + 1 - u64::from(first));
        if report.summary.interrupted || made < wanted {
            return wrong(format!(" ended early with {made} of {wanted} frames: continue it with --resume"));
        }

        // Determine the number of pictures per frame from the rate in the report.
        let place = path_beside(path).display().to_string();
        let coded: PartCoding = serde_json::from_value(report.settings.clone().into()).context(place.clone())?;
        let CodedRate { pictures, .. } = CodedRate::of(coded.fps).context(place)?;

        // Compare the sizes of frames to check that the stream matches its report. If frames have several pictures,
        // compare only the total, because with lookahead pictures may be counted with the previous frame.
        let mut lines: Vec<(u32, u64)> = report.frames.iter().map(|frame| (frame.index, frame.bits)).collect();
        lines.sort_unstable();
        let mut frames = vec![0; wanted as usize];
        for unit in &stream.units {
            if let Some(bits) = frames.get_mut((unit.display_index / u64::from(pictures)) as usize) {
                *bits += 8 * unit.data.len() as u64;
            }
        }
        let is_same = match pictures {
            1 => lines.iter().map(|&(_, bits)| bits).eq(frames.iter().copied()),
            _ => lines.iter().map(|&(_, bits)| bits).sum::<u64>() == frames.iter().sum::<u64>(),
        };
        let has_all = lines.iter().map(|&(index, _)| index).eq(first..=last);
        if !is_same || !has_all || stream.units.len() as u64 != wanted * u64::from(pictures) {
            return wrong(format!(" does not match {}: copy both files again", path_beside(path).display()));
        }
        // Reject a stream that starts with an open group: earlier pictures are missing at decoding.
        if !stream.begins_closed {
            return wrong(" begins with pictures that need earlier ones: it is not a part of a film".into());
        }
        Ok(Self {
            path: path.into(),
            range,
            film_frames,
            fps: coded.fps,
            aspect: coded.aspect,
            pictures,
            sequence_header: stream.sequence_header,
            report,
        })
    }

    /// Reads the stream again.
    ///
    /// # Errors
    /// If the stream cannot be read or has changed in the meantime.
    pub fn stream(&self) -> Result<ElementaryStream> {
        let stream = stream_at(&self.path)?;
        let bits: u64 = stream.units.iter().map(|unit| 8 * unit.data.len() as u64).sum();
        if bits != self.report.summary.bits_total {
            return Err(Error::content(&self.path, " changed while parts were joined"));
        }
        Ok(stream)
    }

    /// Returns the encoder configuration that containers need.
    ///
    /// # Errors
    /// If no encoder supports the settings in the report.
    pub fn encoder_config(&self) -> Result<Config> {
        let place = path_beside(&self.path).display().to_string();
        let coded: PartCoding = serde_json::from_value(self.report.settings.clone().into()).context(place.clone())?;
        // Rebuild the encoder settings. Parts have no bit rate, so only B pictures need lookahead.
        let PartCoding { size: CodedSize { width, height }, fps, aspect, mpeg1, bframes } = coded;
        let config = Config::new(width, height, CodedRate::of(fps).context(place.clone())?.rate)
            .with_aspect(aspect.ratio())
            .with_standard(if mpeg1 { Standard::Mpeg1 } else { Standard::Mpeg2 })
            .with_lookahead(if bframes > 0 { Config::LOOKAHEAD_MAX } else { 0 })
            .with_b_pictures(bframes);
        config.validate().context(place)?;
        Ok(config)
    }
}

/// Reads the complete elementary stream at `path`.
fn stream_at(path: &Path) -> Result<ElementaryStream> {
    let bytes = fs::read(path).map_err(Error::file(path, "cannot be read; make parts with render --range"))?;
    let stream = ElementaryStream::parse(&bytes).map_err(|error| Error::content(path, format!(" {error}")))?;
    match stream.is_ended {
        true => Ok(stream),
        false => Err(Error::content(path, " is truncated: copy it again, or complete it with --resume")),
    }
}

/// Reads the report next to a part.
fn report_of(path: &Path) -> Result<PartReport> {
    let place = path_beside(path);
    let problem = format!("cannot be read; {} needs its report next to it", path.display());
    let bytes = fs::read(&place).map_err(Error::file(&place, &problem))?;
    serde_json::from_slice(&bytes).map_err(|error| Error::content(&place, format!(": not a report of a film: {error}")))
}
