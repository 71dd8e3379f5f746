//! A layer of light: one way to find a part of the light of every pixel.

use super::audits::Audits;
use super::counts::{CutCounts, RecordCounts};
use super::movement::Movement;
use super::tolerance::Tolerance;
use crate::frame::Frame;
use crate::settings::Aov;
use glam::Vec3;
use pipeline::error::Result;
use plane::{Correspondence, Plane};
use render_core::GBuffer;
use render_core::cache::SharedRecord;
use render_core::ranks::{Portable, Ranks};
use std::f32::consts::PI;
use std::ops::AddAssign;

/// One way to find a part of the light of every pixel. What a layer keeps from frame to frame is its own.
pub trait Layer: Send {
    /// Finds this layer's light for the pixels of `visible` that are `wanted`, or for all; that of other pixels is not used.
    ///
    /// The luminance of each pixel may be wrong by what `tolerance` says. The same input gives the same bits, whatever the number
    /// of threads.
    fn light(&mut self, visible: &Visible<'_>, wanted: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit;

    /// Whether nothing in `frame` shines that this layer has the light of: it is not called then.
    fn is_dark(&self, _frame: &Frame<'_>) -> bool {
        false
    }

    /// Keeps what the channel `aov` needs, from the next frame on, where this layer has it and does not keep that anyway.
    fn keep(&mut self, _aov: Aov) {}

    /// The channel `aov` of the frame that was lit last, in raster order, where this layer has it.
    fn channel(&self, _aov: Aov, _frame: &Frame<'_>) -> Option<Vec<f32>> {
        None
    }

    /// This layer in frames that are lit part by part, if it keeps records for them.
    fn in_parts(&mut self) -> Option<&mut dyn PartLayer> {
        None
    }

    /// Forgets the frames before: the next one is lit as the first of a film. Layers that keep nothing have nothing to forget.
    fn forget(&mut self) {}

    /// The state after the last frame, for a checkpoint; empty where the layer keeps nothing.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Continues after the frame `last` from its [`state`](Layer::state).
    ///
    /// # Errors
    /// The state does not fit this layer, or that frame.
    fn restore(&mut self, _state: &[u8], _last: &Frame<'_>) -> Result<()> {
        Ok(())
    }
}

/// A layer that keeps records in frames that are lit part by part: each call of [`light`](Layer::light) is for one part, one sample
/// of its pixels after the other. Other layers light each pixel by itself and need no preparation.
pub trait PartLayer: Layer {
    /// Begins a frame.
    fn begin_parts(&mut self, visible: &Visible<'_>, tolerance: &Tolerance<'_>);

    /// Ends the frame.
    fn end_parts(&mut self, visible: &Visible<'_>);

    /// The records that were made since they were last taken.
    fn take_records(&mut self) -> Vec<SharedRecord>;

    /// Adds records that layers of the same film on other ranks have made.
    fn adopt(&mut self, records: Vec<SharedRecord>);
}

/// A call of [`Layer::light`] for a part of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartSample {
    /// The first for these pixels.
    First,
    /// For further samples of the pixels of the call before, or of some of them.
    Further,
}

/// The visible surfaces of a frame, to be lit.
#[derive(Clone, Copy, Debug)]
pub struct Visible<'a> {
    /// The scene and its lights.
    pub frame: &'a Frame<'a>,
    /// The surface of each pixel.
    pub surfaces: &'a GBuffer,
    /// The same with the albedo that is left below coats.
    pub matte: &'a GBuffer,
    /// Which of the places in its pixels the picture goes through, from 0; the first is that of thresholds and motion.
    pub sample: usize,
    /// The part of the picture that is lit, between [`PartLayer::begin_parts`] and [`PartLayer::end_parts`]; none if it is the whole.
    pub part: Option<PartSample>,
    /// Where each pixel was in the frame before; none for the first frame and after a cut.
    pub motion: Option<&'a Correspondence>,
    /// Radiance that the layers before this one found, and what surfaces emit \[W·m⁻²·sr⁻¹\].
    pub radiance: &'a Plane<Vec3>,
    /// Who shares the work. Layers of all ranks are called in the same order, with the same surfaces.
    pub ranks: &'a dyn Ranks,
    /// What has moved since the frame before.
    pub(super) movement: &'a Movement,
}

