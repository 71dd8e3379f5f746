//! Outputs that are not regular files, and folders for regular files.

use crate::error::{Error, Result};
use std::fs;
use std::path::Path;

/// Returns whether `path` names standard output.
#[must_use]
pub fn is_standard_output(path: &Path) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"].iter().any(|name| path == Path::new(name))
}

/// Returns whether `path` is standard output, a device or a pipe. Such outputs are written directly, are never resumed, and
/// have no files next to them.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    is_standard_output(path) || fs::metadata(path).is_ok_and(|metadata| !metadata.is_file())
}

/// Creates the folder `path` unless it exists.
///
/// # Errors
/// If a file has the folder's name, or the system refuses.
pub fn make_folder(path: &Path) -> Result<()> {
    if path.is_file() {
        return Err(Error::content(path, " is a file, not a folder; choose another name"));
    }
    fs::create_dir_all(path).map_err(Error::file(path, "cannot be created"))
}
