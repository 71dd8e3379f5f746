//! Visibility and thresholds of a frame, as cuts need them.

use super::WITHOUT_THRESHOLD;
use crate::figures::FrameFigures;
use crate::renderer::frame::Frame;
use crate::settings::{Lighting, Settings, Thresholds};
use glam::{Vec3, Vec3A};
use lighttree::{Audits, Calibration, Light, Scratch, Stop};
use perceptual::ThresholdMap;
use plane::Plane;
use render_core::sampling::{centered_sobol, concentric_disc, frame};
use render_core::{
    Accelerator, GBuffer, GatherDirections, Gathered, Hit, PACKET, PixelSurface, PosedScene, ShadingPoint, luminance,
};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Rays of a final gather. With as many, films of `cornell` and `nave` at 256×256 came no less near to paths when anchors were
/// softened over eight shares and more of the light was left to these rays.
const GATHER_RAYS: usize = 64;
/// The same where every light is evaluated: the noise of 64 would be a tenth of a reference's error, and their cost is small
/// beside that of the lights.
const GATHER_RAYS_OF_ALL_LIGHTS: usize = 256;

/// Rays that feel how open a pixel is. On `nave` 8 leave a tenth more error than 16 and need one record in a hundred more, 12 leave
/// one in a hundred more; in a simulation, 32 leave 3 % less than 16.
const FEELERS: usize = 16;

/// Reflectance below which a pixel needs no finer irradiance: its own light hardly matters.
pub(super) const LEAST_REFLECTANCE: f32 = 0.05;

/// Errors that the pixels of a frame may have.
pub(super) struct Allowance {
    pub map: ThresholdMap,
    /// Luminance that the pixels had in the frame before, where they were seen there.
    pub before: Option<ThresholdMap>,
    /// Errors measured so far, if cuts are to end by them.
    pub calibration: Option<Calibration>,
}

/// A cut that was made, to be compared with a finer one.
pub(super) struct MadeCut {
    /// Index of its entry among the errors.
    pub class: usize,
    /// The error that it may have.
    pub stop: Stop,
    pub radiance: Vec3,
}

/// A frame whose indirect light is computed, by many threads at once.
pub(super) struct LightTransport<'a> {
    pub settings: &'a Settings,
    pub prepared: &'a Frame<'a>,
    pub allowance: &'a Allowance,
    /// The surfaces that are lit.
    pub seen: &'a GBuffer,
    /// Radiance known before any cut.
    pub direct: &'a Plane<Vec3>,
    /// Whether there is bias compensation.
    pub compensates: bool,
    pub figures: &'a Figures,
    directions: GatherDirections,
    /// Cosine-distributed about +z.
    feelers: [Vec3; FEELERS],
}

impl<'a> LightTransport<'a> {
    pub fn new(
        settings: &'a Settings,
        prepared: &'a Frame,
        allowance: &'a Allowance,
        (seen, direct): (&'a GBuffer, &'a Plane<Vec3>),
        figures: &'a Figures,
    ) -> Self {
        let all_lights = settings.lighting == Lighting::AllLights;
        let directions = GatherDirections::new(if all_lights { GATHER_RAYS_OF_ALL_LIGHTS } else { GATHER_RAYS });
        let mut feelers = [Vec3::Z; FEELERS];
        for (feeler, u) in feelers.iter_mut().zip(centered_sobol(FEELERS)) {
            let p = concentric_disc(u);
            *feeler = p.extend((1.0 - p.length_squared()).max(0.0).sqrt());
        }
        Self { settings, prepared, allowance, seen, direct, compensates: false, figures, directions, feelers }
    }

    /// With the light that softening takes, or without.
    pub fn with_compensation(self, compensates: bool) -> Self {
        Self { compensates, ..self }
    }

    /// Whether light from `lamp` arrives at `receiver`.
    #[inline]
    pub fn visible(&self, receiver: &ShadingPoint, lamp: &Light) -> bool {
        sees(&self.prepared.accelerator, receiver, lamp)
    }

    /// Finds, among the first [`PACKET`] `lamps` whose bits are set in `active`, those whose light arrives from their `place`.
    pub fn visible_among<T>(
        &self,
        receiver: &ShadingPoint,
        lamps: &[T],
        place: impl Fn(&T) -> Vec3A,
        active: u64,
    ) -> u64 {
        if active == 0 {
            return 0;
        }
        let mut ends = [Vec3A::ZERO; PACKET];
        let mut above = 0;
        for (i, (end, lamp)) in ends.iter_mut().zip(lamps).enumerate() {
            *end = place(lamp);
            above |= u64::from(is_above(receiver, *end)) << i;
        }
        let active = active & above;
        active & !self.prepared.accelerator.occluded_packet(receiver.position, &ends[..lamps.len()], active)
    }

