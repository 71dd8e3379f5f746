//! Files that are complete or absent.

use crate::early_end::{EarlyEnd, Tail, held};
use crate::error::{Error, Result};
use crate::streams::{is_standard_output, is_stream};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// File that is written as `NAME.part` and renamed when it is finished.
///
/// The `.part` file is locked during writing, so that no other run writes to the same path. Dropping an unfinished
/// output removes that file unless it is [kept](Output::kept_if). A killed process leaves it behind; for video, it is a
/// playable prefix. Devices, pipes and standard output (named `-`) are written directly.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    part: Option<PathBuf>,
    file: File,
    written: Written,
    sum: crc32fast::Hasher,
    /// Whether the `.part` file of an unfinished output is kept.
    kept: Arc<AtomicBool>,
    /// End of the file, shared with a thread that may end it early.
    tail: Arc<Mutex<Tail>>,
}

/// Length and checksum of a file's bytes, as stored in checkpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Written {
    /// Number of written bytes.
    pub length: u64,
    /// CRC-32 of the written bytes.
    pub sum: u32,
}

impl Output {
    /// Opens the file for writing, before any other work.
    ///
    /// # Errors
    /// If the folder does not exist or cannot be written to, or another run writes to `path`.
    pub fn create(path: &Path) -> Result<Self> {
        // Write streams directly: they can neither be locked nor renamed.
        let problem = || Error::file(path, "cannot be written; choose another path with -o");
        if is_standard_output(path) {
            let file = standard_output().map_err(Error::file(path, "cannot be opened: standard output is closed"))?;
            return Ok(Self::new(Path::new("standard output"), None, file));
        }
        let (part, file) = if is_stream(path) {
            (None, File::options().write(true).open(path).map_err(problem())?)
        } else {
            // Truncate only after locking, because another run may be writing to the file.
            let part = part_of(path);
            let file = locked(path, &part, File::options().write(true).create(true))?;
            file.set_len(0).map_err(problem())?;
            (Some(part), file)
        };
        Ok(Self::new(path, part, file))
    }

    fn new(path: &Path, part: Option<PathBuf>, file: File) -> Self {
        let (written, sum) = (Written::default(), crc32fast::Hasher::new());
        Self { path: path.to_owned(), part, file, written, sum, kept: Arc::default(), tail: Tail::of_nothing() }
    }

    /// Returns a handle to complete the file from another thread while the writing thread is busy.
    #[must_use]
    pub fn early_end(&self) -> EarlyEnd {
        EarlyEnd::new(&self.path, self.part.clone(), self.tail.clone())
    }

    /// Opens the unfinished file of an earlier process, and continues after the first `written` bytes.
    ///
    /// # Errors
    /// If the file is shorter or contains different bytes, if it cannot be written to, or if another run writes to it.
    pub fn resume(path: &Path, written: Written) -> Result<Self> {
        let context = |error| Error::file(path, "cannot be resumed")(error);
        let part = part_of(path);
        let has_enough =
            |path: &Path| fs::metadata(path).is_ok_and(|file| file.is_file() && file.len() >= written.length);

        // Find the bytes written so far, in the `.part` file or under the final name.
        let is_finished = !has_enough(&part);
        if is_finished {
            // Copy a film that already has its final name: it was completed, for example after Ctrl-C.
            if !has_enough(path) {
                let problem = " is shorter than at its checkpoint: restart without --resume";
                return Err(Error::content(&part, problem));
            }
            fs::copy(path, &part).map_err(context)?;
        }
        let mut file = locked(path, &part, File::options().read(true).write(true))?;

        // Compare checksums: a different beginning would silently corrupt the film.
        let sum = sum_of(&mut file, written.length).map_err(context)?;
        if sum.clone().finalize() != written.sum {
            if is_finished {
                let _ = fs::remove_file(&part);
            }
            return Err(Error::content(&part, " differs from its checkpoint: restart without --resume"));
        }

        // Discard the bytes after the checkpoint: they are written again.
        file.set_len(written.length).map_err(context)?;
        file.seek(SeekFrom::End(0)).map_err(context)?;
        let mut output = Self::new(path, Some(part), file);
        (output.written, output.sum) = (written, sum);
        Ok(output)
    }

