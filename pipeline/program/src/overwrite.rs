//! Files that are there already: replaced only where the user says so.

use anyhow::{Result, bail};
use clap::Args;
use std::io::{BufRead, IsTerminal, Write};
use std::path::Path;

/// Whether files may be replaced.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Overwrite {
    /// Replace files that are there already, without asking
    #[arg(long, help_heading = "Output", hide_short_help = true)]
    overwrite: bool,
}

impl Overwrite {
    /// Lets a file that is there be replaced if the user says so, now or by `--overwrite`. Devices and pipes are no files.
    ///
    /// # Errors
    /// The user says no, or there is no terminal to ask at.
    pub fn check(self, path: &Path) -> Result<()> {
        self.check_for(path, "is there already")
    }

    /// As [`check`](Self::check), for a file that is there in the state that `what` says.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn check_for(self, path: &Path, what: &str) -> Result<()> {
        if self.overwrite || !path.is_file() {
            return Ok(());
        }
        let name = path.display();
        let is_asked = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        if is_asked && says_yes(&format!("{name} {what}; replace it? [y/N] "))? {
            return Ok(());
        }
        bail!("{name} {what}; --overwrite replaces it");
    }
}

/// Asks at the terminal. Anything but yes is no.
fn says_yes(question: &str) -> Result<bool> {
    let mut shown = std::io::stderr();
    write!(shown, "{}", super::print::single_line(question))?;
    shown.flush()?;
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer)?;
    Ok(["y", "yes"].contains(&answer.trim().to_lowercase().as_str()))
}
