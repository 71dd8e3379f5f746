//! Interrupted films can be continued: the state of every part is written now and then, and another process goes on from
//! there, to the same bits.
//!
//! A checkpoint is a cut through the loop after one frame. The driver marks the frame when it is begun, and each part that is
//! done with it leaves its state here; when the last one is there, the file is written, whole or not at all. Parts do not wait
//! for each other: all states are of the same frame, though not of the same time.
//!
//! A run that is ended early (Ctrl-C) leaves the same after its last frame, when the parts come to their ends.
//!
//! Data that follows from scene and settings is not written but made again: the ray tree, photons, direct lights and the
//! picture of the last frame, for which that one frame is prepared once more.

mod file;
mod job;

use crate::error::{Error, Result};
use crate::output::part_of;
use crate::streams::is_stream;
use file::Stored;
pub use job::FilmJob;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The part of the loop that a state belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The light tree.
    Prepare,
    /// The irradiance cache, or the light of a film in which nothing moves.
    Shade,
    /// The exposure; bytes of the uncompressed film.
    Display,
    /// The encoder with the frames that wait in it; bytes of the film; the report up to here.
    Encode,
    /// ΔY; not there in films without masking.
    Mask,
}

const PARTS: usize = 5;

/// States of one frame that are there already.
type States = [Option<Vec<u8>>; PARTS];

/// The place where checkpoints go, and the one that a run begins with.
#[derive(Debug)]
pub struct Checkpoints {
    /// None: nothing is written.
    place: Option<Destination>,
    from: Option<Stored>,
    path: Option<PathBuf>,
    /// Whether there is a checkpoint, so that an unfinished film is worth keeping.
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
    /// When a frame was last marked.
    last: Instant,
    /// The last frame of a run that ends before its film does.
    ends_after: Option<u32>,
    /// States that make up a checkpoint.
    expected: usize,
    waiting: BTreeMap<u32, States>,
    /// The first checkpoint that could not be written, until it is told.
    failure: Option<Error>,
}

impl Checkpoints {
    /// None are written, and the film begins at its beginning.
    #[must_use]
    pub fn off() -> Self {
        Self { place: None, from: None, path: None, kept: Arc::default() }
    }

    /// For a film that begins at its beginning: a checkpoint beside it every so often, and after each frame if that is zero.
    /// The checkpoint of another run is removed when the first frame begins.
    #[must_use]
    pub fn new(job: &FilmJob, every: Option<Duration>) -> Self {
        let path = path_for(job.film());
        // A stream cannot be cut to a length later.
        let is_file = !is_stream(job.film());
        let place = every.filter(|_| is_file).map(|every| Destination::new(path.clone(), job, every));
        Self { place, from: None, path: Some(path), kept: Arc::default() }
    }

    /// Continues from the checkpoint beside the film; from the beginning if there is none.
    ///
    /// # Errors
    /// The checkpoint is damaged, or of another scene, other settings, or another version of the program.
    pub fn resume(job: &FilmJob, every: Option<Duration>) -> Result<Self> {
        let path = path_for(job.film());
        if !path.exists() {
            return Ok(Self::new(job, every));
        }
        let stored = Stored::read(&path)?;
        if let Some(difference) = stored.identity.difference(job.identity()) {
            return Err(Error::Checkpoint(format!(
                "{} cannot be continued: {difference}; give the options of then, or begin anew with --overwrite in place of --resume",
                path.display()
            )));
        }
        let done = stored.frame.saturating_add(1);
        if let Some(end) = job.end().filter(|&end| end < done) {
            return Err(Error::Checkpoint(format!(
                "{}: {done} frames are done, and the film would have {end}: take more --frames, or begin anew with --overwrite in place of --resume",
                path.display()
            )));
        }
        let place = every.map(|every| Destination::new(path.clone(), job, every));
        Ok(Self { place, from: Some(stored), path: Some(path), kept: Arc::new(AtomicBool::new(true)) })
    }

    /// The last frame that is done; none at the beginning.
    #[must_use]
    pub fn last_frame(&self) -> Option<u32> {
        self.from.as_ref().map(|stored| stored.frame)
    }

    /// The state that a part left after [`Checkpoints::last_frame`]; empty where there is none.
    #[must_use]
    pub fn state(&self, part: Part) -> &[u8] {
        self.from.as_ref().map_or(&[], |stored| &stored.states[part as usize])
    }

    /// The error of a part that could not read its state, with the name of the checkpoint. What names a file already stays.
    pub(super) fn named(&self, error: Error) -> Error {
        match (&self.path, error) {
            (_, error @ (Error::File { .. } | Error::Content { .. })) | (None, error) => error,
            (Some(path), error) => Error::Context { context: path.display().to_string(), source: error.into() },
        }
    }

