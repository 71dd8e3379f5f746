//! Checkpoint files.

use crate::error::{Error, Result};
use crate::sealed::SealedFormat;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: SealedFormat =
    SealedFormat { magic: *b"R2MC", version: 17, name: "checkpoint", remedy: "restart without --resume" };

/// Program, settings and inputs of a film. A run can resume the film only if all three are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    pub(super) program: String,
    /// All settings, as JSON.
    pub(super) settings: String,
    /// CRC-32 of all input files.
    pub(super) inputs: u32,
}

/// State of a run after a frame.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Stored {
    pub identity: Identity,
    /// Last finished frame; `None` if the run ended before its first checkpoint.
    pub frame: Option<u32>,
    /// States, indexed by [`StageName`](super::StageName); empty if a stage has none.
    pub states: Vec<Vec<u8>>,
}

impl Identity {
    /// Returns the difference between the stored `self` and `wanted`; `None` if both are the same job.
    #[must_use]
    pub fn difference(&self, wanted: &Self) -> Option<String> {
        if self.program != wanted.program {
            return Some(format!("it was written by {}, and this is {}", self.program, wanted.program));
        }
        if self.settings != wanted.settings {
            // Find the first changed setting, to name it in the message.
            let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap_or_default();
            let (then, now) = (read(&self.settings), read(&wanted.settings));
            let names = now.as_object().into_iter().flat_map(|object| object.keys());
            let other = names.into_iter().find(|name| then[name.as_str()] != now[name.as_str()]);
            return Some(match other {
                Some(name) => format!("{name} was {} and is now {}", shown(&then[name]), shown(&now[name])),
                None => "it has other settings".into(),
            });
        }
        (self.inputs != wanted.inputs).then(|| "the scene has changed".into())
    }
}

/// Formats a setting: sizes as on the command line, other values as JSON.
fn shown(value: &serde_json::Value) -> String {
    match (&value["width"], &value["height"]) {
        (serde_json::Value::Null, _) => value.to_string(),
        (width, height) => format!("{width}x{height}"),
    }
}

impl Stored {
    /// Writes the checkpoint. The previous one is replaced only when the new one is complete.
    pub fn write(&self, path: &Path) -> Result<()> {
        FORMAT.write(path, self)
    }

    /// Reads and validates a checkpoint.
    pub fn read(path: &Path) -> Result<Self> {
        let stored: Self = FORMAT.read(path)?;
        if stored.states.len() != super::STAGES {
            return Err(Error::Checkpoint(format!("a checkpoint with {} states", stored.states.len())));
        }
        Ok(stored)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn every_changed_byte_and_every_cut_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.m2v.checkpoint");
        let job = Identity { program: "p 1".into(), settings: r#"{"qscale":8,"gop":15}"#.into(), inputs: 7 };
        let stages = vec![vec![1], vec![], vec![2, 3], vec![250; 300], vec![4]];
        Stored { identity: job.clone(), frame: Some(41), states: stages.clone() }.write(&path).unwrap();
        let read = Stored::read(&path).unwrap();
        assert!(read.identity == job && read.frame == Some(41) && read.states == stages);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no other file remains");

        let bytes = fs::read(&path).unwrap();
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 0x10;
            assert!(FORMAT.decode::<Stored>(&changed).is_err(), "byte {place}");
            assert!(FORMAT.decode::<Stored>(&bytes[..place]).is_err(), "cut at {place}");
        }
    }

    #[test]
    fn what_differs_is_named() {
        let job = Identity { program: "p 1".into(), settings: r#"{"qscale":8,"gop":15}"#.into(), inputs: 7 };
        assert_eq!(job.difference(&job), None);
        let other = Identity { settings: r#"{"qscale":16,"gop":15}"#.into(), ..job.clone() };
        assert_eq!(job.difference(&other).unwrap(), "qscale was 8 and is now 16");
        let other = Identity { inputs: 8, ..job.clone() };
        assert!(job.difference(&other).unwrap().contains("scene"));
    }
}
