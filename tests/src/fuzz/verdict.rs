//! Rules that every run must satisfy.

use super::{Film, Outcome};
use crate::sorted_names;
use serde_json::Value;
use std::fs;

/// First bytes of a film: a sequence header (ISO/IEC 13818-2, 6.2.2.1).
const BEGIN: [u8; 4] = [0, 0, 1, 0xb3];

/// Result of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Complete film.
    Rendered,
    /// Error message of one line, and no files.
    Refused,
    /// Broken rule, with a description.
    Fault(String),
}

impl Verdict {
    /// Judges a run that must leave the folder of `scene` unchanged and write `outputs` or no files.
    pub fn of(film: &Film, outcome: &Outcome, scene: &[String], outputs: &[&str]) -> Self {
        let judged = told(outcome, film.is_quiet()).and_then(|rendered| {
            // Check that other folders are unchanged.
            same("around the scene", &sorted_names(&film.folder), &["out", "scene", "tmp"])?;
            let expected: Vec<&str> = scene.iter().map(String::as_str).collect();
            same("beside the scene", &sorted_names(&film.scene()), &expected)?;
            same("in the folder for temporary files", &sorted_names(&film.folder.join("tmp")), &[])?;
            same("in the folder of the film", &sorted_names(&film.out()), if rendered { outputs } else { &[] })?;
            if rendered { whole(film).map(|()| Self::Rendered) } else { Ok(Self::Refused) }
        });
        judged.unwrap_or_else(Self::Fault)
    }
}

/// Returns whether the run rendered a film, by exit code and messages; an error if these break the rules. Without `--quiet`,
/// notes and a summary precede the decisive line.
pub(super) fn told(outcome: &Outcome, is_quiet: bool) -> Result<bool, String> {
    let message = String::from_utf8_lossy(&outcome.stderr);
    let fault = |what: &str| Err(format!("{what}: exit code {:?}, {message}", outcome.code));
    // Reject faults of any run.
    if outcome.endless {
        return fault("it does not end");
    }
    if let Some(signal) = outcome.signal {
        return fault(&format!("ended by signal {signal}"));
    }
    if message.contains("panicked") {
        return fault("a panic");
    }
    if message.chars().any(|c| c.is_control() && c != '\n') || std::str::from_utf8(&outcome.stderr).is_err() {
        return fault("control characters");
    }
    // Compare the exit code with the message.
    match outcome.code {
        Some(0) if message.is_empty() || !is_quiet => Ok(true),
        Some(0) => fault("words in spite of --quiet"),
        Some(1 | 2) => {
            let is_one_line = message.lines().count() == 1 || !is_quiet;
            let line = message.lines().last().unwrap_or_default();
            if !is_one_line || !message.ends_with('\n') || !line.starts_with("render2mpeg: ") {
                return fault("other than one line");
            }
            if !line.contains("scene.") && !line.contains("film.") {
                return fault("a message that names no file");
            }
            Ok(false)
        }
        _ => fault("another exit code"),
    }
}

/// Checks that a folder contains exactly the expected names.
fn same(place: &str, found: &[String], expected: &[&str]) -> Result<(), String> {
    if found == expected { Ok(()) } else { Err(format!("{place} are {found:?}, not {expected:?}")) }
}

/// Checks that the film is complete and has no pixels that are NaN or infinite.
fn whole(film: &Film) -> Result<(), String> {
    let read = |name: &str| fs::read(film.out().join(name)).map_err(|error| format!("{name}: {error}"));
    if !read("film.m2v")?.starts_with(&BEGIN) {
        return Err("the film has no header".into());
    }
    // Read the frames from the report.
    let report: Value = serde_json::from_slice(&read("film.report.json")?).map_err(|error| error.to_string())?;
    let frames = report["frames"].as_array().ok_or("the report has no frames")?;
    let broken: u64 = frames.iter().filter_map(|frame| frame["non_finite_pixels"].as_u64()).sum();
    if frames.is_empty() || broken > 0 {
        return Err(format!("{} frames with {broken} pixels that are NaN or infinite", frames.len()));
    }
    Ok(())
}
