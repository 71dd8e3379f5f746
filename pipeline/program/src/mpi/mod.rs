//! Ranks as MPI processes, started by mpirun.

mod post;
mod processes;
mod waiting;

pub use processes::{Processes, abort};
