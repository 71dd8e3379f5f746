//! A stage of the loop on its own thread: one step per frame, and its state whenever a checkpoint is due.

use super::checkpoint::{Checkpoints, StageName};
use crate::error::{Context, Error, Result};

/// Message between two stages, labeled with its frame.
pub(super) struct Stamped<T> {
    pub index: u32,
    /// Whether each stage stores its state for a checkpoint after this frame.
    pub marked: bool,
    pub content: T,
}

impl<T> Stamped<T> {
    /// Returns a message of the same frame with its content converted by `other`.
    pub fn with<U>(self, other: impl FnOnce(T) -> U) -> Stamped<U> {
        Stamped { index: self.index, marked: self.marked, content: other(self.content) }
    }
}

/// Stage as the driver runs it: with measured time, spans and observers.
pub(super) trait Stage: Sized {
    /// Index of the stage's state in a checkpoint.
    const STAGE: StageName;
    type In;
    type Out;

    /// Processes frame `index`; returns `None` to end the film.
    fn step(&mut self, index: u32, input: Self::In) -> Result<Option<Self::Out>>;

    /// Returns the state after the last step.
    fn state(&self) -> Result<Vec<u8>>;

    /// Completes the output of the stage after the last frame.
    fn finish(self) -> Result<()> {
        Ok(())
    }
}

/// Processes `frames` until they end, the stage ends the film, or the receiver of `send` is gone.
///
/// The stage stores its state after each frame marked for a checkpoint, and after the last frame of a run that ended
/// early.
///
/// # Errors
/// Returns the first failure of a step, or a failure to return the state.
pub(super) fn work<S: Stage>(
    checkpoints: &Checkpoints,
    mut stage: S,
    frames: impl Iterator<Item = Stamped<S::In>>,
    mut send: impl FnMut(Stamped<S::Out>) -> bool,
) -> Result<()> {
    // Run until the previous stage ends the frames, or this stage ends the film.
    let mut last = None;
    for Stamped { index, marked, content } in frames {
        let Some(content) = stage.step(index, content)? else { break };
        if marked {
            checkpoints.leave(index, S::STAGE, stage.state()?);
        }
        last = Some(index);
        if !send(Stamped { index, marked, content }) {
            // Return without an error: a later stage has failed, and the driver reports its failure.
            return Ok(());
        }
    }

    // Store the state after the last frame of a run that ended early, so that it can be resumed.
    if let Some(index) = last.filter(|&index| checkpoints.ends_after(index)) {
        checkpoints.leave(index, S::STAGE, stage.state()?);
    }
    stage.finish()
}

/// Name and work of a thread.
pub(super) type Work<'a> = (&'static str, Box<dyn FnOnce() -> Result<()> + Send + 'a>);

/// Pairs the work of a thread with its name.
pub(super) fn stage<'a>(name: &'static str, work: impl FnOnce() -> Result<()> + Send + 'a) -> Work<'a> {
    (name, Box::new(work))
}

/// Runs all stages in parallel, and reports the first failure in the order of `stages`.
///
/// A stage that fails drops its channel ends, so the others end too. All threads are joined before a failure is
/// reported.
///
/// # Errors
/// Returns the first failure or panic of a stage.
pub(super) fn run<const N: usize>(stages: [Work<'_>; N]) -> Result<()> {
    std::thread::scope(|scope| {
        let started = stages.map(|(name, stage)| {
            let thread = std::thread::Builder::new().name(name.into()).spawn_scoped(scope, stage);
            (name, thread.context("cannot start a thread"))
        });
        // Join all threads before returning, because each borrows data of this run.
        let results = started.map(|(name, thread)| {
            thread?.join().unwrap_or_else(|_| Err(Error::Fault(format!("the {name} stage failed: this is a bug"))))
        });
        results.into_iter().collect()
    })
}