    /// Sets the flag that keeps the `.part` file if the output is dropped unfinished. A checkpoint refers to that file.
    #[must_use]
    pub fn kept_if(mut self, kept: Arc<AtomicBool>) -> Self {
        self.kept = kept;
        self
    }

    /// Returns the length and checksum of the bytes written so far.
    pub fn written(&self) -> Written {
        Written { sum: self.sum.clone().finalize(), ..self.written }
    }

    /// Waits until all written bytes are on the disk.
    ///
    /// # Errors
    /// If the disk is full or lost, or the `.part` file was removed.
    pub fn sync(&self) -> Result<()> {
        let Some(part) = &self.part else { return Ok(()) };
        // Fail if the file was removed or replaced: no later run could continue it.
        if !is_in_place(&self.file, part) {
            return Err(Error::content(&self.path, ": its .part file was removed or replaced"));
        }
        self.file.sync_data().map_err(Error::file(&self.path, "cannot be written"))
    }

    /// Appends `bytes`.
    ///
    /// # Errors
    /// If the disk is full or lost, or the file was ended early.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.write_before(bytes, Vec::new())
    }

    /// Appends `bytes`. An early end would then append `ending` to complete the file.
    ///
    /// # Errors
    /// If the disk is full or lost, or the file was ended early.
    pub fn write_before(&mut self, bytes: &[u8], ending: Vec<u8>) -> Result<()> {
        let mut tail = held(&self.tail);
        if !tail.is_open {
            return Err(Error::content(&self.path, " was ended early"));
        }
        self.file.write_all(bytes).map_err(Error::file(&self.path, "cannot be written further"))?;
        // Replace the ending only after the bytes that it completes are written.
        tail.ending = ending;
        self.written.length += bytes.len() as u64;
        self.sum.update(bytes);
        Ok(())
    }

    /// Completes the file, and renames it to its final name.
    ///
    /// # Errors
    /// If the file cannot be completed or renamed.
    pub fn finish(mut self) -> Result<()> {
        let tail = self.tail.clone();
        let mut tail = held(&tail);
        if !std::mem::replace(&mut tail.is_open, false) {
            return Err(Error::content(&self.path, " was ended early"));
        }
        let context = |error| Error::file(&self.path, "cannot be completed")(error);
        // Sync before renaming, so that even a power failure leaves no incomplete file under the final name.
        if let Some(part) = &self.part {
            self.file.sync_all().map_err(context)?;
            fs::rename(part, &self.path).map_err(context)?;
        } else {
            self.file.flush().map_err(context)?;
        }
        // Clear the path, so that dropping the output removes nothing.
        self.part = None;
        Ok(())
    }
}

/// Opens standard output as a separate file (on Unix).
#[cfg(unix)]
fn standard_output() -> std::io::Result<File> {
    use std::os::fd::AsFd;
    std::io::stdout().as_fd().try_clone_to_owned().map(File::from)
}

/// Opens standard output as a separate file (on Windows).
#[cfg(windows)]
fn standard_output() -> std::io::Result<File> {
    use std::os::windows::io::AsHandle;
    std::io::stdout().as_handle().try_clone_to_owned().map(File::from)
}

/// Returns whether another run writes to the file at `path` now.
#[must_use]
pub fn is_being_written(path: &Path) -> bool {
    let part = File::options().write(true).open(part_of(path));
    part.is_ok_and(|part| matches!(part.try_lock(), Err(TryLockError::WouldBlock)))
}

/// Opens `part`, and locks it for the file at `path`.
fn locked(path: &Path, part: &Path, options: &fs::OpenOptions) -> Result<File> {
    let problem = || Error::file(path, "cannot be written; choose another path with -o");
    loop {
        let file = options.open(part).map_err(problem())?;
        match file.try_lock() {
            // Try again if another run has renamed the `.part` file between the two calls.
            Ok(()) if is_in_place(&file, part) => return Ok(file),
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let text = " is being written by another run: wait for it to end, or choose another path with -o";
                return Err(Error::content(path, text));
            }
            // Write without a lock on network file systems that do not support locks.
            Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => return Ok(file),
            Err(TryLockError::Error(error)) => return Err(problem()(error)),
        }
    }
}

