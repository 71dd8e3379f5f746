//! Loops of a bake: ranks share their items, and a checkpoint stores the finished ones.
//!
//! A bake is a sequence of loops. Each item depends only on the scene and on earlier loops, so the results have the same
//! bits for any number of ranks, and after a restart.

use pipeline::checkpoint::{FilmJob, Identity};
use pipeline::error::{Error, Result};
use pipeline::sealed::SealedFormat;
use render_core::ranks::{Alone, Portable, Ranks, in_order, share_each};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const FORMAT: SealedFormat =
    SealedFormat { magic: *b"R2MB", version: 1, name: "checkpoint of a bake", remedy: "restart without --resume" };

/// Number of batches of a loop. Checkpoints are written between batches.
const BATCHES: usize = 32;
/// Minimum number of items in a batch, which keep all threads busy.
const LEAST_AT_ONCE: usize = 64;

/// Run of a bake: its ranks, its checkpoint, and its interruption.
pub struct BakeRun<'a> {
    /// Ranks that share the work. All ranks must call [`bake`](super::bake) together.
    pub ranks: Arc<dyn Ranks>,
    /// Checkpoint of the bake; `None` for no checkpoints. Only rank 0 reads and writes it.
    pub checkpoint: Option<BakeCheckpoint>,
    /// Flag that ends the bake at its next batch, with a checkpoint. Only the flag of rank 0 counts.
    pub stop: &'a AtomicBool,
}

impl BakeRun<'_> {
    /// Returns a run of this process alone, without checkpoints.
    #[must_use]
    pub fn alone() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self { ranks: Arc::new(Alone), checkpoint: None, stop: &NEVER }
    }
}

/// File that a bake writes at intervals, and that a later run continues.
#[derive(Debug)]
pub struct BakeCheckpoint {
    path: PathBuf,
    identity: Identity,
    every: Duration,
    stored: Option<StoredLoops>,
}

/// Results of the finished items, by loop.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct StoredLoops {
    loops: Vec<StoredLoop>,
}

/// Results of the first items of a loop.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct StoredLoop {
    /// Number of finished items.
    done: usize,
    /// Results of these items, in order.
    bytes: Vec<u8>,
}

/// Content of a checkpoint.
#[derive(Serialize, Deserialize)]
struct WrittenBake {
    identity: Identity,
    loops: StoredLoops,
}

impl BakeCheckpoint {
    /// Returns a checkpoint next to the file of `job`, written at every interval `every`. With `resume`, the bake
    /// continues from an existing checkpoint; without one, it starts at its first item.
    ///
    /// # Errors
    /// If the checkpoint is damaged, or belongs to another scene, program version or settings.
    pub fn new(job: &FilmJob, every: Duration, resume: bool) -> Result<Self> {
        let path = pipeline::checkpoint::path_for(job.film());
        let identity = job.identity().clone();
        let mut stored = None;
        if resume && path.exists() {
            let read: WrittenBake = FORMAT.read(&path)?;
            if let Some(difference) = read.identity.difference(&identity) {
                let text = format!(" cannot be resumed: {difference}; use the same options, or bake without --resume");
                return Err(Error::content(&path, text));
            }
            stored = Some(read.loops);
        }
        Ok(Self { path, identity, every, stored })
    }

    /// Returns whether the bake continues from a checkpoint.
    #[must_use]
    pub fn is_resumed(&self) -> bool {
        self.stored.is_some()
    }

    /// Removes the checkpoint of a finished bake.
    ///
    /// # Errors
    /// If the file cannot be removed.
    pub fn remove(&self) -> Result<()> {
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(Error::file(&self.path, "cannot be removed")(error))
            }
            _ => Ok(()),
        }
    }

    fn write(&self, loops: StoredLoops) -> Result<()> {
        FORMAT.write(&self.path, &WrittenBake { identity: self.identity.clone(), loops })
    }
}

