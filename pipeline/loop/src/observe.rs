//! Observers of a running film.

use crate::report::FrameReport;
use crate::stage::{CodedUnit, Shaded};
use perceptual::YCbCr;
use plane::{Picture, Plane};
use std::sync::Mutex;

/// Receives the results of a run's stages. Each method is called on the thread of its stage, which continues after the
/// method returns. For longer work, send the data through a channel.
pub trait Observer: Sync {
    /// Receives the light of frame `index` and its channels, in display order.
    fn shaded(&self, _index: u32, _shaded: &Shaded) {}

    /// Receives the picture of frame `index` before coding, in display order.
    fn picture(&self, _index: u32, _picture: &YCbCr) {}

    /// Receives the importance of each pixel of frame `index`, 0…1, in display order. This method is
    /// called only if importance is in use.
    fn importance(&self, _index: u32, _importance: &Plane<f32>) {}

    /// Receives the permitted luminance error of each pixel of frame `index` \[W·m⁻²·sr⁻¹\], in display order. Frame
    /// `index` + 1 is rendered with these thresholds.
    fn thresholds(&self, _index: u32, _delta: &Plane<f32>) {}

    /// Receives frame `index` as a decoder displays it, in coding order, if the encoder provides it.
    fn decoded(&self, _index: u32, _picture: &Picture) {}

    /// Receives the next bytes of the film.
    fn bytes(&self, _bytes: &[u8]) {}

    /// Receives the next picture of the elementary stream, in coding order, if the encoder provides it.
    fn coded(&self, _unit: &CodedUnit) {}

    /// Receives the report of a coded frame, in coding order.
    fn frame(&self, _report: &FrameReport) {}
}

/// Observer that ignores all results.
impl Observer for () {}

/// Observer that passes each frame's report to a function.
pub struct OnFrame<F>(Mutex<F>);

impl<F: FnMut(&FrameReport) + Send> OnFrame<F> {
    /// Returns an observer that calls `tell` with each frame's report.
    pub fn new(tell: F) -> Self {
        Self(Mutex::new(tell))
    }
}

impl<F: FnMut(&FrameReport) + Send> Observer for OnFrame<F> {
    fn frame(&self, report: &FrameReport) {
        // Ignore lock poisoning: the panic of an earlier call is reported separately.
        let mut tell = self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        tell(report);
    }
}
