//! Light that is carried from the frame before: what neither moves nor changes is not lit again.
//!
//! Direct light is carried to surfaces at rest where nothing has moved between them and the lamps; indirect light, while no light
//! and no thing in the scene changes. In turns all light is found anew.

use super::cache::around::{Around, Movement};
use super::cuts::{Allowance, LEAST_REFLECTANCE, relative_threshold, threshold};
use crate::figures::FrameFigures;
use crate::renderer::frame::Frame;
use crate::settings::Settings;
use glam::Vec3A;
use plane::{Correspondence, Plane};
use render_core::{
    AuditCounts, Busy, CarriedLight, Completed, Destination, DirectLights, GBuffer, MACROBLOCK, Reuse, Source, Unseen,
    luminance,
};
use std::f32::consts::PI;
use std::sync::Arc;

/// Distance of moving things and their shadows from a pixel up to which its light is not carried \[pixels\].
const BESIDE: f32 = 2.0;
/// Each macroblock is lit anew once in this number of frames.
const TURN: usize = 16;
/// Mean square of the errors by carrying, in squares of ΔY: its least and largest, and the quantiser_scale at which it is 1. As
/// the error of coding, it grows with the square of quantiser_scale.
///
/// At 192×192, 0.25 at quantiser 2 takes 0.15 dB of decoded luma in Sponza and nothing in Sibenik, where all thresholds of 2
/// together take 0.3. At 16 and 48, 1 takes at most 0.05 dB there, and 2 at most 0.06.
const ALLOWED_ONE: f32 = 16.0;
const ALLOWED: (f32, f32) = (0.25, 2.0);

/// The light of the frame before, and what it depends on.
#[derive(Default)]
pub(super) struct Carry {
    pub light: Light,
    /// The lamps of the frame before.
    lamps: Option<Arc<DirectLights>>,
    found: Found,
}

/// Irradiance, by where it comes from.
#[derive(Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Light {
    direct: CarriedLight,
    indirect: CarriedLight,
}

/// How the light of the last frame was found.
#[derive(Default)]
struct Found {
    /// Pixels whose direct and indirect light were computed.
    computed: [Plane<bool>; 2],
    /// Pixels that reflect light.
    lit: usize,
    audits: AuditCounts,
}

/// A frame that light is carried to.
pub(super) struct To<'a> {
    pub settings: &'a Settings,
    pub frame: &'a Frame<'a>,
    pub seen: &'a GBuffer,
    pub known: Option<&'a Correspondence>,
    pub movement: &'a Movement,
    pub allowance: &'a Allowance,
}

impl Carry {
    /// As it was after frame `last`.
    pub fn resumed(light: Light, last: &Frame) -> Self {
        Self { light, lamps: Some(last.direct.clone()), found: Found::default() }
    }

    /// Direct light of a frame: carried over, and from `light` for the pixels where that does not do.
    pub fn direct(
        &mut self,
        to: &To,
        busy: &Busy,
        light: impl FnOnce(&Plane<bool>) -> Plane<[f32; 3]>,
    ) -> Plane<[f32; 3]> {
        let now = &to.frame.direct;
        let before = self.lamps.replace(now.clone());
        let known = before.filter(|before| before.has_lamps_of(now)).and(to.known);
        let (sources, swept) = (now.sources(), &to.movement.swept);
        let mut moves = vec![false; to.seen.world.len()];
        swept.iter().for_each(|thing| moves[thing.instance as usize] = true);
        let reuse = |x: usize, y: usize| {
            let pixel = to.seen.pixels.get(x, y);
            // The sample that a pixel keeps is beside it, and has to hold as well.
            let margin = BESIDE * to.seen.view.pixel_width(pixel.depth);
            let is_shaded_by = |thing: &Around| {
                let thing = thing.grown(margin);
                sources.iter().any(|source| shades(&thing, pixel.position.into(), source))
            };
            let is_disturbed = moves[pixel.instance as usize] || swept.iter().any(is_shaded_by);
            if is_disturbed { Reuse::Forbidden } else { to.reuse(x, y) }
        };
        let destination = Destination { seen: to.seen, known, unseen: Unseen::Shadows, allowed: to.allowed() };
        let tolerance = |x, y, e| to.tolerance(x, y, e);
        let carried = busy.take(self.light.direct.carry(destination, reuse, tolerance));
        let missing = carried.missing.clone();
        let Completed { irradiance, audits, .. } = carried.complete(&light(&missing), to.seen, &mut self.light.direct);
        let lit = to.seen.pixels.samples().iter().filter(|pixel| pixel.reflects()).count();
        self.found = Found { computed: [missing.clone(), missing], lit, audits };
        irradiance
    }

