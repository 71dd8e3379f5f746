//! Observers of a run while it goes on.

use crate::parts::Shaded;
use crate::report::FrameReport;
use perceptual::YCbCr;
use plane::{Picture, Plane};
use std::sync::Mutex;

/// Sees what the stages of a run make. Each method is called from the thread of its stage, which goes on when it returns;
/// who wants to do more with what comes sends it on through a channel.
pub trait Observer: Sync {
    /// Frame `index` as light, with the channels that are kept of it, in display order.
    fn shaded(&self, _index: u32, _shaded: &Shaded) {}

    /// Frame `index` as it goes to the encoder, in display order.
    fn picture(&self, _index: u32, _picture: &YCbCr) {}

    /// Importance of each pixel of frame `index`, 0…1, in display order, where it steers anything.
    fn importance(&self, _index: u32, _importance: &Plane<f32>) {}

    /// The luminance that each pixel of frame `index` may be wrong by \[W·m⁻²·sr⁻¹\], in display order; frame `index` + 1 is
    /// rendered with them.
    fn thresholds(&self, _index: u32, _delta: &Plane<f32>) {}

    /// Frame `index` as decoders show it, in the order of coding, where the encoder tells.
    fn decoded(&self, _index: u32, _picture: &Picture) {}

    /// The next bytes of the film.
    fn bytes(&self, _bytes: &[u8]) {}

    /// A frame is coded, in the order of coding.
    fn frame(&self, _report: &FrameReport) {}
}

/// Sees nothing.
impl Observer for () {}

/// Sees what is told of each frame.
pub struct OnFrame<F>(Mutex<F>);

impl<F: FnMut(&FrameReport) + Send> OnFrame<F> {
    /// Calls `tell` with each frame.
    pub fn new(tell: F) -> Self {
        Self(Mutex::new(tell))
    }
}

impl<F: FnMut(&FrameReport) + Send> Observer for OnFrame<F> {
    fn frame(&self, report: &FrameReport) {
        let mut tell = self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        tell(report);
    }
}
