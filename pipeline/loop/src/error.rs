//! Errors of the loop, its stages and its files.
//!
//! [`Error`] names in one line the failed action, the file or option, and a remedy. Causes are available through
//! [`source`](std::error::Error::source); [`Error::chain`] joins all messages with ": ".

use std::io;
use std::path::{Path, PathBuf};

/// Underlying error, from another library or the caller's code.
pub type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Result with the error type of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option is out of range, or two options contradict each other. The text contains the option's name on the
    /// command line and a valid value.
    #[error("{0}")]
    Options(String),
    /// The operating system refused to open, read or write a file or folder.
    #[error("{} {problem}", path.display())]
    File {
        /// Path of the file or folder.
        path: PathBuf,
        /// Description of the failure, appended to the path, with the remedy if one exists.
        problem: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A file was read, but its content is invalid or unexpected.
    #[error("{}{problem}", path.display())]
    Content {
        /// Path of the file or folder.
        path: PathBuf,
        /// Description of the problem with leading punctuation, appended to the path.
        problem: String,
        /// Error of another library, if any.
        source: Option<Cause>,
    },
    /// A checkpoint is damaged or belongs to another run; the text describes how to restart.
    #[error("{0}")]
    Checkpoint(String),
    /// The ranks of a film disagree. Every rank returns this error.
    #[error("{0}")]
    Ranks(String),
    /// A stage of the loop panicked, or an invariant of this crate is violated.
    #[error("{0}")]
    Fault(String),
    /// Another error, with a description of the failed action.
    #[error("{context}")]
    Context {
        /// Description of the failed action.
        context: String,
        /// Error that caused the failure.
        source: Cause,
    },
    /// Error from another library or from the caller's code.
    #[error(transparent)]
    Other(Cause),
}

impl Error {
    /// Wraps an error of the caller's code, such as a renderer, an encoder or an observer.
    #[must_use]
    pub fn other(error: impl Into<Cause>) -> Self {
        Self::Other(error.into())
    }

    /// Returns the message and the messages of all causes, joined by ": ", in one line.
    #[must_use]
    pub fn chain(&self) -> String {
        chain(self)
    }

    /// Returns a function for `map_err` that makes an [`Error::File`] from an operating-system error.
    pub fn file(path: &Path, problem: &str) -> impl FnOnce(io::Error) -> Self {
        |source| Self::File { path: path.into(), problem: problem.into(), source }
    }

    /// Returns an error for unexpected content of a file. `problem` is appended to the path, with leading punctuation.
    #[must_use]
    pub fn content(path: &Path, problem: impl Into<String>) -> Self {
        Self::Content { path: path.into(), problem: problem.into(), source: None }
    }
}

/// Returns the message of `error` and the messages of all causes, joined by ": ", in one line.
#[must_use]
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}

impl From<Cause> for Error {
    fn from(error: Cause) -> Self {
        Self::Other(error)
    }
}

impl From<serde_json::Error> for Error {
    fn from(error: serde_json::Error) -> Self {
        Self::other(error)
    }
}

/// Adds the failed action to an error of any type.
pub trait Context<T> {
    /// Wraps the error, if any, in [`Error::Context`].
    ///
    /// # Errors
    /// Returns an error with the message `context` and the original error as its cause.
    fn context(self, context: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Cause>> Context<T> for Result<T, E> {
    fn context(self, context: impl Into<String>) -> Result<T> {
        self.map_err(|error| Error::Context { context: context.into(), source: error.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_names_the_file_and_every_cause() {
        let denied = io::Error::from(io::ErrorKind::PermissionDenied);
        let error = Error::file(Path::new("a.m2v"), "cannot be written; choose another path with -o")(denied);
        assert_eq!(error.to_string(), "a.m2v cannot be written; choose another path with -o");
        assert_eq!(error.chain(), "a.m2v cannot be written; choose another path with -o: permission denied");
        let error = Err::<(), _>(error).context("the film").unwrap_err();
        assert!(error.chain().starts_with("the film: a.m2v cannot be written"), "{}", error.chain());
        assert_eq!(Error::other("the disk is full").chain(), "the disk is full");
    }

    #[test]
    fn errors_cross_threads() {
        fn check<T: std::error::Error + Send + Sync + 'static>() {}
        check::<Error>();
    }
}
