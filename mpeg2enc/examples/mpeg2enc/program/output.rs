//! The output: a file that has its name only once it is whole, or a stream.

use anyhow::{Context, Result};
use std::{
    fs::{self, File},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

/// Bytes of a stream on their way.
pub struct Output<'a> {
    writer: BufWriter<Box<dyn Write + Send + 'a>>,
    name: String,
    /// The file being written, and the one that it becomes.
    part: Option<(PathBuf, PathBuf)>,
}

/// Whether this is standard output by any of its names.
fn is_standard_output(path: &Path) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"].iter().any(|name| path == Path::new(name))
}

/// Whether this is a pipe, a device or a standard stream, which cannot begin again.
pub fn is_stream(path: &Path) -> bool {
    // These names lead to open files: their true names are unknown, so that nothing can take their places.
    let is_open = ["/dev/stdin", "/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"];
    path == Path::new("-")
        || is_open.iter().any(|start| path.starts_with(start))
        || fs::metadata(path).is_ok_and(|metadata| !metadata.is_file())
}

impl<'a> Output<'a> {
    /// Begins to write. A file is named `NAME.part` until [`finish`](Self::finish) gives it its name. Standard output is `standard`, if
    /// that is free.
    pub fn create(path: &Path, standard: Option<&'a mut (dyn Write + Send)>) -> Result<Self> {
        let name = path.display().to_string();
        let fail = |path: &Path| format!("{} cannot be written", path.display());
        let (writer, part): (Box<dyn Write + Send>, _) = match standard.filter(|_| is_standard_output(path)) {
            Some(standard) => (Box::new(standard), None),
            // An open file may have contents already: nothing of it is cut off.
            None if is_stream(path) => {
                (Box::new(File::options().append(true).open(path).with_context(|| fail(path))?), None)
            }
            None => {
                // A link stays: the file that it leads to is replaced.
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

    /// All is written: the file gets its name.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        match self.part.take() {
            Some((part, target)) => {
                fs::rename(&part, &target).with_context(|| format!("{} cannot become {}", part.display(), self.name))
            }
            None => Ok(()),
        }
    }

    /// Something is missing: the file keeps its ending, and this is its name. `None` for streams.
    pub fn abandon(mut self) -> Result<Option<PathBuf>> {
        self.flush()?;
        Ok(self.part.take().map(|(part, _)| part))
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.flush().with_context(|| format!("{} cannot be written", self.name))
    }
}

impl Drop for Output<'_> {
    /// A file that is neither finished nor abandoned is worth nothing.
    fn drop(&mut self) {
        if let Some((part, _)) = &self.part {
            let _ = fs::remove_file(part);
        }
    }
}
