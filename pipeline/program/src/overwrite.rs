//! Replacement of existing files, only with the user's consent.

use anyhow::{Result, bail};
use clap::Args;
use std::io::{BufRead, IsTerminal, Write};
use std::path::Path;

/// Permission to replace existing files.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Overwrite {
    /// Replace existing files without asking
    #[arg(long, help_heading = "Output", hide_short_help = true)]
    overwrite: bool,
}

impl Overwrite {
    /// Permits the replacement of an existing file if `--overwrite` is set or the user agrees. Devices and pipes need
    /// no permission.
    ///
    /// # Errors
    /// If the user refuses, or no terminal is available for the question.
    pub fn check(self, path: &Path) -> Result<()> {
        self.check_for(path, "already exists")
    }

    /// Checks a file like [`check`](Self::check), with `what` as the description of the existing file.
    ///
    /// # Errors
    /// If the user refuses, or no terminal is available for the question.
    pub fn check_for(self, path: &Path, what: &str) -> Result<()> {
        if self.overwrite || !path.is_file() {
            return Ok(());
        }
        let name = path.display();
        // Ask only if the user can read the question and answer it.
        let is_asked = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        if is_asked && says_yes(&format!("{name} {what}; replace it? [y/N] "))? {
            return Ok(());
        }
        bail!("{name} {what}; --overwrite replaces it");
    }
}

/// Asks at the terminal. Any answer except "y" or "yes" is a refusal.
fn says_yes(question: &str) -> Result<bool> {
    let mut shown = std::io::stderr();
    write!(shown, "{}", super::print::single_line(question))?;
    shown.flush()?;
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer)?;
    Ok(["y", "yes"].contains(&answer.trim().to_lowercase().as_str()))
}
