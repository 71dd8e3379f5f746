//! Failures of the loop, of its parts and of their files.
//!
//! [`Error`] says in one line what failed, where, and what helps. Causes are reached through
//! [`source`](std::error::Error::source); [`Error::chain`] writes all of them in one line, joined by ": ".

use std::io;
use std::path::{Path, PathBuf};

/// An error from another library.
pub type Cause = Box<dyn std::error::Error + Send + Sync>;

/// A result whose error is that of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can fail in this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option is out of its range, or two options contradict each other.
    /// The text names the option as on the command line, and a value that works.
    #[error("{0}")]
    Options(String),
    /// The operating system refuses to open, read or write a file or folder.
    #[error("{} {problem}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The failure, as text after the name, and the remedy if there is one.
        problem: String,
        /// The system's reason.
        source: io::Error,
    },
    /// A file was read and holds something else than expected.
    #[error("{}{problem}", path.display())]
    Content {
        /// The file or folder.
        path: PathBuf,
        /// The problem, as text after the name and with its own punctuation.
        problem: String,
        /// The reason, if another library told one.
        source: Option<Cause>,
    },
    /// A checkpoint does not fit the run, or is damaged; the text says to start anew.
    #[error("{0}")]
    Checkpoint(String),
    /// The ranks of a film do not fit together: every one of them says so.
    #[error("{0}")]
    Ranks(String),
    /// A stage of the loop panicked, or an invariant of this crate does not hold.
    #[error("{0}")]
    Fault(String),
    /// Another error, and what was being done.
    #[error("{context}")]
    Context {
        /// The action that failed.
        context: String,
        /// The reason.
        source: Cause,
    },
    /// An error from another library, or from code of the caller.
    #[error(transparent)]
    Other(Cause),
}

impl Error {
    /// Wraps an error of the caller's own code, such as that of a renderer, an encoder or a receiver of the film.
    #[must_use]
    pub fn other(error: impl Into<Cause>) -> Self {
        Self::Other(error.into())
    }

    /// The message with those of all causes, joined by ": ", in one line.
    #[must_use]
    pub fn chain(&self) -> String {
        chain(self)
    }

    /// Makes a [`Error::File`] of the system's reason; for `map_err`.
    pub fn file(path: &Path, problem: &str) -> impl FnOnce(io::Error) -> Self {
        |source| Self::File { path: path.into(), problem: problem.into(), source }
    }

    /// A file that holds something else than expected; `problem` begins with its punctuation.
    #[must_use]
    pub fn content(path: &Path, problem: impl Into<String>) -> Self {
        Self::Content { path: path.into(), problem: problem.into(), source: None }
    }
}

/// The message of `error` with those of all causes, joined by ": ", in one line.
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
        self.map_err(|error| Error::Context { context: context.into(), source: error.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_names_the_file_and_every_cause() {
        let denied = io::Error::from(io::ErrorKind::PermissionDenied);
        let error = Error::file(Path::new("a.m2v"), "cannot be written; choose another place with -o")(denied);
        assert_eq!(error.to_string(), "a.m2v cannot be written; choose another place with -o");
        assert_eq!(error.chain(), "a.m2v cannot be written; choose another place with -o: permission denied");
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
