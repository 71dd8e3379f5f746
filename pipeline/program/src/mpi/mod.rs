//! Ranks as MPI processes that `mpirun` started.

mod post;
mod processes;
mod waiting;

pub use processes::{Processes, abort};
