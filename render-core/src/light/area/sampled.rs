//! Direct light from emissive surfaces: sample points for shadow rays.

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

/// Bound of a sample's geometry term, as a fraction of the bound for the sample's own disc. The bound keeps the term
/// finite at contact. With the full disc, a panel seen from a distance of its own width is 0.5 % too dark. Its
/// points already average over each other.
const BOUND: f32 = 1.0 / 8.0;
/// Number of sample points of an area light.
const SAMPLES: usize = 64;
/// Number of sample points traced first. The remaining points are skipped if the first points and the corners of the
/// light agree. Without corners, a penumbra begins too late and with a step.
const FIRST_SAMPLES: usize = 16;
/// Maximum half-angle of the disc that represents several samples in a lobe \[rad\]. Half of it is at most half of α for
/// roughness ≥ 0.2, so the lobe is nearly linear over the disc.
const WIDEST_DISC: f32 = 0.04;
/// Distance of corner samples from the corner, as a fraction of the distance to the center. Objects that touch a lamp
/// occlude its border.
const INWARD: f32 = 0.05;
/// Maximum number of pieces of a light for the closed form. Other lights are summed over their points even if
/// unoccluded.
const MOST_POLYGONS: usize = 4;

/// Emissive surface with sample points for shadow rays.
#[derive(Debug)]
pub(in crate::light) struct SampledArea {
    instance: u32,
    samples: Vec<AreaSample>,
    /// Samples at the light's corners, if the shape is simple.
    corners: Vec<AreaSample>,
    /// Positions of the samples and the corners.
    positions: Vec<Vec3A>,
    /// Polygons of the light, if the shape is simple enough for a closed form.
    polygons: Vec<Polygon>,
    /// Factors that correct the samples' intensity to the whole light's, if the light has no closed form.
    balance: Option<Balance>,
}

