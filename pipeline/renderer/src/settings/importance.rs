//! The importance option: weights of the maps.

use super::importance_files::{ImportanceFiles, parse_weight};
use super::values::parsed;
use pipeline::error::{Error, Result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Weights of the maps, summed into importance. Each weight is 0…1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Importance {
    /// Weight of visual saliency.
    pub saliency: f32,
    /// Weight of the task map. The map covers the nodes that the scene's TOML file names.
    pub task: f32,
    /// Weight of the edge map: outlines, creases, and borders of textures.
    pub edges: f32,
    /// Weight of the cost map: computation of indirect light in the previous frame.
    pub cost: f32,
    /// Maps from files, with their weight.
    pub files: Option<ImportanceFiles>,
}

/// Valid values of the option.
const KNOWN: &str = "a list of \"saliency:W\", \"task:W\", \"edges:W\", \"cost:W\" and \"map:W:FOLDER\" with weights from 0 \
                     to 1, not all 0";

impl Importance {
    /// Returns whether the maps of a frame depend on its light or the light of the previous frame.
    #[must_use]
    pub fn needs_light(&self) -> bool {
        self.saliency > 0.0 || self.cost > 0.0
    }

    /// Returns the names of the computed maps, and their weights.
    fn computed(&self) -> [(&'static str, f32); 4] {
        [("saliency", self.saliency), ("task", self.task), ("edges", self.edges), ("cost", self.cost)]
    }
}

impl FromStr for Importance {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut importance = Self::default();
        let wrong = || {
            let text = format!("\"{text}\" is not {KNOWN}, such as saliency:1 or saliency:0.5,task:1");
            Error::Options(text)
        };
        for part in text.split(',') {
            let (map, value) = part.split_once(':').ok_or_else(wrong)?;
            if map == "map" {
                importance.files = Some(ImportanceFiles::parse(value).ok_or_else(wrong)?);
                continue;
            }
            let weight = parse_weight(value).ok_or_else(wrong)?;
            match map {
                "saliency" => importance.saliency = weight,
                "task" => importance.task = weight,
                "edges" => importance.edges = weight,
                "cost" => importance.cost = weight,
                _ => return Err(wrong()),
            }
        }
        // Require a positive weight: otherwise, importance would be 0 everywhere.
        let has_files = importance.files.as_ref().is_some_and(|files| files.weight() > 0.0);
        if has_files || importance.computed().iter().any(|(_, weight)| *weight > 0.0) {
            Ok(importance)
        } else {
            Err(wrong())
        }
    }
}

impl fmt::Display for Importance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for (map, weight) in self.computed() {
            if weight > 0.0 {
                parts.push(format!("{map}:{weight}"));
            }
        }
        parts.extend(self.files.as_ref().map(|files| format!("map:{files}")));
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
        assert_eq!("task:0.5".parse::<Importance>().unwrap(), Importance { task: 0.5, ..Importance::default() });
        for text in ["saliency:1", "saliency:0.25,task:1", "edges:0.5,cost:1", "saliency:1,map:0.5:my maps"] {
            assert_eq!(text.parse::<Importance>().unwrap().to_string(), text);
        }
        let bad =
            ["", "saliency", "saliency:2", "task:nan", "gaze:1", "saliency:0,task:0", "task:1,", "map:", "map:0:a"];
        for bad in bad {
            assert!(bad.parse::<Importance>().unwrap_err().to_string().contains("saliency:0.5,task:1"), "{bad}");
        }
        // Without a weight, maps from files have weight 1.
        for (text, folder) in [("map:gaze", "1:gaze"), ("map:C:\\gaze", "1:C:\\gaze"), ("map:0.5:a:b", "0.5:a:b")] {
            assert_eq!(text.parse::<Importance>().unwrap().files.unwrap().to_string(), folder);
        }
    }
}