#[cfg(test)]
impl<'a> Visible<'a> {
    /// The surfaces of `frame` in the middle of its pixels, as in the first frame of a film.
    pub(super) fn alone(frame: &'a Frame<'a>, radiance: &'a Plane<Vec3>) -> Self {
        static MOVEMENT: Movement = Movement { places: Vec::new(), swept: Vec::new(), is_any: true };
        Self {
            frame,
            surfaces: &frame.seen,
            matte: &frame.seen,
            sample: 0,
            part: None,
            motion: None,
            radiance,
            ranks: &ranks::Alone,
            movement: &MOVEMENT,
        }
    }
}

/// Light that a layer found, and what it took. Those of several layers add up.
#[derive(Debug, Default)]
pub struct Lit {
    /// Irradiance of matte surfaces \[W·m⁻²\], linear RGB.
    pub irradiance: Option<Plane<[f32; 3]>>,
    /// Radiance that surfaces send to the viewer besides \[W·m⁻²·sr⁻¹\].
    pub radiance: Option<Plane<Vec3>>,
    /// Pixels whose light was computed, of those that may have that of the frame before; none if no light is carried.
    pub computed: Option<Plane<bool>>,
    /// Shadow rays.
    pub rays: u64,
    /// CPU time of all threads \[s\].
    pub seconds: f64,
    /// Cuts through the light tree.
    pub cuts: CutCounts,
    /// Records of an irradiance cache.
    pub records: RecordCounts,
    /// Light that was found twice.
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
    /// Adds the counts of another rank; `None` if the bytes are not those.
    fn add_from(&mut self, bytes: &mut &[u8]) -> Option<()> {
        self.rays += u64::take(bytes)?;
        let ((cuts, clusters), largest) = Portable::take(bytes)?;
        self.cuts += CutCounts { cuts, clusters, largest };
        self.audits.cuts.add_numbers(&Vec::<u32>::take(bytes)?);
        Some(())
    }

    /// Adds what `other` took, and not its light, which may be that of another picture.
    pub(super) fn add_counts(&mut self, other: Self) {
        self.rays += other.rays;
        self.seconds += other.seconds;
        self.cuts += other.cuts;
        self.records += other.records;
        self.audits += other.audits;
    }
}

/// Adds to `lit`, whose counts are those of this rank's share of the work, the counts of all other ranks.
///
/// Counts of what was carried, and of records, are those of the whole picture on every rank already.
pub(super) fn add_ranks(ranks: &dyn Ranks, lit: &mut Lit) {
    if ranks.count() == 1 {
        return;
    }
    let mut bytes = Vec::new();
    lit.rays.put(&mut bytes);
    ((lit.cuts.cuts, lit.cuts.clusters), lit.cuts.largest).put(&mut bytes);
    lit.audits.cuts.numbers().put(&mut bytes);
    for (rank, bytes) in ranks.all_gather(bytes).into_iter().enumerate() {
        if rank != ranks.rank() {
            lit.add_from(&mut &bytes[..]).expect("every rank gives its counts");
        }
    }
}

/// `sum` and `more`, pixel by pixel where both are there.
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
    /// Light of a layer that has only irradiance \[W·m⁻²\].
    #[must_use]
    pub fn of_irradiance(irradiance: Plane<[f32; 3]>) -> Self {
        Self { irradiance: Some(irradiance), ..Self::default() }
    }

    /// Radiance of the pixels of `matte` that already send `radiance` \[W·m⁻²·sr⁻¹\]:
    ///
    /// ```text
    /// L = L₀ + ρ E / π + L_r        ρ  albedo    E  irradiance    L_r  radiance besides
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
