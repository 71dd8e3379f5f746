//! Photon tracing. Photons transport flux from the lights to surfels, which determine the flux of the anchors.
//!
//! Every frame uses the same Halton numbers. Where the scene is static, the flux is bit-identical in all frames.
//! Elsewhere, it changes as little as the scene \[Herzog08, 4.1.1\].
//!
//! Flux is counted in integer quanta, because integer sums do not depend on their order. Results are therefore
//! independent of threads and of the selection of retraced photons. All paths are traced once, up to the first possible
//! contact with moving geometry ([`Photons::with_swept_volume`]). The results are bit-identical to tracing all paths
//! completely.

mod aims;
mod boxes;
mod glass;
mod guide;
mod path;
mod quanta;

pub use guide::{Guide, GuideSearch};

use crate::anchor::{Anchors, Moved, Sight, SurfelMap};
use crate::light::Emitters;
use crate::ranks::{Alone, Assignment, Meter, Ranks, sum_of_all};
use crate::swept::SweptVolume;
use crate::{Busy, PosedScene, Timed, Units};
use glam::Vec3;
use guide::Starts;
use path::{LONGEST_PATH, Leg, Path, Walk};
use quanta::{Left, Quantum, Receivers, Sums};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Flux of the photons in one frame, by anchor and by surfel.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AnchorFlux {
    /// Flux of each fixed anchor \[W\], linear RGB: the flux of its surfels that leaves their neighborhood.
    pub fixed: Vec<Vec3>,
    /// Flux of each dynamic anchor \[W\], linear RGB.
    pub dynamic: Vec<Vec3>,
    /// Flux reflected around each fixed surfel, and around each dynamic surfel \[W\].
    pub surfels: [Vec<Vec3>; 2],
    /// Flux emitted by the lights \[W\].
    pub emitted: Vec3,
    /// Flux reflected by all surfaces \[W\]. It is exactly the sum over the surfels.
    pub reflected: Vec3,
    /// Flux that left the scene, hit the back of a surface, or was reflected at a point without surfels \[W\].
    pub lost: Vec3,
    /// Number of photons that this rank traced for the frame, completely or from the first segment that may have
    /// changed. The flux of all other photons comes from previous frames or from other ranks.
    pub traced: u64,
    /// Changes of visibility between surfels by moving geometry.
    pub moved: Moved,
}

/// Photon tracing of a scene over successive frames.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Photons {
    count: u64,
    seed: u64,
    bounces: usize,
    guide: Option<Arc<Guide>>,
    swept: Option<SweptVolume>,
    settled: Option<Settled>,
    /// Ranks that share the work; not stored.
    #[cfg_attr(feature = "serde", serde(skip, default = "alone"))]
    ranks: Arc<dyn Ranks>,
}

fn alone() -> Arc<dyn Ranks> {
    Arc::new(Alone)
}

/// Photon paths up to their first possible contact with moving geometry.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Settled {
    /// Powers of the lights when the paths were traced. They determine the light at which each photon starts.
    powers: Vec<Vec3>,
    /// Flux of the segments that moving geometry cannot change.
    sums: Sums,
    /// Photons that this rank traces in every frame, completely or from a segment.
    others: Vec<Other>,
}

/// Photon that moving geometry may affect.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Other {
    /// The whole path of the photon with this index, because its light moves.
    Whole(u32),
    /// The path from the first segment that moving geometry may affect.
    From(Leg),
}

impl Other {
    /// Returns the owner assignment of the photon's batch.
    fn assignment(&self) -> Assignment {
        let photon = match self {
            Self::Whole(photon) => *photon,
            Self::From(leg) => leg.photon(),
        };
        assignment_of(photon.into())
    }
}

/// Number of photons per thread task. Each surfel then receives several photons, which makes distribution efficient.
const BATCH: u64 = 16_384;

/// Returns the owner assignment of the batch of a photon.
fn assignment_of(photon: u64) -> Assignment {
    Assignment::InOrder((photon / BATCH) as u32)
}

impl Photons {
    /// Returns a tracer of `count` photons per frame (at most 2³²), with random numbers that depend on `seed`.
    #[must_use]
    pub fn new(count: u64, seed: u64) -> Self {
        Self {
            count: count.min(1 << 32),
            seed,
            bounces: LONGEST_PATH,
            guide: None,
            swept: None,
            settled: None,
            ranks: alone(),
        }
    }

    /// Limits paths to `bounces` reflections. The default is 1024.
    #[must_use]
    pub fn with_bounces(self, bounces: usize) -> Self {
        Self { bounces: bounces.min(LONGEST_PATH), ..self }
    }

    /// Sets the `guide` for emission. Without a guide, photons start in proportion to power.
    #[must_use]
    pub fn with_guide(self, guide: Option<Guide>) -> Self {
        Self { guide: guide.map(Arc::new), ..self }
    }

    /// Traces photons only in the first frame until they enter `swept`, the space through which moving geometry passes.
    /// Later frames must have the same anchors, and moving geometry must not leave that space.
    #[must_use]
    pub fn with_swept_volume(self, swept: SweptVolume) -> Self {
        Self { swept: Some(swept), ..self }
    }

