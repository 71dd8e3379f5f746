//! Errors of picture files.

#[cfg(any(feature = "exr", feature = "textures"))]
use std::path::Path;
use std::path::PathBuf;

/// A picture cannot be read or written; the message begins with the path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageFileError {
    /// The operating system refuses.
    #[error("{}: {error}", path.display())]
    System {
        /// The picture.
        path: PathBuf,
        /// The system's reason.
        error: std::io::Error,
    },
    /// The file is damaged, or is not of the format that its name says; or the system fails while it is read or written.
    #[error("{}: {error}", path.display())]
    Format {
        /// The picture.
        path: PathBuf,
        /// The decoder's or encoder's reason.
        error: Box<dyn std::error::Error + Send + Sync>,
    },
    /// More pixels than memory is taken for.
    #[error("{}: {width}x{height} pixels are more than this program takes", path.display())]
    TooLarge {
        /// The picture.
        path: PathBuf,
        /// Pixels in a row, as the header claims.
        width: usize,
        /// Rows, as the header claims.
        height: usize,
    },
    /// The file's name has an ending that stands for no format of radiances.
    #[error("{}: radiances are read from .hdr and .exr files", path.display())]
    UnknownEnding {
        /// The picture.
        path: PathBuf,
    },
    /// This build leaves the format out.
    #[error("{}: this build does not read .{ending}; build it with the feature {feature}", path.display())]
    LeftOut {
        /// The picture.
        path: PathBuf,
        /// The ending of its name, in lower case.
        ending: String,
        /// The feature that reads it.
        feature: &'static str,
    },
}

#[cfg(any(feature = "exr", feature = "textures"))]
impl ImageFileError {
    /// Makes a [`System`](Self::System) error of its reason; for `map_err`.
    pub(super) fn system(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |error| Self::System { path: path.into(), error }
    }

    /// Makes a [`Format`](Self::Format) error of its reason; for `map_err`.
    pub(super) fn format<E: std::error::Error + Send + Sync + 'static>(path: &Path) -> impl FnOnce(E) -> Self {
        |error| Self::Format { path: path.into(), error: error.into() }
    }
}
