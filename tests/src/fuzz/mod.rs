//! Scenes and checkpoints that are changed by what they mean, and what the program has to do with them.
//!
//! A case is a function of a seed and a number, so that each can be repeated. A [`Draft`] is a real scene as a document, its
//! binary part and its settings. [`mutate`] changes it, [`Film`] is the run of the program on it, and [`Verdict`] says whether
//! that kept its promises. [`Forger`] does the same for checkpoints.

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
