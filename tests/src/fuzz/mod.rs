//! Changes scenes and checkpoints by their structure, and checks the program's response.
//!
//! A case is a function of a seed and a number, so it can be repeated. A [`Draft`] is a real scene: document, binary chunk
//! and settings. [`mutate`] changes it, [`Film`] runs the program on it, and [`Verdict`] judges the run. [`Forger`] does the
//! same for checkpoints.

mod case;
mod checkpoint;
mod draft;
mod film;
mod mutate;
mod seeds;
mod verdict;

pub use case::{Case, Finding, Fuzzer};
pub use checkpoint::Forger;
pub use draft::Draft;
pub use film::{Film, Outcome};
pub use mutate::mutate;
pub use seeds::{own_seeds, seeds_below};
pub use verdict::Verdict;
