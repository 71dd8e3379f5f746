//! Errors of live pictures and their server.

use std::net::SocketAddr;

/// Result of live pictures.
pub type LiveResult<T> = Result<T, LiveError>;

/// Error of live pictures or their server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// The renderer or the encoder does not support the settings.
    #[error(transparent)]
    Film(#[from] render2mpeg::Error),
    /// A file cannot be written.
    #[error(transparent)]
    Pipeline(#[from] pipeline::Error),
    /// The server cannot listen at the address.
    #[error("cannot listen at {address}: {source}; choose another address with --listen")]
    Listen {
        /// Requested address.
        address: SocketAddr,
        /// Cause.
        source: std::io::Error,
    },
    /// The system refuses a resource of the server.
    #[error("cannot start {what}: {source}")]
    System {
        /// Resource, such as a thread.
        what: &'static str,
        /// Cause.
        source: std::io::Error,
    },
    /// The token contains characters that a link cannot contain as they are.
    #[error("--token: use 8 to 64 letters, digits, - and _")]
    WrongToken,
    /// The system has no source of random numbers for the token.
    #[error("cannot make a random token: {0}; set one with --token")]
    Token(getrandom::Error),
    /// The thread that makes the light of the scene has failed.
    #[error("the light of the scene cannot be made")]
    Light,
    /// The number of pictures exceeds its range.
    #[error("a stream has at most 2^32 pictures")]
    TooManyPictures,
}
