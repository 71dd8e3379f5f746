//! Outputs that are no ordinary files, and folders for those that are.

use crate::error::{Error, Result};
use std::fs;
use std::path::Path;

/// Whether this is standard output by any of its names.
#[must_use]
pub fn is_standard_output(path: &Path) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"].iter().any(|name| path == Path::new(name))
}

/// Whether this is standard output, a device or a pipe: written directly, never continued, and with nothing beside it.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    is_standard_output(path) || fs::metadata(path).is_ok_and(|metadata| !metadata.is_file())
}

/// Makes a folder for files, if it is not there.
///
/// # Errors
/// A file has its name, or the system refuses it.
pub fn make_folder(path: &Path) -> Result<()> {
    if path.is_file() {
        return Err(Error::content(path, " is a file, not a folder; choose another name"));
    }
    fs::create_dir_all(path).map_err(Error::file(path, "cannot be made"))
}
