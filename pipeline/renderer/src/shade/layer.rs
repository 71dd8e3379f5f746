//! Layer of light: one component of every pixel's light.

use super::audits::Audits;
use super::counts::{LightcutCounts, RecordCounts};
use super::gradient_sum::GradientSum;
use super::movement::Movement;
use super::tolerance::Tolerance;
use crate::frame::Frame;
use crate::settings::Aov;
#[cfg(feature = "bake")]
use crate::texels::BakedTexels;
use glam::Vec3;
use pipeline::error::Result;
use plane::{Correspondence, Plane};
#[cfg(feature = "bake")]
use render_core::Timed;
use render_core::cache::SharedRecord;
use render_core::ranks::{Portable, Ranks};
use render_core::{GBuffer, Hit, LightPoints, ShadingPoint, Surface};
use std::f32::consts::PI;
use std::fmt::Debug;
use std::ops::AddAssign;
use std::sync::atomic::{AtomicBool, Ordering};

/// Component of every pixel's light, with its own state between frames.
pub trait Layer: Send {
    /// Computes the layer's light for the `wanted` pixels of `visible`, or for all pixels. Unwanted pixels may have any
    /// value.
    ///
    /// `tolerance` defines the permitted luminance error of each pixel. Equal input must produce equal bits for any
    /// number of threads.
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit;

    /// Returns whether `frame` contains no light for the layer. The layer is then not called.
    fn is_dark(&self, _frame: &Frame<'_>) -> bool {
        false
    }

    /// Adapts to the quantiser_scale of the next frames, 1…112.
    fn set_quantiser_scale(&mut self, _quantiser_scale: u32) {}

    /// Limits the pixels for which the layer computes light in the next frames to a `share` of all pixels, as far as the
    /// layer reprojects light. All others keep larger errors. `None` removes the limit.
    fn set_budget(&mut self, _share: Option<f32>) {}

    /// Keeps the data of the channel `aov` from the next frame on, if the layer provides that channel.
    fn keep(&mut self, _aov: Aov) {}

    /// Returns the channel `aov` of the last lit frame, in raster order; `None` if the layer does not provide it.
    fn channel(&self, _aov: Aov, _frame: &Frame<'_>) -> Option<Vec<f32>> {
        None
    }

    /// Returns the layer for frames lit in regions; `None` if the layer keeps no records.
    fn in_regions(&mut self) -> Option<&mut dyn RegionLayer> {
        None
    }

    /// Returns a copy with the state after the last frame; `None` if the layer cannot be copied. A frame that uses other
    /// layers too then cannot be discarded.
    fn copy(&self) -> Option<Box<dyn Layer>> {
        None
    }

    /// Discards the state of earlier frames: the next frame is lit like the first frame of a film.
    fn forget(&mut self) {}

    /// Returns the state after the last frame, for a checkpoint; empty for a stateless layer.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Continues after frame `last` from the [`state`](Layer::state) of that frame.
    ///
    /// # Errors
    /// If the state does not fit the layer or the frame.
    fn restore(&mut self, _state: &[u8], _last: &Frame<'_>) -> Result<()> {
        Ok(())
    }
}

/// Layer with records, in frames lit region by region. Each call of [`light`](Layer::light) covers one sample of one
/// region; the samples of a region are consecutive. Layers without records need no preparation.
pub trait RegionLayer: Layer {
    /// Begins a frame that is lit region by region.
    fn begin_regions(&mut self, visible: &Visible<'_>, tolerance: &Tolerance<'_>);

    /// Ends a frame that was lit region by region.
    fn end_regions(&mut self, visible: &Visible<'_>);

    /// Returns the records that the layer created since the last call.
    fn take_records(&mut self) -> Vec<SharedRecord>;

    /// Adds records that the same layer created on other ranks.
    fn adopt(&mut self, records: Vec<SharedRecord>);
}

/// Position of a call of [`Layer::light`] among the samples of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionSample {
    /// First sample of the region's pixels.
    First,
    /// Later sample of all or some of the region's pixels.
    Further,
}

/// Irradiance of all surfaces, known before a frame is lit. It replaces photons and virtual lights.
pub(crate) trait KnownLight: Debug + Sync {
    /// Returns the irradiance at a ray's hit \[W·m⁻²\]. `surface` is the surface at the hit.
    fn irradiance(&self, hit: &Hit, surface: &Surface) -> Vec3;

    /// Traces rays around `receiver`, and returns the light that surfaces reflect to it. `key` determines the rotation
    /// of the rays.
    fn gather(&self, receiver: &ShadingPoint, key: u64) -> GatheredLight;

