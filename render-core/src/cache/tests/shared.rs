//! Tests that several ranks together make the same records as a single rank.

use super::*;
use crate::PixelSurface;
use crate::ranks::{Alone, Assignment, LoggedAlone, ThreadRanks};
use glam::Vec3;

/// Unpredictable light. The recipe contains the position and the brightness of the computation.
struct Shimmer {
    power: f32,
}

impl Illumination for Shimmer {
    type Recipe = (Vec3A, f32);
    type Scratch = ();

    fn compute(&self, site: &Site, (): &mut ()) -> Computed<Self::Recipe> {
        let light = self.power * (1.0 + 0.3 * (site.position.x * 23.0).sin() * (site.position.z * 11.0).cos());
        Computed { light: even(light, 0.7), recipe: (site.position, light / self.power) }
    }

    /// Relights from the recipe alone, so that a missing recipe would change the light. Every seventh record must be
    /// recomputed.
    fn relight(&self, site: &Site, (position, light): &mut Self::Recipe, _: LastUpdate) -> Option<LocalIrradiance> {
        assert_eq!(*position, site.position, "the recipe is that of the record");
        (!site.key.is_multiple_of(7)).then(|| even(*light * self.power, 0.6))
    }

    fn openness(&self, site: &Site, scale: f32) -> f32 {
        (site.position.x * 9.0).sin().abs() * scale / (scale + 1.0)
    }

    fn note(&self, &(_, light): &Self::Recipe) -> u32 {
        light.to_bits()
    }
}

/// Lowers the pixel by 5 cm if it is in a groove.
fn grooved(pixel: &mut PixelSurface) {
    if (9.0 * pixel.position[0]).sin() > 0.5 {
        pixel.position[1] -= 0.05;
    }
}

/// Visible results of a frame, compared bit by bit.
#[derive(Debug, PartialEq)]
struct Outcome {
    irradiance: Vec<[u32; 3]>,
    counts: [usize; 2],
    /// Position of each record, and the record's note, share and openness.
    records: Vec<[[u32; 3]; 2]>,
}

/// Lights five pictures of a walk: with constant light, changed light and moving geometry. Then the light changes
/// again, and the frame has a further picture.
fn film(ranks: &dyn Ranks) -> (Vec<Outcome>, Vec<u32>) {
    let mut cache = IrradianceCache::default();
    let mut outcomes = Vec::new();
    let mut note = |lit: CachedLight, cache: &IrradianceCache<(Vec3A, f32)>| {
        let bits = |v: [f32; 3]| v.map(f32::to_bits);
        let of =
            |r: &Record<_>| [bits(r.site.position.to_array()), [r.note, r.share.to_bits(), r.site.openness.to_bits()]];
        outcomes.push(Outcome {
            irradiance: lit.irradiance.samples().iter().map(|&e| bits(e)).collect(),
            counts: [lit.in_use, lit.computed],
            records: cache.records.iter().map(of).collect(),
        });
    };
    for frame in 0..5 {
        let seen = floor_from(Vec3::new(0.05 * frame as f32, 5.0, 0.0), grooved);
        let shimmer = Shimmer { power: [1.0, 1.0, 1.5, 1.5, 2.0][frame] };
        let changes = Changes { light: frame.is_multiple_of(2), geometry: frame == 3 };
        let is_first_of_many = frame == 4;
        let request = Request { ranks, is_first_of_many, ..Request::whole(&seen, &[false; 2]) };
        let lit = cache.light(request, changes, &shimmer).value;
        note(lit, &cache);
    }
    let beside = floor_from(Vec3::new(0.21, 5.0, 0.01), grooved);
    let request = Request { ranks, ..Request::whole(&beside, &[false; 2]) };
    let lit = cache.light_more(request, &Shimmer { power: 2.0 }).value;
    note(lit, &cache);
    (outcomes, cache.kept().iter().map(|kept| kept.number).collect())
}

