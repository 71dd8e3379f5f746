//! Light that is computed once, and kept in a file for all films of its scene.
//!
//! [`SectionFile`] is the file, `NAME.slf`. [`fingerprint()`] tells whether a scene still is the one that it was baked from.

mod file;
mod fingerprint;

pub use file::SectionFile;
pub use fingerprint::fingerprint;
