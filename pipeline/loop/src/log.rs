//! Log of a film: the written bytes, and the report of each coded frame.

use super::observe::Observer;
use crate::early_end::EarlyEnd;
use crate::error::{Error, Result};
use crate::figures::FrameFigures;
use crate::output::{Output, Written};
use crate::report::{FrameReport, PictureTypeName, picture_type};
use crate::stage::{Coding, Encoded};
use crate::state::{NONSENSE, decode, encode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Reports of coded frames, and figures of frames that are still in the encoder.
#[derive(Debug, Default)]
pub(super) struct FilmLog {
    /// File for the bytes of the film; without a file, only the observer receives them.
    output: Option<Output>,
    /// Length and checksum of the film at the checkpoint from which it continues.
    written: Written,
    /// First frame of the film or of the range to make.
    begin: u32,
    reports: Vec<FrameReport>,
    waiting: BTreeMap<u32, FrameFigures>,
}

/// Log in a checkpoint: length and checksum of the film, reports, waiting figures, and state of the encoder.
type StoredLog = (Written, Vec<StoredLine>, BTreeMap<u32, FrameFigures>, Vec<u8>);

/// Report without flattened fields, which bincode cannot store.
#[derive(Serialize, Deserialize)]
struct StoredLine {
    index: u32,
    #[serde(deserialize_with = "picture_type")]
    picture_type: PictureTypeName,
    bits: u64,
    qscale: u32,
    psnr_y: Option<f64>,
    figures: FrameFigures,
}

impl From<&FrameReport> for StoredLine {
    fn from(report: &FrameReport) -> Self {
        let FrameReport { index, picture_type, bits, qscale, psnr_y, figures } = report.clone();
        Self { index, picture_type, bits, qscale, psnr_y, figures }
    }
}

impl From<StoredLine> for FrameReport {
    fn from(line: StoredLine) -> Self {
        let StoredLine { index, picture_type, bits, qscale, psnr_y, figures } = line;
        Self { index, picture_type, bits, qscale, psnr_y, figures }
    }
}

impl FilmLog {
    /// Syncs the film to the disk, and returns the state of the log and of the `encoder`.
    pub fn state(&self, encoder: Vec<u8>) -> Result<Vec<u8>> {
        // Sync first: the stored length must not exceed the bytes on the disk.
        self.output.as_ref().map_or(Ok(()), Output::sync)?;
        let written = self.output.as_ref().map(Output::written).unwrap_or_default();
        let lines: Vec<StoredLine> = self.reports.iter().map(StoredLine::from).collect();
        Ok(encode(&(written, lines, &self.waiting, encoder)))
    }

    /// Returns an empty log of a film or a range with first frame `begin`.
    pub fn beginning(begin: u32) -> Self {
        Self { begin, ..Self::default() }
    }

    /// Returns the log and the state of the encoder, restored from a [`state`](Self::state) that was stored after the
    /// frames `done`.
    pub fn restored(state: &[u8], done: Range<u32>) -> Result<(Self, Vec<u8>)> {
        let begin = done.start;
        let (written, lines, waiting, encoder): StoredLog = decode(state)?;
        let reports: Vec<FrameReport> = lines.into_iter().map(FrameReport::from).collect();
        // Check that each finished frame has a report or waiting figures.
        let mut frames: Vec<u32> = reports.iter().map(|line| line.index).collect();
        frames.extend(waiting.keys());
        frames.sort_unstable();
        if !frames.into_iter().eq(done) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        Ok((Self { output: None, written, begin, reports, waiting }, encoder))
    }

    /// Opens the film's file: a new one, or the existing one at its length in the checkpoint. An unfinished file
    /// remains if it is dropped while `kept` is true.
    pub fn write_to(&mut self, path: &Path, continued: bool, kept: Arc<AtomicBool>) -> Result<()> {
        let output = if continued { Output::resume(path, self.written)? } else { Output::create(path)? };
        self.output = Some(output.kept_if(kept));
        Ok(())
    }

    /// Returns a handle to end the film's file from another thread; `None` without a file.
    pub fn early_end(&self) -> Option<EarlyEnd> {
        self.output.as_ref().map(Output::early_end)
    }

    /// Stores the figures of frame `index`, which has entered the encoder.
    pub fn expect(&mut self, index: u32, figures: FrameFigures) {
        self.waiting.insert(index, figures);
    }

    /// Adds CPU seconds of encoding to the last waiting frame.
    pub fn spend_on_last(&mut self, seconds: f64) {
        if let Some(mut last) = self.waiting.last_entry() {
            last.get_mut().seconds.encode += seconds;
        }
    }

    /// Sets the bytes that complete the film if it ends before any further bytes are written.
    pub fn end_with(&mut self, ending: Vec<u8>) -> Result<()> {
        self.output.as_mut().map_or(Ok(()), |output| output.write_before(&[], ending))
    }

    /// Writes the coded bytes, and reports each coded picture with its waiting figures. If the film ends early,
    /// `ending` completes it.
    pub fn hand_out(&mut self, coded: Encoded, ending: Vec<u8>, observer: &dyn Observer) -> Result<Coding> {
        let Encoded { bytes, pictures, units, coding } = coded;
        self.output.as_mut().map_or(Ok(()), |output| output.write_before(&bytes, ending))?;
        observer.bytes(&bytes);
        units.iter().for_each(|unit| observer.coded(unit));

        // Report coded pictures with the figures that were stored when they entered the encoder.
        for picture in &pictures {
            let figures = self.waiting.remove(&picture.index).unwrap_or_default();
            let line = FrameReport::new(picture, figures);
            let FrameReport { index, picture_type, bits, psnr_y, .. } = &line;
            tracing::info!("frame {index}: {picture_type}, {bits} bits, {:.2} dB", psnr_y.unwrap_or(f64::INFINITY));
            if let Some(decoded) = &picture.decoded {
                observer.decoded(picture.index, decoded);
            }
            observer.frame(&line);
            self.reports.push(line);
        }
        Ok(coding)
    }

    /// Completes the file, and returns the reports in display order with the CPU seconds of masking.
    pub fn finish(self, masking_seconds: &[(u32, f64)]) -> Result<Vec<FrameReport>> {
        let Self { output, begin, mut reports, .. } = self;
        // Sort the reports: an encoder with look-ahead codes in another order.
        reports.sort_by_key(|frame| frame.index);
        // Check the frame numbers: only an encoder in an invalid state omits a frame or reports it twice.
        if !reports.iter().map(|frame| frame.index).eq((begin..).take(reports.len())) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }

        // Add the CPU time of masking, which runs after the frame is logged.
        for &(of, seconds) in masking_seconds {
            let place = of.checked_sub(begin).map(|place| place as usize);
            let frame =
                place.and_then(|place| reports.get_mut(place)).ok_or_else(|| Error::Checkpoint(NONSENSE.into()))?;
            frame.add_masking(seconds);
        }
        output.map_or(Ok(()), Output::finish)?;
        Ok(reports)
    }
}