/// Returns whether `path` still refers to the open `file`.
#[cfg(unix)]
fn is_in_place(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    // Compare device and inode, which remain the same when a file is renamed.
    let identity = |metadata: &fs::Metadata| (metadata.dev(), metadata.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(own), Ok(there)) if identity(&own) == identity(&there))
}

/// Returns true: outside Unix, open files cannot be renamed.
#[cfg(not(unix))]
fn is_in_place(_: &File, _: &Path) -> bool {
    true
}

/// Returns the checksum of the first `length` bytes of `file`, to be updated with later bytes.
fn sum_of(file: &mut File, length: u64) -> std::io::Result<crc32fast::Hasher> {
    let mut sum = crc32fast::Hasher::new();
    let mut first = file.take(length);
    let mut buffer = vec![0; 1 << 16];
    loop {
        match first.read(&mut buffer)? {
            0 => return Ok(sum),
            count => sum.update(&buffer[..count]),
        }
    }
}

/// Returns the path of the unfinished file of `path`: `film.m2v` → `film.m2v.part`.
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    path.with_file_name(name)
}

impl Drop for Output {
    fn drop(&mut self) {
        if let Some(part) = self.part.as_ref().filter(|_| !self.kept.load(Ordering::Relaxed)) {
            let _ = fs::remove_file(part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_finished_has_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.m2v");
        let mut output = Output::create(&path).unwrap();
        output.write(b"abc").unwrap();
        assert!(!path.exists());
        drop(output);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "no unfinished file remains");
        let mut output = Output::create(&path).unwrap();
        output.write(b"abc").unwrap();
        output.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"abc");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_was_left_is_continued_where_it_was_known() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.m2v");
        let written = |bytes: &[u8]| Written { length: bytes.len() as u64, sum: crc32fast::hash(bytes) };
        fs::write(folder.path().join("a.m2v.part"), b"abcdef").unwrap();
        let mut output = Output::resume(&path, written(b"abcd")).unwrap();
        output.write(b"xy").unwrap();
        assert_eq!(output.written(), written(b"abcdxy"));
        output.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"abcdxy");
        // The file has its final name now, but a run can still resume after the first bytes.
        let mut output = Output::resume(&path, written(b"a")).unwrap();
        output.write(b"z").unwrap();
        output.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"az");
        for left in [written(b"azz"), written(b"ay")] {
            let error = Output::resume(&path, left).err().unwrap().to_string();
            assert!(error.contains("restart") && error.contains("a.m2v.part"), "{error}");
            assert_eq!(fs::read(&path).unwrap(), b"az");
        }
    }

    #[test]
    fn one_run_writes_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.m2v");
        let mut first = Output::create(&path).unwrap();
        first.write(b"abc").unwrap();
        for second in
            [Output::create(&path), Output::resume(&path, Written { length: 3, sum: crc32fast::hash(b"abc") })]
        {
            let error = second.err().unwrap().to_string();
            assert!(error.contains("another run") && error.contains("a.m2v"), "{error}");
        }
        first.write(b"de").unwrap();
        first.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"abcde");
        Output::create(&path).unwrap().finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"");
    }

    #[test]
    fn what_a_checkpoint_knows_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.m2v");
        let kept = Arc::new(AtomicBool::new(false));
        for (keeps, stays) in [(false, false), (true, true)] {
            let mut output = Output::create(&path).unwrap().kept_if(kept.clone());
            output.write(b"abc").unwrap();
            kept.store(keeps, Ordering::Relaxed);
            drop(output);
            assert_eq!(part_of(&path).exists(), stays);
        }
    }

    /// Checks that removing the `.part` file during writing is an error: the file could not be renamed.
    #[test]
    #[cfg(unix)]
    fn a_part_that_is_gone_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.m2v");
        let mut output = Output::create(&path).unwrap();
        output.write(b"abc").unwrap();
        output.sync().unwrap();
        fs::remove_file(part_of(&path)).unwrap();
        assert!(output.sync().unwrap_err().to_string().contains("removed"));
    }

    #[test]
    fn errors_name_the_file() {
        let message = |path: &str| Output::create(Path::new(path)).err().unwrap().chain();
        assert!(message("/no/such/folder/a.m2v").contains("/no/such/folder/a.m2v"));
    }
}
