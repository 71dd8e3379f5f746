//! Errors of image files.

#[cfg(any(feature = "exr", feature = "textures"))]
use std::path::Path;
use std::path::PathBuf;

/// Error while an image is read or written. The message begins with the path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageFileError {
    /// The operating system refuses access.
    #[error("{}: {error}", path.display())]
    System {
        /// Path of the image.
        path: PathBuf,
        /// Reason reported by the system.
        error: std::io::Error,
    },
    /// The file is damaged or in another format than its name indicates, or the system fails during access.
    #[error("{}: {error}", path.display())]
    Format {
        /// Path of the image.
        path: PathBuf,
        /// Reason reported by the decoder or encoder.
        error: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The image was read, but its content is unexpected.
    #[error("{}: {problem}", path.display())]
    Content {
        /// Path of the image.
        path: PathBuf,
        /// Description of the problem, with a remedy.
        problem: String,
    },
    /// The image has more pixels than the limit.
    #[error("{}: {width}x{height} pixels are more than this program takes", path.display())]
    TooLarge {
        /// Path of the image.
        path: PathBuf,
        /// Width in the header \[pixels\].
        width: usize,
        /// Height in the header \[pixels\].
        height: usize,
    },
    /// The file's extension is not a known format of radiance images.
    #[error("{}: radiances are read from .hdr and .exr files", path.display())]
    UnknownEnding {
        /// Path of the image.
        path: PathBuf,
    },
    /// The build does not support the format.
    #[error("{}: this build does not read .{ending}; build it with the feature {feature}", path.display())]
    LeftOut {
        /// Path of the image.
        path: PathBuf,
        /// Extension of the file name, in lower case.
        ending: String,
        /// Feature that reads the format.
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
