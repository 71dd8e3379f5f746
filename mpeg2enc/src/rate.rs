//! Bit rates, and how quantisers keep to them.

mod passes;

pub use passes::Passes;

/// Part of the buffer that is full at the beginning, and is to be full again at the end of each window, in 16ths: room for
/// the first I picture, and for what comes after. Any difference between the two would be spent over the length of the film:
/// with 13 and 10 a second of film took 9 % more than its rate.
const LEVEL_SIXTEENTHS: i64 = 11;

/// How quantisers are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Rate {
    /// By quantiser_scale alone; no bound on bits.
    #[default]
    ConstantQuantiser,
    /// This many bits a second, always: vbv_delay tells when each picture is due, and nothing overflows.
    Constant {
        /// Bits a second; a multiple of 400 is stated and kept, the next above.
        bits_per_second: u32,
        /// Size of the decoder's buffer, in bits; a multiple of 16384 is stated and kept, the next below.
        buffer_bits: u32,
    },
    /// By quantiser_scale, and coarser only where a decoder that reads at most this many bits a second would run dry.
    Capped {
        /// The most bits a second.
        bits_per_second: u32,
        /// Size of the decoder's buffer, in bits.
        buffer_bits: u32,
    },
}

impl Rate {
    /// bit_rate in units of 400 bits a second, and vbv_buffer_size in units of 16 384 bits, if they are bounded.
    pub(crate) fn stated(self) -> Option<(u32, u32)> {
        match self {
            Self::ConstantQuantiser => None,
            Self::Constant { bits_per_second, buffer_bits } | Self::Capped { bits_per_second, buffer_bits } => {
                Some((bits_per_second.div_ceil(400), buffer_bits / 16_384))
            }
        }
    }
}

/// Bits in a buffer of `size` bits when the first picture is taken out.
pub(crate) fn starting_fullness(rate: Rate, size: i64) -> i64 {
    match rate {
        Rate::Constant { .. } => size * LEVEL_SIXTEENTHS / 16,
        _ => size,
    }
}
