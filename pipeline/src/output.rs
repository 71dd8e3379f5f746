//! Files that are either whole or not there.

use anyhow::{Context, Result};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A file that is written under `NAME.part` and gets its name when it is finished.
///
/// Dropped before that, it leaves nothing behind. Killed, the process leaves the part: for video, a prefix that plays.
/// Devices and pipes are written directly.
pub struct Output {
    path: PathBuf,
    part: Option<PathBuf>,
    file: File,
}

impl Output {
    /// Opens the file for writing, before any work is done for it.
    ///
    /// # Errors
    /// The folder does not exist or may not be written to.
    pub fn create(path: &Path) -> Result<Self> {
        let direct = fs::metadata(path).is_ok_and(|metadata| !metadata.is_file());
        let part = (!direct).then(|| {
            let mut name = path.file_name().unwrap_or_default().to_owned();
            name.push(".part");
            path.with_file_name(name)
        });
        let target = part.as_deref().unwrap_or(path);
        let file = File::options()
            .write(true)
            .create(!direct)
            .truncate(!direct)
            .open(target)
            .with_context(|| format!("{} cannot be written; choose another place with -o", path.display()))?;
        Ok(Self { path: path.to_owned(), part, file })
    }

    /// Appends `bytes`.
    ///
    /// # Errors
    /// The disk is full or gone.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).with_context(|| format!("{} cannot be written further", self.path.display()))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// What was written cannot be kept.
    pub fn finish(mut self) -> Result<()> {
        let context = || format!("{} cannot be completed", self.path.display());
        if let Some(part) = &self.part {
            self.file.sync_all().with_context(context)?;
            fs::rename(part, &self.path).with_context(context)?;
        } else {
            self.file.flush().with_context(context)?;
        }
        self.part = None;
        Ok(())
    }
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
    fn errors_name_the_file() {
        let message = |path: &str| format!("{:#}", Output::create(Path::new(path)).err().unwrap());
        assert!(message("/no/such/folder/a.m2v").contains("/no/such/folder/a.m2v"));
    }
}
