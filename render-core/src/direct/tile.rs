//! Receivers that are lit together: shadow rays of a light sample are traced to all of them.

use super::lights::{Area, FIRST_AREA_SAMPLES, FIRST_SUN_SAMPLES, Sun};
use super::{Disc, ShadingPoint, WORTH_A_SHAFT, bits, disc_term};
use crate::accel::{Accelerator, PACKET, Shadows, Shaft};
use crate::emitter::{AreaSample, PointLight};
use glam::{Vec3, Vec3A};
use std::cell::Cell;

/// Shadow rays of the samples of a sun at one receiver so far.
#[derive(Clone, Copy, Default)]
struct Votes {
    lit: bool,
    dark: bool,
    /// Irradiance from those that were lit \[W·m⁻²\].
    sum: Vec3,
}

impl Votes {
    /// Adds a sample that gives `e`, of which this `share` arrives.
    fn add(&mut self, e: Vec3, share: f32) {
        self.dark |= share < 1.0;
        self.lit |= share > 0.0;
        self.sum += e * share;
    }

    /// Whether all agreed. Without a vote there is no agreement, as when the first few samples all lie below the horizon.
    fn agree(&self) -> bool {
        self.lit != self.dark
    }
}

/// The shafts between the receivers of a tile and a light, where they are worth their cost: to what hides it, and to what hides
/// it in part.
struct Shafts {
    opaque: Option<Shaft>,
    blended: Option<Shaft>,
}

/// How a light, or a sample of one, is hidden from the receivers of a tile.
struct Hidden {
    /// Receivers from which it is hidden as a whole, as bits.
    whole: u64,
    /// Share of it that arrives at each receiver; `None` where that is all or nothing.
    passed: Option<[f32; PACKET]>,
}

impl Hidden {
    /// Share of the light that arrives at a receiver.
    fn share(&self, receiver: usize) -> f32 {
        let whole = || if self.whole >> receiver & 1 == 1 { 0.0 } else { 1.0 };
        self.passed.as_ref().map_or_else(whole, |passed| passed[receiver])
    }
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

/// Up to [`PACKET`] receivers that are lit together.
pub(super) struct Tile<'a> {
    shadows: &'a Shadows<'a>,
    receivers: &'a [ShadingPoint],
    positions: [Vec3A; PACKET],
    /// The same, and both normals, by axis.
    columns: [[[f32; PACKET]; 3]; 3],
    /// Shadow rays traced so far.
    rays: Cell<u64>,
}

impl<'a> Tile<'a> {
    pub(super) fn new(shadows: &'a Shadows<'a>, receivers: &'a [ShadingPoint]) -> Self {
        // By axis, so that the terms of a disc are computed for many receivers at once.
        // Places without a receiver repeat the last.
        let mut columns = [[[0.0; PACKET]; 3]; 3];
        for i in 0..PACKET {
            let ShadingPoint { position, normal, geometric_normal } = receivers[i.min(receivers.len() - 1)];
            for (columns, v) in columns.iter_mut().zip([position, normal, geometric_normal]) {
                columns.iter_mut().zip(v.to_array()).for_each(|(column, x)| column[i] = x);
            }
        }
        let positions = std::array::from_fn(|i| receivers.get(i).map_or(Vec3A::ZERO, |receiver| receiver.position));
        Self { shadows, receivers, positions, columns, rays: Cell::new(0) }
    }

    /// Shadow rays traced so far.
    pub(super) fn shadow_rays(&self) -> u64 {
        self.rays.get()
    }

    /// Irradiance from a disc at each receiver, per intensity \[m⁻²\].
    pub(super) fn terms(&self, disc: &Disc) -> [f32; PACKET] {
        let mut terms = [0.0; PACKET];
        let [position, normal, geometric_normal] = &self.columns;
        for i in 0..self.receivers.len().min(PACKET) {
            let at = |columns: &[[f32; PACKET]; 3]| [columns[0][i], columns[1][i], columns[2][i]];
            terms[i] = disc_term(at(position), [at(normal), at(geometric_normal)], disc);
        }
        terms
    }

