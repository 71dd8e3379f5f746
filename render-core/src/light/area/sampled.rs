//! Direct light of glowing surfaces: points to trace shadow rays to.

use super::balance::Balance;
use super::{AreaLight, AreaSample};
use crate::accel::{PACKET, Shadows, Shaft};
use crate::light::receiver::{Disc, ShadingPoint};
use crate::light::sampled::{Brdf, Lamp, Sampled, Source, Traced};
use crate::light::tile::{Hidden, ReceiverTile, bits};
use crate::polygon::Polygon;
use crate::surface::Surfaces;
use glam::{Vec3, Vec3A};
use std::any::Any;
use std::f32::consts::PI;

/// Bound of the geometry term of a sample, as a share of that of its own disc: it keeps contact finite. With the full disc a
/// panel seen from its own width comes out 0.5 % dark, since its points already average over each other.
const BOUND: f32 = 1.0 / 8.0;
/// Sample points of an area light, and those that shadow rays are traced to first. The rest is skipped where these and the
/// corners of the light agree. Without the corners a penumbra begins too late, and with a step.
const SAMPLES: usize = 64;
const FIRST_SAMPLES: usize = 16;
/// Distance of corner samples from the corner, as a share of that to the middle: objects that touch a lamp hide its border.
const INWARD: f32 = 0.05;
/// A light of more pieces than this is summed over its points even where nothing hides it.
const MOST_POLYGONS: usize = 4;

/// A glowing surface, with points to trace shadow rays to.
#[derive(Debug)]
pub(in crate::light) struct SampledArea {
    instance: u32,
    samples: Vec<AreaSample>,
    /// Where it ends, where its shape is simple.
    corners: Vec<AreaSample>,
    /// Positions of the samples and the corners.
    positions: Vec<Vec3A>,
    /// Its shape, where that is simple enough for a closed form.
    polygons: Vec<Polygon>,
    /// Factors that give the samples the intensity of the whole light, where there is no closed form.
    balance: Option<Balance>,
}

impl AreaLight {
    /// The light with points to trace shadow rays to.
    pub(in crate::light) fn sampled(&self, surfaces: &Surfaces) -> SampledArea {
        // A few evenly glowing polygons have a closed form. What has none is summed over its samples, in balance.
        let simple = self.patch_count() <= MOST_POLYGONS && !self.is_textured();
        let samples = self.samples(surfaces, SAMPLES);
        let pieces = self.polygons(surfaces);
        let balance = (!simple).then(|| Balance::new(&pieces, &samples));
        let polygons = if simple { pieces } else { Vec::new() };

        // Corners give nothing: they only tell whether the light is partly hidden.
        let corners: Vec<AreaSample> = polygons.iter().flat_map(|polygon| corners(polygon, &samples[0])).collect();
        SampledArea {
            instance: self.instance as u32,
            positions: samples.iter().chain(&corners).map(|sample| sample.position).collect(),
            samples,
            corners,
            polygons,
            balance,
        }
    }
}

impl SampledArea {
    /// Unshadowed irradiance from one of the samples.
    #[inline]
    fn unhidden_sample(&self, receiver: &ShadingPoint, sample: &AreaSample) -> Vec3 {
        sample.intensity * disc_of(sample).term(receiver)
    }

    /// Factor for light of the samples at a receiver.
    fn balance_at(&self, receiver: &ShadingPoint) -> f32 {
        self.balance.as_ref().map_or(1.0, |balance| balance.at(receiver.position))
    }

    /// Unshadowed irradiance from the whole light.
    fn unhidden(&self, receiver: &ShadingPoint) -> Vec3 {
        if self.polygons.is_empty() {
            let sum: Vec3 = self.samples.iter().map(|sample| self.unhidden_sample(receiver, sample)).sum();
            return sum * self.balance_at(receiver);
        }
        let ShadingPoint { position, normal, geometric_normal } = *receiver;
        self.polygons.iter().map(|polygon| polygon.irradiance(position, normal, geometric_normal)).sum()
    }
}

