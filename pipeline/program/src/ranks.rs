//! Processes that `mpirun` has started together.

use anyhow::{Result, bail};
use pipeline::team::Team;

/// Variables by which Open MPI, MPICH and schedulers tell a process how many there are, and which it is.
const COUNTS: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];
const RANKS: [&str; 3] = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK"];

fn first_of(names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Whether this process is one of several, and not the first: it says nothing then, as the first says the same.
pub fn is_silent() -> bool {
    first_of(&RANKS).is_some_and(|rank| rank > 0)
}

/// Whether this process is one of several.
pub fn are_several() -> bool {
    first_of(&COUNTS).is_some_and(|count| count > 1) || is_silent()
}

/// The ranks that this process is one of.
pub struct Ranks {
    team: Team,
    #[cfg(feature = "mpi")]
    processes: Option<crate::mpi::Processes>,
}

impl Ranks {
    /// Joins the processes that were started together with this one; alone if there are none.
    ///
    /// # Errors
    /// This build knows no ranks, or they cannot be joined.
    #[cfg(feature = "mpi")]
    pub fn join() -> Result<Self> {
        // A launcher may tell the rank and not how many there are.
        let count = first_of(&COUNTS).or(first_of(&RANKS).map(|_| 2));
        if count.is_none_or(|count| count <= 1) {
            return Ok(Self { team: Team::alone(), processes: None });
        }
        let processes = crate::mpi::Processes::join()?;
        Ok(Self { team: processes.team().clone(), processes: Some(processes) })
    }

    /// The same where there can be none.
    #[cfg(not(feature = "mpi"))]
    pub fn join() -> Result<Self> {
        Ok(Self { team: Team::alone() })
    }

    /// The ranks.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Ends all other ranks, where this one has failed and they have not.
    pub fn fail(&self, code: u8) {
        #[cfg(feature = "mpi")]
        if self.processes.is_some() {
            crate::mpi::abort(code.into());
        }
        let _ = code;
    }
}

/// Refuses what several processes would all do at once.
///
/// # Errors
/// There are several, and this build does not know of it, or the command is none that they share.
pub fn check(is_shared: bool) -> Result<()> {
    if !are_several() {
        return Ok(());
    }
    if !cfg!(feature = "mpi") {
        bail!(
            "mpirun has started several ranks, and this build knows none; build it with cargo build --release --features mpi"
        );
    }
    if !is_shared {
        bail!(
            "mpirun has started several ranks, which only render shares its work among; run this command without mpirun"
        );
    }
    Ok(())
}
