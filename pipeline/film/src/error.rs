//! Failures of a film: of its scene, its options, its encoder, and of the loop that makes it.

pub use pipeline::error::Cause;

use std::io;
use std::path::{Path, PathBuf};

/// A result whose error is that of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can fail in this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene cannot be loaded.
    #[error(transparent)]
    Scene(#[from] render_core::scene::LoadError),
    /// The encoder has no such size, rate, quantiser or group of pictures.
    #[error(transparent)]
    Encoder(#[from] mpeg2enc::ConfigError),
    /// An option is out of its range, or two options contradict each other.
    /// The text names the option as on the command line, and a value that works.
    #[error("{0}")]
    Options(String),
    /// The film would take more memory than there is, or than is allowed.
    #[error(
        "{}: a film of this size takes some {needed} of memory, and {allowed}; choose a smaller --size or a simpler scene",
        path.display()
    )]
    Memory {
        /// The scene.
        path: PathBuf,
        /// The estimate, with its unit.
        needed: String,
        /// Who allows how much, with its unit.
        allowed: String,
    },
    /// Two pictures or sequences cannot be compared.
    #[error("{0}")]
    Comparison(String),
    /// The run was ended by its caller before it had a result.
    #[error("interrupted before anything was measured")]
    Interrupted,
    /// The loop, one of its parts or a file fails.
    #[error(transparent)]
    Loop(pipeline::Error),
}

impl Error {
    /// Wraps an error of another library, or of code of the caller.
    #[must_use]
    pub fn other(error: impl Into<Cause>) -> Self {
        Self::Loop(pipeline::Error::other(error))
    }

    /// An invariant of this workspace that does not hold.
    #[must_use]
    pub fn fault(text: impl Into<String>) -> Self {
        Self::Loop(pipeline::Error::Fault(text.into()))
    }

    /// The message with those of all causes, joined by ": ", in one line.
    #[must_use]
    pub fn chain(&self) -> String {
        pipeline::error::chain(self)
    }

    /// Makes an error of the system's reason to refuse the file at `path`; for `map_err`.
    pub fn file(path: &Path, problem: &str) -> impl FnOnce(io::Error) -> Self {
        |source| Self::Loop(pipeline::Error::file(path, problem)(source))
    }

    /// A file that holds something else than expected; `problem` begins with its punctuation.
    #[must_use]
    pub fn content(path: &Path, problem: impl Into<String>) -> Self {
        Self::Loop(pipeline::Error::content(path, problem))
    }
}

impl From<pipeline::Error> for Error {
    fn from(error: pipeline::Error) -> Self {
        match error {
            pipeline::Error::Options(text) => Self::Options(text),
            error => Self::Loop(error),
        }
    }
}

/// For parts of the loop that are made of this crate's functions.
impl From<Error> for pipeline::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Options(text) => Self::Options(text),
            Error::Loop(error) => error,
            error => Self::other(error),
        }
    }
}

impl From<Cause> for Error {
    fn from(error: Cause) -> Self {
        Self::other(error)
    }
}

impl From<serde_json::Error> for Error {
    fn from(error: serde_json::Error) -> Self {
        Self::other(error)
    }
}

/// Adds what was being done to an error of another kind.
pub trait Context<T> {
    /// Wraps the error, if there is one.
    ///
    /// # Errors
    /// The same one, with `context` before it.
    fn context(self, context: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Cause>> Context<T> for Result<T, E> {
    fn context(self, context: impl Into<String>) -> Result<T> {
        Ok(pipeline::error::Context::context(self, context)?)
    }
}
