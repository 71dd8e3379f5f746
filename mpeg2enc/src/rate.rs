//! Bit rates and the modes of rate control.

mod passes;

pub use passes::Passes;

/// Fullness of the buffer at the beginning, and again at the end of each window, in 16ths. It leaves room for the first I picture
/// and for later pictures. Both must be equal, because a film spends any difference over its length. With 13 at the beginning and
/// 10 at the end, a second of film exceeded its rate by 9 %.
const LEVEL_SIXTEENTHS: i64 = 11;

/// Mode of rate control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Rate {
    /// Constant quantiser_scale from the settings; bits are not bounded.
    #[default]
    ConstantQuantiser,
    /// Constant bit rate. vbv_delay codes when each picture is due, and the buffer never overflows.
    Constant {
        /// Bits per second, rounded up to a multiple of 400.
        bits_per_second: u32,
        /// Size of the decoder's buffer in bits, rounded down to a multiple of 16384.
        buffer_bits: u32,
    },
    /// Maximum bit rate. The quantiser_scale of the settings becomes coarser only where a decoder at this rate would underflow.
    Capped {
        /// Maximum bits per second.
        bits_per_second: u32,
        /// Size of the decoder's buffer, in bits.
        buffer_bits: u32,
    },
}

impl Rate {
    /// Returns bit_rate in units of 400 bits per second and vbv_buffer_size in units of 16 384 bits, if they are bounded.
    pub(crate) fn stated(self) -> Option<(u32, u32)> {
        match self {
            Self::ConstantQuantiser => None,
            Self::Constant { bits_per_second, buffer_bits } | Self::Capped { bits_per_second, buffer_bits } => {
                Some((bits_per_second.div_ceil(400), buffer_bits / 16_384))
            }
        }
    }
}

/// Returns the number of bits in a buffer of `size` bits when the first picture is removed.
pub(crate) fn starting_fullness(rate: Rate, size: i64) -> i64 {
    match rate {
        Rate::Constant { .. } => size * LEVEL_SIXTEENTHS / 16,
        _ => size,
    }
}