    /// Whether there is a checkpoint, now and later.
    pub(super) fn kept(&self) -> Arc<AtomicBool> {
        self.kept.clone()
    }

    /// A line about a checkpoint that could not be written, once: the film goes on, and the checkpoint before stays.
    #[must_use]
    pub fn take_warning(&self) -> Option<String> {
        let failure = self.place.as_ref()?.lock().failure.take()?;
        Some(format!("{}; the film goes on without it", failure.chain()))
    }

    /// Says whether masking leaves states too. The driver calls this before the first frame, when the film's file is its own: the
    /// checkpoint of another run can go.
    ///
    /// # Errors
    /// That checkpoint cannot be removed.
    pub(super) fn begin(&self, masking: bool) -> Result<()> {
        if let Some(path) = self.path.as_ref().filter(|_| self.from.is_none()) {
            remove(path)?;
        }
        if let Some(place) = &self.place {
            place.lock().expected = if masking { PARTS } else { PARTS - 1 };
        }
        Ok(())
    }

    /// Whether a checkpoint is to be made after the frame that is begun now; called once for each.
    pub(super) fn is_due(&self) -> bool {
        let Some(place) = &self.place else { return false };
        let mut progress = place.lock();
        let due = progress.last.elapsed() >= place.every;
        if due {
            progress.last = Instant::now();
        }
        due
    }

    /// Has a checkpoint made after the last frame of a film whose next one would be `end`: with more frames it goes on from there.
    pub fn leave_at_end(&self, end: u32) {
        if let Some(place) = &self.place {
            place.lock().ends_after = end.checked_sub(1);
        }
    }

    /// Says that the run ends early, before frame `next`; told before the first part hands over nothing more. A run that began
    /// with `first` leaves nothing if it made no frame.
    pub(super) fn end_before(&self, next: u32, first: u32) {
        if let Some(place) = self.place.as_ref().filter(|_| next > first) {
            place.lock().ends_after = Some(next - 1);
        }
    }

    /// Whether a part that has come to its end, with `frame` as its last, is to leave its state: the run was ended early, and
    /// can be continued from here.
    pub(super) fn ends_after(&self, frame: u32) -> bool {
        self.place.as_ref().is_some_and(|place| place.lock().ends_after == Some(frame))
    }

    /// Leaves the state of a part after `frame`, and writes the checkpoint if this was the last one of it. Where that fails, the
    /// checkpoint before stays, and [`take_warning`](Self::take_warning) says so.
    pub(super) fn leave(&self, frame: u32, part: Part, state: Vec<u8>) {
        let Some(place) = &self.place else { return };
        let mut progress = place.lock();
        let expected = progress.expected;
        let states = progress.waiting.entry(frame).or_default();
        states[part as usize] = Some(state);
        let whole = states.iter().flatten().count() == expected;
        let Some(states) = whole.then(|| progress.waiting.remove(&frame)).flatten() else { return };
        // Written under the lock: a later checkpoint never comes before an earlier one.
        let states = states.map(Option::unwrap_or_default).to_vec();
        match (Stored { identity: place.job.identity().clone(), frame, states }.write(&place.path)) {
            Ok(()) => {
                self.kept.store(true, Ordering::Relaxed);
                tracing::info!("checkpoint after frame {frame}");
            }
            Err(error) => progress.failure = Some(error),
        }
    }

    /// Removes the checkpoint: the film is whole.
    pub fn remove(self) {
        self.path.iter().for_each(|path| drop(remove(path)));
    }
}

impl Destination {
    fn new(path: PathBuf, job: &FilmJob, every: Duration) -> Self {
        let progress = CheckpointProgress {
            last: Instant::now(),
            ends_after: None,
            expected: PARTS,
            waiting: BTreeMap::new(),
            failure: None,
        };
        Self { path, every, job: job.clone(), progress: Mutex::new(progress) }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, CheckpointProgress> {
        // A part that panicked has left nothing half-done here.
        self.progress.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// Removes a checkpoint, and one that a killed run had begun to write.
fn remove(path: &Path) -> Result<()> {
    for path in [path, &part_of(path)] {
        match std::fs::remove_file(path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::file(path, "cannot be removed")(error));
            }
            _ => {}
        }
    }
    Ok(())
}

/// `film.m2v` → `film.m2v.checkpoint`.
#[must_use]
pub fn path_for(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".checkpoint");
    output.with_file_name(name)
}