    /// Final gather at `receiver`; `key` turns its rays.
    pub fn final_gather(&self, receiver: &ShadingPoint, key: u64) -> Gathered {
        let Frame { accelerator, surfaces, gather, .. } = self.prepared;
        gather.gather(PosedScene::new(accelerator, surfaces), receiver, &self.directions, key)
    }

    /// Mean of d / (d + `scale`) for the distances d of what is around, 0 for what `encloses` the receiver; the same directions
    /// about the same normal.
    pub fn openness(&self, receiver: &ShadingPoint, scale: f32, encloses: impl Fn(&Hit, Vec3A) -> bool) -> f32 {
        let normal = Vec3::from(receiver.normal);
        let (x, y) = frame(normal);
        let (mut sum, mut count) = (0.0, 0);
        for local in &self.feelers {
            let direction = Vec3A::from(x * local.x + y * local.y + normal * local.z);
            if direction.dot(receiver.geometric_normal) > 0.0 {
                let met = self.prepared.accelerator.closest(receiver.position, direction);
                sum += match met {
                    None => 1.0,
                    Some(hit) if encloses(&hit, direction) => 0.0,
                    Some(hit) => hit.distance / (hit.distance + scale),
                };
                count += 1;
            }
        }
        if count == 0 { 1.0 } else { sum / count as f32 }
    }

    /// The absolute threshold of a pixel, if it has one \[W·m⁻²·sr⁻¹\].
    pub fn threshold(&self, x: usize, y: usize) -> Option<f32> {
        threshold(self.settings, self.allowance, x, y)
    }

    /// Share of its luminance that a pixel without absolute threshold may be wrong by.
    pub fn relative_threshold(&self) -> f32 {
        relative_threshold(self.settings)
    }

    /// Error that each cluster of a pixel's cut may have if errors did not add up.
    pub fn stop_at_pixel(&self, x: usize, y: usize) -> Stop {
        let relative = || Stop::Relative {
            fraction: self.relative_threshold(),
            known_luminance: luminance(self.direct.get(x, y)),
        };
        self.threshold(x, y).map_or_else(relative, Stop::Absolute)
    }

    /// Where pixels with the threshold of this one belong in what is known of errors.
    pub fn class_at(&self, x: usize, y: usize) -> usize {
        let before = self.allowance.before.as_ref().and_then(|before| before.get(x, y));
        match (self.threshold(x, y), before) {
            (Some(threshold), Some(luminance)) => Calibration::class(threshold, luminance),
            (Some(_), None) => 0,
            (None, _) => Calibration::class(self.relative_threshold(), 1.0),
        }
    }

    /// When a cut of this class is let end, that was to be no more wrong than `stop` says.
    pub fn calibrated(&self, stop: Stop, class: usize) -> Stop {
        let Some(calibration) = &self.allowance.calibration else { return stop };
        stop.scaled(calibration.kappa(class))
    }

    /// Whether the cut of a pixel is made again to see how wrong it is.
    pub fn is_audited(&self, x: usize, y: usize) -> bool {
        let width = self.seen.pixels.width();
        let calibration = self.allowance.calibration.as_ref();
        calibration.is_some_and(|of| is_audited((x, y), width, self.prepared.index, of.audits_per_macroblock()))
    }

    /// Notes how wrong the cut is that was `made` for `receiver`.
    /// `scratch` allows cuts of [`Calibration::LARGEST_CUT`]: one that ends for its size alone would pass for the truth.
    pub fn audit<M: lighttree::Receiver>(
        &self,
        made: MadeCut,
        receiver: &M,
        visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
    ) {
        let MadeCut { class, stop, radiance } = made;
        let found = luminance(radiance);
        let threshold = stop.threshold_at(found);
        let fine = Stop::Absolute(Calibration::fine(threshold));
        let cut = self.prepared.tree.lightcut(receiver, fine, visible, scratch);
        self.figures.count_rays(cut.shadow_rays);
        self.figures.audits.note(class, (found - luminance(cut.radiance)).abs() / threshold);
    }
}

