//! Option values of a film: text forms and ranges.

use crate::error::{Error, Result};
#[cfg(feature = "clap")]
use mpeg2enc::Effort;
use renderer::settings::parsed;
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// Interval between checkpoints of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CheckpointEvery {
    /// Seconds between checkpoints; 0 writes one after each frame.
    Seconds(f64),
    /// Writes no checkpoints.
    Off,
}

impl CheckpointEvery {
    /// Returns the interval as a duration; `None` for [`CheckpointEvery::Off`].
    pub fn duration(self) -> Option<Duration> {
        match self {
            Self::Seconds(seconds) => Some(Duration::from_secs_f64(seconds)),
            Self::Off => None,
        }
    }
}

impl fmt::Display for CheckpointEvery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seconds(seconds) => write!(f, "{seconds}"),
            Self::Off => write!(f, "off"),
        }
    }
}

impl FromStr for CheckpointEvery {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text == "off" {
            return Ok(Self::Off);
        }
        // Limit the range, because `Duration` panics for negative, infinite and NaN seconds.
        let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=1e6).contains(seconds));
        seconds.map(Self::Seconds).ok_or_else(|| {
            let known = "is neither \"off\" nor a number of seconds from 0 to 1000000, such as 60; 0 writes one after each frame";
            Error::Options(format!("\"{text}\" {known}"))
        })
    }
}

/// Value of an option that is on or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Switch {
    /// Enabled.
    On,
    /// Disabled.
    Off,
}

impl Switch {
    /// Returns whether the switch is [`Switch::On`].
    pub fn is_on(self) -> bool {
        self == Self::On
    }
}

impl FromStr for Switch {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "on" => Ok(Self::On),
            "off" => Ok(Self::Off),
            _ => Err(Error::Options(format!("\"{text}\" is neither \"on\" nor \"off\""))),
        }
    }
}

impl<'de> Deserialize<'de> for Switch {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

/// Bit depth of colors in OpenEXR files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ExrDepth {
    /// 16-bit floats (11 bits of precision) for light, albedo and normals; 32 bits for light that 16 would lose, and
    /// for all other data.
    #[default]
    Half,
    /// 32-bit floats for all data.
    Float,
}

/// Bit rate \[bits per second\].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct BitRate(pub u32);

/// Minimum accepted bit rate \[bits per second\]: even the smallest MPEG-1 pictures need more.
const LEAST_BIT_RATE: f64 = 10_000.0;

impl FromStr for BitRate {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        // Split off a decimal unit; without a unit, the number is in bits per second.
        let (number, unit) = match text.as_bytes().last() {
            Some(b'k' | b'K') => (&text[..text.len() - 1], 1e3),
            Some(b'm' | b'M') => (&text[..text.len() - 1], 1e6),
            _ => (text, 1.0),
        };
        let rate = number.parse::<f64>().ok().map(|number| number * unit);
        let rate = rate.filter(|rate| (LEAST_BIT_RATE..=1e9).contains(rate));
        rate.map(|rate| Self(rate.round() as u32)).ok_or_else(|| {
            let known = "a bit rate such as 1500k or 2M, from 10k to 1000M bits per second";
            Error::Options(format!("\"{text}\" is not {known}"))
        })
    }
}

impl<'de> Deserialize<'de> for BitRate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

/// Amount of memory \[bytes\]; the text form has a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemorySize(pub u64);

impl fmt::Display for MemorySize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Switch units at 9999.5 MB, so that megabytes never round to five digits.
        let megabytes = self.0 as f64 / 1e6;
        if megabytes < 9999.5 { write!(f, "{megabytes:.0} MB") } else { write!(f, "{:.0} GB", megabytes / 1e3) }
    }
}

impl FromStr for MemorySize {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let units = [("M", 1e6), ("G", 1e9), ("T", 1e12)];
        let unit = units.iter().find_map(|(unit, bytes)| Some((text.strip_suffix(unit)?, bytes)));
        let bytes = unit.and_then(|(number, bytes)| Some(number.parse::<f64>().ok()? * bytes));
        let bytes = bytes.filter(|bytes| (1e6..=1e15).contains(bytes));
        bytes.map(|bytes| Self(bytes.round() as u64)).ok_or_else(|| {
            Error::Options(format!("\"{text}\" is not an amount of memory such as 500M or 8G, from 1M to 1000T bytes"))
        })
    }
}

/// Returns a clap parser for effort names.
#[cfg(feature = "clap")]
pub(super) fn effort() -> impl clap::builder::TypedValueParser<Value = Effort> {
    use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
    let value = |&effort: &Effort| {
        let value = PossibleValue::new(effort.name());
        match effort {
            Effort::Fast => value.help("Least time; with a bit rate, no lookahead"),
            Effort::Balanced => value.help("Fewer bits"),
            Effort::Best => value.help("Fewest bits"),
            _ => value,
        }
    };
    let parsed = |name: String| Effort::ALL.iter().copied().find(|effort| effort.name() == name).expect("one of them");
    PossibleValuesParser::new(Effort::ALL.iter().map(value)).map(parsed)
}

/// Module for serde's `with` that serializes a size as text.
pub(super) mod size_as_text {
    use renderer::settings::{Size, parsed};
    use serde::{Deserializer, Serializer};

    pub fn serialize<S: Serializer>(size: &Option<Size>, serializer: S) -> Result<S::Ok, S::Error> {
        match size {
            Some(size) => serializer.collect_str(size),
            None => serializer.serialize_none(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Size>, D::Error> {
        parsed(deserializer).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_read_or_explained() {
        for (text, rate) in [("1500k", 1_500_000), ("2M", 2_000_000), ("0.5m", 500_000), ("64000", 64_000)] {
            assert_eq!(text.parse::<BitRate>().unwrap(), BitRate(rate), "{text}");
        }
        for bad in ["", "k", "2000", "-2M", "2G", "nank", "2000M", "\u{b5}"] {
            assert!(bad.parse::<BitRate>().unwrap_err().to_string().contains("1500k"), "{bad}");
        }
    }
}
