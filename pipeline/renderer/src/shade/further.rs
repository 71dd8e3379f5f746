//! Further samples of a lit frame.

use super::Shading;
use super::fine::{CodeCurve, FinePixels, FirstSample};
use super::samples::{Common, SamplesLight};
use super::tolerance::Tolerance;
use crate::frame::PreparedFrame;
use render_core::{GBuffer, PosedScene};

impl Shading<'_> {
    /// Lights further samples of the pixels that need them.
    pub(super) fn light_finer(
        &mut self,
        prepared: &PreparedFrame,
        common: Common,
        tolerance: &Tolerance,
        lit: &mut SamplesLight,
    ) {
        // Choose the pixels by the light of the first sample.
        let (frame, seen) = (&prepared.frame, &*prepared.frame.seen);
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let curve = CodeCurve::of(&lit.samples[0].whole(), &self.settings);
        let mut fine =
            lit.visibility.measure(|| FinePixels::choose(seen, &lit.samples[0], lit.coverage.as_ref(), &curve));
        // Light sample after sample, while pixels need one.
        let scene = PosedScene::new(&frame.accelerator, &frame.surfaces);
        let centers = self.surfaces_of(frame, None);
        let matte = centers.below.as_ref().unwrap_or(seen);
        let first = FirstSample { matte, indirect: &lit.samples[0].indirect, coats: lit.coats.as_ref() };
        while let Some((place, wanted)) = fine.next(width, height, &curve) {
            let own = lit.visibility.take(GBuffer::trace_wanted(place, scene, &seen.view, &wanted));
            let of_sample = self.surfaces_of(frame, Some(own));
            let visible = of_sample.visible(prepared, fine.count(), common);
            let (light, cost) = self.layers.further_sample(&visible, &wanted, tolerance, &first);
            fine.add(&light, &wanted);
            lit.direct.add_counts(cost);
        }
        lit.fine = Some(fine);
    }
}
