//! Color description of sequence_display_extension() (6.3.6): primaries, transfer characteristics and matrix.

/// Defines an enum of the values of a table in the standard, each with its code and its name in command lines.
macro_rules! coded {
    ($(#[$doc:meta])* $name:ident { $($(#[$of:meta])* $variant:ident = $code:literal, $text:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[non_exhaustive]
        pub enum $name {
            $($(#[$of])* $variant = $code,)*
        }

        impl $name {
            /// All values, in the order of their codes.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// Returns the name in lower case, as in ffmpeg.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }

            /// Returns the code in the standard's table.
            #[must_use]
            pub fn code(self) -> u8 {
                self as u8
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

coded! {
    /// Chromaticities of red, green, blue and white (colour_primaries, Table 6-7).
    ColorPrimaries {
        /// Rec. ITU-R BT.709: high definition.
        #[default]
        Bt709 = 1, "bt709";
        /// Unspecified in the stream.
        Unspecified = 2, "unknown";
        /// Rec. ITU-R BT.470-2 System M: original NTSC.
        Bt470M = 4, "bt470m";
        /// Rec. ITU-R BT.470-2 System B, G: 625 lines.
        Bt470Bg = 5, "bt470bg";
        /// SMPTE 170M: 525 lines.
        Smpte170M = 6, "smpte170m";
        /// SMPTE 240M of 1987.
        Smpte240M = 7, "smpte240m";
    }
}

coded! {
    /// Transfer function between light and samples (transfer_characteristics, Table 6-8).
    TransferCharacteristics {
        /// Rec. ITU-R BT.709: high definition.
        #[default]
        Bt709 = 1, "bt709";
        /// Unspecified in the stream.
        Unspecified = 2, "unknown";
        /// Rec. ITU-R BT.470-2 System M: a display gamma of 2.2.
        Bt470M = 4, "bt470m";
        /// Rec. ITU-R BT.470-2 System B, G: a display gamma of 2.8.
        Bt470Bg = 5, "bt470bg";
        /// SMPTE 170M: the same function as BT.709.
        Smpte170M = 6, "smpte170m";
        /// SMPTE 240M of 1987.
        Smpte240M = 7, "smpte240m";
        /// Samples are proportional to light.
        Linear = 8, "linear";
    }
}

coded! {
    /// Weights that form luma and chroma from red, green and blue (matrix_coefficients, Table 6-9).
    MatrixCoefficients {
        /// Rec. ITU-R BT.709: high definition.
        #[default]
        Bt709 = 1, "bt709";
        /// Unspecified in the stream.
        Unspecified = 2, "unknown";
        /// FCC: original NTSC.
        Fcc = 4, "fcc";
        /// Rec. ITU-R BT.470-2 System B, G: 625 lines.
        Bt470Bg = 5, "bt470bg";
        /// SMPTE 170M: 525 lines; the weights equal `Bt470Bg`.
        Smpte170M = 6, "smpte170m";
        /// SMPTE 240M of 1987.
        Smpte240M = 7, "smpte240m";
    }
}

/// Color description of the pictures (colour_description, 6.3.6); all three fields default to BT.709.
///
/// ```
/// use mpeg2enc::{ColorDescription, ColorPrimaries, Config, FrameRate, MatrixCoefficients};
/// let color = ColorDescription {
///     primaries: ColorPrimaries::Bt470Bg,
///     matrix: MatrixCoefficients::Bt470Bg,
///     ..ColorDescription::default()
/// };
/// let config = Config::new(720, 576, FrameRate::FPS_25).with_color(color);
/// # config.validate().unwrap();
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ColorDescription {
    /// Chromaticities of red, green, blue and white.
    pub primaries: ColorPrimaries,
    /// Transfer function between light and samples.
    pub transfer: TransferCharacteristics,
    /// Weights that form luma and chroma.
    pub matrix: MatrixCoefficients,
}
