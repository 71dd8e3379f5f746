//! Processes started together by `mpirun`.

use anyhow::{Result, bail};
use pipeline::team::Team;

/// Environment variables of Open MPI, MPICH and schedulers with the number of processes and the rank.
const COUNTS: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];
const RANKS: [&str; 3] = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK"];

fn first_of(names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Returns true if this process is one of several and not the first: the first prints the same.
pub fn is_silent() -> bool {
    first_of(&RANKS).is_some_and(|rank| rank > 0)
}

/// Returns true if this process is one of several.
pub fn are_several() -> bool {
    first_of(&COUNTS).is_some_and(|count| count > 1) || is_silent()
}

/// The ranks, of which this process is one.
pub struct Ranks {
    team: Team,
    #[cfg(feature = "mpi")]
    processes: Option<crate::mpi::Processes>,
}

impl Ranks {
    /// Joins the processes that were started with this one; a single process stays alone.
    ///
    /// # Errors
    /// If this build does not support ranks, or the processes cannot be connected.
    #[cfg(feature = "mpi")]
    pub fn join() -> Result<Self> {
        // A launcher may set the rank without the number of ranks.
        let count = first_of(&COUNTS).or(first_of(&RANKS).map(|_| 2));
        if count.is_none_or(|count| count <= 1) {
            return Ok(Self { team: Team::alone(), processes: None });
        }
        let processes = crate::mpi::Processes::join()?;
        Ok(Self { team: processes.team().clone(), processes: Some(processes) })
    }

    /// Returns this process alone, in builds without MPI.
    #[cfg(not(feature = "mpi"))]
    pub fn join() -> Result<Self> {
        Ok(Self { team: Team::alone() })
    }

    /// Ranks of the team.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Ends all other ranks after a failure on this rank only.
    pub fn fail(&self, code: u8) {
        #[cfg(feature = "mpi")]
        if self.processes.is_some() {
            crate::mpi::abort(code.into());
        }
        let _ = code;
    }
}

/// Refuses commands that several processes would all run at once.
///
/// # Errors
/// If there are several processes, and this build lacks MPI or the command does not share its work.
pub fn check(is_shared: bool) -> Result<()> {
    if !are_several() {
        return Ok(());
    }
    if !cfg!(feature = "mpi") {
        bail!(
            "mpirun started several ranks, but this build lacks the feature mpi; build with cargo build --release --features mpi"
        );
    }
    if !is_shared {
        bail!("mpirun started several ranks, but only render shares its work; run this command without mpirun");
    }
    Ok(())
}
