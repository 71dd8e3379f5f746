//! The loop: parts on threads, joined by bounded channels, with the feedback edge from masking to shading.

use super::checkpoint::{Checkpoints, NONSENSE, Part, decode};
use super::log::FilmLog;
use super::observe::Observer;
use super::parts::{Encode, LuminanceThresholds, Mask, Prepare, Shade};
use super::stages::{Displaying, Encoding, Masking, Preparing, Shading};
use super::threads::{self, Stamped, work};
use crate::error::{Error, Result};
use crate::film::display::Display;
use crate::report::FrameReport;
use crossbeam_channel::bounded;
use plane::Plane;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// The parts of a film. Without masking, no thresholds flow back.
#[derive(Debug)]
pub struct Parts<P, S, M, E> {
    /// The first half of the renderer.
    pub prepare: P,
    /// The second half.
    pub shade: S,
    /// Tone curve, and files of uncompressed frames.
    pub display: Display,
    /// The encoder with its container.
    pub encode: E,
    /// The masking model.
    pub mask: Option<M>,
}

/// Where a film begins or is continued; made by [`Parts::begin`].
#[derive(Debug)]
pub struct Start<'a> {
    checkpoints: &'a Checkpoints,
    first: u32,
    thresholds: Option<LuminanceThresholds>,
    masking_seconds: Vec<(u32, f64)>,
    log: FilmLog,
}

/// The surroundings of a run.
#[derive(Clone, Copy)]
pub struct Run<'a> {
    /// Sees the results of every stage.
    pub observer: &'a dyn Observer,
    /// When this becomes true, no further frame is begun, and the stream ends in order.
    pub stop: &'a AtomicBool,
}

impl Default for Run<'_> {
    /// No observer, and no early end.
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self { observer: &(), stop: &NEVER }
    }
}

impl std::fmt::Debug for Run<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Run").field("stop", self.stop).finish_non_exhaustive()
    }
}

/// Runs the loop to the end of a film, and gives the report of each frame in display order.
///
/// Shading frame n waits for the thresholds of frame n−1, which follow from that picture as it was coded; preparation of
/// frame n+1 goes on meanwhile. The film depends on its parts alone, and not on the time that they take. Its bytes go to the
/// observer, and to the file of [`Start::write_to`].
///
/// # Errors
/// The first failure of a part, of a file or of a checkpoint; or the panic of a part.
pub fn couple<P: Prepare, S: Shade<P::Frame>, M: Mask, E: Encode>(
    parts: Parts<P, S, M, E>,
    start: Start<'_>,
    run: Run<'_>,
) -> Result<Vec<FrameReport>> {
    let Parts { prepare, shade, display, encode, mask } = parts;
    let Start { checkpoints, first, thresholds, mut masking_seconds, mut log } = start;
    let Run { observer, stop } = run;
    checkpoints.expect(mask.is_some());
    // Prepared frames are handed over without a queue: preparation is one frame ahead, which is all that can be used, and
    // each further one would hold a G-buffer. Elsewhere one frame may wait.
    let (prepared_out, prepared_in) = bounded(0);
    let (shaded_out, shaded_in) = bounded(1);
    let (displayed_out, displayed_in) = bounded(1);
    let (coded_out, coded_in) = bounded(1);
    // The feedback edge: it holds the thresholds of one frame. Shading frame n takes those of n−1 before it makes anything.
    let (thresholds_out, thresholds_in) = bounded::<LuminanceThresholds>(1);
    let masks = mask.is_some();
    let last_thresholds = move |frame: u32| match masks && frame > 0 {
        true => thresholds_in.recv().map(Some),
        false => Ok(None),
    };
    if let Some(thresholds) = thresholds {
        // A film that is continued: those of the last frame that is done.
        let _ = thresholds_out.send(thresholds);
    }
    let preparing = Preparing(prepare);
    let shading = Shading::new(shade);
    let displaying = Displaying::new(display, observer)?;
    let encoding = Encoding::new(encode, &mut log, observer)?;
    let masking = mask.map(|mask| Masking::new(mask, &mut masking_seconds, observer)).transpose()?;
    threads::run([
        (
            "encode",
            Box::new(move || {
                // Without masking nobody takes the coding.
                work(checkpoints, encoding, displayed_in.into_iter(), |coded| !masks || coded_out.send(coded).is_ok())
            }),
        ),
        (
            "display",
            Box::new(move || {
                work(checkpoints, displaying, shaded_in.into_iter(), |displayed| displayed_out.send(displayed).is_ok())
            }),
        ),
        (
            "mask",
            Box::new(move || match masking {
                Some(masking) => work(checkpoints, masking, coded_in.into_iter(), |thresholds| {
                    // The thresholds of the last frame are for nobody.
                    let _ = thresholds_out.send(thresholds.content);
                    true
                }),
                None => Ok(()),
            }),
        ),
        (
            "shade",
            Box::new(move || {
                let frames = prepared_in.into_iter().map_while(|frame: Stamped<_>| {
                    let _span = tracing::debug_span!("wait for thresholds", frame = frame.index).entered();
                    let thresholds = last_thresholds(frame.index).ok()?;
                    Some(frame.with(|prepared| (prepared, thresholds)))
                });
                work(checkpoints, shading, frames, |shaded| shaded_out.send(shaded).is_ok())
            }),
        ),
        (
            "prepare",
            Box::new(move || {
                let begun = (first..).map_while(|index| {
                    if stop.load(Ordering::Relaxed) {
                        checkpoints.end_before(index, first);
                        return None;
                    }
                    Some(Stamped { index, marked: checkpoints.is_due(), content: () })
                });
                work(checkpoints, preparing, begun, |prepared| prepared_out.send(prepared).is_ok())
            }),
        ),
    ])?;
    log.finish(&masking_seconds)
}

