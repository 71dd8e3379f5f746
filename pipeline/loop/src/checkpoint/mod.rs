//! Checkpoints: files with the states of all stages, written at intervals. From a checkpoint, another process continues
//! the film to the same bits.
//!
//! A checkpoint contains the state of every stage after the same frame. The driver marks that frame when it starts, and
//! each stage stores its state after processing it. When the last state arrives, the file is written atomically. Stages
//! do not wait for each other, so the states are stored at different times.
//!
//! A run that ends early (Ctrl-C) leaves a checkpoint after its last frame.
//!
//! Data that follows from scene and settings is recomputed instead of stored: the ray tree, photons, direct lights and
//! the G-buffer of the last frame. Resuming therefore prepares that one frame again.

mod file;
mod job;

use crate::error::{Error, Result};
use crate::output::part_of;
use crate::streams::is_stream;
pub use file::Identity;
use file::Stored;
pub use job::FilmJob;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Stage of the loop, as the owner of a state in a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageName {
    /// Preparation, with the light tree as its state.
    Prepare,
    /// Shading, with the irradiance cache or the light of a static film as its state.
    Shade,
    /// Display, with the exposure and the length of the uncompressed file as its state.
    Display,
    /// Encoder, with the waiting frames, the length of the film and the reports so far as its state.
    Encode,
    /// Masking, with the thresholds ΔY as its state; absent in films without masking.
    Mask,
}

const STAGES: usize = 5;

/// Collected states of one frame, indexed by [`StageName`].
type States = [Option<Vec<u8>>; STAGES];

/// Destination of a run's checkpoints, and the checkpoint from which the run starts.
#[derive(Debug)]
pub struct Checkpoints {
    /// Job and file of the checkpoints; `None` writes no checkpoints.
    place: Option<Destination>,
    from: Option<Stored>,
    path: Option<PathBuf>,
    /// Whether a checkpoint exists, so that an unfinished film is kept.
    kept: Arc<AtomicBool>,
}

#[derive(Debug)]
struct Destination {
    path: PathBuf,
    every: Duration,
    job: FilmJob,
    progress: Mutex<CheckpointProgress>,
}

#[derive(Debug)]
struct CheckpointProgress {
    /// Time at which a frame was last marked for a checkpoint.
    last: Instant,
    /// Last frame of a run that ends before its film does.
    ends_after: Option<u32>,
    /// Number of states in a complete checkpoint.
    expected: usize,
    waiting: BTreeMap<u32, States>,
    /// First failure to write a checkpoint, until it is reported.
    failure: Option<Error>,
}

impl Checkpoints {
    /// Returns checkpoints that write no files and start the film at its first frame.
    #[must_use]
    pub fn off() -> Self {
        Self { place: None, from: None, path: None, kept: Arc::default() }
    }

    /// Returns the checkpoints of a film that starts at its first frame. A checkpoint is written next to the film at
    /// every interval `every`, or after each frame if the interval is zero. Starting the first frame removes the
    /// checkpoint of an earlier run.
    #[must_use]
    pub fn new(job: &FilmJob, every: Option<Duration>) -> Self {
        let path = path_for(job.film());
        // Exclude streams: they cannot be truncated later.
        let is_file = !is_stream(job.film());
        let place = every.filter(|_| is_file).map(|every| Destination::new(path.clone(), job, every));
        Self { place, from: None, path: Some(path), kept: Arc::default() }
    }

    /// Continues from the checkpoint next to the film. Without one, the film starts at its first frame.
    ///
    /// # Errors
    /// If the checkpoint is damaged, or belongs to another scene, program version or settings.
    pub fn resume(job: &FilmJob, every: Option<Duration>) -> Result<Self> {
        let path = path_for(job.film());
        if !path.exists() {
            return Ok(Self::new(job, every));
        }
        let stored = Stored::read(&path)?;
        // Refuse a checkpoint of another job: the resumed film would differ from an uninterrupted one.
        if let Some(difference) = stored.identity.difference(job.identity()) {
            return Err(Error::Checkpoint(format!(
                "{} cannot be resumed: {difference}; use the same options, or restart with --overwrite instead of --resume",
                path.display()
            )));
        }
        // Start again if the earlier run wrote no state.
        let Some(last) = stored.frame else { return Ok(Self::new(job, every)) };
        // Refuse to shorten a film: coded frames cannot be removed again.
        let done = last.saturating_add(1);
        if let Some(end) = job.end().filter(|&end| end < done) {
            return Err(Error::Checkpoint(format!(
                "{}: {done} frames are done, not {end}: increase --frames, or restart with --overwrite instead of --resume",
                path.display()
            )));
        }
        let place = every.map(|every| Destination::new(path.clone(), job, every));
        Ok(Self { place, from: Some(stored), path: Some(path), kept: Arc::new(AtomicBool::new(true)) })
    }

    /// Returns the last finished frame; `None` at the start of a film.
    #[must_use]
    pub fn last_frame(&self) -> Option<u32> {
        self.from.as_ref()?.frame
    }

    /// Returns the state of a stage after [`Checkpoints::last_frame`]; empty if the stage has none.
    #[must_use]
    pub fn state(&self, stage: StageName) -> &[u8] {
        self.from.as_ref().map_or(&[], |stored| &stored.states[stage as usize])
    }

    /// Adds the checkpoint's path to the error of a stage that could not restore its state. Returns errors with a path
    /// unchanged.
    pub(super) fn named(&self, error: Error) -> Error {
        match (&self.path, error) {
            (_, error @ (Error::File { .. } | Error::Content { .. })) | (None, error) => error,
            (Some(path), error) => Error::Context { context: path.display().to_string(), source: error.into() },
        }
    }