/// State of the loops of a running bake.
pub(super) struct BakeLoops<'a> {
    run: &'a BakeRun<'a>,
    /// Results so far, without those of a bake that has no checkpoints.
    stored: StoredLoops,
    /// Index of the next loop.
    next: usize,
    /// Time of the last checkpoint.
    last: Instant,
}

/// Reasons for the end of a loop before its last item.
pub(super) enum LoopEnd {
    /// The bake was stopped.
    Stopped,
    /// The checkpoint is invalid or cannot be written.
    Failed(Error),
}

impl From<Error> for LoopEnd {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

impl<'a> BakeLoops<'a> {
    /// Starts the loops of a bake, or continues those in its checkpoint.
    pub fn new(run: &'a BakeRun<'a>) -> Result<Self> {
        // Rank 0 sends the results of its checkpoint, so that all ranks continue with the same items.
        let own = run.checkpoint.as_ref().and_then(|checkpoint| checkpoint.stored.as_ref());
        let own = pipeline::state::encode(&own.cloned().unwrap_or_default());
        let stored = pipeline::state::decode(&run.ranks.broadcast(own))?;
        Ok(Self { run, stored, next: 0, last: Instant::now() })
    }

    /// Returns the ranks that share the work.
    pub fn ranks(&self) -> Arc<dyn Ranks> {
        self.run.ranks.clone()
    }

    /// Runs the next loop over `count` items and returns one result per item. `done` is called with the index of each
    /// finished item.
    pub fn each<T: Portable + Send, S>(
        &mut self,
        count: usize,
        scratch: impl Fn() -> S + Sync + Send,
        compute: impl Fn(&mut S, usize) -> T + Sync,
        done: impl Fn(usize),
    ) -> Result<Vec<T>, LoopEnd> {
        let number = self.next;
        self.next += 1;
        if self.stored.loops.len() <= number {
            self.stored.loops.push(StoredLoop::default());
        }

        // Decode the results of an earlier run.
        let StoredLoop { done: first, bytes } = &self.stored.loops[number];
        let (first, mut left) = (*first, bytes.as_slice());
        let mut results = Vec::with_capacity(count);
        for item in 0..first.min(count) {
            results.push(T::take(&mut left).ok_or_else(invalid)?);
            done(item);
        }
        if first > count || !left.is_empty() {
            return Err(invalid().into());
        }

        // Compute the other items in batches.
        let at_once = count.div_ceil(BATCHES).max(LEAST_AT_ONCE);
        for begin in (first..count).step_by(at_once) {
            let end = (begin + at_once).min(count);
            let item = |scratch: &mut S, place: usize| compute(scratch, begin + place);
            let batch: Vec<T> = share_each(&*self.run.ranks, &in_order(end - begin), 1, &scratch, item).value;
            if self.run.checkpoint.is_some() {
                let stored = &mut self.stored.loops[number];
                batch.iter().for_each(|result| result.put(&mut stored.bytes));
                stored.done = end;
            }
            results.extend(batch);
            (begin..end).for_each(&done);
            self.between_batches()?;
        }
        Ok(results)
    }

    /// Writes a checkpoint if it is due or the bake is stopped.
    fn between_batches(&mut self) -> Result<(), LoopEnd> {
        // All ranks stop at the same batch.
        let own = vec![u8::from(self.run.stop.load(Ordering::Relaxed))];
        let stops = self.run.ranks.broadcast(own) == [1];
        if let Some(checkpoint) = &self.run.checkpoint
            && self.run.ranks.rank() == 0
            && (stops || self.last.elapsed() >= checkpoint.every)
        {
            checkpoint.write(self.stored.clone())?;
            self.last = Instant::now();
        }
        if stops { Err(LoopEnd::Stopped) } else { Ok(()) }
    }
}

/// Returns the error for a checkpoint with results that this bake cannot have.
fn invalid() -> Error {
    Error::Checkpoint("the checkpoint of the bake is invalid: restart without --resume".into())
}