    /// Returns the texels of static surfaces.
    #[cfg(feature = "bake")]
    fn texels(&self) -> &BakedTexels;

    /// Returns whether the light of static surfaces changes from frame to frame.
    fn changes(&self) -> bool;

    /// Returns the change of the irradiance of visible static surfaces by dynamic objects \[W·m⁻²\]; `None` without such
    /// objects. `still` contains the irradiance of these surfaces without dynamic objects, and `None` elsewhere.
    #[cfg(feature = "bake")]
    fn change(&self, visible: &Visible<'_>, still: &Plane<Option<[f32; 3]>>) -> Option<Timed<Plane<[f32; 3]>>>;
}

/// Light that surfaces reflect to a point, and the distances of these surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GatheredLight {
    /// Irradiance with its derivatives.
    pub light: GradientSum,
    /// Harmonic mean distance of the hits \[m\]; infinite without hits.
    pub harmonic_mean: f32,
    /// Distance to the nearest hit \[m\]; infinite without hits.
    pub nearest: f32,
}

/// Visible surfaces of a frame, to be lit.
#[derive(Clone, Copy, Debug)]
pub struct Visible<'a> {
    /// The scene and its lights.
    pub frame: &'a Frame<'a>,
    /// Surface of each pixel.
    pub surfaces: &'a GBuffer,
    /// Surface of each pixel, with the albedo below the surface's coat.
    pub matte: &'a GBuffer,
    /// Number of the sample position within pixels, from 0. Thresholds and motion belong to sample 0.
    pub sample: usize,
    /// Sample points of lamps for direct light.
    pub points: LightPoints,
    /// Position of the sample among the region's samples, between [`RegionLayer::begin_regions`] and
    /// [`RegionLayer::end_regions`]; `None` if the whole frame is lit.
    pub part: Option<RegionSample>,
    /// Position of each pixel's surface in the previous frame; `None` in the first frame and after a shot change.
    pub motion: Option<&'a Correspondence>,
    /// Emitted radiance plus the radiance of earlier layers \[W·m⁻²·sr⁻¹\].
    pub radiance: &'a Plane<Vec3>,
    /// Ranks that share the work. All ranks call layers in the same order, with the same surfaces.
    pub ranks: &'a dyn Ranks,
    /// Motion since the previous frame.
    pub(super) movement: &'a Movement,
    /// Light that is known before the frame is lit; `None` if photons and virtual lights represent all light.
    pub(super) known: Option<&'a dyn KnownLight>,
    /// Flag after which the light is discarded, so that layers may return any; `None` if it never is.
    pub(super) stop: Option<&'a AtomicBool>,
}

impl Visible<'_> {
    /// Returns whether the light will be discarded.
    pub(super) fn has_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
impl<'a> Visible<'a> {
    /// Returns the surfaces at the pixel centers of `frame`, as in the first frame of a film.
    pub(super) fn alone(frame: &'a Frame<'a>, radiance: &'a Plane<Vec3>) -> Self {
        static MOVEMENT: Movement = Movement { places: Vec::new(), swept: Vec::new(), is_any: true };
        Self {
            frame,
            surfaces: &frame.seen,
            matte: &frame.seen,
            sample: 0,
            points: LightPoints::All,
            part: None,
            motion: None,
            radiance,
            ranks: &ranks::Alone,
            movement: &MOVEMENT,
            known: None,
            stop: None,
        }
    }
}

/// Light of a layer, and the cost of computing it. Values of several layers are summed.
#[derive(Debug, Default)]
pub struct Lit {
    /// Irradiance of matte surfaces \[W·m⁻²\], linear RGB.
    pub irradiance: Option<Plane<[f32; 3]>>,
    /// Additional radiance toward the viewer \[W·m⁻²·sr⁻¹\], linear RGB.
    pub radiance: Option<Plane<Vec3>>,
    /// Whether each pixel's light was computed, not reprojected; `None` if no light can be reprojected.
    pub computed: Option<Plane<bool>>,
    /// Number of pixels whose errors exceed their tolerance, because a budget left them unlit.
    pub open: u64,
    /// Number of traced shadow rays.
    pub rays: u64,
    /// CPU time, summed over threads \[s\].
    pub seconds: f64,
    /// Counts of lightcuts.
    pub cuts: LightcutCounts,
    /// Counts of irradiance cache records.
    pub records: RecordCounts,
    /// Errors measured by recomputing light.
    pub audits: Audits,
}

