//! Checks the decoder's buffer over a whole stream.

use crate::{Config, rate_control::RateControl, vbv::Buffer};

/// Upper bound on the bits of any picture.
const BITS_MAX: u64 = 1 << 40;

/// The video buffering verifier (Annex C), which tracks the decoder's buffer of a stream, picture by picture.
///
/// An encoder respects the buffer as long as the coarsest quantiser is coarse enough. Otherwise pictures are late, and the
/// verifier reports them.
///
/// ```
/// use mpeg2enc::{BufferVerifier, Config, FrameRate, Rate};
/// let rate = Rate::Capped { bits_per_second: 1_000_000, buffer_bits: 65_536 };
/// let config = Config::new(64, 48, FrameRate::FPS_25).with_lookahead(30).with_rate(rate);
/// let mut verifier = BufferVerifier::new(&config).expect("a bounded rate");
/// assert_eq!(verifier.take(65_536), 0.0); // as large as the buffer
/// assert_eq!(verifier.take(41_000), 0.001); // 40 000 bits have arrived since
/// ```
#[derive(Clone, Debug)]
#[must_use = "it reports which pictures are late"]
pub struct BufferVerifier {
    buffer: Buffer,
}

impl BufferVerifier {
    /// Returns the buffer when the first picture is due; `None` if the settings do not bound bits.
    #[must_use]
    pub fn new(config: &Config) -> Option<Self> {
        // The buffer does not depend on the number of macroblocks.
        RateControl::new(config, 0).map(|rate| Self { buffer: rate.buffer })
    }

    /// Removes the next picture in the order of coding. Returns the seconds by which it is late, or 0.
    pub fn take(&mut self, bits: u64) -> f64 {
        let bits = bits.min(BITS_MAX) as i64;
        let missing = (bits - self.buffer.bits()).max(0);
        self.buffer.take(bits);
        missing as f64 / self.buffer.bit_rate as f64
    }
}
