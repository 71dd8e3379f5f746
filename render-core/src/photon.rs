//! Photons walk from the lights through the scene and leave their flux at surfels, which feed the anchors.
//!
//! The same Halton numbers are used for every frame: where nothing moves, the flux is the same to the last bit, and where
//! something does, it changes as little as the scene \[Herzog08, 4.1.1\].
//!
//! Flux is counted in whole quanta. Sums of integers do not depend on their order: not on the threads, and not on
//! which photons are traced again. So the ways of all are traced once up to where anything that moves could meet them
//! ([`Photons::with_swept_volume`]), and the bits are those of tracing them whole.

mod aims;
mod boxes;
mod guide;
mod path;
mod quanta;

pub use guide::{Guide, GuideSearch};

use crate::anchor::{Anchors, Moved, Sight, SurfelMap};
use crate::light::Emitters;
use crate::ranks::{Alone, Meter, Ranks, Turn, sum_of_all};
use crate::swept::SweptVolume;
use crate::{Busy, PosedScene, Timed, Units};
use glam::Vec3;
use guide::Starts;
use path::{LONGEST_PATH, Leg, Path, Walk};
use quanta::{Left, Quantum, Receivers, Sums};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Flux of the photons of one frame, by anchor and by surfel.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorFlux {
    /// Flux of each fixed anchor \[W\], linear RGB: the part of its surfels' flux that leaves their neighborhood.
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
    /// Photons that this rank traced for the frame, whole or from where something may have moved into their way. The flux of all
    /// others is known from the frames before, or from other ranks.
    pub traced: u64,
    /// Surfels that moving things hide from each other.
    pub moved: Moved,
}

/// The photons of a scene, frame after frame.
#[derive(Clone, Debug)]
pub struct Photons {
    count: u64,
    seed: u64,
    bounces: usize,
    guide: Option<Arc<Guide>>,
    swept: Option<SweptVolume>,
    settled: Option<Settled>,
    ranks: Arc<dyn Ranks>,
}

/// Photon paths up to where they may meet moving things.
#[derive(Clone, Debug)]
struct Settled {
    /// Powers of the lights when they were traced: these decide which light a photon starts from.
    powers: Vec<Vec3>,
    /// Flux of the segments that no moving thing can change.
    sums: Sums,
    /// Segments from which this rank traces photons on in every frame.
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

impl Other {
    /// Turn of the photon's batch.
    fn turn(&self) -> Turn {
        let photon = match self {
            Self::Whole(photon) => *photon,
            Self::From(leg) => leg.photon(),
        };
        turn_of(photon.into())
    }
}

/// Photons that a thread takes at a time: enough that each surfel gets several, for then sharing out is fast.
const BATCH: u64 = 16_384;

/// Turn of the batch that a photon is in.
fn turn_of(photon: u64) -> Turn {
    Turn::InOrder((photon / BATCH) as u32)
}

impl Photons {
    /// `count` photons a frame (at most 2³²), with numbers that follow from `seed`.
    #[must_use]
    pub fn new(count: u64, seed: u64) -> Self {
        Self {
            count: count.min(1 << 32),
            seed,
            bounces: LONGEST_PATH,
            guide: None,
            swept: None,
            settled: None,
            ranks: Arc::new(Alone),
        }
    }

    /// Paths end after `bounces` reflections at the latest; 1024 when not stated.
    #[must_use]
    pub fn with_bounces(self, bounces: usize) -> Self {
        Self { bounces: bounces.min(LONGEST_PATH), ..self }
    }

    /// Photons start by `guide`; by power alone where there is none.
    #[must_use]
    pub fn with_guide(self, guide: Option<Guide>) -> Self {
        Self { guide: guide.map(Arc::new), ..self }
    }

    /// Photons are traced for the first frame only until they enter `swept`, the space that moving things pass through.
    /// Later frames need the same anchors, and nothing that moves may leave that space.
    #[must_use]
    pub fn with_swept_volume(self, swept: SweptVolume) -> Self {
        Self { swept: Some(swept), ..self }
    }

    /// Shares the photons with other `ranks`: batch b of them is traced by rank b mod R.
    #[must_use]
    pub fn with_ranks(self, ranks: Arc<dyn Ranks>) -> Self {
        Self { ranks, ..self }
    }

