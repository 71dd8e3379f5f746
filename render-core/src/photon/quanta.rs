//! Flux in integer quanta, which makes sums independent of their order.

use super::AnchorFlux;
use super::path::Path;
use crate::anchor::{Anchors, Moved, Sight, SplatScratch, Spot, SurfelMap};
use crate::ranks::Portable;
use glam::{DVec3, Vec3};
use ranks::portable;

/// Number of quanta in the total power of all lights. With 2⁴⁸ quanta, sums may reach 2¹⁵ times this power. One of a
/// million photons has 2²⁸ quanta, a finer resolution than `f32`.
const QUANTA: f64 = (1u64 << 48) as f64;

/// Size of a quantum \[W\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantum(f64);

impl Default for Quantum {
    fn default() -> Self {
        Self(1.0)
    }
}

impl Quantum {
    /// Returns the quantum for lights of these powers \[W\].
    pub fn of(powers: &[Vec3]) -> Self {
        let total: f64 = powers.iter().map(|power| f64::from(power.max_element())).sum();
        Self(if total > 0.0 { total / QUANTA } else { 1.0 })
    }

    fn count(self, flux: Vec3) -> Quanta {
        Quanta::round(self.exactly(flux))
    }

    /// Returns the flux in quanta, without rounding.
    fn exactly(self, flux: Vec3) -> DVec3 {
        flux.as_dvec3() / self.0
    }

    fn watts(self, quanta: Quanta) -> Vec3 {
        Vec3::from(quanta.0.map(|count| (count as f64 * self.0) as f32))
    }
}

/// Flux of red, green and blue, in quanta.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Quanta([i64; 3]);

impl Portable for Quanta {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.0.put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        <[i64; 3]>::take(bytes).map(Self)
    }
}

impl Quanta {
    /// Rounds toward zero, saturates, and converts NaN to 0.
    fn round(exactly: DVec3) -> Self {
        Self(exactly.to_array().map(|count| count as i64))
    }

    fn add(&mut self, other: Quanta) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, part)| *sum = sum.saturating_add(part));
    }

    fn subtract(&mut self, other: Quanta) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, part)| *sum = sum.saturating_sub(part));
    }
}

/// Flux of a set of photons.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sums {
    /// Flux at the fixed and at the dynamic surfels, in the order of [`SurfelMap::splat_all`].
    held: [Vec<Quanta>; 2],
    emitted: Quanta,
    reflected: Quanta,
    lost: Quanta,
}

portable!(Sums { held, emitted, reflected, lost });

/// Static and dynamic surfels that receive the energy of photons.
pub(super) struct Receivers<'a> {
    pub surfels: [&'a SurfelMap; 2],
    /// Visibility tests for the static surfels. Dynamic surfels receive energy without tests.
    pub sight: Sight<'a>,
}

/// Flux of photons at static and at moving surfaces that is not distributed yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Left {
    kinds: [Vec<(Spot, Vec3)>; 2],
    scratch: SplatScratch,
}

/// Maximum number of reflections that are stored before distribution. A batch of photons in a white room, each
/// reflected thousands of times, would need gigabytes.
const MOST_LEFT: usize = 1 << 18;

impl Sums {
    /// Returns zero flux.
    pub fn new(surfels: [&SurfelMap; 2]) -> Self {
        let none = Quanta::default();
        Self { held: surfels.map(|surfels| vec![none; surfels.len()]), emitted: none, reflected: none, lost: none }
    }

    /// Adds the flux of the photon of `path`. Its reflections are collected in `left` until [`Sums::settle`], because
    /// distributing many reflections at a time is faster.
    pub fn take(&mut self, path: &Path, quantum: Quantum, left: &mut Left, receivers: &Receivers) {
        // Emitted and lost flux needs no surfels.
        self.emitted.add(quantum.count(path.emitted));
        self.lost.add(quantum.count(path.lost));
        for reflection in &path.reflections {
            left.kinds[usize::from(reflection.on_moving)].push((reflection.spot(), reflection.flux));
        }
        if left.kinds.iter().any(|spots| spots.len() >= MOST_LEFT) {
            self.settle(left, quantum, receivers);
        }
    }

    /// Distributes the flux in `left` among nearby surfels, and clears `left`.
    pub fn settle(&mut self, left: &mut Left, quantum: Quantum, receivers: &Receivers) {
        let Left { kinds, scratch } = left;
        let Receivers { surfels, sight } = receivers;
        let sights = [Some(sight), None];
        for (kind, spots) in kinds.iter_mut().enumerate() {
            let held = &mut self.held[kind];
            surfels[kind].splat_all(spots, sights[kind], scratch, |flux, parts| {
                // Without any surfel nearby, the flux is lost.
                let (exactly, whole) = (quantum.exactly(flux), quantum.count(flux));
                let Some((&(last, _), others)) = parts.split_last() else { return self.lost.add(whole) };
                let mut rest = whole;
                for &(surfel, weight) in others {
                    let part = Quanta::round(exactly * f64::from(weight));
                    held[surfel as usize].add(part);
                    rest.subtract(part);
                }
                // Assign the remainder, including rounding errors, to the last surfel, so that no flux is lost.
                held[last as usize].add(rest);
                self.reflected.add(whole);
            });
            spots.clear();
        }
    }

    /// Returns the sum of `self` and `other`.
    pub fn plus(mut self, other: Sums) -> Sums {
        for (mine, theirs) in self.held.iter_mut().zip(&other.held) {
            mine.iter_mut().zip(theirs).for_each(|(sum, part)| sum.add(*part));
        }
        self.emitted.add(other.emitted);
        self.reflected.add(other.reflected);
        self.lost.add(other.lost);
        self
    }

    /// Converts the sums to watts. The number of traced photons in the result is 0.
    pub fn anchor_flux(
        &self,
        quantum: Quantum,
        anchors: &Anchors,
        surfels: [&SurfelMap; 2],
        moved: Moved,
    ) -> AnchorFlux {
        // Restore the order of the surfels, then sum over the surfels of each anchor.
        let watts = |kind: usize| -> Vec<Vec3> {
            surfels[kind].by_index(&self.held[kind]).into_iter().map(|q| quantum.watts(q)).collect()
        };
        let [fixed, dynamic] = [watts(0), watts(1)];
        AnchorFlux {
            fixed: surfels[0].anchor_flux(&fixed, &moved, anchors.fixed.len()),
            dynamic: surfels[1].anchor_flux(&dynamic, &Moved::default(), anchors.dynamic.len()),
            surfels: [fixed, dynamic],
            emitted: quantum.watts(self.emitted),
            reflected: quantum.watts(self.reflected),
            lost: quantum.watts(self.lost),
            traced: 0,
            moved,
        }
    }
}