impl Sampled for SampledArea {
    /// Exact where all of it is visible, else by the visible share of its samples, each weighted by its unshadowed irradiance.
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]) {
        // A shadow ray votes for a receiver: whether this sample is visible there.
        let shafts = tile.shafts(&self.positions);
        let mut votes = TileVotes::NONE;
        let mut trace_samples = |samples: &[AreaSample], among: u64| {
            for sample in samples {
                let terms = tile.terms(&disc_of(sample));
                let traced = among & shining(&terms);
                let hidden = tile.hidden(sample.position, traced, &shafts);
                votes.add(sample.intensity, &terms, traced, &hidden);
            }
            among & !votes.agreed()
        };

        // Corners and the first samples go to all receivers, the rest to those of a penumbra: where the votes disagree.
        let (first, rest) = match (&shafts.opaque, &shafts.blended) {
            // Where nothing can hide it, one sample that shines is enough.
            (Some(opaque), blended) if opaque.is_empty() && blended.as_ref().is_none_or(Shaft::is_empty) => {
                self.samples.split_at(1)
            }
            _ => {
                trace_samples(&self.corners, tile.all());
                self.samples.split_at(FIRST_SAMPLES.min(self.samples.len()))
            }
        };
        let undecided = trace_samples(first, tile.all());
        if undecided != 0 {
            trace_samples(rest, undecided);
        }

        // Each receiver's light: all of the lamp where no vote was against, else the share of it that is seen.
        for i in bits(votes.lit) {
            sums[i] += if votes.dark >> i & 1 == 0 {
                self.unhidden(&tile.receivers()[i])
            } else if self.polygons.is_empty() {
                TileVotes::of(&votes.seen, i) * self.balance_at(&tile.receivers()[i])
            } else {
                // Where a color is missing in all samples, it is missing in the light.
                let all = TileVotes::of(&votes.all, i).max(Vec3::splat(f32::MIN_POSITIVE));
                self.unhidden(&tile.receivers()[i]) * (TileVotes::of(&votes.seen, i) / all)
            };
        }
    }

    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3> {
        let mut whole = Traced::default();
        let balance = self.balance_at(receiver);
        for samples in self.samples.chunks(PACKET) {
            // L = f E of each sample, if nothing hides it. To the BRDF it is as wide as a disc of its area.
            let (mut given, mut ends, mut active) = ([Vec3::ZERO; PACKET], [Vec3A::ZERO; PACKET], 0);
            for (i, sample) in samples.iter().enumerate() {
                let way = sample.position - receiver.position;
                let irradiance = self.unhidden_sample(receiver, sample);
                ends[i] = sample.position;
                if irradiance != Vec3::ZERO {
                    let distance = way.length();
                    let half_angle = (sample.area / PI).sqrt().atan2(distance);
                    given[i] = irradiance * brdf(way / distance, half_angle);
                    active |= u64::from(given[i] != Vec3::ZERO) << i;
                }
            }

            // One packet of shadow rays tells which of them are hidden.
            whole.shadow_rays += u64::from(active.count_ones());
            let hidden = shadows.opaque().occluded_packet(receiver.position, &ends[..samples.len()], active);
            let seen = bits(active & !hidden).map(|i| given[i] * shadows.passed(receiver.position, ends[i]));
            whole.value += balance * seen.sum::<Vec3>();
        }
        whole
    }

    /// Shadow rays end at its samples and corners; no other place of it matters.
    fn source(&self) -> Source {
        let mut corners = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for &position in &self.positions {
            corners = (corners.0.min(position), corners.1.max(position));
        }
        Source::Lamp { low: corners.0, high: corners.1 }
    }

    fn lamp(&self) -> Lamp {
        Lamp::At(self.positions[0])
    }

    fn is_same(&self, other: &dyn Sampled) -> bool {
        // Samples have the place and the brightness of an area: all else of it follows from the same surface.
        let is_same = |other: &Self| self.instance == other.instance && self.samples == other.samples;
        (other as &dyn Any).downcast_ref().is_some_and(is_same)
    }

    fn instance(&self) -> Option<u32> {
        Some(self.instance)
    }
}

