//! A stage of the loop on a thread of its own: frames in, one step for each, and its state where a checkpoint is due.

use super::checkpoint::{Checkpoints, Part};
use crate::error::{Context, Error, Result};

/// A message between two stages, with the frame that it belongs to.
pub(super) struct Stamped<T> {
    pub index: u32,
    /// Whether each stage leaves its state for a checkpoint after this frame.
    pub marked: bool,
    pub content: T,
}

impl<T> Stamped<T> {
    /// Another message of the same frame.
    pub fn with<U>(self, other: impl FnOnce(T) -> U) -> Stamped<U> {
        Stamped { index: self.index, marked: self.marked, content: other(self.content) }
    }
}

/// A part of the loop with what the driver adds to it: time, spans, observers.
pub(super) trait Stage: Sized {
    /// Its place in a checkpoint.
    const PART: Part;
    type In;
    type Out;

    /// Takes in frame `index`; none ends the film.
    fn step(&mut self, index: u32, input: Self::In) -> Result<Option<Self::Out>>;

    /// The state after the last step.
    fn state(&self) -> Result<Vec<u8>>;

    /// Ends the film in order, after the last frame.
    fn finish(self) -> Result<()> {
        Ok(())
    }
}

/// Steps through `frames` until there are none, or until `send` finds that its receiver is gone.
///
/// The stage leaves its state after each marked frame, and after the last frame of a run that was ended early.
///
/// # Errors
/// The first failure of a step, or a state that cannot be had.
pub(super) fn work<S: Stage>(
    checkpoints: &Checkpoints,
    mut stage: S,
    frames: impl Iterator<Item = Stamped<S::In>>,
    mut send: impl FnMut(Stamped<S::Out>) -> bool,
) -> Result<()> {
    let mut last = None;
    for Stamped { index, marked, content } in frames {
        let Some(content) = stage.step(index, content)? else { break };
        if marked {
            checkpoints.leave(index, S::PART, stage.state()?);
        }
        last = Some(index);
        if !send(Stamped { index, marked, content }) {
            // A later stage has failed, and the driver will report that.
            return Ok(());
        }
    }
    if let Some(index) = last.filter(|&index| checkpoints.ends_after(index)) {
        checkpoints.leave(index, S::PART, stage.state()?);
    }
    stage.finish()
}

/// The work of a thread, and its name.
pub(super) type Work<'a> = (&'static str, Box<dyn FnOnce() -> Result<()> + Send + 'a>);

/// Names the work of a thread.
pub(super) fn stage<'a>(name: &'static str, work: impl FnOnce() -> Result<()> + Send + 'a) -> Work<'a> {
    (name, Box::new(work))
}

/// Runs everything at once, and reports the first failure in the order of `stages`.
///
/// A stage that fails drops its ends of the channels, so the others end too; all are joined before any failure is reported.
///
/// # Errors
/// The first failure of a stage, or its panic.
pub(super) fn run<const N: usize>(stages: [Work<'_>; N]) -> Result<()> {
    std::thread::scope(|scope| {
        let started = stages.map(|(name, stage)| {
            let thread = std::thread::Builder::new().name(name.into()).spawn_scoped(scope, stage);
            (name, thread.context("a thread cannot be started"))
        });
        let results = started.map(|(name, thread)| {
            thread?
                .join()
                .unwrap_or_else(|_| Err(Error::Fault(format!("the {name} stage failed: a fault of this program"))))
        });
        results.into_iter().collect()
    })
}
