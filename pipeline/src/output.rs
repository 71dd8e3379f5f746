//! Files that are either whole or not there.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A file that is written under `NAME.part` and gets its name when it is finished.
///
/// Dropped before that, it leaves nothing behind. Killed, the process leaves the part: for video, a prefix that plays.
/// Devices and pipes are written directly.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    part: Option<PathBuf>,
    file: File,
    /// Bytes written so far.
    length: u64,
}

impl Output {
    /// Opens the file for writing, before any work is done for it.
    ///
    /// # Errors
    /// The folder does not exist or may not be written to.
    pub fn create(path: &Path) -> Result<Self> {
        let direct = fs::metadata(path).is_ok_and(|metadata| !metadata.is_file());
        let part = (!direct).then(|| part_of(path));
        let target = part.as_deref().unwrap_or(path);
        let file = File::options()
            .write(true)
            .create(!direct)
            .truncate(!direct)
            .open(target)
            .map_err(Error::file(path, "cannot be written; choose another place with -o"))?;
        Ok(Self { path: path.to_owned(), part, file, length: 0 })
    }

    /// Opens what an earlier process has left of the file, and goes on after its first `length` bytes.
    ///
    /// # Errors
    /// There is not as much of it, or it may not be written to.
    pub fn resume(path: &Path, length: u64) -> Result<Self> {
        let context = |error| Error::file(path, "cannot be continued")(error);
        let part = part_of(path);
        let has_enough = |path: &Path| fs::metadata(path).is_ok_and(|file| file.is_file() && file.len() >= length);
        if !has_enough(&part) {
            // Finished in order, as after Ctrl-C, it has its name already.
            if !has_enough(path) {
                let problem = " is shorter than when it was left: start anew, without --resume";
                return Err(Error::content(&part, problem));
            }
            fs::copy(path, &part).map_err(context)?;
        }
        let mut file = File::options().write(true).open(&part).map_err(context)?;
        file.set_len(length).map_err(context)?;
        file.seek(SeekFrom::End(0)).map_err(context)?;
        Ok(Self { path: path.to_owned(), part: Some(part), file, length })
    }

    /// Bytes written so far.
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Whether nothing was written yet.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Returns when all that was written is on the disk.
    ///
    /// # Errors
    /// The disk is full or gone.
    pub fn sync(&self) -> Result<()> {
        match self.part {
            Some(_) => self.file.sync_data().map_err(Error::file(&self.path, "cannot be written")),
            None => Ok(()),
        }
    }

    /// Appends `bytes`.
    ///
    /// # Errors
    /// The disk is full or gone.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.length += bytes.len() as u64;
        self.file.write_all(bytes).map_err(Error::file(&self.path, "cannot be written further"))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// The written file cannot be kept.
    pub fn finish(mut self) -> Result<()> {
        let context = |error| Error::file(&self.path, "cannot be completed")(error);
        if let Some(part) = &self.part {
            self.file.sync_all().map_err(context)?;
            fs::rename(part, &self.path).map_err(context)?;
        } else {
            self.file.flush().map_err(context)?;
        }
        self.part = None;
        Ok(())
    }
}

/// `film.m2v` → `film.m2v.part`.
pub(crate) fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    path.with_file_name(name)
}

impl Drop for Output {
    fn drop(&mut self) {
        if let Some(part) = &self.part {
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
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing half-written stays");
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
        fs::write(folder.path().join("a.m2v.part"), b"abcdef").unwrap();
        let mut output = Output::resume(&path, 4).unwrap();
        output.write(b"xy").unwrap();
        assert_eq!(output.len(), 6);
        output.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"abcdxy");
        // Now it has its name, and its first bytes can be continued all the same.
        let mut output = Output::resume(&path, 1).unwrap();
        output.write(b"z").unwrap();
        output.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"az");
        assert!(Output::resume(&path, 3).err().unwrap().to_string().contains("start anew"));
    }

    #[test]
    fn errors_name_the_file() {
        let message = |path: &str| Output::create(Path::new(path)).err().unwrap().chain();
        assert!(message("/no/such/folder/a.m2v").contains("/no/such/folder/a.m2v"));
    }
}
