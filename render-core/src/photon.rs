//! Photons walk from the lights through the scene and leave their flux at surfels, which feed the anchors.
//!
//! The same Halton numbers are used for every frame: where nothing moves, the flux is the same to the last bit, and where
//! something does, it changes as little as the scene \[Herzog08, 4.1.1\].
//!
//! Flux is counted in whole quanta. Sums of integers do not depend on their order: not on the threads, and not on
//! which photons are traced again. So the ways of all are traced once up to where anything that moves could meet them
//! ([`Photons::with_swept_volume`]), and the bits are those of tracing them whole.

mod path;
mod quanta;
mod swept;

pub use swept::SweptVolume;

use crate::anchor::{Anchors, SurfelMap};
use crate::emitter::Emitters;
use crate::{Busy, PosedScene, Timed, Units};
use glam::Vec3;
use path::{LONGEST_PATH, Leg, Path, Walk};
use quanta::{Left, Quantum, Sums};
use rayon::prelude::*;

/// Flux of the photons of one frame, by anchor and by surfel.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorFlux {
    /// Of each fixed anchor \[W\], linear RGB: the part of its surfels' flux that leaves their neighborhood.
    pub fixed: Vec<Vec3>,
    /// The same for the dynamic anchors.
    pub dynamic: Vec<Vec3>,
    /// Reflected by the surface around each fixed surfel, then around each dynamic one \[W\].
    pub surfels: [Vec<Vec3>; 2],
    /// Emitted by the lights \[W\].
    pub emitted: Vec3,
    /// Reflected by all surfaces \[W\]: the sum over the surfels, to the quantum.
    pub reflected: Vec3,
    /// Left the scene, met the back of a surface, or was reflected where there is no surfel \[W\].
    pub lost: Vec3,
    /// Photons that were traced for this frame, whole or from where something may have moved into their way. The flux of all
    /// others was known.
    pub traced: u64,
}

/// The photons of a scene, frame after frame.
#[derive(Clone, Debug)]
pub struct Photons {
    count: u64,
    seed: u64,
    bounces: usize,
    swept: Option<SweptVolume>,
    settled: Option<Settled>,
}

/// Photon paths up to where they may meet moving things.
#[derive(Clone, Debug)]
struct Settled {
    /// Powers of the lights when they were traced: these decide which light a photon starts from.
    powers: Vec<Vec3>,
    /// Flux of the segments that no moving thing can change.
    sums: Sums,
    /// Segments from which photons are traced on in every frame.
    others: Vec<Other>,
}

/// A photon that moving things may meet.
#[derive(Clone, Copy, Debug)]
enum Other {
    /// Its light moves.
    Whole(u32),
    /// From the first segment on that something may stand in the way of.
    From(Leg),
}

/// Photons that a thread takes at a time: enough that each surfel gets several, for then sharing out is fast.
const BATCH: u64 = 16_384;

impl Photons {
    /// `count` photons a frame (at most 2³²), with numbers that follow from `seed`.
    pub fn new(count: u64, seed: u64) -> Self {
        Self { count: count.min(1 << 32), seed, bounces: LONGEST_PATH, swept: None, settled: None }
    }

    /// Paths end after `bounces` reflections at the latest; 1024 when not stated.
    pub fn with_bounces(self, bounces: usize) -> Self {
        Self { bounces: bounces.min(LONGEST_PATH), ..self }
    }

    /// Photons are traced for the first frame only until they enter `swept`, the space that moving things pass through.
    /// Later frames need the same anchors, and nothing that moves may leave that space.
    pub fn with_swept_volume(self, swept: SweptVolume) -> Self {
        Self { swept: Some(swept), ..self }
    }

    /// Traces one frame. The same scene gives the same bits, for any number of threads and whatever was kept.
    pub fn trace(
        &mut self,
        scene: PosedScene,
        emitters: &Emitters,
        anchors: &Anchors,
        units: &Units,
    ) -> Timed<AnchorFlux> {
        Timed::of(|busy| self.traced(scene, emitters, anchors, units, busy))
    }

