//! Ending a file from another thread, while the one that writes it may be busy for long.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// State of a file that both threads know.
#[derive(Debug)]
pub(crate) struct Tail {
    /// Whether more may be written: not after an end.
    pub is_open: bool,
    /// Bytes that make the file whole, after those that are written.
    pub ending: Vec<u8>,
}

impl Tail {
    /// Of a file that is empty.
    pub fn of_nothing() -> Arc<Mutex<Self>> {
        Arc::new(Mutex::new(Self { is_open: true, ending: Vec::new() }))
    }
}

/// Takes a tail, which is valid at any time, also after a panic elsewhere.
pub(crate) fn held(tail: &Mutex<Tail>) -> MutexGuard<'_, Tail> {
    tail.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Completes an [`Output`](crate::output::Output) from another thread at once; what is written to it afterwards fails.
#[derive(Clone, Debug)]
pub struct EarlyEnd {
    path: PathBuf,
    part: Option<PathBuf>,
    tail: Arc<Mutex<Tail>>,
}

impl EarlyEnd {
    /// The early end of the file at `path`, which is written at `part` until it is whole.
    pub(crate) fn new(path: &Path, part: Option<PathBuf>, tail: Arc<Mutex<Tail>>) -> Self {
        Self { path: path.into(), part, tail }
    }

    /// Appends the bytes that make the file whole and gives it its name, unless it has that already. What holds nothing, or is no
    /// file, stays as it is. Tells whether there is a file now.
    ///
    /// # Errors
    /// The file cannot be written or renamed.
    pub fn end(&self) -> Result<bool> {
        // Held to the end: a write that is under way comes first, and none comes after it.
        let mut tail = held(&self.tail);
        let Some(part) = self.part.as_ref().filter(|_| tail.is_open) else { return Ok(false) };
        tail.is_open = false;
        let context = |error| Error::file(&self.path, "cannot be completed")(error);
        let mut file = File::options().append(true).open(part).map_err(context)?;
        if file.metadata().map_err(context)?.len() == 0 && tail.ending.is_empty() {
            return Ok(false);
        }
        file.write_all(&tail.ending).map_err(context)?;
        file.sync_all().map_err(context)?;
        fs::rename(part, &self.path).map_err(context)?;
        Ok(true)
    }
}