    /// The shafts between the receivers and a light's points, if they are worth their cost.
    fn shafts(&self, light: &[Vec3A]) -> Shafts {
        let receivers = &self.positions[..self.receivers.len()];
        let is_worth = receivers.len() >= WORTH_A_SHAFT && !light.is_empty();
        let opaque = is_worth.then(|| self.shadows.opaque().shaft(receivers, light));
        let to = |blends: &Accelerator| is_worth.then(|| blends.shaft_if_near(receivers, light));
        Shafts { opaque, blended: self.shadows.blends().and_then(to) }
    }

    /// All receivers, as bits.
    fn all(&self) -> u64 {
        u64::MAX >> (PACKET - self.receivers.len())
    }

    /// Finds the receivers among `active` that `light` is hidden from. Its shadow rays start at the light, which they have in
    /// common; it lies in the `shaft`, if there is one.
    pub(super) fn hidden_from(&self, light: Vec3A, active: u64, shaft: Option<&Shaft>) -> u64 {
        if active == 0 || shaft.is_some_and(Shaft::is_empty) {
            return 0;
        }

        // All the rays of a packet share their origin, the light. Within a shaft they meet fewer boxes of the tree.
        self.rays.set(self.rays.get() + u64::from(active.count_ones()));
        match shaft {
            Some(shaft) => self.shadows.opaque().occluded_packet_within(shaft, light, &self.columns[0], active),
            None => self.shadows.opaque().occluded_packet(light, &self.positions[..self.receivers.len()], active),
        }
    }

    /// How `light` is hidden from the receivers among `active`, as [`Tile::hidden_from`], with the shares that blended surfaces
    /// let through.
    fn hidden(&self, light: Vec3A, active: u64, shafts: &Shafts) -> Hidden {
        let whole = self.hidden_from(light, active, shafts.opaque.as_ref());
        let left = active & !whole;
        let partly = match (self.shadows.blends(), &shafts.blended) {
            (None, _) => 0,
            (Some(_), Some(shaft)) if shaft.is_empty() => 0,
            (Some(blends), Some(shaft)) => blends.occluded_packet_within(shaft, light, &self.columns[0], left),
            (Some(blends), None) => blends.occluded_packet(light, &self.positions[..self.receivers.len()], left),
        };
        if partly == 0 {
            return Hidden { whole, passed: None };
        }
        let mut passed = std::array::from_fn(|i| if whole >> i & 1 == 1 { 0.0 } else { 1.0 });
        bits(partly).for_each(|i| passed[i] = self.shadows.passed(light, self.positions[i]));
        Hidden { whole, passed: Some(passed) }
    }

    /// As [`Tile::hidden`], where few receivers ask: share of `light` that blended surfaces let through to one.
    pub(super) fn passed(&self, light: Vec3A, receiver: usize) -> f32 {
        self.shadows.passed(light, self.positions[receiver])
    }

