//! The loop: stages on threads, connected by bounded channels, with the feedback edge from masking to shading.

use super::checkpoint::Checkpoints;
use super::observe::Observer;
use super::pace::Pace;
use super::stages::{Displaying, Encoding, Masking, Preparing, Shading};
use super::start::{Stages, Start};
use super::threads::{self, Stamped, stage, work};
use crate::error::Result;
use crate::report::FrameReport;
use crate::stage::{Display, Encode, LuminanceThresholds, Mask, Prepare, Prepared, Shade};
use crate::team::Lead;
use crossbeam_channel::{Receiver, Sender, bounded};
use std::sync::atomic::AtomicBool;

/// Observer and stop flag of a run.
#[derive(Clone, Copy)]
pub struct Run<'a> {
    /// Receives the results of every stage.
    pub observer: &'a dyn Observer,
    /// Whether to complete the stream without starting another frame.
    pub stop: &'a AtomicBool,
}

impl Default for Run<'_> {
    /// Returns a run without observer and without early end.
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

/// Runs the loop to the end of a film, and returns the reports of all frames in display order.
///
/// Shading frame n waits for the thresholds of frame n−1, which follow from that frame's coded picture. Frame n+1 is
/// prepared in the meantime. The film depends only on its stages, not on their timing. The bytes of the film are passed to the
/// observer and to the file of [`Start::write_to`].
///
/// # Errors
/// Returns the first failure of a stage, a file or a checkpoint, or the panic of a stage.
pub fn couple<P: Prepare, S: Shade<P::Frame>, D: Display, M: Mask, E: Encode>(
    stages: Stages<P, S, D, M, E>,
    start: Start<'_>,
    run: Run<'_>,
) -> Result<Vec<FrameReport>> {
    let Stages { prepare, shade, display, encode, mask } = stages;
    let Start { checkpoints, begin, first, thresholds, mut masking_seconds, mut log, lead } = start;
    let Run { observer, stop } = run;

    // Remove an earlier checkpoint only now that all stages are restored and the film's file is open.
    checkpoints.begin(mask.is_some())?;
    let ranks = lead.ranks();

    // Pass prepared frames without a queue. Preparation is then one frame ahead, which suffices. Each queued frame
    // would keep another G-buffer in memory. The other channels queue one frame.
    let (prepared_out, prepared_in) = bounded(0);
    let (shaded_out, shaded_in) = bounded(1);
    let (displayed_out, displayed_in) = bounded(1);
    let (coded_out, coded_in) = bounded(1);
    let masks = mask.is_some();
    let (thresholds_out, last_thresholds) = feedback_edge(masks.then_some(begin), thresholds);

    // Wrap each stage to record its time and figures and to notify its observer.
    let preparing = Preparing(prepare);
    let shading = Shading::new(shade, ranks.clone());
    let displaying = Displaying::new(display, observer)?;
    let encoding = Encoding::new(encode, &mut log, observer)?;
    let masking = mask.map(|mask| Masking::new(mask, &mut masking_seconds, observer)).transpose()?;

    // Decide whether the first frame starts, and announce the decision to the other ranks.
    let pace = Pace::new(stop, checkpoints, first, ranks.count() > 1);
    lead.begin(pace.decision().unwrap_or_default());

    // Run the stages in the order in which their failures are reported.
    threads::run([
        stage("encode", move || {
            // Send the coding only to masking: it is unused otherwise.
            work(checkpoints, encoding, displayed_in.into_iter(), |coded| !masks || coded_out.send(coded).is_ok())
        }),
        stage("display", move || {
            work(checkpoints, displaying, shaded_in.into_iter(), |displayed| displayed_out.send(displayed).is_ok())
        }),
        stage("mask", move || {
            let Some(masking) = masking else { return Ok(()) };
            work(checkpoints, masking, coded_in.into_iter(), |thresholds| {
                // Ignore a closed channel: the thresholds of the last frame are unused.
                let _ = thresholds_out.send(thresholds.content);
                true
            })
        }),
        stage("shade", move || {
            let frames = with_thresholds(prepared_in, last_thresholds, lead, checkpoints);
            work(checkpoints, shading, frames, |shaded| shaded_out.send(shaded).is_ok())
        }),
        stage("prepare", move || {
            // Mark a frame for a checkpoint when it starts, so that all stages store their states at that frame.
            let begun = (first..).map_while(|index| {
                pace.begins(index).then(|| Stamped { index, marked: checkpoints.is_due(), content: () })
            });
            work(checkpoints, preparing, begun, |prepared| {
                // Decide about the next frame now, because the ranks receive the decision with this frame.
                let goes_on = pace.hand_over(prepared.index);
                prepared_out.send((prepared, goes_on)).is_ok()
            })
        }),
    ])?;

    // Complete the file only after every stage has ended without an error.
    log.finish(&masking_seconds)
}

/// Returns the feedback edge. It stores the thresholds of one frame: shading frame n first receives the thresholds of
/// frame n−1.
///
/// The sender belongs to masking. The function returns the thresholds for a frame: `None` after masking has ended,
/// `Some(None)` without thresholds. Masked films start with frame `begin`, or continue with the `thresholds` of the
/// last finished frame.
fn feedback_edge(
    begin: Option<u32>,
    thresholds: Option<LuminanceThresholds>,
) -> (Sender<LuminanceThresholds>, impl Fn(u32) -> Option<Option<LuminanceThresholds>>) {
    let (sender, receiver) = bounded(1);
    // Insert the thresholds of the checkpoint, with which a resumed film continues.
    if let Some(thresholds) = thresholds {
        let _ = sender.send(thresholds);
    }
    // Wait for thresholds in every frame except the first, which has no previous frame.
    let of_last = move |frame: u32| match begin.is_some_and(|begin| frame > begin) {
        true => receiver.recv().ok().map(Some),
        false => Some(None),
    };
    (sender, of_last)
}

/// Prepared frame for shading, and whether the next frame is started.
type OnItsWay<F> = (Stamped<Prepared<F>>, bool);
/// Prepared frame with the thresholds of the previous frame.
type WithThresholds<F> = Stamped<(Prepared<F>, Option<LuminanceThresholds>)>;

/// Returns prepared frames with their thresholds from `of_last` until either source ends. Announces each frame to the
/// ranks that this process leads.
fn with_thresholds<F>(
    prepared: Receiver<OnItsWay<F>>,
    of_last: impl Fn(u32) -> Option<Option<LuminanceThresholds>>,
    mut lead: Lead,
    checkpoints: &Checkpoints,
) -> impl Iterator<Item = WithThresholds<F>> {
    let mut last = None;
    std::iter::from_fn(move || {
        let next = prepared.recv().ok().and_then(|(frame, goes_on)| {
            lead.notes(goes_on);
            let _span = tracing::debug_span!("wait for thresholds", frame = frame.index).entered();
            let thresholds = of_last(frame.index)?;
            // Order the frame from the other ranks now that its thresholds are available.
            lead.frame(frame.index, frame.marked, thresholds.as_ref());
            last = Some(frame.index);
            Some(frame.with(|prepared| (prepared, thresholds)))
        });
        if next.is_none() {
            // Let all ranks store their states at the same frame.
            lead.end(last.is_some_and(|last| checkpoints.ends_after(last)));
        }
        next
    })
}