    /// Returns a flag that is true while a checkpoint exists.
    pub(super) fn kept(&self) -> Arc<AtomicBool> {
        self.kept.clone()
    }

    /// Returns a warning about a checkpoint that could not be written, only once. The film continues, and the previous
    /// checkpoint remains.
    #[must_use]
    pub fn take_warning(&self) -> Option<String> {
        let failure = self.place.as_ref()?.lock().failure.take()?;
        Some(format!("{}; the film continues without it", failure.chain()))
    }

    /// Sets the number of states, which depends on `masking`, and removes the checkpoint of an earlier run. The driver
    /// calls this before the first frame, after it has opened the film's file.
    ///
    /// # Errors
    /// If the earlier checkpoint cannot be removed.
    pub(super) fn begin(&self, masking: bool) -> Result<()> {
        // Remove the checkpoint of an earlier film, but keep the one that this run resumes.
        if let Some(path) = self.path.as_ref().filter(|_| self.from.is_none()) {
            remove(path)?;
        }
        if let Some(place) = &self.place {
            place.lock().expected = if masking { STAGES } else { STAGES - 1 };
        }
        Ok(())
    }

    /// Returns whether a checkpoint is due after the frame that starts now. Call this function once per frame.
    pub(super) fn is_due(&self) -> bool {
        let Some(place) = &self.place else { return false };
        let mut progress = place.lock();
        // Measure the interval between marked frames, independent of the time to write a checkpoint.
        let due = progress.last.elapsed() >= place.every;
        if due {
            progress.last = Instant::now();
        }
        due
    }

    /// Requests a checkpoint after the last frame of a film with `end` frames. A longer film can continue from it.
    pub fn leave_at_end(&self, end: u32) {
        if let Some(place) = &self.place {
            place.lock().ends_after = end.checked_sub(1);
        }
    }

    /// Records that the run ends early, before frame `next`. Call this before the first stage ends its output. A run
    /// that started with frame `first` and made no frame leaves no checkpoint.
    pub(super) fn end_before(&self, next: u32, first: u32) {
        if let Some(place) = self.place.as_ref().filter(|_| next > first) {
            place.lock().ends_after = Some(next - 1);
        }
    }

    /// Returns whether a stage that ends after `frame` must store its state, because the run ended early and can be
    /// resumed there.
    pub(super) fn ends_after(&self, frame: u32) -> bool {
        self.place.as_ref().is_some_and(|place| place.lock().ends_after == Some(frame))
    }

    /// Stores the state of a stage after `frame`, and writes the checkpoint if this state completes it. If writing
    /// fails, the previous checkpoint remains, and [`take_warning`](Self::take_warning) returns the error.
    pub(super) fn leave(&self, frame: u32, stage: StageName, state: Vec<u8>) {
        let Some(place) = &self.place else { return };
        let mut progress = place.lock();

        // Wait until every stage has stored its state after this frame.
        let expected = progress.expected;
        let states = progress.waiting.entry(frame).or_default();
        states[stage as usize] = Some(state);
        let whole = states.iter().flatten().count() == expected;
        let Some(states) = whole.then(|| progress.waiting.remove(&frame)).flatten() else { return };

        // Write under the lock, so that checkpoints are written in frame order.
        let states = states.map(Option::unwrap_or_default).to_vec();
        match (Stored { identity: place.job.identity().clone(), frame: Some(frame), states }.write(&place.path)) {
            Ok(()) => {
                self.kept.store(true, Ordering::Relaxed);
                tracing::info!("checkpoint after frame {frame}");
            }
            Err(error) => progress.failure = Some(error),
        }
    }

    /// Returns a function that permits `--resume` for a run that ends before its first checkpoint: the resumed film
    /// then starts at its first frame and replaces the incomplete one. The function has no effect if a checkpoint
    /// exists or checkpoints are off.
    pub fn restart(&self) -> impl Fn() -> Result<()> + Send + 'static {
        let job = self.place.as_ref().map(|place| (place.path.clone(), place.job.identity().clone()));
        let kept = self.kept();
        move || match &job {
            Some((path, identity)) if !kept.load(Ordering::Relaxed) => {
                let states = vec![Vec::new(); STAGES];
                Stored { identity: identity.clone(), frame: None, states }.write(path)
            }
            _ => Ok(()),
        }
    }

    /// Removes the checkpoint of a finished film.
    pub fn remove(self) {
        // Ignore a failure, because the film is already complete.
        self.path.iter().for_each(|path| drop(remove(path)));
    }
}

impl Destination {
    fn new(path: PathBuf, job: &FilmJob, every: Duration) -> Self {
        let progress = CheckpointProgress {
            last: Instant::now(),
            ends_after: None,
            expected: STAGES,
            waiting: BTreeMap::new(),
            failure: None,
        };
        Self { path, every, job: job.clone(), progress: Mutex::new(progress) }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, CheckpointProgress> {
        // Ignore lock poisoning: a panic leaves this data consistent.
        self.progress.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// Removes a checkpoint, and the incomplete checkpoint of a killed run.
fn remove(path: &Path) -> Result<()> {
    for path in [path, &part_of(path)] {
        match std::fs::remove_file(path) {
            // Ignore a missing file: usually only one of the two exists, or none.
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::file(path, "cannot be removed")(error));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Returns the path of the checkpoint of the film at `output`: `film.m2v` → `film.m2v.checkpoint`.
#[must_use]
pub fn path_for(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".checkpoint");
    output.with_file_name(name)
}