impl AreaLight {
    /// Returns the light with sample points for shadow rays.
    pub(in crate::light) fn sampled(&self, surfaces: &Surfaces) -> SampledArea {
        // A few polygons of even emission have a closed form. Other lights are summed over their samples, with balance factors.
        let simple = self.patch_count() <= MOST_POLYGONS && !self.is_textured();
        let samples = self.samples(surfaces, SAMPLES);
        let pieces = self.polygons(surfaces);
        let balance = (!simple).then(|| Balance::new(&pieces, &samples));
        let polygons = if simple { pieces } else { Vec::new() };

        // Corners emit no light. They only detect partial occlusion.
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
    /// Returns the unshadowed irradiance from one sample \[W·m⁻²\].
    #[inline]
    fn unhidden_sample(&self, receiver: &ShadingPoint, sample: &AreaSample) -> Vec3 {
        sample.intensity * disc_of(sample).term(receiver)
    }

    /// Returns the balance factor for the samples' light at a receiver.
    fn balance_at(&self, receiver: &ShadingPoint) -> f32 {
        self.balance.as_ref().map_or(1.0, |balance| balance.at(receiver.position))
    }

    /// Returns the light that a surface with `brdf` reflects, by the first samples; `None` if these are too few. The light
    /// of the first samples is scaled by the ratio of the irradiance from all samples to the irradiance from the first
    /// samples.
    fn reflected_by_first(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Option<Vec3>> {
        let few = Traced { value: None, shadow_rays: 0 };
        if self.corners.is_empty() || self.samples.len() <= FIRST_SAMPLES {
            return few;
        }

        // Let each of the first samples represent an equal fraction of the light.
        let share = self.samples.len() as f32 / FIRST_SAMPLES as f32;
        let (first, rest) = self.samples.split_at(FIRST_SAMPLES);
        let (mut ends, mut active) = ([Vec3A::ZERO; PACKET], 0);
        let (mut value, mut near) = (Vec3::ZERO, Vec3::ZERO);
        for (i, sample) in first.iter().enumerate() {
            let way = sample.position - receiver.position;
            let (distance, irradiance) = (way.length(), self.unhidden_sample(receiver, sample));
            let half_angle = (share * sample.area / PI).sqrt() / distance;
            if half_angle > WIDEST_DISC {
                return few;
            }
            ends[i] = sample.position;
            if irradiance != Vec3::ZERO {
                near += irradiance;
                value += irradiance * brdf(way / distance, half_angle);
                active |= 1 << i;
            }
        }

        // Trace the corners too: they find penumbras earlier.
        let count = (FIRST_SAMPLES + self.corners.len()).min(PACKET);
        for (i, corner) in (FIRST_SAMPLES..count).zip(&self.corners) {
            ends[i] = corner.position;
            active |= u64::from(receiver.cosine_to(corner.position).0 > 0.0) << i;
        }
        let hidden = shadows.opaque().occluded_packet(receiver.position, &ends[..count], active) & active;
        let shadow_rays = u64::from(active.count_ones());
        let is_passed = |i: usize| shadows.passed(receiver.position, ends[i]).min_element() >= 1.0;
        let value = if hidden == active {
            Some(Vec3::ZERO)
        } else if hidden == 0 && bits(active).all(is_passed) {
            let whole = near + rest.iter().map(|sample| self.unhidden_sample(receiver, sample)).sum::<Vec3>();
            Some(value * self.balance_at(receiver) * whole / near.max(Vec3::splat(f32::MIN_POSITIVE)))
        } else {
            None
        };
        Traced { value, shadow_rays }
    }

    /// Returns the unshadowed irradiance from the whole light \[W·m⁻²\].
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
    /// Adds the exact irradiance if the whole light is visible. Otherwise the irradiance is scaled by the visible fraction
    /// of the samples, weighted by their unshadowed irradiance.
    fn add_to(&self, tile: &ReceiverTile, sums: &mut [Vec3]) {
        // Each shadow ray votes on whether its sample is visible from the receiver.
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

        // Trace corners and the first samples for all receivers. Trace the remaining samples only for receivers in a
        // penumbra, at which the votes disagree.
        let quarter = tile.points.quarter(&self.samples);
        let (first, rest) = match (&shafts.opaque, &shafts.blended, quarter) {
            // If there is no occluder, one contributing sample is enough.
            (Some(opaque), blended, _) if opaque.is_empty() && blended.as_ref().is_none_or(Shaft::is_empty) => {
                self.samples.split_at(1)
            }
            (_, _, Some(quarter)) => (quarter, &[][..]),
            _ => {
                trace_samples(&self.corners, tile.all());
                self.samples.split_at(FIRST_SAMPLES.min(self.samples.len()))
            }
        };
        let undecided = trace_samples(first, tile.all());
        if undecided != 0 {
            trace_samples(rest, undecided);
        }

        // Use the whole lamp's light if no sample is occluded, otherwise its visible fraction.
        for i in bits(votes.lit) {
            sums[i] += if votes.dark >> i & 1 == 0 {
                self.unhidden(&tile.receivers()[i])
            } else if self.polygons.is_empty() && quarter.is_none() {
                TileVotes::of(&votes.seen, i) * self.balance_at(&tile.receivers()[i])
            } else {
                // A color missing in all samples is also missing in the light.
                let all = TileVotes::of(&votes.all, i).max(Vec3::splat(f32::MIN_POSITIVE));
                self.unhidden(&tile.receivers()[i]) * (TileVotes::of(&votes.seen, i) / all)
            };
        }
    }

    /// Returns the reflected light by the first samples alone if these agree with the corners on the light's visibility;
    /// otherwise by all samples.
    fn reflected(&self, shadows: &Shadows, receiver: &ShadingPoint, brdf: Brdf) -> Traced<Vec3> {
        let mut whole = self.reflected_by_first(shadows, receiver, brdf);
        if let Some(value) = whole.value {
            return Traced { value, shadow_rays: whole.shadow_rays };
        }
        let mut whole = Traced { value: Vec3::ZERO, shadow_rays: std::mem::take(&mut whole.shadow_rays) };
        let balance = self.balance_at(receiver);
        for samples in self.samples.chunks(PACKET) {
            // L = f E of each sample, if unoccluded. The BRDF is evaluated for a disc of the sample's area.
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

            // Find the occluded samples with one packet of shadow rays.
            whole.shadow_rays += u64::from(active.count_ones());
            let hidden = shadows.opaque().occluded_packet(receiver.position, &ends[..samples.len()], active);
            let seen = bits(active & !hidden).map(|i| given[i] * shadows.passed(receiver.position, ends[i]));
            whole.value += balance * seen.sum::<Vec3>();
        }
        whole
    }

    /// Returns the box around the light's samples and corners, in which shadow rays end.
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
        // Samples contain position and brightness. All other properties follow from the same surface.
        let is_same = |other: &Self| self.instance == other.instance && self.samples == other.samples;
        (other as &dyn Any).downcast_ref().is_some_and(is_same)
    }

    fn instance(&self) -> Option<u32> {
        Some(self.instance)
    }
}

/// Returns a disc on the surface itself: objects that touch a lamp may be nearer to the surface than to its sample
/// points.
#[inline]
fn disc_of(sample: &AreaSample) -> Disc {
    let position = sample.position - sample.normal * sample.offset;
    Disc { position: position.to_array(), normal: sample.normal.to_array(), bound: BOUND * sample.area / PI }
}

/// Returns points near a polygon's corners, which emit no light.
fn corners(polygon: &Polygon, sample: &AreaSample) -> impl Iterator<Item = AreaSample> {
    let Polygon { corners, normal, .. } = *polygon;
    let middle = corners.iter().sum::<Vec3A>() / corners.len() as f32;
    // Limit the offset from the surface to the offset of the samples.
    let offset = sample.offset.min(1e-3 * (corners[0] - middle).length());
    // A triangle repeats its last corner.
    let count = if corners[2] == corners[3] { 3 } else { 4 };
    corners.into_iter().take(count).map(move |corner| AreaSample {
        position: corner.lerp(middle, INWARD) + normal * offset,
        offset,
        normal,
        intensity: Vec3::ZERO,
        area: sample.area,
    })
}

/// Accumulated results of an area light's shadow rays at the receivers of a tile.
struct TileVotes {
    /// Receivers with any visible sample, as bits.
    lit: u64,
    /// Receivers with any occluded sample, as bits.
    dark: u64,
    /// Irradiance from the visible samples, by color and receiver \[W·m⁻²\].
    seen: [[f32; PACKET]; 3],
    /// Irradiance from all samples, by color and receiver \[W·m⁻²\].
    all: [[f32; PACKET]; 3],
}

/// Factor for each bit of a byte: 0 for set bits (occluded), 1 for clear bits.
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