    /// Adds the irradiance from a glowing surface: exact where all of it is visible, else by the visible share of its samples,
    /// each weighted by its unshadowed irradiance.
    pub(super) fn add_area(&self, area: &Area, sums: &mut [Vec3]) {
        // A shadow ray votes for a receiver: whether this sample is visible there.
        let shafts = self.shafts(&area.positions);
        let mut votes = TileVotes::NONE;
        let mut trace_samples = |samples: &[AreaSample], among: u64| {
            for sample in samples {
                let terms = self.terms(&Disc::of_sample(sample));
                let traced = among & shining(&terms);
                let hidden = self.hidden(sample.position, traced, &shafts);
                votes.add(sample.intensity, &terms, traced, &hidden);
            }
            among & !votes.agreed()
        };

        // Corners and the first samples go to all receivers, the rest to those of a penumbra: where the votes disagree.
        let (first, rest) = match (&shafts.opaque, &shafts.blended) {
            // Where nothing can hide it, one sample that shines is enough.
            (Some(opaque), blended) if opaque.is_empty() && blended.as_ref().is_none_or(Shaft::is_empty) => {
                area.samples.split_at(1)
            }
            _ => {
                trace_samples(&area.corners, self.all());
                area.samples.split_at(FIRST_AREA_SAMPLES.min(area.samples.len()))
            }
        };
        let undecided = trace_samples(first, self.all());
        if undecided != 0 {
            trace_samples(rest, undecided);
        }

        // Each receiver's light: all of the lamp where no vote was against, else the share of it that is seen.
        for i in bits(votes.lit) {
            sums[i] += if votes.dark >> i & 1 == 0 {
                area.unhidden(&self.receivers[i])
            } else if area.polygons.is_empty() {
                TileVotes::of(&votes.seen, i) * area.balance_at(&self.receivers[i])
            } else {
                // Where a color is missing in all samples, it is missing in the light.
                let all = TileVotes::of(&votes.all, i).max(Vec3::splat(f32::MIN_POSITIVE));
                area.unhidden(&self.receivers[i]) * (TileVotes::of(&votes.seen, i) / all)
            };
        }
    }

    pub(super) fn add_point(&self, light: &PointLight, sums: &mut [Vec3]) {
        // E = I(ω) cos θ / r², if nothing hides it.
        let mut given = [Vec3::ZERO; PACKET];
        let mut active = 0;
        for (i, receiver) in self.receivers.iter().enumerate() {
            let (cos, r2) = receiver.cosine_to(light.position);
            given[i] = light.intensity_towards(receiver.position) * (cos / r2.max(f32::MIN_POSITIVE));
            active |= u64::from(given[i] != Vec3::ZERO) << i;
        }

        // Shadow rays for those it shines on.
        let hidden = self.hidden(light.position, active, &self.shafts(&[light.position]));
        bits(active & !hidden.whole).for_each(|i| sums[i] += given[i] * hidden.share(i));
    }

    /// Adds the irradiance from a sun: all of it or none is visible where its border and the first few of its points agree.
    pub(super) fn add_sun(&self, sun: &Sun, sums: &mut [Vec3]) {
        let share = sun.irradiance / sun.directions.len() as f32;
        for (receiver, sum) in self.receivers.iter().zip(sums) {
            // Irradiance from a point of the disc, and the share of it that arrives.
            let given = |towards: Vec3A| {
                let above = receiver.geometric_normal.dot(towards) > 0.0;
                share * if above { receiver.normal.dot(towards).max(0.0) } else { 0.0 }
            };
            let visible = |towards: Vec3A| {
                self.rays.set(self.rays.get() + 1);
                self.shadows.visible_towards(receiver.position, towards)
            };

            // The border of the disc first: its points give nothing, and show whether the sun is partly hidden.
            let mut votes = Votes::default();
            for towards in sun.border {
                if given(towards) != Vec3::ZERO && !(votes.lit && votes.dark) {
                    votes.add(Vec3::ZERO, visible(towards));
                }
            }

            // Then points of the disc, each with its share of E cos θ. Once all votes agree the rest follows without rays.
            for (index, &towards) in sun.directions.iter().enumerate() {
                let e = given(towards);
                if e != Vec3::ZERO {
                    let is_known = index >= FIRST_SUN_SAMPLES && votes.agree();
                    let known = if votes.dark { 0.0 } else { 1.0 };
                    votes.add(e, if is_known { known } else { visible(towards) });
                }
            }
            *sum += votes.sum;
        }
    }
}

/// Where a disc shines, as bits.
fn shining(terms: &[f32; PACKET]) -> u64 {
    bits_where(terms, |term| term > 0.0)
}

fn bits_where(numbers: &[f32; PACKET], is: impl Fn(f32) -> bool) -> u64 {
    numbers.iter().rev().fold(0, |bits, &number| bits << 1 | u64::from(is(number)))
}