/// On the surface itself: objects that touch a lamp may be nearer to it than its sample points.
#[inline]
fn disc_of(sample: &AreaSample) -> Disc {
    let position = sample.position - sample.normal * sample.offset;
    Disc { position: position.to_array(), normal: sample.normal.to_array(), bound: BOUND * sample.area / PI }
}

/// Points of a light that are near its corners, and give nothing.
fn corners(polygon: &Polygon, sample: &AreaSample) -> impl Iterator<Item = AreaSample> {
    let Polygon { corners, normal, .. } = *polygon;
    let middle = corners.iter().sum::<Vec3A>() / corners.len() as f32;
    // As far off the surface as the others.
    let offset = sample.offset.min(1e-3 * (corners[0] - middle).length());
    // A triangle's last corner stands twice.
    let count = if corners[2] == corners[3] { 3 } else { 4 };
    corners.into_iter().take(count).map(move |corner| AreaSample {
        position: corner.lerp(middle, INWARD) + normal * offset,
        offset,
        normal,
        intensity: Vec3::ZERO,
        area: sample.area,
    })
}

/// Shadow rays of the samples of an area light at the receivers of a tile so far.
struct TileVotes {
    /// Receivers to which any of the samples is visible, and to which any is hidden, as bits.
    lit: u64,
    dark: u64,
    /// By color and receiver, irradiance from the visible samples, and from all \[W·m⁻²\].
    seen: [[f32; PACKET]; 3],
    all: [[f32; PACKET]; 3],
}

/// 0 for each bit of a number that is set, 1 for the others: hidden or not, as factors.
const FACTORS: [[f32; 8]; 256] = {
    let mut factors = [[1.0; 8]; 256];
    let mut k = 0;
    while k < 256 * 8 {
        if (k / 8) >> (k % 8) & 1 == 1 {
            factors[k / 8][k % 8] = 0.0;
        }
        k += 1;
    }
    factors
};

impl TileVotes {
    const NONE: Self = Self { lit: 0, dark: 0, seen: [[0.0; PACKET]; 3], all: [[0.0; PACKET]; 3] };

    /// Adds a sample: `terms` times its intensity, 0 where it does not shine, for the receivers in `traced`.
    fn add(&mut self, intensity: Vec3, terms: &[f32; PACKET], traced: u64, hidden: &Hidden) {
        let Hidden { whole, passed } = hidden;
        self.lit |= traced & !whole;
        self.dark |= traced & whole;
        if let Some(passed) = passed {
            self.dark |= traced & bits_where(passed, |share| share < 1.0);
        }

        // Eight receivers at a time, all of a row together: rows that no ray was traced to are passed over.
        let (terms, _) = terms.as_chunks::<8>();
        for (row, terms) in terms.iter().enumerate().filter(|(row, _)| traced >> (8 * row) & 0xff != 0) {
            let factors = match passed {
                Some(passed) => &passed.as_chunks::<8>().0[row],
                None => &FACTORS[(whole >> (8 * row)) as usize & 0xff],
            };
            for (c, intensity) in intensity.to_array().into_iter().enumerate() {
                // E = I · term, all of it, and what is seen of it. The factor is 0 where the sample is hidden: no branches.
                let seen = &mut self.seen[c].as_chunks_mut::<8>().0[row];
                let all = &mut self.all[c].as_chunks_mut::<8>().0[row];
                for lane in 0..8 {
                    let e = intensity * terms[lane];
                    all[lane] += e;
                    seen[lane] += e * factors[lane];
                }
            }
        }
    }

    /// Receivers whose votes all agree, as bits.
    fn agreed(&self) -> u64 {
        self.lit ^ self.dark
    }

    fn of(sums: &[[f32; PACKET]; 3], receiver: usize) -> Vec3 {
        Vec3::from(std::array::from_fn(|c| sums[c][receiver]))
    }
}

/// Where a disc shines, as bits.
fn shining(terms: &[f32; PACKET]) -> u64 {
    bits_where(terms, |term| term > 0.0)
}

fn bits_where(numbers: &[f32; PACKET], is: impl Fn(f32) -> bool) -> u64 {
    numbers.iter().rev().fold(0, |bits, &number| bits << 1 | u64::from(is(number)))
}