    /// Distributes the photons among `ranks`. Of R ranks, rank b mod R traces batch b. Stored paths of a single process
    /// are distributed in the same way.
    #[must_use]
    pub fn with_ranks(mut self, ranks: Arc<dyn Ranks>) -> Self {
        if let Some(settled) = &mut self.settled {
            settled.others.retain(|other| other.assignment().owner(ranks.count()) == ranks.rank());
        }
        Self { ranks, ..self }
    }

    /// Returns the photons for storage. Paths that several ranks share are left out, because each rank has only its
    /// own; the next frame then traces them again.
    #[must_use]
    pub fn for_storage(&self) -> Self {
        let settled = self.settled.clone().filter(|_| self.ranks.count() == 1);
        Self { settled, ..self.clone() }
    }

    /// Traces one frame. The result is bit-identical for any number of threads and ranks, with or without reused paths.
    pub fn trace(
        &mut self,
        PosedScene { accelerator, surfaces }: PosedScene,
        emitters: &Emitters,
        anchors: &Anchors,
        units: &Units,
    ) -> Timed<AnchorFlux> {
        Timed::of(|busy| {
            let dynamic = anchors.surfels.dynamic_in_world(surfaces);
            let surfels = [&anchors.surfels.fixed, &dynamic];
            // Return no flux if the scene has no emitters.
            let source = emitters.photons(surfaces.scene()).filter(|_| self.count > 0);
            let Some(source) = source else {
                return Sums::new(surfels).anchor_flux(Quantum::default(), anchors, surfels, Moved::default());
            };

            // Collect the scene and settings that all photons of the frame share.
            let starts = Starts::new(&source, self.guide.clone());
            let walk = Walk {
                accelerator,
                surfaces,
                source: &source,
                starts: &starts,
                moving: surfaces.moving().clone(),
                // Average textures over an anchor's area, because anchors represent the mean of their neighborhood.
                footprint: anchors.area_share.sqrt(),
                epsilon: units.epsilon,
                count: self.count,
                seed: self.seed,
                bounces: self.bounces,
            };

            // Trace the photons. Their flux at surfels determines the flux of the anchors.
            let quantum = Quantum::of(source.powers());
            let ranks = self.ranks.clone();
            let emission = FrameEmission { walk, quantum, surfels, busy, ranks: &*ranks };
            let (sums, traced) = self.sums(&emission);
            let moved = anchors.surfels.fixed.moved(&emission.sight(), &*ranks);
            AnchorFlux { traced, ..sums.anchor_flux(emission.quantum, anchors, surfels, moved) }
        })
    }

    /// Returns the flux of all photons of a frame, and the number of photons that this rank traced for it.
    fn sums(&mut self, emission: &FrameEmission) -> (Sums, u64) {
        let powers = emission.walk.source.powers();
        // Reuse previous paths only with unchanged powers: otherwise, photons start at different lights.
        if let Some(settled) = self.settled.as_ref().filter(|settled| settled.powers == powers) {
            let others = emission.of_all_ranks(|meter| emission.trace_others(&settled.others, meter));
            let sums = others.plus(settled.sums.clone());
            return (sums, settled.others.len() as u64);
        }

        // Trace all photons in every frame if there is no swept volume.
        let count: u64 = emission.batches().map(|batch| batch.end - batch.start).sum();
        let Some(swept) = &self.swept else { return (emission.of_all_ranks(|meter| emission.trace_all(meter)), count) };

        // Sum separately the flux that moving geometry cannot change, so that later frames reuse the sums.
        let swept = &Swept { entered: swept.clone(), near: swept.widened(emission.surfels[0].reach()) };
        let (mut change, mut others) = (emission.no_sums(), Vec::new());
        let stay = emission.of_all_ranks(|meter| {
            let parted = emission.trace_split(swept, meter);
            (change, others) = (parted.change, parted.others);
            parted.stay
        });
        let change = emission.of_all_ranks(|_| change);
        let sums = stay.clone().plus(change);
        self.settled = Some(Settled { powers: powers.to_vec(), sums: stay, others });
        (sums, count)
    }
}

/// Photon emission of one frame.
struct FrameEmission<'a> {
    walk: Walk<'a>,
    quantum: Quantum,
    /// Fixed surfels, and dynamic surfels at the pose of the frame.
    surfels: [&'a SurfelMap; 2],
    busy: &'a Busy,
    ranks: &'a dyn Ranks,
}

/// Space in which moving geometry affects photons.
struct Swept {
    /// Cells that moving geometry enters.
    entered: SweptVolume,
    /// Cells so close that surfels receive energy across moving geometry.
    near: SweptVolume,
}

/// Flux of whole paths, split by whether moving geometry may change it.
struct SplitFlux {
    stay: Sums,
    change: Sums,
    /// Photons, completely or from a segment, that contribute to `change`.
    others: Vec<Other>,
}

impl SplitFlux {
    /// Returns the sum of `self` and `other`.
    fn plus(self, other: Self) -> Self {
        Self {
            stay: self.stay.plus(other.stay),
            change: self.change.plus(other.change),
            others: [self.others, other.others].concat(),
        }
    }
}

