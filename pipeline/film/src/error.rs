//! Errors in the scene, the options, the encoder, or the loop that makes a film.

pub use pipeline::error::Cause;

use std::io;
use std::path::{Path, PathBuf};

/// Result with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene cannot be loaded.
    #[error(transparent)]
    Scene(#[from] render_core::scene::LoadError),
    /// The encoder does not support the size, rate, quantiser or group of pictures.
    #[error(transparent)]
    Encoder(#[from] mpeg2enc::ConfigError),
    /// An option is out of range, or two options contradict each other. The text names the option as on the command
    /// line, and a valid value.
    #[error("{0}")]
    Options(String),
    /// The film would need more memory than available or allowed.
    #[error(
        "{}: a film of this size takes about {needed} of memory, but {allowed}; choose a smaller --size or a simpler scene",
        path.display()
    )]
    Memory {
        /// Path of the scene.
        path: PathBuf,
        /// Estimated memory, with unit.
        needed: String,
        /// Memory limit, with source and unit.
        allowed: String,
    },
    /// Two pictures or sequences cannot be compared.
    #[error("{0}")]
    Comparison(String),
    /// The caller ended the run before it had a result.
    #[error("interrupted before the first result")]
    Interrupted,
    /// The loop, one of its stages or a file failed.
    #[error(transparent)]
    Loop(pipeline::Error),
}

impl Error {
    /// Wraps an error from another library or from the caller's code.
    #[must_use]
    pub fn other(error: impl Into<Cause>) -> Self {
        Self::Loop(pipeline::Error::other(error))
    }

    /// Returns an error about a violated invariant of this workspace.
    #[must_use]
    pub fn fault(text: impl Into<String>) -> Self {
        Self::Loop(pipeline::Error::Fault(text.into()))
    }

    /// Returns the message and the messages of all causes, joined by ": ", in one line.
    #[must_use]
    pub fn chain(&self) -> String {
        pipeline::error::chain(self)
    }

    /// Returns a function for `map_err` that converts an operating-system error for the file at `path` to an error with
    /// the message `problem`.
    pub fn file(path: &Path, problem: &str) -> impl FnOnce(io::Error) -> Self {
        |source| Self::Loop(pipeline::Error::file(path, problem)(source))
    }

    /// Returns an error for unexpected content of a file. `problem` is appended to the path, with leading punctuation.
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

/// Converts errors of this crate for stages of the loop that use its functions.
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

/// Adds context to an error of another type.
pub trait Context<T> {
    /// Wraps the error, if any, in an error with the message `context`.
    ///
    /// # Errors
    /// Returns an error with the message `context` and the original error as its cause.
    fn context(self, context: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Cause>> Context<T> for Result<T, E> {
    fn context(self, context: impl Into<String>) -> Result<T> {
        Ok(pipeline::error::Context::context(self, context)?)
    }
}