    /// Traces one frame. The same scene gives the same bits, for any number of threads and ranks, and whatever was kept.
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
            let source = emitters.photons(surfaces.scene()).filter(|_| self.count > 0);
            let Some(source) = source else {
                return Sums::new(surfels).anchor_flux(Quantum::default(), anchors, surfels, Moved::default());
            };
            let starts = Starts::new(&source, self.guide.clone());
            let walk = Walk {
                accelerator,
                surfaces,
                source: &source,
                starts: &starts,
                moving: surfaces.moving().clone(),
                // An anchor sees its neighborhood blurred: so do the photons that feed it.
                footprint: anchors.area_share.sqrt(),
                epsilon: units.epsilon,
                count: self.count,
                seed: self.seed,
                bounces: self.bounces,
            };
            let quantum = Quantum::of(source.powers());
            let ranks = self.ranks.clone();
            let emission = FrameEmission { walk, quantum, surfels, busy, ranks: &*ranks };
            let (sums, traced) = self.sums(&emission);
            let moved = anchors.surfels.fixed.moved(&emission.sight());
            AnchorFlux { traced, ..sums.anchor_flux(emission.quantum, anchors, surfels, moved) }
        })
    }

    /// Flux of all photons of a frame, and how many of them this rank traced for it.
    fn sums(&mut self, emission: &FrameEmission) -> (Sums, u64) {
        let powers = emission.walk.source.powers();
        // With other powers photons start elsewhere: nothing that was kept holds.
        if let Some(settled) = self.settled.as_ref().filter(|settled| settled.powers == powers) {
            let others = emission.of_all_ranks(|meter| emission.trace_others(&settled.others, meter));
            let sums = others.plus(settled.sums.clone());
            return (sums, settled.others.len() as u64);
        }
        let count: u64 = emission.batches().map(|batch| batch.end - batch.start).sum();
        let Some(swept) = &self.swept else { return (emission.of_all_ranks(|meter| emission.trace_all(meter)), count) };
        // The first frame with something to keep: photons that stay are summed apart from the others.
        let swept = &Swept { entered: swept.clone(), near: swept.widened(emission.surfels[0].reach()) };
        let (mut change, mut others) = (emission.no_sums(), Vec::new());
        let stay = emission.of_all_ranks(|meter| {
            let parted = emission.trace_apart(swept, meter);
            (change, others) = (parted.change, parted.others);
            parted.stay
        });
        let change = emission.of_all_ranks(|_| change);
        let sums = stay.clone().plus(change);
        self.settled = Some(Settled { powers: powers.to_vec(), sums: stay, others });
        (sums, count)
    }
}

/// The photons that the lights emit for one frame.
struct FrameEmission<'a> {
    walk: Walk<'a>,
    quantum: Quantum,
    /// The fixed surfels, and the dynamic ones at the pose of the frame.
    surfels: [&'a SurfelMap; 2],
    busy: &'a Busy,
    ranks: &'a dyn Ranks,
}

/// Where moving things change the light of photons.
struct Swept {
    /// The space that they pass through.
    entered: SweptVolume,
    /// And what is near enough for a photon's light to be shared out across it.
    near: SweptVolume,
}

/// Flux of whole paths, apart from that of segments which moving things may change.
struct Parted {
    stay: Sums,
    change: Sums,
    /// Segments that `change` was traced from.
    others: Vec<Other>,
}

impl Parted {
    /// Both together.
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

    /// Ranges of photons that this rank traces, one after the other.
    fn batches(&self) -> impl ParallelIterator<Item = Range<u64>> {
        let count = self.walk.count;
        let (rank, ranks) = (self.ranks.rank(), self.ranks.count());
        let begins = (0..count.div_ceil(BATCH)).into_par_iter().map(|batch| batch * BATCH);
        let of_this_rank = begins.filter(move |&begin| turn_of(begin).owner(ranks) == rank);
        of_this_rank.map(move |begin| begin..(begin + BATCH).min(count))
    }

    /// The sums of all ranks together, given those of each.
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

    /// Traces every photon whole.
    fn trace_all(&self, meter: &Meter) -> Sums {
        let started = || (self.no_sums(), Left::default());
        let fold = self.batches().fold(started, |(mut sums, mut left), batch| {
            let (mut laps, turn) = (meter.laps(), turn_of(batch.start));
            self.busy.measure(|| {
                let mut path = Path::default();
                for index in batch {
                    self.walk.follow(index as u32, &mut path, |_| ());
                    self.take(&mut sums, &path, &mut left);
                }
                self.settle(&mut sums, &mut left);
            });
            laps.note(turn);
            (sums, left)
        });
        fold.map(|(sums, _)| sums).reduce(|| self.no_sums(), Sums::plus)
    }

    /// Traces the photons that moving things may meet, each from the segment where they first may.
    fn trace_others(&self, others: &[Other], meter: &Meter) -> Sums {
        let started = || (self.no_sums(), Left::default());
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
            laps.note_together(others.iter().map(Other::turn));
            (sums, left)
        });
        fold.map(|(sums, _)| sums).reduce(|| self.no_sums(), Sums::plus)
    }

    /// Traces every photon, and parts its path where it first enters `swept`.
    fn trace_apart(&self, swept: &Swept, meter: &Meter) -> Parted {
        let nothing = || Parted { stay: self.no_sums(), change: self.no_sums(), others: Vec::new() };
        let fold = self.batches().fold(nothing, |mut parted, batch| {
            let (mut laps, turn) = (meter.laps(), turn_of(batch.start));
            let Parted { stay, change, others } = &mut parted;
            self.busy.measure(|| {
                let (mut left_to_stay, mut left_to_change) = (Left::default(), Left::default());
                let (mut path, mut legs) = (Path::default(), Vec::new());
                for index in batch {
                    let index = index as u32;
                    legs.clear();
                    self.walk.follow(index, &mut path, |leg| legs.push(leg));
                    if path.from_moving {
                        self.take(change, &path, &mut left_to_change);
                        others.push(Other::Whole(index));
                        continue;
                    }
                    if let Some(segment) = path.first_met(&legs, &swept.entered, &swept.near) {
                        self.take(change, &path.split_off(segment), &mut left_to_change);
                        others.push(Other::From(legs[segment]));
                    }
                    self.take(stay, &path, &mut left_to_stay);
                }
                self.settle(change, &mut left_to_change);
                self.settle(stay, &mut left_to_stay);
            });
            laps.note(turn);
            parted
        });
        fold.reduce(nothing, Parted::plus)
    }
}
