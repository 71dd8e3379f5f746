//! Early end of a file, from another thread while its writer is busy.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// End of a file, shared by the writing thread and the thread that ends the file early.
#[derive(Debug)]
pub(crate) struct Tail {
    /// Whether more bytes may be written.
    pub is_open: bool,
    /// Bytes that complete the file after the bytes written so far.
    pub ending: Vec<u8>,
}

impl Tail {
    /// Returns the tail of an empty file.
    pub fn of_nothing() -> Arc<Mutex<Self>> {
        Arc::new(Mutex::new(Self { is_open: true, ending: Vec::new() }))
    }
}

/// Locks a tail and ignores poisoning: the tail is valid even after a panic of another thread.
pub(crate) fn held(tail: &Mutex<Tail>) -> MutexGuard<'_, Tail> {
    tail.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Handle that completes an [`Output`](crate::output::Output) at once, from another thread. Later writes to the output
/// fail.
#[derive(Clone, Debug)]
pub struct EarlyEnd {
    path: PathBuf,
    part: Option<PathBuf>,
    tail: Arc<Mutex<Tail>>,
}

impl EarlyEnd {
    /// Returns a handle for the file at `path`, which is written as `part` until it is finished.
    pub(crate) fn new(path: &Path, part: Option<PathBuf>, tail: Arc<Mutex<Tail>>) -> Self {
        Self { path: path.into(), part, tail }
    }

    /// Appends the ending, renames the file to its final name, and returns true. Returns false for a stream and for a
    /// finished or empty file, and leaves them unchanged.
    ///
    /// # Errors
    /// If the file cannot be written or renamed.
    pub fn end(&self) -> Result<bool> {
        // Keep the lock until the end: a write in progress finishes first, and later writes fail.
        let mut tail = held(&self.tail);
        let Some(part) = self.part.as_ref().filter(|_| tail.is_open) else { return Ok(false) };
        tail.is_open = false;
        let context = |error| Error::file(&self.path, "cannot be completed")(error);
        let mut file = File::options().append(true).open(part).map_err(context)?;
        // Leave an empty file unfinished, because a film without frames is not playable.
        if file.metadata().map_err(context)?.len() == 0 && tail.ending.is_empty() {
            return Ok(false);
        }
        file.write_all(&tail.ending).map_err(context)?;
        file.sync_all().map_err(context)?;
        fs::rename(part, &self.path).map_err(context)?;
        Ok(true)
    }
}
