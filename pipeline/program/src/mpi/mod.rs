//! Ranks that are processes of a message-passing library, under mpirun.

mod post;
mod processes;
mod waiting;

pub use processes::{Processes, abort};
