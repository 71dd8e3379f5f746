//! The importance option: weights of the saliency and task maps.

use super::values::parsed;
use pipeline::error::{Error, Result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Weights of the maps, summed into importance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Importance {
    /// Weight of visual saliency, 0…1.
    pub saliency: f32,
    /// Weight of the task map, 0…1. The map covers the nodes that the scene's TOML file names.
    pub task: f32,
}

impl FromStr for Importance {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut weights = Self::default();
        let wrong = || {
            let known = "a list of \"saliency:W\" and \"task:W\" with weights from 0 to 1, not all 0";
            Error::Options(format!("\"{text}\" is not {known}, such as saliency:1 or saliency:0.5,task:1"))
        };
        for part in text.split(',') {
            let (map, weight) = part.split_once(':').ok_or_else(wrong)?;
            let weight = weight.parse::<f32>().ok().filter(|weight| (0.0..=1.0).contains(weight)).ok_or_else(wrong)?;
            match map {
                "saliency" => weights.saliency = weight,
                "task" => weights.task = weight,
                _ => return Err(wrong()),
            }
        }
        // Require a positive weight: otherwise, importance would be 0 everywhere.
        if weights == Self::default() { Err(wrong()) } else { Ok(weights) }
    }
}

impl fmt::Display for Importance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for (map, weight) in [("saliency", self.saliency), ("task", self.task)] {
            if weight > 0.0 {
                parts.push(format!("{map}:{weight}"));
            }
        }
        f.write_str(&parts.join(","))
    }
}

impl Serialize for Importance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Importance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_and_their_weights_are_read_or_explained() {
        assert_eq!("task:0.5".parse::<Importance>().unwrap(), Importance { saliency: 0.0, task: 0.5 });
        for text in ["saliency:1", "saliency:0.25,task:1"] {
            assert_eq!(text.parse::<Importance>().unwrap().to_string(), text);
        }
        for bad in ["", "saliency", "saliency:2", "task:nan", "gaze:1", "saliency:0,task:0", "task:1,"] {
            assert!(bad.parse::<Importance>().unwrap_err().to_string().contains("saliency:0.5,task:1"), "{bad}");
        }
    }
}
