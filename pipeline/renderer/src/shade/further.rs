//! Further samples of a lit frame.

use super::Shading;
use super::fine::{CodeCurve, FinePixels, FirstSample, rough_pixels};
use super::layer::Visible;
use super::samples::{Common, SampleSurfaces, SamplesLight};
use crate::frame::PreparedFrame;
use render_core::{GBuffer, LightPoints, PosedScene};

impl Shading<'_> {
    /// Lights further samples of the pixels that need them. `centers` are the surfaces of the first sample.
    pub(super) fn light_finer(
        &mut self,
        prepared: &PreparedFrame,
        common: Common,
        centers: &SampleSurfaces,
        lit: &mut SamplesLight,
    ) {
        // Choose the pixels by the light of the first sample.
        let (frame, seen) = (&prepared.frame, &*prepared.frame.seen);
        let (width, height) = (seen.pixels.width(), seen.pixels.height());
        let light = lit.samples[0].whole();
        let curve = CodeCurve::of(&light, &self.settings);
        let pixels = lit.visibility.measure(|| rough_pixels(seen, &light, lit.coverage.as_ref(), &curve));
        let mut fine = FinePixels::new(pixels, &lit.samples[0]);

        // Light sample after sample, while pixels need one.
        let scene = PosedScene::new(&frame.accelerator, &frame.surfaces);
        let matte = centers.below.as_ref().unwrap_or(seen);
        let first = FirstSample { matte, indirect: &lit.samples[0].indirect, coats: lit.coats.as_ref() };
        while let Some((place, wanted)) = fine.next(width, height, &curve).filter(|_| !self.has_stopped()) {
            let own = lit.visibility.take(GBuffer::trace_wanted(place, scene, &seen.view, &wanted));
            let of_sample = self.surfaces_of(frame, Some(own));
            let points = LightPoints::Quarter(fine.count());
            let visible = Visible { points, ..of_sample.visible(prepared, fine.count(), common) };
            let (light, cost) = self.layers.further_sample(&visible, &wanted, common.tolerance, &first);
            fine.add(&light, &wanted);
            lit.direct.add_counts(cost);
        }
        lit.fine = Some(fine);
    }
}