    /// Indirect light of a frame, which is that of the frame before if the scene `is_unchanged`; `light` has that of a few
    /// pixels, or of all.
    pub fn indirect(
        &mut self,
        to: &To,
        is_unchanged: bool,
        busy: &Busy,
        light: impl FnOnce(Option<&Plane<bool>>) -> Plane<[f32; 3]>,
    ) -> Plane<[f32; 3]> {
        let known = to.known.filter(|_| is_unchanged);
        let destination = Destination { seen: to.seen, known, unseen: Unseen::Smooth, allowed: to.allowed() };
        let tolerance = |x, y, e| to.tolerance(x, y, e);
        let carried = busy.take(self.light.indirect.carry(destination, |x, y| to.reuse(x, y), tolerance));
        let missing = carried.missing.clone();
        let lit = light(is_unchanged.then_some(&missing));
        let Completed { irradiance, audits, .. } = carried.complete(&lit, to.seen, &mut self.light.indirect);
        self.found.computed[1] = missing;
        self.found.audits.within += audits.within;
        self.found.audits.all += audits.all;
        irradiance
    }

    /// Counts of the last frame.
    pub fn put_into(&self, figures: &mut FrameFigures) {
        let Found { computed: [direct, indirect], lit, audits: AuditCounts { within, all } } = &self.found;
        let shaded =
            direct.samples().iter().zip(indirect.samples()).filter(|(direct, indirect)| **direct || **indirect);
        figures.shaded_share = shaded.count() as f64 / (*lit).max(1) as f64;
        figures.carried_share = 1.0 - figures.shaded_share;
        figures.audit_carried_within = (*all > 0).then(|| *within as f64 / *all as f64);
    }

    /// [`Aov::Shading`](crate::settings::Aov::Shading) of the last frame, whose surfaces are `seen`.
    pub fn reused(&self, seen: &GBuffer) -> Vec<f32> {
        let [direct, indirect] = &self.found.computed;
        let pixels = seen.pixels.samples().iter().zip(direct.samples().iter().zip(indirect.samples()));
        let reused = |reflects: bool, direct: bool, indirect: bool| {
            f32::from(u8::from(reflects && !direct) + 2 * u8::from(reflects && !indirect))
        };
        pixels.map(|(pixel, (&direct, &indirect))| reused(pixel.reflects(), direct, indirect)).collect()
    }
}

impl To<'_> {
    /// Whether the light of a pixel, where it has not changed, is carried over or found anew.
    fn reuse(&self, x: usize, y: usize) -> Reuse {
        // Odd multipliers: macroblocks in their turn do not lie side by side.
        let turn = x / MACROBLOCK * 7 + y / MACROBLOCK * 19 + self.frame.index as usize;
        if turn.is_multiple_of(TURN) { Reuse::Audited } else { Reuse::Allowed }
    }

    /// [`Destination::allowed`] at the quantiser of the film.
    fn allowed(&self) -> f32 {
        (self.settings.qscale as f32 / ALLOWED_ONE).powi(2).clamp(ALLOWED.0, ALLOWED.1)
    }

    /// Error that the luminance of a pixel's irradiance may have where it is carried, given that it is `irradiance`.
    fn tolerance(&self, x: usize, y: usize, irradiance: f32) -> f32 {
        let albedo = luminance(self.seen.pixels.get(x, y).albedo.into()).max(LEAST_REFLECTANCE);
        threshold(self.settings, self.allowance, x, y)
            .map_or_else(|| relative_threshold(self.settings) * irradiance, |threshold| threshold * PI / albedo)
    }
}

/// Whether `thing` may stand between a point and a light.
fn shades(thing: &Around, point: Vec3A, source: &Source) -> bool {
    match *source {
        Source::Lamp { low, high } => thing.is_between(point, low, high),
        Source::Sun { towards, angular_radius } => {
            // Beyond the box there is nothing to cross.
            let far = thing.farthest(point);
            let (center, radius) = (point + towards * far, angular_radius.tan() * far);
            thing.is_between(point, center - radius, center + radius)
        }
    }
}
