//! Light that is carried from the frame before: what neither moves nor changes is not lit again.
//!
//! A layer says where its light of the frame before still holds. There a pixel takes it, where the error of that is within what
//! the pixel may have; in turns all light is found anew, to see how wrong carrying would have been.

use super::audits::{Audits, reuse_in_turns};
use super::layer::{Layer, Lit, Visible};
use super::tolerance::Tolerance;
use crate::frame::Frame;
use crate::settings::Aov;
use pipeline::error::Result;
use pipeline::state::{decode, encode};
use plane::Plane;
use render_core::{Busy, CarriedLight, Completed, Destination, Reuse, Unseen};
use serde::{Deserialize, Serialize};

/// Mean square of the errors by carrying, in squares of ΔY: its least and largest, and the quantiser_scale at which it is 1. As
/// the error of coding, it grows with the square of quantiser_scale.
///
/// At 192×192, 0.25 at quantiser 2 takes 0.15 dB of decoded luma in Sponza and nothing in Sibenik, where all thresholds of 2
/// together take 0.3. At 16 and 48, 1 takes at most 0.05 dB there, and 2 at most 0.06.
const ALLOWED_ONE: f32 = 16.0;
const ALLOWED: (f32, f32) = (0.25, 2.0);

/// A layer of irradiance that knows what of its light still holds in the next frame.
pub(super) trait Carriable: Layer {
    /// Contrast of its light that samples may miss.
    const UNSEEN: Unseen;

    /// Where the light that it had in the frame before is that of `visible`. Asked once in each frame, before its light.
    fn holding<'a>(&mut self, visible: &Visible<'a>) -> Holding<'a>;
}

/// Surfaces whose light has not changed.
pub(super) enum Holding<'a> {
    Nowhere,
    Everywhere,
    /// The surfaces of the pixels for which this is true, given column and row.
    Where(Box<dyn Fn(usize, usize) -> bool + Sync + 'a>),
}

/// A layer whose light is carried from frame to frame where it holds.
pub(super) struct Carried<L> {
    layer: L,
    light: CarriedLight,
    /// [`Destination::allowed`].
    allowed: f32,
}

impl<L> Carried<L> {
    /// Light of `layer` for a film at this quantiser_scale, 1…112.
    pub fn new(layer: L, quantiser_scale: u32) -> Self {
        let allowed = (quantiser_scale as f32 / ALLOWED_ONE).powi(2).clamp(ALLOWED.0, ALLOWED.1);
        Self { layer, light: CarriedLight::default(), allowed }
    }
}

impl<L: Carriable> Layer for Carried<L> {
    /// Finds the light of all pixels in their first sample, wanted or not: the next frame may take it from any of them.
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        if visible.sample > 0 {
            return self.layer.light(visible, wanted, tolerance);
        }
        let Visible { frame, matte, motion, .. } = *visible;
        let busy = Busy::default();

        // Light that changes everywhere is not compared with that of the frame before.
        let holding = self.layer.holding(visible);
        let holds_nowhere = matches!(holding, Holding::Nowhere);
        let known = motion.filter(|_| !holds_nowhere);
        let reuse = |x: usize, y: usize| match &holding {
            Holding::Where(holds) if !holds(x, y) => Reuse::Forbidden,
            _ => reuse_in_turns(x, y, frame.index),
        };
        let of_pixel =
            |x, y, irradiance| tolerance.of_irradiance(x, y, matte.pixels.get(x, y).albedo.into(), irradiance);
        let destination = Destination { seen: matte, known, unseen: L::UNSEEN, allowed: self.allowed };
        let carried = busy.take(self.light.carry(destination, reuse, of_pixel));

        // The layer lights the rest.
        let missing = carried.missing.clone();
        let mut lit = self.layer.light(visible, (!holds_nowhere).then_some(&missing), tolerance);
        let computed =
            lit.irradiance.take().unwrap_or_else(|| Plane::filled(missing.width(), missing.height(), [0.0; 3]));
        let Completed { irradiance, audits, .. } = carried.complete(&computed, matte, &mut self.light);
        lit += Lit {
            computed: Some(missing),
            seconds: busy.seconds(),
            audits: Audits { carried: audits, ..Audits::default() },
            ..Lit::of_irradiance(irradiance)
        };
        lit
    }

    fn is_dark(&self, frame: &Frame<'_>) -> bool {
        self.layer.is_dark(frame)
    }

    fn keep(&mut self, aov: Aov) {
        self.layer.keep(aov);
    }

    fn channel(&self, aov: Aov, frame: &Frame<'_>) -> Option<Vec<f32>> {
        self.layer.channel(aov, frame)
    }

    fn forget(&mut self) {
        self.light = CarriedLight::default();
        self.layer.forget();
    }

    fn state(&self) -> Vec<u8> {
        encode(&WrittenCarried { light: &self.light, layer: self.layer.state() })
    }

    fn restore(&mut self, state: &[u8], last: &Frame<'_>) -> Result<()> {
        let Read { light, layer } = decode(state)?;
        self.light = light;
        self.layer.restore(&layer, last)
    }
}

/// The state as it is written.
#[derive(Serialize)]
struct WrittenCarried<'a> {
    light: &'a CarriedLight,
    layer: Vec<u8>,
}

/// The state as it is read.
#[derive(Deserialize)]
struct Read {
    light: CarriedLight,
    layer: Vec<u8>,
}
