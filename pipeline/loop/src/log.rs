//! The film as far as it is made: its bytes, and a line of the report for each coded picture.

use super::observe::Observer;
use crate::early_end::EarlyEnd;
use crate::error::{Error, Result};
use crate::figures::FrameFigures;
use crate::output::{Output, Written};
use crate::parts::{Coding, Encoded};
use crate::report::{FrameReport, PictureTypeName, picture_type};
use crate::state::{NONSENSE, decode, encode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Reports of the coded frames, and figures of the frames that the encoder still holds.
#[derive(Debug, Default)]
pub(super) struct FilmLog {
    /// Where the bytes go; none: only to the observer.
    output: Option<Output>,
    /// Bytes of the film at the checkpoint that it is continued from.
    written: Written,
    /// The first frame of the film, or of its part.
    begin: u32,
    reports: Vec<FrameReport>,
    waiting: BTreeMap<u32, FrameFigures>,
}

/// The log in a checkpoint: bytes of the film, reports, figures that wait, and the state of the encoder.
type StoredLog = (Written, Vec<StoredLine>, BTreeMap<u32, FrameFigures>, Vec<u8>);

/// A report without names, which bincode does not store.
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
    /// How much of the film there is, once that is on the disk, with the `encoder`'s state.
    pub fn state(&self, encoder: Vec<u8>) -> Result<Vec<u8>> {
        self.output.as_ref().map_or(Ok(()), Output::sync)?;
        let written = self.output.as_ref().map(Output::written).unwrap_or_default();
        let lines: Vec<StoredLine> = self.reports.iter().map(StoredLine::from).collect();
        Ok(encode(&(written, lines, &self.waiting, encoder)))
    }

    /// Nothing yet of a film, or of a part of one, whose first frame is `begin`.
    pub fn beginning(begin: u32) -> Self {
        Self { begin, ..Self::default() }
    }

    /// Continues from a [`state`](Self::state) that was left when the frames `done` were; gives the encoder's state too.
    pub fn restored(state: &[u8], done: Range<u32>) -> Result<(Self, Vec<u8>)> {
        let begin = done.start;
        let (written, lines, waiting, encoder): StoredLog = decode(state)?;
        let reports: Vec<FrameReport> = lines.into_iter().map(FrameReport::from).collect();
        // Each frame that is done has its line, or waits for it.
        let mut frames: Vec<u32> = reports.iter().map(|line| line.index).chain(waiting.keys().copied()).collect();
        frames.sort_unstable();
        if !frames.into_iter().eq(done) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
        Ok((Self { output: None, written, begin, reports, waiting }, encoder))
    }

    /// Opens the film's file: anew, or where it was at the checkpoint. Unfinished, it stays if `kept` is true then.
    pub fn write_to(&mut self, path: &Path, continued: bool, kept: Arc<AtomicBool>) -> Result<()> {
        let output = if continued { Output::resume(path, self.written)? } else { Output::create(path)? };
        self.output = Some(output.kept_if(kept));
        Ok(())
    }

    /// A way to end the film's file from another thread; none without a file.
    pub fn early_end(&self) -> Option<EarlyEnd> {
        self.output.as_ref().map(Output::early_end)
    }

    /// Keeps the figures of frame `index`, which has come to the encoder.
    pub fn expect(&mut self, index: u32, figures: FrameFigures) {
        self.waiting.insert(index, figures);
    }

    /// Adds seconds of encoding to the last frame that waits.
    pub fn spend_on_last(&mut self, seconds: f64) {
        if let Some(mut last) = self.waiting.last_entry() {
            last.get_mut().seconds.encode += seconds;
        }
    }

    /// Says what makes the film whole, if it ends with what was written at the checkpoint.
    pub fn end_with(&mut self, ending: Vec<u8>) -> Result<()> {
        self.output.as_mut().map_or(Ok(()), |output| output.write_before(&[], ending))
    }

    /// Writes the bytes, and a line for each coded picture with the figures that waited for it. The film may end early with `ending`.
    pub fn hand_out(&mut self, coded: Encoded, ending: Vec<u8>, observer: &dyn Observer) -> Result<Coding> {
        let Encoded { bytes, pictures, coding } = coded;
        self.output.as_mut().map_or(Ok(()), |output| output.write_before(&bytes, ending))?;
        observer.bytes(&bytes);
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

    /// Completes the file, and gives the reports in display order with the seconds that masking each frame took.
    pub fn finish(self, masking_seconds: &[(u32, f64)]) -> Result<Vec<FrameReport>> {
        let Self { output, begin, mut reports, .. } = self;
        // An encoder that looks ahead codes in another order.
        reports.sort_by_key(|frame| frame.index);
        // Only an encoder in a wrong state leaves a frame out, or reports it twice.
        if !reports.iter().map(|frame| frame.index).eq((begin..).take(reports.len())) {
            return Err(Error::Checkpoint(NONSENSE.into()));
        }
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
