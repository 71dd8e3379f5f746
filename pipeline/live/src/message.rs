//! Messages between server and page: pictures with a fixed header, and inputs as JSON.

use crate::controls::Controls;
use axum::body::Bytes;
use serde::Deserialize;
use std::time::Duration;

/// Version of the header.
const VERSION: u8 = 1;
/// Length of the header before the picture \[bytes\].
pub const HEADER: usize = 64;

/// Message of a viewer.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum ViewerMessage {
    /// Answer to the first message.
    Hello,
    /// Acknowledgement of a picture and all earlier ones.
    Seen {
        /// Number of the picture.
        sequence: u32,
        /// Time from the picture's arrival to this message \[µs\].
        held: u32,
    },
    /// Input that moves the camera or the animation.
    Control {
        /// Number of the input, which later pictures contain.
        number: u32,
        /// Changes.
        controls: Controls,
    },
    /// Limits of rate and quality.
    Limits {
        /// Maximum bit rate \[bits/s\]; `None` for no limit.
        bits_per_second: Option<u32>,
        /// Quantiser of finished static views.
        best: Option<u32>,
    },
}

/// State of the session in a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureState {
    /// Whether the animation plays.
    pub is_playing: bool,
    /// Whether the picture differs from the last one by motion.
    pub is_moving: bool,
    /// Number of viewers.
    pub viewers: u8,
}

/// Header of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureHeader {
    /// Whether a decoder may start with the picture.
    pub is_intra: bool,
    /// State of the session.
    pub state: PictureState,
    /// Number of the picture.
    pub sequence: u32,
    /// Number of the last input in the picture.
    pub input: u32,
    /// Size of the picture \[bits\].
    pub bits: u64,
    /// quantiser_scale.
    pub quantiser_scale: u32,
    /// Fraction of the lit pixels with computed light.
    pub shaded_share: f64,
    /// Mean threshold, relative to luminance.
    pub threshold: f64,
    /// Time from the first input in the picture to the start of rendering.
    pub waited: Duration,
    /// Time of rendering and coding.
    pub rendered: Duration,
    /// CPU time of the picture \[s\].
    pub seconds: f64,
    /// Rate of acknowledged pictures \[bits/s\].
    pub rate: f64,
    /// Last round trip \[s\].
    pub round_trip: f64,
    /// CPU time of the server so far \[s\].
    pub process_seconds: f64,
}

impl PictureHeader {
    /// Returns the message: the header in little-endian order, then the `picture`.
    ///
    /// | bytes | content | bytes | content |
    /// |---|---|---|---|
    /// | 0 | version | 20–23 | time before rendering \[µs\] |
    /// | 1 | picture type: 1 I, 2 P | 24–27 | time of rendering \[µs\] |
    /// | 2 | flags: 1 plays, 2 moves | 28–31 | CPU time \[µs\] |
    /// | 3 | number of viewers | 32–35 | mean threshold, f32 |
    /// | 4–7 | number of the picture | 36–39 | rate \[bits/s\], f32 |
    /// | 8–11 | number of the last input | 40–43 | round trip \[s\], f32 |
    /// | 12–15 | size \[bits\] | 44–47 | fraction of computed light, f32 |
    /// | 16–19 | quantiser_scale | 48–55 | CPU time of the server \[s\], f64; then zeros |
    #[must_use]
    pub fn with(&self, picture: &[u8]) -> Bytes {
        let flags = u8::from(self.state.is_playing) | u8::from(self.state.is_moving) << 1;
        let micros = |time: Duration| u32::try_from(time.as_micros()).unwrap_or(u32::MAX);
        let mut bytes = Vec::with_capacity(HEADER + picture.len());
        bytes.extend([VERSION, if self.is_intra { 1 } else { 2 }, flags, self.state.viewers]);
        let cpu = Duration::try_from_secs_f64(self.seconds).unwrap_or_default();
        for number in [
            self.sequence,
            self.input,
            u32::try_from(self.bits).unwrap_or(u32::MAX),
            self.quantiser_scale,
            micros(self.waited),
            micros(self.rendered),
            micros(cpu),
        ] {
            bytes.extend(number.to_le_bytes());
        }
        for number in [self.threshold, self.rate, self.round_trip, self.shaded_share] {
            bytes.extend((number as f32).to_le_bytes());
        }
        bytes.extend(self.process_seconds.to_le_bytes());
        bytes.resize(HEADER, 0);
        bytes.extend(picture);
        bytes.into()
    }
}
