//! Bit rates and the modes of rate control.

mod passes;

pub use passes::Passes;

/// Fullness of the buffer at the beginning, and again at the end of each window, in 16ths. It leaves room for the first I
/// picture and for later pictures. The two must be equal, because a film spends any difference over its length. With 13 and 10
/// a second of film exceeded its rate by 9 %.
const LEVEL_SIXTEENTHS: i64 = 11;

/// Mode of rate control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Rate {
    /// The quantiser_scale of the settings; no bound on bits.
    #[default]
    ConstantQuantiser,
    /// Constant bit rate. vbv_delay states when each picture is due, and the buffer never overflows.
    Constant {
        /// Bits per second, rounded up to a multiple of 400.
        bits_per_second: u32,
        /// Size of the decoder's buffer in bits, rounded down to a multiple of 16384.
        buffer_bits: u32,
    },
    /// The quantiser_scale of the settings; coarser only where a decoder that reads at this maximum rate would underflow.
    Capped {
        /// Maximum bits per second.
        bits_per_second: u32,
        /// Size of the decoder's buffer, in bits.
        buffer_bits: u32,
    },
}

impl Rate {
    /// bit_rate in units of 400 bits per second and vbv_buffer_size in units of 16 384 bits, if they are bounded.
    pub(crate) fn stated(self) -> Option<(u32, u32)> {
        match self {
            Self::ConstantQuantiser => None,
            Self::Constant { bits_per_second, buffer_bits } | Self::Capped { bits_per_second, buffer_bits } => {
                Some((bits_per_second.div_ceil(400), buffer_bits / 16_384))
            }
        }
    }
}

/// Bits in a buffer of `size` bits when the first picture is removed.
pub(crate) fn starting_fullness(rate: Rate, size: i64) -> i64 {
    match rate {
        Rate::Constant { .. } => size * LEVEL_SIXTEENTHS / 16,
        _ => size,
    }
}
