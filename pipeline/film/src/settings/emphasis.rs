//! Adaptive quantisation: finer quantisers for selected macroblocks.

use serde::{Deserialize, Serialize};

/// Rule that selects macroblocks for finer quantisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum AdaptiveQuantiser {
    /// None; `--importance` still makes important macroblocks finer.
    Off,
    /// Finer in macroblocks without detail, which would mask coding errors.
    Masking,
}
