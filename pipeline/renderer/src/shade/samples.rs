//! The samples of a frame's pixels: their surfaces, and their light before it is one picture.

use super::importance::ImportanceMap;
use super::layer::{Lit, Visible};
use super::lit_frame::{Reused, Sample};
use super::movement::{InstancePose, Movement};
use crate::frame::PreparedFrame;
use glam::Vec3;
use plane::Plane;
use render_core::ranks::Ranks;
use render_core::{Busy, Coverage, GBuffer, PixelSample, PosedScene};

/// Light of a frame through the places of its pixels, before it is one picture.
#[derive(Default)]
pub(super) struct SamplesLight {
    pub samples: Vec<Sample>,
    /// The layers of pixels that show several, for each of several samples ([`StoredLight::layers`](super::lit_frame::StoredLight::layers)).
    pub layers: Vec<Coverage>,
    /// Times and counts of all samples.
    pub direct: Lit,
    pub indirect: Lit,
    pub reused: Reused,
    pub importance: Option<ImportanceMap>,
    /// Where the instances are.
    pub places: Vec<Option<InstancePose>>,
    /// CPU time of primary rays and importance.
    pub visibility: Busy,
}

/// The surfaces that pixels show through one place of each.
pub(super) struct SampleSurfaces<'f> {
    /// Surfaces in the middle of each pixel, as the G-buffer has them.
    pub seen: &'f GBuffer,
    /// Surfaces at the sample's place; none if it is the middle of the pixel.
    pub own: Option<GBuffer>,
    /// Surfaces at the sample's place with the albedo below their coats; none in scenes without coats.
    pub below: Option<GBuffer>,
    /// Radiance that each pixel's surface emits \[W·m⁻²·sr⁻¹\].
    pub emitted: Plane<Vec3>,
}

impl SampleSurfaces<'_> {
    /// The surfaces as [`Layer`](super::layer::Layer) takes them, for sample number `sample`.
    pub fn visible<'a>(
        &'a self,
        prepared: &'a PreparedFrame,
        sample: usize,
        movement: &'a Movement,
        ranks: &'a dyn Ranks,
    ) -> Visible<'a> {
        let surfaces = self.own.as_ref().unwrap_or(self.seen);
        Visible {
            frame: &prepared.frame,
            surfaces,
            matte: self.below.as_ref().unwrap_or(surfaces),
            sample,
            part: None,
            motion: prepared.correspondence.as_deref(),
            radiance: &self.emitted,
            ranks,
            movement,
        }
    }

    /// The layers of pixels that show several, where the `sample` of each pixel shows this light.
    pub fn layers(&self, prepared: &PreparedFrame, sample: PixelSample, light: &Sample, busy: &Busy) -> Coverage {
        let seen = self.own.as_ref().unwrap_or(self.seen);
        if seen.layered.is_empty() {
            return Coverage::default();
        }
        let scene = PosedScene::new(&prepared.frame.accelerator, &prepared.frame.surfaces);
        busy.take(Coverage::of_layers(seen, scene, &light.whole(), sample))
    }
}