impl AddAssign for Lit {
    fn add_assign(&mut self, mut other: Self) {
        add(&mut self.irradiance, other.irradiance.take(), |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        add(&mut self.radiance, other.radiance.take(), |a, b| a + b);
        add(&mut self.computed, other.computed.take(), |a, b| a || b);
        self.add_counts(other);
    }
}

impl Lit {
    /// Adds the counts of another rank; returns `None` if `bytes` are invalid.
    fn add_from(&mut self, bytes: &mut &[u8]) -> Option<()> {
        self.rays += u64::take(bytes)?;
        let ((cuts, clusters), largest) = Portable::take(bytes)?;
        self.cuts += LightcutCounts { cuts, clusters, largest };
        self.audits.cuts.add_numbers(&Vec::<u32>::take(bytes)?);
        Some(())
    }

    /// Adds the counts and times of `other`, but not the light, which may belong to another sample.
    pub(super) fn add_counts(&mut self, other: Self) {
        self.open += other.open;
        self.rays += other.rays;
        self.seconds += other.seconds;
        self.cuts += other.cuts;
        self.records += other.records;
        self.audits += other.audits;
    }
}

/// Adds the counts of all other ranks to `lit`, which contains the counts of this rank's share of work.
///
/// Counts of reprojected pixels and of records are excluded: they cover the whole frame on every rank.
pub(super) fn add_ranks(ranks: &dyn Ranks, lit: &mut Lit) {
    if ranks.count() == 1 {
        return;
    }
    let mut bytes = Vec::new();
    lit.rays.put(&mut bytes);
    ((lit.cuts.cuts, lit.cuts.clusters), lit.cuts.largest).put(&mut bytes);
    lit.audits.cuts.numbers().put(&mut bytes);
    for (rank, bytes) in ranks.all_gather(bytes).into_iter().enumerate() {
        // Skip this rank: its counts are in `lit` already.
        if rank != ranks.rank() {
            lit.add_from(&mut &bytes[..]).expect("every rank sends its counts");
        }
    }
}

/// Combines `sum` and `more` pixel by pixel if both exist.
fn add<T: Copy>(sum: &mut Option<Plane<T>>, more: Option<Plane<T>>, both: impl Fn(T, T) -> T) {
    match (&mut *sum, more) {
        (_, None) => {}
        (None, more) => *sum = more,
        (Some(sum), Some(more)) => {
            for (sum, &more) in sum.samples_mut().iter_mut().zip(more.samples()) {
                *sum = both(*sum, more);
            }
        }
    }
}

impl Lit {
    /// Returns light that consists only of irradiance \[W·m⁻²\].
    #[must_use]
    pub fn of_irradiance(irradiance: Plane<[f32; 3]>) -> Self {
        Self { irradiance: Some(irradiance), ..Self::default() }
    }

    /// Adds the light to the `radiance` of the pixels of `matte` \[W·m⁻²·sr⁻¹\]:
    ///
    /// ```text
    /// L = L₀ + ρ E / π + L_r        ρ  albedo    E  irradiance    L_r  additional radiance
    /// ```
    #[must_use]
    pub fn shown(&self, matte: &GBuffer, mut radiance: Plane<Vec3>) -> Plane<Vec3> {
        if let Some(irradiance) = &self.irradiance {
            let surfaces = matte.pixels.samples().iter().zip(irradiance.samples());
            for (light, (pixel, &arriving)) in radiance.samples_mut().iter_mut().zip(surfaces) {
                *light += Vec3::from(pixel.albedo) * Vec3::from(arriving) / PI;
            }
        }
        if let Some(besides) = &self.radiance {
            for (light, &more) in radiance.samples_mut().iter_mut().zip(besides.samples()) {
                *light += more;
            }
        }
        radiance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_add_up() {
        let mut sum = Lit::default();
        let of = |x: f32| Lit { rays: 3, ..Lit::of_irradiance(Plane::filled(2, 1, [x, 0.0, 1.0])) };
        sum += of(1.0);
        sum += Lit { radiance: Some(Plane::filled(2, 1, Vec3::ONE)), rays: 1, ..Lit::default() };
        sum += of(2.0);
        sum += Lit { computed: Some(Plane::from_vec(2, 1, vec![true, false])), ..Lit::default() };
        assert_eq!(sum.irradiance.as_ref().map(|plane| plane.get(1, 0)), Some([3.0, 0.0, 2.0]));
        assert_eq!(sum.radiance.as_ref().map(|plane| plane.get(1, 0)), Some(Vec3::ONE));
        assert_eq!((sum.rays, sum.computed.map(|plane| plane.get(1, 0))), (7, Some(false)));
    }
}
