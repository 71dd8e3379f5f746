//! Energy in whole quanta, so that sums are the same in any order.

use super::Energies;
use super::path::Path;
use crate::anchor::{Anchors, SurfelMap};
use glam::Vec3;

/// Quanta in the largest power of all lights together: 2⁴⁸ leave room for sums of 2¹⁵ times as much, and divide the
/// share of one of a million photons into 2²⁸ parts, more than `f32` does.
const QUANTA: f64 = (1u64 << 48) as f64;

/// Watts of a quantum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantum(f64);

impl Default for Quantum {
    fn default() -> Self {
        Self(1.0)
    }
}

impl Quantum {
    /// For lights of these powers \[W\].
    pub fn of(powers: &[Vec3]) -> Self {
        let total: f64 = powers.iter().map(|power| f64::from(power.max_element())).sum();
        Self(if total > 0.0 { total / QUANTA } else { 1.0 })
    }

    fn count(self, flux: Vec3) -> Quanta {
        // The conversion saturates; NaN becomes 0.
        Quanta(flux.to_array().map(|watts| (f64::from(watts) / self.0) as i64))
    }

    fn watts(self, quanta: Quanta) -> Vec3 {
        Vec3::from(quanta.0.map(|count| (count as f64 * self.0) as f32))
    }
}

/// Energy in red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Quanta([i64; 3]);

impl Quanta {
    fn add(&mut self, other: Quanta) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, part)| *sum = sum.saturating_add(part));
    }

    fn subtract(&mut self, other: Quanta) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, part)| *sum = sum.saturating_sub(part));
    }
}

/// What some of the photons left.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    /// At the fixed and at the carried surfels.
    held: [Vec<Quanta>; 2],
    emitted: Quanta,
    reflected: Quanta,
    lost: Quanta,
}

impl Sums {
    /// Nothing.
    pub fn new(surfels: [&SurfelMap; 2]) -> Self {
        let none = Quanta::default();
        Self { held: surfels.map(|surfels| vec![none; surfels.len()]), emitted: none, reflected: none, lost: none }
    }

    /// Takes what the photon of `path` left at the fixed and the carried `surfels`.
    pub fn take(&mut self, path: &Path, surfels: [&SurfelMap; 2], quantum: Quantum) {
        self.emitted.add(quantum.count(path.emitted));
        self.lost.add(quantum.count(path.lost));
        for reflection in &path.reflections {
            let kind = usize::from(reflection.carrier.is_some());
            let whole = quantum.count(reflection.flux);
            // The last surfel also takes what rounding left of the others: nothing gets lost.
            let (mut rest, mut last) = (whole, None);
            let held = &mut self.held[kind];
            let taken = surfels[kind].splat(&reflection.spot(), |surfel, weight| {
                let part = quantum.count(reflection.flux * weight);
                held[surfel].add(part);
                rest.subtract(part);
                last = Some(surfel);
            });
            if let Some(surfel) = last.filter(|_| taken) {
                held[surfel].add(rest);
                self.reflected.add(whole);
            } else {
                self.lost.add(whole);
            }
        }
    }

    /// Both together.
    pub fn plus(mut self, other: Sums) -> Sums {
        for (mine, theirs) in self.held.iter_mut().zip(&other.held) {
            mine.iter_mut().zip(theirs).for_each(|(sum, part)| sum.add(*part));
        }
        self.emitted.add(other.emitted);
        self.reflected.add(other.reflected);
        self.lost.add(other.lost);
        self
    }

    /// In watts.
    pub fn energies(&self, quantum: Quantum, traced: u64, anchors: &Anchors, surfels: [&SurfelMap; 2]) -> Energies {
        let watts = |held: &Vec<Quanta>| -> Vec<Vec3> { held.iter().map(|&q| quantum.watts(q)).collect() };
        let [fixed, carried] = self.held.each_ref().map(watts);
        Energies {
            fixed: surfels[0].anchor_flux(&fixed, anchors.fixed.len()),
            carried: surfels[1].anchor_flux(&carried, anchors.carried.len()),
            surfels: [fixed, carried],
            emitted: quantum.watts(self.emitted),
            reflected: quantum.watts(self.reflected),
            lost: quantum.watts(self.lost),
            traced,
        }
    }
}
