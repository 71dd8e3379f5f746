//! Adaptive quantisation: macroblocks coded finer than others.

use serde::{Deserialize, Serialize};

/// Rule for macroblocks that are quantised finer than others.
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
