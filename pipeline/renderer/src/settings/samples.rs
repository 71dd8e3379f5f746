//! The option for the number of samples per pixel.

use super::values::parsed;
use pipeline::error::{Error, Result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Maximum number of samples per pixel.
const MOST: u32 = 64;

/// Number of visibility and light samples per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleCount {
    /// One sample, and further ones in pixels where light changes within the pixel.
    Auto,
    /// The same number in every pixel, or the maximum with importance.
    Each(u32),
}

impl SampleCount {
    /// Returns the number of samples that every pixel may have.
    #[must_use]
    pub fn most(self) -> u32 {
        match self {
            Self::Auto => 1,
            Self::Each(count) => count,
        }
    }
}

impl FromStr for SampleCount {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let count = text.parse().ok().filter(|count| (1..=MOST).contains(count));
        let wrong = || Error::Options(format!("\"{text}\" is not auto or a number of samples from 1 to {MOST}"));
        count.map(Self::Each).ok_or_else(wrong)
    }
}

impl fmt::Display for SampleCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Each(count) => write!(f, "{count}"),
        }
    }
}

impl Serialize for SampleCount {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Each(count) => serializer.serialize_u32(*count),
        }
    }
}

impl<'de> Deserialize<'de> for SampleCount {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_samples_are_read_or_explained() {
        for (text, expected) in
            [("auto", SampleCount::Auto), ("1", SampleCount::Each(1)), ("64", SampleCount::Each(64))]
        {
            assert_eq!(text.parse::<SampleCount>().unwrap(), expected);
            assert_eq!(expected.to_string(), text);
        }
        for text in ["", "0", "65", "-1", "1.5", "Auto", "many"] {
            assert!(text.parse::<SampleCount>().unwrap_err().to_string().contains("from 1 to 64"), "{text}");
        }
    }
}
