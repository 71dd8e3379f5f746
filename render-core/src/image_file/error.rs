//! Errors of image files.

#[cfg(any(feature = "exr", feature = "textures"))]
use std::path::Path;
use std::path::PathBuf;

/// An error while an image is read or written; the message begins with the path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageFileError {
    /// The operating system refuses access.
    #[error("{}: {error}", path.display())]
    System {
        /// Path of the image.
        path: PathBuf,
        /// The system's reason.
        error: std::io::Error,
    },
    /// The file is damaged or in another format than its name indicates, or the system fails during access.
    #[error("{}: {error}", path.display())]
    Format {
        /// Path of the image.
        path: PathBuf,
        /// The decoder's or encoder's reason.
        error: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The image has more pixels than the limit.
    #[error("{}: {width}x{height} pixels are more than this program takes", path.display())]
    TooLarge {
        /// Path of the image.
        path: PathBuf,
        /// Width \[pixels\] in the header.
        width: usize,
        /// Height \[pixels\] in the header.
        height: usize,
    },
    /// The file's extension is not a known format of radiance images.
    #[error("{}: radiances are read from .hdr and .exr files", path.display())]
    UnknownEnding {
        /// Path of the image.
        path: PathBuf,
    },
    /// This build lacks the format.
    #[error("{}: this build does not read .{ending}; build it with the feature {feature}", path.display())]
    LeftOut {
        /// Path of the image.
        path: PathBuf,
        /// Extension of the file, in lower case.
        ending: String,
        /// The feature that reads the format.
        feature: &'static str,
    },
}

#[cfg(any(feature = "exr", feature = "textures"))]
impl ImageFileError {
    /// Returns a function for `map_err` that makes a [`System`](Self::System) error.
    pub(super) fn system(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |error| Self::System { path: path.into(), error }
    }

    /// Returns a function for `map_err` that makes a [`Format`](Self::Format) error.
    pub(super) fn format<E: std::error::Error + Send + Sync + 'static>(path: &Path) -> impl FnOnce(E) -> Self {
        |error| Self::Format { path: path.into(), error: error.into() }
    }
}