    /// Adds a sample with `terms` times its intensity for the receivers in `traced`. A term is 0 if the sample does not
    /// emit towards the receiver.
    fn add(&mut self, intensity: Vec3, terms: &[f32; PACKET], traced: u64, hidden: &Hidden) {
        // Vote: a partly occluded sample votes for both lit and dark.
        let Hidden { whole, passed } = hidden;
        self.lit |= traced & !whole;
        self.dark |= traced & whole;
        if let Some(passed) = passed {
            passed.iter().for_each(|color| self.dark |= traced & bits_where(color, |share| share < 1.0));
        }

        // Process rows of eight receivers together; skip rows without a traced ray.
        let (terms, _) = terms.as_chunks::<8>();
        for (row, terms) in terms.iter().enumerate().filter(|(row, _)| traced >> (8 * row) & 0xff != 0) {
            for (c, intensity) in intensity.to_array().into_iter().enumerate() {
                let factors = match passed {
                    Some(passed) => &passed[c].as_chunks::<8>().0[row],
                    None => &FACTORS[(whole >> (8 * row)) as usize & 0xff],
                };
                // E = I · term. Add it to the total and to the visible irradiance. An occluded sample has factor 0,
                // which avoids branches.
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

    /// Returns the receivers with unanimous votes, as bits.
    fn agreed(&self) -> u64 {
        self.lit ^ self.dark
    }

    fn of(sums: &[[f32; PACKET]; 3], receiver: usize) -> Vec3 {
        Vec3::from(std::array::from_fn(|c| sums[c][receiver]))
    }
}

/// Returns the receivers that a disc lights, as bits.
fn shining(terms: &[f32; PACKET]) -> u64 {
    bits_where(terms, |term| term > 0.0)
}

fn bits_where(numbers: &[f32; PACKET], is: impl Fn(f32) -> bool) -> u64 {
    numbers.iter().rev().fold(0, |bits, &number| bits << 1 | u64::from(is(number)))
}
