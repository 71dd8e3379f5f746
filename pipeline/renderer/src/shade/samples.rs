//! Samples of a frame's pixels: their surfaces and light before reconstruction.

use super::fine::FinePixels;
use super::importance::ImportanceMap;
use super::layer::KnownLight;
use super::layer::{Lit, Visible};
use super::lit_frame::Reused;
use super::movement::{InstancePose, Movement};
use super::sample::Sample;
use super::tolerance::Tolerance;
use crate::frame::PreparedFrame;
use glam::Vec3;
use plane::Plane;
use render_core::ranks::Ranks;
use render_core::{Busy, Coverage, GBuffer, LightPoints, PixelSample, PosedScene};
use std::sync::atomic::AtomicBool;

/// Light of all samples of a frame before reconstruction, with times and counts.
#[derive(Default)]
pub(super) struct SamplesLight {
    pub samples: Vec<Sample>,
    /// Pixels with further samples of their own.
    pub fine: Option<FinePixels>,
    /// Light of coats in the first sample; `None` in scenes without coats.
    pub coats: Option<Plane<Vec3>>,
    /// Surfaces of pixels that outlines cross, if already found.
    pub coverage: Option<Coverage>,
    /// Transparent layers within pixels, per sample, as in
    /// [`StoredLight::layers`](super::lit_frame::StoredLight::layers).
    pub layers: Vec<Coverage>,
    /// Times and counts of all samples.
    pub direct: Lit,
    pub indirect: Lit,
    pub reused: Reused,
    pub importance: Option<ImportanceMap>,
    /// Poses of the moving instances; `None` for a static instance.
    pub places: Vec<Option<InstancePose>>,
    /// CPU time of primary rays and importance.
    pub visibility: Busy,
}

/// State of a frame that all samples have in common.
#[derive(Clone, Copy)]
pub(super) struct Common<'a> {
    /// Motion since the previous frame.
    pub movement: &'a Movement,
    /// Light that is known before the frame is lit.
    pub known: Option<&'a dyn KnownLight>,
    pub ranks: &'a dyn Ranks,
    /// Permitted errors of the pixels.
    pub tolerance: &'a Tolerance<'a>,
    /// Flag after which the light is discarded; `None` if it never is.
    pub stop: Option<&'a AtomicBool>,
}

/// Visible surfaces of one sample of each pixel.
pub(super) struct SampleSurfaces<'f> {
    /// Surfaces at the pixel centers: the G-buffer.
    pub seen: &'f GBuffer,
    /// Surfaces at the sample positions; `None` if these are the pixel centers.
    pub own: Option<GBuffer>,
    /// Surfaces at the sample positions, with the albedo below their coats; `None` in scenes without coats.
    pub below: Option<GBuffer>,
    /// Radiance emitted by each pixel's surface \[W·m⁻²·sr⁻¹\].
    pub emitted: Plane<Vec3>,
}

impl SampleSurfaces<'_> {
    /// Returns the surfaces for a [`Layer`](super::layer::Layer). `sample` is the sample's number within pixels.
    pub fn visible<'a>(&'a self, prepared: &'a PreparedFrame, sample: usize, common: Common<'a>) -> Visible<'a> {
        let Common { movement, known, ranks, stop, .. } = common;
        // Use the G-buffer for samples at the pixel centers.
        let surfaces = self.own.as_ref().unwrap_or(self.seen);
        Visible {
            frame: &prepared.frame,
            surfaces,
            matte: self.below.as_ref().unwrap_or(surfaces),
            sample,
            points: LightPoints::All,
            part: None,
            motion: prepared.correspondence.as_deref(),
            radiance: &self.emitted,
            ranks,
            movement,
            known,
            stop,
        }
    }

    /// Returns the transparent layers within pixels, lit by the `light` of this `sample`.
    pub fn layers(&self, prepared: &PreparedFrame, sample: PixelSample, light: &Sample, busy: &Busy) -> Coverage {
        let seen = self.own.as_ref().unwrap_or(self.seen);
        if seen.layered.is_empty() {
            return Coverage::default();
        }
        let scene = PosedScene::new(&prepared.frame.accelerator, &prepared.frame.surfaces);
        busy.take(Coverage::of_layers(seen, scene, &light.whole(), sample))
    }
}
