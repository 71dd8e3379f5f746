//! Display aspect ratio.

use super::FrameRange;
use super::container::container_of;
use crate::error::{Error, Result};
use mpeg2enc::{AspectRatio, Container};
use renderer::settings::{Size, parsed};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// Display aspect ratio, or square pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PictureAspect {
    /// Pixels are square.
    #[default]
    Square,
    /// The displayed picture is 4:3.
    Display4x3,
    /// The displayed picture is 16:9.
    Display16x9,
}

impl PictureAspect {
    const ALL: [Self; 3] = [Self::Square, Self::Display4x3, Self::Display16x9];

    /// Returns whether pixels are square.
    #[must_use]
    pub fn is_square(&self) -> bool {
        *self == Self::Square
    }

    /// Returns the aspect ratio as coded by the encoder.
    #[must_use]
    pub fn ratio(self) -> AspectRatio {
        match self {
            Self::Square => AspectRatio::SquareSamples,
            Self::Display4x3 => AspectRatio::Display4x3,
            Self::Display16x9 => AspectRatio::Display16x9,
        }
    }

    /// Returns width and height of a pixel, as a reduced ratio, for pictures of the given size.
    #[must_use]
    pub fn pixel(self, size: Size) -> [u64; 2] {
        let (wide, high) = match self {
            Self::Square => return [1, 1],
            Self::Display4x3 => (4, 3),
            Self::Display16x9 => (16, 9),
        };

        // Divide the display aspect ratio by the ratio of the sizes, and reduce it by Euclid's algorithm.
        let [width, height] = [wide * size.height as u64, high * size.width as u64];
        let (mut divisor, mut rest) = (width, height);
        while rest > 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        [width / divisor, height / divisor]
    }

    /// Returns the aspect ratio of a film at `output`: the `requested` ratio, or a default. DVD-Video does not support
    /// square pixels.
    ///
    /// # Errors
    /// If square pixels are requested for DVD-Video.
    pub(super) fn of(requested: Option<Self>, output: &Path, range: Option<FrameRange>, size: Size) -> Result<Self> {
        let is_disc = container_of(output, range) == Some(Container::Disc);
        match requested {
            Some(Self::Square) if is_disc => {
                let name = output.display();
                let text = "DVD-Video pictures are 4:3 or 16:9; use --aspect 4:3, or name the output .mpg";
                Err(Error::Options(format!("{name}: {text}")))
            }
            Some(aspect) => Ok(aspect),
            None if is_disc => Ok(Self::nearest(size)),
            None => Ok(Self::Square),
        }
    }

    /// Returns the DVD-Video aspect ratio that is nearest to square pixels.
    fn nearest(size: Size) -> Self {
        // Compare with 14:9, the midpoint of 4:3 and 16:9.
        if 9 * size.width > 14 * size.height { Self::Display16x9 } else { Self::Display4x3 }
    }
}

impl FromStr for PictureAspect {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let known = Self::ALL.into_iter().find(|aspect| aspect.to_string() == text);
        known.ok_or_else(|| Error::Options(format!("\"{text}\" is not \"4:3\", \"16:9\" or \"square\"")))
    }
}

impl fmt::Display for PictureAspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.ratio().name())
    }
}

impl Serialize for PictureAspect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for PictureAspect {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the pixel shapes of DVD-Video with 625 and 525 lines.
    #[test]
    fn pixels_of_discs() {
        let pixel = |aspect: PictureAspect, width, height| aspect.pixel(Size { width, height });
        assert_eq!(pixel(PictureAspect::Display4x3, 720, 576), [16, 15]);
        assert_eq!(pixel(PictureAspect::Display16x9, 720, 576), [64, 45]);
        assert_eq!(pixel(PictureAspect::Display4x3, 720, 480), [8, 9]);
        assert_eq!(pixel(PictureAspect::Display16x9, 720, 480), [32, 27]);
        assert_eq!(PictureAspect::nearest(Size { width: 720, height: 480 }), PictureAspect::Display4x3);
        assert_eq!(PictureAspect::nearest(Size { width: 1024, height: 576 }), PictureAspect::Display16x9);
    }
}
