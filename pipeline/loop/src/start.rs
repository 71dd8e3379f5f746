//! The stages of a film, and the start of a new or resumed film.

use super::checkpoint::{Checkpoints, StageName};
use super::log::FilmLog;
use crate::early_end::EarlyEnd;
use crate::error::{Error, Result};
use crate::stage::{Display, Encode, LuminanceThresholds, Mask, Prepare, Shade};
use crate::state::{NONSENSE, decode};
use crate::team::Lead;
use plane::Plane;
use std::path::Path;

/// Stages of a film. Without masking, no thresholds flow back.
#[derive(Debug)]
pub struct Stages<P, S, D, M, E> {
    /// First half of the renderer.
    pub prepare: P,
    /// Second half of the renderer.
    pub shade: S,
    /// Display stage with the tone curve and the files of uncompressed frames.
    pub display: D,
    /// Encoder with its container.
    pub encode: E,
    /// Masking model.
    pub mask: Option<M>,
}

/// Start of a new or resumed film, returned by [`Stages::begin`].
#[derive(Debug)]
pub struct Start<'a> {
    pub(super) checkpoints: &'a Checkpoints,
    /// First frame of the film or of the range to make.
    pub(super) begin: u32,
    /// First unfinished frame.
    pub(super) first: u32,
    pub(super) thresholds: Option<LuminanceThresholds>,
    pub(super) masking_seconds: Vec<(u32, f64)>,
    pub(super) log: FilmLog,
    /// Connection to the ranks that this process leads.
    pub(super) lead: Lead,
}

/// State of masking in a checkpoint: the state of the stage, ΔY and luminance of the last frame, and CPU seconds per
/// frame.
type MaskState = (Vec<u8>, Option<(Plane<f32>, Plane<f32>)>, Vec<(u32, f64)>);

impl<P: Prepare, S: Shade<P::Frame>, D: Display, M: Mask, E: Encode> Stages<P, S, D, M, E> {
    /// Prepares every stage for the first frame, or restores the stages after the last finished frame of `checkpoints`.
    ///
    /// # Errors
    /// If a stage cannot restore its state, or a file of uncompressed frames cannot be opened.
    pub fn begin<'a>(&mut self, checkpoints: &'a Checkpoints) -> Result<Start<'a>> {
        self.begin_at(0, checkpoints)
    }

    /// Prepares or restores every stage as [`begin`](Stages::begin) does, for a range of a film with first frame
    /// `begin`.
    ///
    /// # Errors
    /// If a stage cannot restore its state, or a file of uncompressed frames cannot be opened.
    pub fn begin_at<'a>(&mut self, begin: u32, checkpoints: &'a Checkpoints) -> Result<Start<'a>> {
        self.begin_among(begin, checkpoints, Lead::nobody())
    }

    /// Prepares or restores every stage as [`begin_at`](Stages::begin_at) does, with this process as `lead` of other
    /// ranks.
    ///
    /// # Errors
    /// If a stage cannot restore its state, or a file of uncompressed frames cannot be opened.
    pub fn begin_among<'a>(&mut self, begin: u32, checkpoints: &'a Checkpoints, lead: Lead) -> Result<Start<'a>> {
        let log = FilmLog::beginning(begin);
        let (thresholds, masking_seconds) = (None, Vec::new());
        let mut start = Start { checkpoints, begin, first: begin, thresholds, masking_seconds, log, lead };
        // Without a checkpoint, open new files and let all ranks start at the first frame.
        let Some(last) = checkpoints.last_frame() else {
            self.display.begin(&checkpoints.kept())?;
            start.lead.start(begin, None);
            return Ok(start);
        };
        self.restore(&mut start, last).map_err(|error| checkpoints.named(error))?;
        Ok(start)
    }

    /// Restores the state of every stage after frame `last`.
    fn restore(&mut self, start: &mut Start, last: u32) -> Result<()> {
        let checkpoints = start.checkpoints;
        let state = |part| checkpoints.state(part);
        start.first = last.checked_add(1).ok_or_else(|| Error::Checkpoint(NONSENSE.into()))?;
        // Restore the log together with the encoder, whose waiting frames have figures in the log.
        let (log, encoder) = FilmLog::restored(state(StageName::Encode), start.begin..start.first)?;
        start.log = log;
        self.encode.restore(&encoder)?;
        // Restore the thresholds of the last frame, which steer the shading of the next frame.
        if let Some(mask) = &mut self.mask {
            let (own, planes, masking_seconds): MaskState = decode(state(StageName::Mask))?;
            let (delta, luminance) = planes.ok_or_else(|| Error::Checkpoint(NONSENSE.into()))?;
            let thresholds = LuminanceThresholds { of: last, delta: delta.into(), luminance: luminance.into() };
            mask.restore(&own, &thresholds)?;
            (start.thresholds, start.masking_seconds) = (Some(thresholds), masking_seconds);
        }
        // All ranks restore the same state, so rank 0 sends it before the remaining steps.
        start.lead.start(start.first, Some((state(StageName::Prepare), state(StageName::Shade))));
        let done = self.prepare.restore(state(StageName::Prepare), last)?;
        self.shade.restore(state(StageName::Shade), &done)?;
        // Restore the display last, because it truncates its file.
        self.display.restore(state(StageName::Display), &checkpoints.kept())
    }
}

impl Start<'_> {
    /// Returns the first unfinished frame.
    #[must_use]
    pub fn first_frame(&self) -> u32 {
        self.first
    }

    /// Lets `prepare` compute the state that all frames have in common, on all ranks.
    pub fn make_ready(&self, prepare: &mut impl Prepare) {
        self.lead.make_ready();
        prepare.make_ready();
    }

    /// Opens the file at `path` for the film: a new file, or the existing one after its bytes at the checkpoint.
    ///
    /// # Errors
    /// If the file cannot be written, or is shorter than it was at the checkpoint.
    pub fn write_to(&mut self, path: &Path) -> Result<()> {
        self.log.write_to(path, self.first > self.begin, self.checkpoints.kept())
    }

    /// Returns a handle to end the film's file at once from another thread; `None` before
    /// [`write_to`](Self::write_to).
    #[must_use]
    pub fn early_end(&self) -> Option<EarlyEnd> {
        self.log.early_end()
    }
}
