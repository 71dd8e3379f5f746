//! Which macroblocks the encoder quantises finer than others.

use serde::{Deserialize, Serialize};

/// Choice of the macroblocks that are quantised finer than others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum AdaptiveQuantiser {
    /// None, but where people look with `--importance`.
    Off,
    /// Those without detail, which would hide what coding loses.
    Masking,
}
