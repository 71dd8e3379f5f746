//! Command-line arguments.

use std::path::PathBuf;
use std::time::Duration;

/// The arguments, with defaults for missing ones.
pub struct Arguments {
    /// Time limit for the start of new cases.
    pub time: Duration,
    /// Seed of all cases.
    pub seed: u64,
    /// Folder for findings.
    pub keep: PathBuf,
    /// The only case to run.
    pub case: Option<u64>,
}

impl Arguments {
    /// Parses pairs of a name and a value.
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let keep = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target/tmp/fuzz-findings"));
        let mut arguments = Self { time: Duration::from_secs(60), seed: 1, keep, case: None };
        while let Some(name) = words.next() {
            let value = words.next().ok_or_else(|| format!("{name} needs a value"))?;
            let number = || value.parse::<u64>().map_err(|_| format!("{name} {value} is no whole number"));
            match name.as_str() {
                "--minutes" => {
                    let minutes = value.parse::<f64>().ok().and_then(|m| Duration::try_from_secs_f64(60.0 * m).ok());
                    arguments.time = minutes.ok_or_else(|| format!("--minutes {value} is no time"))?;
                }
                "--seed" => arguments.seed = number()?,
                "--keep" => arguments.keep = value.into(),
                "--case" => arguments.case = Some(number()?),
                _ => return Err(format!("there is no {name}")),
            }
        }
        Ok(arguments)
    }
}