    fn traced(
        &mut self,
        PosedScene { accelerator, surfaces }: PosedScene,
        emitters: &Emitters,
        anchors: &Anchors,
        units: &Units,
        busy: &Busy,
    ) -> AnchorFlux {
        let dynamic = anchors.surfels.dynamic_in_world(surfaces);
        let surfels: [&SurfelMap; 2] = [&anchors.surfels.fixed, &dynamic];
        let empty = || Sums::new(surfels);
        let started = || (empty(), Left::default());
        let source = emitters.photons(surfaces.scene()).filter(|_| self.count > 0);
        let Some(source) = source else { return empty().anchor_flux(Quantum::default(), 0, anchors, surfels) };
        let quantum = Quantum::of(source.powers());
        let walk = Walk {
            accelerator,
            surfaces,
            source: &source,
            moving: surfaces.scene().moving_instances(),
            // An anchor sees its neighborhood blurred: so do the photons that feed it.
            footprint: anchors.area_share.sqrt(),
            epsilon: units.epsilon,
            count: self.count,
            seed: self.seed,
            bounces: self.bounces,
        };
        let batches = (0..self.count.div_ceil(BATCH)).into_par_iter();
        let batch = |batch: u64| batch * BATCH..((batch + 1) * BATCH).min(self.count);

        // With other powers photons start elsewhere: nothing that was kept holds.
        if let Some(settled) = self.settled.as_ref().filter(|settled| settled.powers == source.powers()) {
            let chunks = settled.others.par_chunks(BATCH as usize);
            let fold = chunks.fold(started, |(mut sums, mut left), others| {
                busy.measure(|| {
                    let mut path = Path::default();
                    for &other in others {
                        match other {
                            Other::Whole(index) => walk.follow(index, &mut path, |_| ()),
                            Other::From(leg) => walk.follow_from(leg, &mut path, |_| ()),
                        }
                        sums.take(&path, quantum, &mut left, surfels);
                    }
                    sums.settle(&mut left, surfels, quantum);
                });
                (sums, left)
            });
            let sums = fold.map(|(sums, _)| sums).reduce(empty, Sums::plus).plus(settled.sums.clone());
            return sums.anchor_flux(quantum, settled.others.len() as u64, anchors, surfels);
        }
        let Some(swept) = &self.swept else {
            let fold = batches.fold(started, |(mut sums, mut left), place| {
                busy.measure(|| {
                    let mut path = Path::default();
                    for index in batch(place) {
                        walk.follow(index as u32, &mut path, |_| ());
                        sums.take(&path, quantum, &mut left, surfels);
                    }
                    sums.settle(&mut left, surfels, quantum);
                });
                (sums, left)
            });
            return fold
                .map(|(sums, _)| sums)
                .reduce(empty, Sums::plus)
                .anchor_flux(quantum, self.count, anchors, surfels);
        };
        // The first frame with something to keep: photons that stay are summed apart from the others.
        let apart = || (empty(), empty(), Vec::new());
        let fold = batches.fold(apart, |(mut stay, mut change, mut others), place| {
            busy.measure(|| {
                let (mut left_to_stay, mut left_to_change) = (Left::default(), Left::default());
                let (mut path, mut legs) = (Path::default(), Vec::new());
                for index in batch(place) {
                    let index = index as u32;
                    legs.clear();
                    walk.follow(index, &mut path, |leg| legs.push(leg));
                    if path.from_moving {
                        change.take(&path, quantum, &mut left_to_change, surfels);
                        others.push(Other::Whole(index));
                        continue;
                    }
                    if let Some(segment) = path.first_met(&legs, swept) {
                        change.take(&path.split_off(segment), quantum, &mut left_to_change, surfels);
                        others.push(Other::From(legs[segment]));
                    }
                    stay.take(&path, quantum, &mut left_to_stay, surfels);
                }
                change.settle(&mut left_to_change, surfels, quantum);
                stay.settle(&mut left_to_stay, surfels, quantum);
            });
            (stay, change, others)
        });
        let (stay, change, others) = fold.reduce(apart, |a, b| (a.0.plus(b.0), a.1.plus(b.1), [a.2, b.2].concat()));
        let anchor_flux = stay.clone().plus(change).anchor_flux(quantum, self.count, anchors, surfels);
        self.settled = Some(Settled { powers: source.powers().to_vec(), sums: stay, others });
        anchor_flux
    }
}
