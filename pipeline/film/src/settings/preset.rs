//! Quality presets.

use serde::{Deserialize, Serialize};

/// Quality preset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preset {
    /// Small and coarse, to check motion and layout.
    Draft,
    /// The defaults.
    Good,
    /// Large, with smooth edges and little coding loss.
    Final,
}
