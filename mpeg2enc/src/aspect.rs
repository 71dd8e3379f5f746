//! Aspect ratios of samples and pictures, for undistorted display.

use crate::Standard;
use mpeg2::PEL_ASPECT_RATIOS;

/// Aspect ratio of the samples or of the whole picture (aspect_ratio_information, Table 6-3).
///
/// MPEG-2 codes the aspect ratio of the displayed picture, or square samples. MPEG-1 codes the nearest sample aspect ratio from
/// its own table (pel_aspect_ratio, 11172-2, 2.4.3.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum AspectRatio {
    /// Square samples.
    #[default]
    SquareSamples,
    /// A 4:3 picture.
    Display4x3,
    /// A 16:9 picture.
    Display16x9,
    /// A 2.21:1 picture.
    Display221x100,
}

/// Maximum relative error of an MPEG-1 sample aspect ratio. Neighboring values in the MPEG-1 table differ by up to 8 %.
const PEL_TOLERANCE: f64 = 0.05;
/// Maximum relative error of a sample aspect ratio. Pictures of 720 columns are called 4:3 or 16:9 although 702 to 711 of these
/// columns have that ratio, an error of 2.5 %.
const SAMPLE_TOLERANCE: f64 = 0.03;

impl AspectRatio {
    /// All aspect ratios, in the order of their codes.
    pub const ALL: &[Self] = &[Self::SquareSamples, Self::Display4x3, Self::Display16x9, Self::Display221x100];

    /// Returns the name of the aspect ratio in command lines.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SquareSamples => "square",
            Self::Display4x3 => "4:3",
            Self::Display16x9 => "16:9",
            Self::Display221x100 => "2.21:1",
        }
    }

    /// Returns the aspect ratio of pictures of `width`×`height` with samples `sample.0` wide and `sample.1` high.
    ///
    /// `None` if no aspect ratio of the standard is within 3 %.
    ///
    /// ```
    /// use mpeg2enc::AspectRatio;
    /// assert_eq!(AspectRatio::of_samples(720, 576, (16, 15)), Some(AspectRatio::Display4x3));
    /// assert_eq!(AspectRatio::of_samples(720, 576, (118, 81)), Some(AspectRatio::Display16x9));
    /// assert_eq!(AspectRatio::of_samples(720, 576, (3, 1)), None);
    /// ```
    #[must_use]
    pub fn of_samples(width: usize, height: usize, sample: (u32, u32)) -> Option<Self> {
        let requested = f64::from(sample.0) / f64::from(sample.1);
        let distance = |shape: Self| (shape.sample_width(width, height) / requested).ln().abs();
        // If several ratios are equally near, the first one is used: square samples.
        let nearest = Self::ALL.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        (distance(nearest) <= SAMPLE_TOLERANCE).then_some(nearest)
    }

    /// Returns the width of a sample divided by its height, in pictures of `width`×`height`.
    fn sample_width(self, width: usize, height: usize) -> f64 {
        let Some((wide, high)) = self.of_display() else { return 1.0 };
        let picture = f64::from(wide) / f64::from(high);
        picture * height as f64 / width as f64
    }

    /// Returns the width and height of the displayed picture, as a ratio; `None` for square samples.
    pub(crate) fn of_display(self) -> Option<(u32, u32)> {
        match self {
            Self::SquareSamples => None,
            Self::Display4x3 => Some((4, 3)),
            Self::Display16x9 => Some((16, 9)),
            Self::Display221x100 => Some((221, 100)),
        }
    }

    /// Returns aspect_ratio_information, or pel_aspect_ratio in MPEG-1; `None` if the MPEG-1 table has no near value.
    pub(crate) fn code(self, standard: Standard, width: usize, height: usize) -> Option<u32> {
        if standard == Standard::Mpeg2 {
            return Some(self as u32 + 1);
        }
        let requested = 1.0 / self.sample_width(width, height);
        let distance = |code: usize| (PEL_ASPECT_RATIOS[code - 1] / requested).ln().abs();
        let nearest = (1..=PEL_ASPECT_RATIOS.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        (distance(nearest) <= PEL_TOLERANCE).then_some(nearest as u32)
    }
}

impl std::fmt::Display for AspectRatio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_known_formats() {
        let shape = AspectRatio::of_samples;
        assert_eq!(shape(720, 540, (1, 1)), Some(AspectRatio::SquareSamples), "also 4:3");
        for sample in [(16, 15), (59, 54), (12, 11)] {
            assert_eq!(shape(720, 576, sample), Some(AspectRatio::Display4x3), "{sample:?}");
        }
        for sample in [(8, 9), (10, 11)] {
            assert_eq!(shape(720, 480, sample), Some(AspectRatio::Display4x3), "{sample:?}");
        }
        for sample in [(64, 45), (118, 81), (16, 11)] {
            assert_eq!(shape(720, 576, sample), Some(AspectRatio::Display16x9), "{sample:?}");
        }
        assert_eq!(shape(1440, 1080, (221, 178)), None);
        assert_eq!(shape(1000, 1000, (221, 100)), Some(AspectRatio::Display221x100));
        for sample in [(0, 1), (1, 0), (0, 0), (2, 1)] {
            assert_eq!(shape(720, 576, sample), None, "{sample:?}");
        }
    }

    /// Uses the notes on the table of 11172-2. For 16:9, 0.7031 belongs to 625 lines and 0.8437 to 525 lines. For 4:3, 0.9157
    /// belongs to 625 lines and 1.0950 to 525 lines.
    #[test]
    fn mpeg1_states_samples() {
        let code = |shape: AspectRatio, width, height| shape.code(Standard::Mpeg1, width, height);
        assert_eq!(code(AspectRatio::SquareSamples, 720, 576), Some(1));
        assert_eq!(code(AspectRatio::Display16x9, 720, 576), Some(3));
        assert_eq!(code(AspectRatio::Display16x9, 720, 480), Some(6));
        assert_eq!(code(AspectRatio::Display4x3, 720, 576), Some(8));
        assert_eq!(code(AspectRatio::Display4x3, 720, 480), Some(12));
        assert_eq!(code(AspectRatio::Display221x100, 720, 576), None);
    }
}