/// What masking leaves in a checkpoint: its state, ΔY and luminance of the last frame, and its seconds so far.
type MaskState = (Vec<u8>, Option<(Plane<f32>, Plane<f32>)>, Vec<(u32, f64)>);

impl<P: Prepare, S: Shade<P::Frame>, M: Mask, E: Encode> Parts<P, S, M, E> {
    /// Brings every part to where `checkpoints` say: to the beginning, or after the last frame that is done.
    ///
    /// # Errors
    /// A part cannot read its state, or a file of uncompressed frames cannot be opened.
    pub fn begin<'a>(&mut self, checkpoints: &'a Checkpoints) -> Result<Start<'a>> {
        let mut start =
            Start { checkpoints, first: 0, thresholds: None, masking_seconds: Vec::new(), log: FilmLog::default() };
        let Some(last) = checkpoints.last_frame() else {
            self.display.begin()?;
            return Ok(start);
        };
        let state = |part| checkpoints.state(part);
        start.first = last + 1;
        let (log, encoder) = FilmLog::restored(state(Part::Encode), start.first)?;
        start.log = log;
        self.encode.restore(&encoder)?;
        if let Some(mask) = &mut self.mask {
            let (own, planes, masking_seconds): MaskState = decode(state(Part::Mask))?;
            let (delta, luminance) = planes.ok_or_else(|| Error::Checkpoint(NONSENSE.into()))?;
            let thresholds = LuminanceThresholds { of: last, delta: delta.into(), luminance: luminance.into() };
            mask.restore(&own, &thresholds)?;
            (start.thresholds, start.masking_seconds) = (Some(thresholds), masking_seconds);
        }
        let done = self.prepare.restore(state(Part::Prepare), last)?;
        self.shade.restore(state(Part::Shade), &done)?;
        // Last, because this cuts a file to the length that it had.
        self.display.restore(state(Part::Display))?;
        Ok(start)
    }
}

impl Start<'_> {
    /// The first frame that is still to be made.
    #[must_use]
    pub fn first_frame(&self) -> u32 {
        self.first
    }

    /// Writes the film to `path`: to a new file, or after the bytes that there were at the checkpoint.
    ///
    /// # Errors
    /// The file cannot be written, or is shorter than it was.
    pub fn write_to(&mut self, path: &Path) -> Result<()> {
        self.log.write_to(path, self.first > 0)
    }
}