impl FrameEmission<'_> {
    fn no_sums(&self) -> Sums {
        Sums::new(self.surfels)
    }

    /// Returns the ranges of photons that this rank traces.
    fn batches(&self) -> impl ParallelIterator<Item = Range<u64>> {
        let count = self.walk.count;
        // Assign batches to ranks, so that a rank retraces only its own photons in later frames.
        let (rank, ranks) = (self.ranks.rank(), self.ranks.count());
        let begins = (0..count.div_ceil(BATCH)).into_par_iter().map(|batch| batch * BATCH);
        let of_this_rank = begins.filter(move |&begin| assignment_of(begin).owner(ranks) == rank);
        of_this_rank.map(move |begin| begin..(begin + BATCH).min(count))
    }

    /// Returns the sum of the results of all ranks.
    fn of_all_ranks(&self, trace: impl FnOnce(&Meter) -> Sums) -> Sums {
        sum_of_all(self.ranks, trace, Sums::plus)
    }

    fn take(&self, sums: &mut Sums, path: &Path, left: &mut Left) {
        sums.take(path, self.quantum, left, &self.receivers());
    }

    fn settle(&self, sums: &mut Sums, left: &mut Left) {
        sums.settle(left, self.quantum, &self.receivers());
    }

    fn receivers(&self) -> Receivers<'_> {
        Receivers { surfels: self.surfels, sight: self.sight() }
    }

    fn sight(&self) -> Sight<'_> {
        Sight { accelerator: self.walk.accelerator, epsilon: self.walk.epsilon }
    }

    /// Traces every photon completely.
    fn trace_all(&self, meter: &Meter) -> Sums {
        let started = || (self.no_sums(), Left::default());
        // Threads sum separate batches. Integer sums do not depend on how batches are grouped.
        let fold = self.batches().fold(started, |(mut sums, mut left), batch| {
            let (mut laps, assignment) = (meter.laps(), assignment_of(batch.start));
            self.busy.measure(|| {
                let mut path = Path::default();
                for index in batch {
                    self.walk.follow(index as u32, &mut path, |_| ());
                    self.take(&mut sums, &path, &mut left);
                }
                self.settle(&mut sums, &mut left);
            });
            laps.note(assignment);
            (sums, left)
        });
        fold.map(|(sums, _)| sums).reduce(|| self.no_sums(), Sums::plus)
    }

    /// Traces the photons that moving geometry may affect, each from its first affected segment.
    fn trace_others(&self, others: &[Other], meter: &Meter) -> Sums {
        let started = || (self.no_sums(), Left::default());
        // Retrace each photon from its first affected segment. The flux before it is in the constant sums.
        let fold = others.par_chunks(BATCH as usize).fold(started, |(mut sums, mut left), others| {
            let mut laps = meter.laps();
            self.busy.measure(|| {
                let mut path = Path::default();
                for &other in others {
                    match other {
                        Other::Whole(index) => self.walk.follow(index, &mut path, |_| ()),
                        Other::From(leg) => self.walk.follow_from(leg, &mut path, |_| ()),
                    }
                    self.take(&mut sums, &path, &mut left);
                }
                self.settle(&mut sums, &mut left);
            });
            laps.note_together(others.iter().map(Other::assignment));
            (sums, left)
        });
        fold.map(|(sums, _)| sums).reduce(|| self.no_sums(), Sums::plus)
    }

    /// Traces every photon, and splits its path where the path first enters `swept`.
    fn trace_split(&self, swept: &Swept, meter: &Meter) -> SplitFlux {
        let nothing = || SplitFlux { stay: self.no_sums(), change: self.no_sums(), others: Vec::new() };
        let fold = self.batches().fold(nothing, |mut parted, batch| {
            let (mut laps, assignment) = (meter.laps(), assignment_of(batch.start));
            let SplitFlux { stay, change, others } = &mut parted;
            self.busy.measure(|| {
                let (mut left_to_stay, mut left_to_change) = (Left::default(), Left::default());
                let (mut path, mut legs) = (Path::default(), Vec::new());
                for index in batch {
                    let index = index as u32;
                    legs.clear();
                    self.walk.follow(index, &mut path, |leg| legs.push(leg));
                    // Retrace photons of moving lights completely in every frame.
                    if path.from_moving {
                        self.take(change, &path, &mut left_to_change);
                        others.push(Other::Whole(index));
                        continue;
                    }
                    // Split other paths at the first segment that moving geometry may affect.
                    if let Some(segment) = path.first_met(&legs, &swept.entered, &swept.near) {
                        self.take(change, &path.split_off(segment), &mut left_to_change);
                        others.push(Other::From(legs[segment]));
                    }
                    // The flux before this segment is constant.
                    self.take(stay, &path, &mut left_to_stay);
                }
                self.settle(change, &mut left_to_change);
                self.settle(stay, &mut left_to_stay);
            });
            laps.note(assignment);
            parted
        });
        fold.reduce(nothing, SplitFlux::plus)
    }
}
