//! The stages as threads, joined by bounded channels; the first failure ends all.

use crate::checkpoint::{Checkpoints, NONSENSE};
use crate::error::{Context, Error, Result};
use crate::message::{Coding, MaskingTime};
use crate::observe::{Observer, OnFrame};
use crate::output::Output;
use crate::plan::Plan;
use crate::report::{FrameReport, Report};
use crate::settings::Settings;
use crate::stage::{display, encode, mask, prepare, shade};
use crossbeam_channel::{bounded, unbounded};
use render_core::scene::Scene;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What the thread of a stage does.
type Stage<'a> = Box<dyn FnOnce() -> Result<()> + Send + 'a>;

/// Renders `scene` into `output` and reports what it took.
///
/// `progress` is called with each finished frame. When `stop` becomes true, no further frame is begun, and the stream ends
/// in order. Blocks until all is done; the caller names the threads that rayon may use by installing a pool.
///
/// # Errors
/// The first failure of a stage: an output that cannot be written, settings without an encoder, or a fault of our own.
pub fn render(
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    output: Output,
    stop: &AtomicBool,
    progress: impl FnMut(&FrameReport) + Send,
) -> Result<Report> {
    render_from(&Checkpoints::off(), scene, settings, plan, output, stop, &OnFrame::new(progress))
}

/// The same with checkpoints, and from where they say; `output` is that of [`Checkpoints::output`], and `observer` sees what
/// the stages make.
///
/// # Errors
/// As those of [`render`], or a checkpoint cannot be read or written.
pub fn render_from(
    checkpoints: &Checkpoints,
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    mut output: Output,
    stop: &AtomicBool,
    observer: &dyn Observer,
) -> Result<Report> {
    let begin = Instant::now();
    let mut reports: Vec<FrameReport> = Vec::new();
    // Prepared frames are handed over without a queue: preparation is one frame ahead, which is all that can be used, and
    // each further one would hold a G-buffer. Elsewhere one frame may wait.
    let (prepared_out, prepared_in) = bounded(0);
    let (shaded_out, shaded_in) = bounded(1);
    let (encode_out, encode_in) = bounded(1);
    let (mask_out, mask_in) = bounded(1);
    // The way back. It holds one map: shading frame n takes that of n−1 before it makes anything new.
    let (thresholds_out, thresholds_in) = bounded(1);
    let (times_out, times_in) = unbounded::<MaskingTime>();
    // Masking wants to know how pictures were really coded. A constant quantiser alone it knows beforehand, and need not wait.
    let (codings_out, codings_in) = unbounded::<Coding>();
    let waits = settings.looks_ahead() || settings.thresholds.follow_coding();
    let constant = || (!waits).then(|| Coding::of_quantiser(settings.qscale as f32));
    std::thread::scope(|scope| {
        let output = &mut output;
        let reports = &mut reports;
        // Each thread owns its ends of the channels, so that they close when it ends.
        let stages: [(&str, Stage<'_>); 5] = [
            (
                "encode",
                Box::new(move || {
                    let codings_out = waits.then_some(codings_out);
                    encode::run(settings, checkpoints, &encode_in, codings_out.as_ref(), output, reports, observer)
                }),
            ),
            (
                "display",
                Box::new(move || {
                    display::run(settings, plan, checkpoints, observer, &shaded_in, &encode_out, &mask_out)
                }),
            ),
            (
                "mask",
                Box::new(move || {
                    let codings = std::iter::from_fn(|| constant().or_else(|| codings_in.recv().ok()));
                    mask::run_from(checkpoints, observer, settings, codings, &mask_in, &thresholds_out, &times_out)
                }),
            ),
            (
                "shade",
                Box::new(move || {
                    shade::run_from(checkpoints, settings, plan, &prepared_in, &thresholds_in, &shaded_out)
                }),
            ),
            ("prepare", Box::new(move || prepare::run_from(checkpoints, scene, settings, plan, stop, &prepared_out))),
        ];
        // A stage that fails drops its ends, and the others follow: all are joined before any is reported.
        let started = stages.map(|(name, stage)| {
            let thread = std::thread::Builder::new().name(name.into()).spawn_scoped(scope, stage);
            (name, thread.context("a thread cannot be started"))
        });
        let results = started.map(|(name, thread)| {
            thread?
                .join()
                .unwrap_or_else(|_| Err(Error::Fault(format!("the {name} stage failed: a fault of this program"))))
        });
        results.into_iter().collect::<Result<Vec<()>>>()
    })?;
    // An encoder that looks ahead codes in another order.
    reports.sort_by_key(|frame| frame.index);
    // Only an encoder that was told nonsense leaves one out, or tells of one twice.
    let nonsense = || Error::Checkpoint(NONSENSE.into());
    if !reports.iter().map(|frame| frame.index).eq(0..reports.len() as u32) {
        return Err(nonsense());
    }
    for MaskingTime { of, seconds } in times_in {
        reports.get_mut(of as usize).ok_or_else(nonsense)?.add_masking(seconds);
    }
    output.finish()?;
    let interrupted = stop.load(Ordering::Relaxed) && (reports.len() as u32) < settings.frames;
    Ok(Report::new(scene, settings, plan.steps(), reports, interrupted, begin.elapsed().as_secs_f64()))
}
