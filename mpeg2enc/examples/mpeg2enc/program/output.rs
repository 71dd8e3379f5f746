//! Output: a file that receives its final name when complete, or a stream.

use anyhow::{Context, Result};
use std::{
    fs::{self, File},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

/// An open output.
pub struct Output<'a> {
    writer: BufWriter<Box<dyn Write + Send + 'a>>,
    name: String,
    /// Path of the temporary file, and its final path.
    part: Option<(PathBuf, PathBuf)>,
}

/// Returns whether `path` is standard output, under any of its names.
fn is_standard_output(path: &Path) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"].iter().any(|name| path == Path::new(name))
}

/// Returns whether `path` is a pipe, a device or a standard stream. None of them can be rewritten from the beginning.
pub fn is_stream(path: &Path) -> bool {
    // These names refer to open files of unknown path, which no other file can replace.
    let is_open = ["/dev/stdin", "/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"];
    path == Path::new("-")
        || is_open.iter().any(|start| path.starts_with(start))
        || fs::metadata(path).is_ok_and(|metadata| !metadata.is_file())
}

impl<'a> Output<'a> {
    /// Opens the output. A file is named `NAME.part` until [`finish`](Self::finish) renames it. `standard` is standard output, if
    /// available.
    pub fn create(path: &Path, standard: Option<&'a mut (dyn Write + Send)>) -> Result<Self> {
        let name = path.display().to_string();
        let fail = |path: &Path| format!("{} cannot be written", path.display());
        let (writer, part): (Box<dyn Write + Send>, _) = match standard.filter(|_| is_standard_output(path)) {
            Some(standard) => (Box::new(standard), None),
            // An open file may already have contents, so do not truncate it.
            None if is_stream(path) => {
                (Box::new(File::options().append(true).open(path).with_context(|| fail(path))?), None)
            }
            None => {
                // Keep a symbolic link and replace its target.
                let target = fs::canonicalize(path).unwrap_or_else(|_| path.into());
                let mut part = target.clone().into_os_string();
                part.push(".part");
                let part = PathBuf::from(part);
                (Box::new(File::create(&part).with_context(|| fail(&part))?), Some((part, target)))
            }
        };
        Ok(Self { writer: BufWriter::new(writer), name, part })
    }

    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.writer.write_all(bytes).with_context(|| format!("{} cannot be written", self.name))
    }

    /// Renames the complete file to its final path.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        match self.part.take() {
            Some((part, target)) => fs::rename(&part, &target)
                .with_context(|| format!("{} cannot be renamed to {}", part.display(), self.name)),
            None => Ok(()),
        }
    }

    /// Keeps an incomplete file under its temporary path and returns that path; `None` for streams.
    pub fn abandon(mut self) -> Result<Option<PathBuf>> {
        self.flush()?;
        Ok(self.part.take().map(|(part, _)| part))
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.flush().with_context(|| format!("{} cannot be written", self.name))
    }
}

impl Drop for Output<'_> {
    /// Deletes a file that is neither finished nor abandoned.
    fn drop(&mut self) {
        if let Some((part, _)) = &self.part {
            let _ = fs::remove_file(part);
        }
    }
}
