//! Frame rates of films: MPEG's own rates, and other rates by repeated frames.

use crate::error::{Error, Result};
use mpeg2enc::{ConfigError, FrameRate};
use render_core::scene::parse_frame_rate;
use renderer::settings::parsed;
use serde::{Deserialize, Deserializer};
use std::str::FromStr;

/// Minimum accepted frame rate \[frames per second\].
const LEAST: f64 = 1.0;
/// Maximum number of pictures per frame: MPEG's highest rate, 60 pictures per second, divided by `LEAST`.
const MOST_PICTURES: u32 = 60;

/// Frame rate of a film, expressed as a picture rate of MPEG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodedRate {
    /// Picture rate \[pictures per second\].
    pub rate: FrameRate,
    /// Number of pictures per frame: 1 if MPEG supports the frame rate.
    pub pictures: u32,
}

impl CodedRate {
    /// Returns the lowest rate of MPEG that is a multiple of `fps` frames per second.
    ///
    /// # Errors
    /// If no rate of MPEG is a multiple of `fps`.
    pub fn of(fps: f64) -> Result<Self, ConfigError> {
        // Prefer a rate of MPEG, and report invalid rates with the encoder's error.
        let exact = FrameRate::from_fps(fps);
        if exact.is_ok() || fps.is_nan() || fps < LEAST {
            return exact.map(|rate| Self { rate, pictures: 1 });
        }
        // Repeat each frame as few times as possible.
        for pictures in 2..=MOST_PICTURES {
            if let Ok(rate) = FrameRate::from_fps(fps * f64::from(pictures)) {
                return Ok(Self { rate, pictures });
            }
        }
        Err(ConfigError::FrameRate { fps })
    }

    /// Returns the number of frames per second as a reduced fraction.
    #[must_use]
    pub fn frames(self) -> (u32, u32) {
        let (numerator, denominator) = self.rate.fraction();
        // Find the greatest common divisor by Euclid's algorithm.
        let (mut divisor, mut rest) = (numerator, self.pictures);
        while rest > 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        (numerator / divisor, denominator * (self.pictures / divisor))
    }
}

/// Number of frames per second, parsed from text.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FramesPerSecond(f64);

impl FromStr for FramesPerSecond {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        parse_fps(text).map(Self)
    }
}

impl<'de> Deserialize<'de> for FramesPerSecond {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

/// Parses a number of frames per second.
///
/// # Errors
/// If the text is neither a number nor a fraction.
pub fn parse_fps(text: &str) -> Result<f64> {
    parse_frame_rate(text)
        .ok_or_else(|| Error::Options(format!("\"{text}\" is not a frame rate such as 25, 29.97 or 24000/1001")))
}

/// Deserializes the number of frames per second from an option file.
pub(super) fn optional_fps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    Ok(Option::<FramesPerSecond>::deserialize(deserializer)?.map(|fps| fps.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_become_multiples() {
        let of = |text: &str| {
            let coded = CodedRate::of(parse_fps(text).unwrap()).unwrap();
            (coded.rate.fraction(), coded.pictures)
        };
        assert_eq!(of("25"), ((25, 1), 1));
        assert_eq!(of("12"), ((24, 1), 2));
        assert_eq!(of("10"), ((30, 1), 3));
        assert_eq!(of("12.5"), ((25, 1), 2));
        assert_eq!(of("20"), ((60, 1), 3));
        assert_eq!(of("1"), ((24, 1), 24));
        assert_eq!(of("12000/1001"), ((24_000, 1001), 2));
        for text in ["24000/1001", "23.98", "23.976"] {
            assert_eq!(of(text), ((24_000, 1001), 1), "{text}");
        }
        assert_eq!(CodedRate::of(12.5).unwrap().frames(), (25, 2));
        for fps in [f64::NAN, f64::INFINITY, -5.0, 0.0, 0.5, 16.0, 23.0, 48.0, 120.0] {
            assert!(CodedRate::of(fps).is_err(), "{fps}");
        }
        for text in ["", "fast", "24000/", "1/2/3"] {
            assert!(parse_fps(text).unwrap_err().to_string().contains("24000/1001"), "{text}");
        }
    }
}
