//! Reprojection of the previous frame's light: unchanged light of static surfaces is not recomputed.
//!
//! A layer reports the surfaces with unchanged light. Their pixels use the reprojected light if the error of
//! reprojection is within the permitted error. Macroblocks are recomputed in rotation to measure that error.

use super::audits::{Audits, reuse_in_turns};
use super::layer::{Layer, Lit, Visible};
use super::tolerance::Tolerance;
use crate::frame::Frame;
use crate::settings::Aov;
use pipeline::error::Result;
use pipeline::state::{decode, encode};
use plane::Plane;
use render_core::{Busy, Completed, Destination, GBuffer, ReprojectedLight, Reuse, Unseen};
use serde::{Deserialize, Serialize};

/// quantiser_scale at which the permitted mean square error of reprojection is 1, in units of ΔY². Like the error of
/// coding, the permitted error grows with the square of quantiser_scale.
///
/// The following losses of decoded luma were measured at 192×192. At quantiser 2, an error of 0.25 costs 0.15 dB in
/// Sponza and nothing in Sibenik, where all thresholds together cost 0.3 dB. At quantiser 16, an error of 1 costs at
/// most 0.05 dB. At quantiser 48, an error of 2 costs at most 0.06 dB.
const ALLOWED_ONE: f32 = 16.0;
/// Minimum and maximum of the permitted mean square error of reprojection, in units of ΔY².
const ALLOWED: (f32, f32) = (0.25, 2.0);

/// Layer of irradiance that detects unchanged light.
pub(super) trait Reprojectable: Layer {
    /// Contrast of light that samples may miss, such as shadow edges.
    const UNSEEN: Unseen;

    /// Returns the surfaces of `visible` with unchanged light since the previous frame. It is called once per frame,
    /// before `light`.
    fn holding<'a>(&mut self, visible: &Visible<'a>) -> Holding<'a>;
}

/// Surfaces with unchanged light.
pub(super) enum Holding<'a> {
    Nowhere,
    Everywhere,
    /// All surfaces in pixels (column, row) for which the predicate is true.
    Where(Box<dyn Fn(usize, usize) -> bool + Sync + 'a>),
}

/// Layer with reprojection of unchanged light.
#[derive(Clone)]
pub(super) struct Reprojected<L> {
    layer: L,
    light: ReprojectedLight,
    /// Permitted mean square error of reprojection; see [`Destination::allowed`].
    allowed: f32,
    /// Maximum fraction of the pixels for which light is computed; `None` without a limit.
    budget: Option<f32>,
}

/// Returns the number of pixels of `surfaces` that are lit with a `budget`.
pub(super) fn most_lit(budget: Option<f32>, surfaces: &GBuffer) -> Option<usize> {
    budget.map(|share| (share * surfaces.pixels.samples().len() as f32).ceil() as usize)
}

impl<L> Reprojected<L> {
    /// Wraps `layer` for a film coded with `quantiser_scale`, 1…112.
    pub fn new(layer: L, quantiser_scale: u32) -> Self {
        let allowed = allowed_error(quantiser_scale);
        Self { layer, light: ReprojectedLight::default(), allowed, budget: None }
    }
}

/// Returns the permitted mean square error of reprojection in a film coded with `quantiser_scale`, 1…112, in squares of
/// the tolerance.
pub(super) fn allowed_error(quantiser_scale: u32) -> f32 {
    (quantiser_scale as f32 / ALLOWED_ONE).powi(2).clamp(ALLOWED.0, ALLOWED.1)
}

impl<L: Reprojectable + Clone + 'static> Layer for Reprojected<L> {
    /// Lights all pixels in the first sample, including unwanted ones: the next frame may reproject any of them.
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        // Reproject only the first sample.
        if visible.sample > 0 {
            return self.layer.light(visible, wanted, tolerance);
        }
        let Visible { frame, matte, motion, .. } = *visible;
        let busy = Busy::default();

        // Compare with the previous frame only if some light is unchanged.
        let holding = self.layer.holding(visible);
        let holds_nowhere = matches!(holding, Holding::Nowhere);
        let known = motion.filter(|_| !holds_nowhere);
        let reuse = |x: usize, y: usize| match &holding {
            Holding::Where(holds) if !holds(x, y) => Reuse::Forbidden,
            _ => reuse_in_turns(x, y, frame.index),
        };
        let of_pixel =
            |x, y, irradiance| tolerance.of_irradiance(x, y, matte.pixels.get(x, y).albedo.into(), irradiance);
        // Light that changes everywhere has no budget: reprojected light would be wrong.
        let most = most_lit(self.budget.filter(|_| !holds_nowhere), matte);
        let destination = Destination { seen: matte, known, unseen: L::UNSEEN, allowed: self.allowed, most };
        let reprojected = busy.take(self.light.carry(destination, reuse, of_pixel));

        // Let the layer light the remaining pixels.
        let missing = reprojected.missing.clone();
        let mut lit = self.layer.light(visible, (!holds_nowhere).then_some(&missing), tolerance);
        let computed =
            lit.irradiance.take().unwrap_or_else(|| Plane::filled(missing.width(), missing.height(), [0.0; 3]));
        let completed = reprojected.complete(&computed, matte, &mut self.light);
        let Completed { irradiance, audits, open, .. } = busy.take(completed);
        lit += Lit {
            computed: Some(missing),
            open: open as u64,
            seconds: busy.seconds(),
            audits: Audits { reprojected: audits, ..Audits::default() },
            ..Lit::of_irradiance(irradiance)
        };
        lit
    }

    fn is_dark(&self, frame: &Frame<'_>) -> bool {
        self.layer.is_dark(frame)
    }

    fn copy(&self) -> Option<Box<dyn Layer>> {
        Some(Box::new(self.clone()))
    }

    fn set_quantiser_scale(&mut self, quantiser_scale: u32) {
        self.allowed = allowed_error(quantiser_scale);
    }

    fn set_budget(&mut self, share: Option<f32>) {
        self.budget = share;
    }

    fn keep(&mut self, aov: Aov) {
        self.layer.keep(aov);
    }

    fn channel(&self, aov: Aov, frame: &Frame<'_>) -> Option<Vec<f32>> {
        self.layer.channel(aov, frame)
    }

    fn forget(&mut self) {
        self.light = ReprojectedLight::default();
        self.layer.forget();
    }

    fn state(&self) -> Vec<u8> {
        encode(&WrittenReprojected { light: &self.light, layer: self.layer.state() })
    }

    fn restore(&mut self, state: &[u8], last: &Frame<'_>) -> Result<()> {
        let Read { light, layer } = decode(state)?;
        self.light = light;
        self.layer.restore(&layer, last)
    }
}

/// State of the layer with borrowed data, for serialization.
#[derive(Serialize)]
struct WrittenReprojected<'a> {
    light: &'a ReprojectedLight,
    layer: Vec<u8>,
}

/// State of the layer with owned data, for deserialization.
#[derive(Deserialize)]
struct Read {
    light: ReprojectedLight,
    layer: Vec<u8>,
}