/// The absolute threshold of a pixel, if it has one \[W·m⁻²·sr⁻¹\].
pub(super) fn threshold(settings: &Settings, allowance: &Allowance, x: usize, y: usize) -> Option<f32> {
    let is_fixed = matches!(settings.thresholds, Thresholds::Fixed(_));
    (!is_fixed).then(|| allowance.map.get(x, y)).flatten()
}

/// Share of its luminance that a pixel without absolute threshold may be wrong by.
pub(super) fn relative_threshold(settings: &Settings) -> f32 {
    match settings.thresholds {
        Thresholds::Fixed(share) => share,
        _ => WITHOUT_THRESHOLD,
    }
}

/// Whether a pixel is audited in a frame: as many in each macroblock, and in 256 frames all of them equally often.
fn is_audited((x, y): (usize, usize), width: usize, frame: u32, of_a_macroblock: usize) -> bool {
    let block = (y / 16) * width.div_ceil(16) + x / 16;
    // Odd multipliers run through all 256 places.
    let first = (frame as usize * 151 + block * 89) % 256;
    (y % 16 * 16 + x % 16 + 256 - first) * 45 % 256 < of_a_macroblock
}

/// Whether light from `lamp` arrives at `receiver`.
#[inline]
pub(super) fn sees(accelerator: &Accelerator, receiver: &ShadingPoint, lamp: &Light) -> bool {
    let lamp = Vec3A::from(lamp.position);
    is_above(receiver, lamp) && !accelerator.occluded(receiver.position, lamp)
}

/// A light below the triangle's own plane is hidden by it, whatever the smooth normal says.
#[inline]
pub(super) fn is_above(receiver: &ShadingPoint, lamp: Vec3A) -> bool {
    receiver.geometric_normal.dot(lamp - receiver.position) > 0.0
}

/// The place of a pixel's surface where rays start.
pub(super) fn receiver(pixel: &PixelSurface, epsilon: f32) -> ShadingPoint {
    let geometric_normal = Vec3A::from(pixel.geometric_normal);
    ShadingPoint {
        position: Vec3A::from(pixel.position) + geometric_normal * epsilon,
        normal: pixel.shading_normal.into(),
        geometric_normal,
    }
}

/// Counts of a frame. Sums and maxima of integers: the same in any order.
#[derive(Default)]
pub(super) struct Figures {
    cuts: AtomicU64,
    sizes: AtomicU64,
    largest: AtomicU32,
    rays: AtomicU64,
    pub audits: Audits,
    /// Largest cut of each pixel, where that is written.
    by_pixel: Vec<AtomicU32>,
}

impl Figures {
    /// Counts that also keep the largest cut of each pixel.
    pub fn by_pixel(pixels: usize) -> Self {
        Self { by_pixel: (0..pixels).map(|_| AtomicU32::new(0)).collect(), ..Self::default() }
    }

    /// A cut of `size` clusters for which `rays` shadow rays were cast.
    pub fn count(&self, size: u32, rays: u32) {
        self.cuts.fetch_add(1, Ordering::Relaxed);
        self.sizes.fetch_add(size.into(), Ordering::Relaxed);
        self.largest.fetch_max(size, Ordering::Relaxed);
        self.count_rays(rays);
    }

    /// A cut of `size` clusters was made for pixel `index`.
    pub fn note(&self, index: usize, size: u32) {
        if let Some(cell) = self.by_pixel.get(index) {
            cell.fetch_max(size, Ordering::Relaxed);
        }
    }

    /// Shadow rays besides.
    pub fn count_rays(&self, rays: u32) {
        self.rays.fetch_add(rays.into(), Ordering::Relaxed);
    }

    /// Largest cut of each pixel; nothing unless it was requested.
    pub fn sizes_by_pixel(&self) -> impl Iterator<Item = u32> {
        self.by_pixel.iter().map(|cell| cell.load(Ordering::Relaxed))
    }

    pub fn put_into(&self, figures: &mut FrameFigures) {
        let cuts = self.cuts.load(Ordering::Relaxed).max(1);
        figures.cut_size_mean = self.sizes.load(Ordering::Relaxed) as f64 / cuts as f64;
        figures.cut_size_max = self.largest.load(Ordering::Relaxed);
        figures.shadow_rays += self.rays.load(Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_its_turn() {
        for of_a_macroblock in [1, 5] {
            let mut audits = vec![0; 32 * 32];
            for n in 0..256 {
                for (i, audits) in audits.iter_mut().enumerate() {
                    *audits += usize::from(is_audited((i % 32, i / 32), 32, n, of_a_macroblock));
                }
            }
            assert!(audits.iter().all(|&times| times == of_a_macroblock));
        }
    }
}
