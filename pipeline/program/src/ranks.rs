//! Ranks: processes that `mpirun` started together.

use anyhow::{Result, bail};
use pipeline::team::Team;

/// Environment variables with the number of processes, set by Open MPI, MPICH and schedulers.
const COUNTS: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];
/// Environment variables with the rank of this process, set by Open MPI, MPICH and schedulers.
const RANKS: [&str; 3] = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK"];

fn first_of(names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Returns whether this process must not print: it has a rank above 0, and rank 0 prints the same text.
pub fn is_silent() -> bool {
    first_of(&RANKS).is_some_and(|rank| rank > 0)
}

/// Returns whether `mpirun` started several processes, including this one.
pub fn are_several() -> bool {
    first_of(&COUNTS).is_some_and(|count| count > 1) || is_silent()
}

/// Ranks of a run, including this process.
pub struct Ranks {
    team: Team,
    #[cfg(feature = "mpi")]
    processes: Option<crate::mpi::Processes>,
}

impl Ranks {
    /// Connects to the processes that were started with this one. A single process runs alone.
    ///
    /// # Errors
    /// If this build does not support ranks, or the processes cannot be connected.
    #[cfg(feature = "mpi")]
    pub fn join() -> Result<Self> {
        // Assume several ranks if the launcher sets only the rank, without the number of ranks.
        let count = first_of(&COUNTS).or(first_of(&RANKS).map(|_| 2));
        if count.is_none_or(|count| count <= 1) {
            return Ok(Self { team: Team::alone(), processes: None });
        }
        let processes = crate::mpi::Processes::join()?;
        Ok(Self { team: processes.team().clone(), processes: Some(processes) })
    }

    /// Returns a team of this process alone, because this build lacks MPI.
    #[cfg(not(feature = "mpi"))]
    pub fn join() -> Result<Self> {
        Ok(Self { team: Team::alone() })
    }

    /// Returns the ranks as a team.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Ends all other ranks after this rank failed.
    pub fn fail(&self, code: u8) {
        #[cfg(feature = "mpi")]
        if self.processes.is_some() {
            crate::mpi::abort(code.into());
        }
        let _ = code;
    }
}

/// Checks that this build can share the work of the command, if the command shares it.
///
/// # Errors
/// If several processes were started for a shared command, and this build lacks MPI.
pub fn check(is_shared: bool) -> Result<()> {
    if is_shared && are_several() && !cfg!(feature = "mpi") {
        bail!(
            "mpirun started several ranks, but this build lacks the feature mpi; build with cargo build --release --features mpi"
        );
    }
    Ok(())
}
