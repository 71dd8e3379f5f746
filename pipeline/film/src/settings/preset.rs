//! Three choices of how good a film is, for who does not want to think about each option.

use serde::{Deserialize, Serialize};

/// How good, and how slow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preset {
    /// Small and coarse: to see what moves where.
    Draft,
    /// The defaults.
    Good,
    /// Large, with smooth edges and few losses.
    Final,
}