#[test]
fn records_of_several_ranks_are_those_of_one() {
    let (alone, all) = film(&Alone);
    assert!(alone.iter().all(|frame| frame.counts[0] > 50), "records are in use");
    assert!(
        alone[4].records.iter().any(|[_, [.., openness]]| f32::from_bits(*openness) < 1.0),
        "some are below others"
    );
    assert!(alone[2].counts[1] > 10 && alone[5].counts[1] > 0, "some are computed later on");
    for count in [2, 3] {
        let results: Vec<_> = std::thread::scope(|scope| {
            let ranks = ThreadRanks::new(count);
            let started: Vec<_> = ranks.into_iter().map(|ranks| scope.spawn(move || film(&ranks))).collect();
            started.into_iter().map(|thread| thread.join().expect("no rank fails")).collect()
        });
        let mut kept = Vec::new();
        for (rank, (outcomes, own)) in results.into_iter().enumerate() {
            assert!(outcomes == alone, "rank {rank} of {count}");
            // Check that each rank stores the recipes of its own records.
            assert!(own.iter().all(|&number| Assignment::Golden(number).owner(count) == rank));
            kept.extend(own);
        }
        kept.sort_unstable();
        assert_eq!(kept, all, "every recipe is kept by one rank");
    }
}

/// A log changes no result, and contains a time for each result.
#[test]
fn records_are_the_same_with_a_log() {
    let logged = LoggedAlone::default();
    assert!(film(&logged) == film(&Alone));
    let loops = logged.log().expect("it keeps one").loops();
    let golden = |assignment: &Assignment| matches!(assignment, Assignment::Golden(_));
    assert!(loops.iter().any(|one| one.results.iter().any(|(assignment, _)| golden(assignment))), "loops of records");
    assert!(loops.iter().any(|one| one.results.iter().any(|(assignment, _)| !golden(assignment))), "loops of places");
    for one in loops {
        let sorted = |mut assignments: Vec<Assignment>| {
            assignments.sort_unstable_by_key(|assignment| format!("{assignment:?}"));
            assignments
        };
        let timed = one.work.iter().map(|&(assignment, _)| assignment).collect();
        let sent = one.results.iter().map(|&(assignment, _)| assignment).collect();
        assert_eq!(sorted(timed), sorted(sent));
    }
}

/// Records are spread evenly over ranks, including the records of one refresh frame, for any first number.
#[test]
fn records_are_spread_evenly() {
    for count in [1, 2, 3, 4, 16] {
        for (step, begin) in [(1, 0), (1, 12_345), (TURN, 7), (2 * TURN, u32::MAX - 100)] {
            let mut owned = vec![0; count];
            for k in 0..1000u32 {
                owned[Assignment::Golden(begin.wrapping_add(k * step)).owner(count)] += 1;
            }
            let mean = 1000 / count;
            assert!(
                owned.iter().all(|&own| own > mean * 7 / 8 - 1 && own < mean * 9 / 8 + 2),
                "{count} {step}: {owned:?}"
            );
        }
    }
}

#[test]
fn recipes_come_together_again() {
    let seen = floor_from(Vec3::new(0.0, 5.0, 0.0), |_| ());
    let lit = |ranks: &dyn Ranks| {
        let mut cache = IrradianceCache::default();
        let request = Request { ranks, ..Request::whole(&seen, &[false; 2]) };
        let _ = cache.light(request, Changes { light: false, geometry: false }, &Shimmer { power: 1.0 });
        cache
    };
    let alone = lit(&Alone);
    let mut halves: Vec<_> = std::thread::scope(|scope| {
        let started: Vec<_> = ThreadRanks::new(2).into_iter().map(|ranks| scope.spawn(move || lit(&ranks))).collect();
        started.into_iter().map(|thread| thread.join().expect("no rank fails")).collect()
    });
    let own = |kept: KeptRecipe<&(Vec3A, f32)>| KeptRecipe { number: kept.number, recipe: *kept.recipe };
    let other: Vec<_> = halves[1].kept().into_iter().map(own).collect();
    assert_ne!(halves[0].kept(), alone.kept());
    halves[0].complete(other);
    assert_eq!(halves[0].kept(), alone.kept());

    // Check that a rank that receives all recipes keeps its own.
    let ranks = ThreadRanks::new(2);
    halves[0].keep_own(&ranks[1]);
    assert_eq!(halves[0].kept(), halves[1].kept());
}
