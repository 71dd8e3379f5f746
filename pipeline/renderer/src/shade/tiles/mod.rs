//! Tiles on demand: each rank lights a tile independently, then requests the next tile from rank 0 \[Debattista05,
//! section 4\].
//!
//! ```text
//! importance map ──► tiles of equal cost ──► rank 0 ──► next tile ──► rank r ──► its light ──► all ranks
//!                                             ╚══════ records of irradiance caches ═════╝
//! ```
//! Each rank has its own irradiance cache. New records stay local, or are sent through rank 0, or to each other rank.
//! Therefore the light of a frame depends on the speed of the ranks. Without tiles, ranks share work in a fixed order
//! (`render_core::ranks`), and the light is independent of their speed.
//!
//! | module | contents |
//! |---|---|
//! | `split` | tiles of equal cost |
//! | `job` | light of a tile |
//! | `master` | rank 0: tiles and records to be distributed, and the messages |
//! | `crew` | ranks that communicate by messages |
//! | `simulated` | ranks simulated one after the other, in virtual time |

mod crew;
mod job;
mod master;
mod simulated;
mod split;

pub use simulated::{SimulatedFrame, SimulatedRanks};

use super::Shading;
use super::coats::Coats;
use super::counts::RecordCounts;
use super::importance::{ImportanceMap, SeenLight};
use super::layer::{Layer, Lit, Visible};
use super::layers::Layers;
use super::lit_frame::Reused;
use super::movement::Movement;
use super::sample::Sample;
use super::samples::{Common, SampleSurfaces, SamplesLight};
use super::tolerance::Tolerance;
use crate::frame::PreparedFrame;
use crate::plan::{Plan, Stage};
use crate::settings::{RenderSettings, TILES_PER_RANK, TileCost, TileSettings};
use crew::Team;
use glam::Vec3;
use job::{Job, TileLight};
use plane::{Correspondence, Plane};
use render_core::ranks::{Alone, Mail, Ranks};
use simulated::SimulatedTeam;
use split::equal_tiles;
use std::ops::Range;
use std::sync::Arc;

/// Ranks that light tiles.
#[derive(Clone, Debug)]
pub enum Crew {
    /// This process and other processes, which light the same frames: their messages, and the exchange of results.
    Ranks(Arc<dyn Mail>, Arc<dyn Ranks>),
    /// This process, which simulates all ranks.
    Simulated(SimulatedRanks),
}

/// Ranks that light the tiles of a job.
trait Workers: Send {
    /// Returns the number of ranks.
    fn count(&self) -> usize;

    /// Begins a frame. This rank lights its tiles with `layers`.
    fn begin(&mut self, layers: &mut Layers, visible: &Visible, tolerance: &Tolerance);

    /// Lights all tiles of a job. Adds times and counts of this rank's direct and indirect light to `counts`.
    fn work(&mut self, layers: &mut Layers, job: &Job, counts: &mut [Lit; 2]) -> Vec<TileLight>;

    /// Ends a frame.
    fn end(&mut self, layers: &mut Layers, visible: &Visible);

    /// Discards the state of earlier frames.
    fn forget(&mut self);
}

/// State of tiles between two frames.
pub(super) struct Tiling {
    settings: TileSettings,
    workers: Box<dyn Workers>,
    /// Layer of coats; `None` in scenes without coats.
    coats: Option<Coats>,
    /// CPU time per sample of each pixel in the previous frame \[s\]; `None` before the first frame.
    cost: Option<Plane<f32>>,
}

impl Tiling {
    /// Creates the state of a film that is lit by tiles.
    pub fn new(settings: TileSettings, crew: Crew, render: &RenderSettings, plan: &Plan) -> Self {
        let workers: Box<dyn Workers> = match crew {
            Crew::Ranks(mail, ranks) => Box::new(Team::new(settings, mail, ranks)),
            Crew::Simulated(ranks) => {
                let layers = || Layers::new(render, plan, &(Arc::new(Alone) as Arc<dyn Ranks>));
                Box::new(SimulatedTeam::new(settings, ranks, layers))
            }
        };
        let coats = plan.is_on(Stage::Gloss).then(Coats::default);
        Self { settings, workers, coats, cost: None }
    }

    /// Discards the state of earlier frames.
    pub fn forget(&mut self) {
        self.workers.forget();
        self.cost = None;
    }

    /// Lights all samples of a frame.
    pub fn light(
        &mut self,
        shading: &mut Shading,
        prepared: &PreparedFrame,
        tolerance: &Tolerance,
        ahead: Option<ImportanceMap>,
    ) -> SamplesLight {
        // Prepare the surfaces of all samples.
        let movement = Movement::to(&prepared.frame, &shading.places);
        let mut lit = SamplesLight { importance: ahead, ..SamplesLight::default() };
        let most = shading.settings.samples.most() as usize;
        let surfaces: Vec<SampleSurfaces> =
            (0..most).map(|sample| shading.surfaces(&prepared.frame, sample, &lit.visibility)).collect();
        let common = Common { movement: &movement, known: None, ranks: &Alone, tolerance, stop: None };
        let of_sample = |sample: usize| surfaces[sample].visible(prepared, sample, common);
        let frame = FrameSamples { visible: (0..most).map(of_sample).collect(), tolerance };
        self.workers.begin(&mut shading.layers, &frame.visible[0], tolerance);

        // Light the first sample alone if the importance map is computed from it.
        let mut counts = [Lit::default(), Lit::default()];
        let mut seconds = Seconds::new(&frame.visible[0]);
        let mut further = 0..most;
        if lit.importance.is_none() && shading.looking.is_some() {
            self.light_some(shading, (&frame, 0..1), &mut lit, (&mut counts, &mut seconds));
            let radiance = lit.samples[0].whole().map(|rgb| rgb.to_array());
            let seen = SeenLight { radiance: &radiance, cut_sizes: None };
            let looking = shading.looking.as_mut().filter(|_| lit.importance.is_none());
            lit.importance = looking.map(|looking| lit.visibility.measure(|| looking.at(prepared, &seen)));
            further = 1..most;
        }
        self.light_some(shading, (&frame, further), &mut lit, (&mut counts, &mut seconds));
        self.workers.end(&mut shading.layers, &frame.visible[0]);
        // Add transparent layers, which need the light of the whole frame.
        for (sample, light) in std::mem::take(&mut lit.samples).into_iter().enumerate() {
            shading.add_layers(prepared, &surfaces[sample], (sample, &light), &mut lit);
            lit.samples.push(light);
        }

        // Keep the times of this frame: they predict the costs of the next frame.
        self.cost = Some(seconds.by_sample());
        let [direct, indirect] = counts;
        lit.direct.add_counts(direct);
        lit.indirect.add_counts(indirect);
        lit.reused = Reused::default();
        lit.places = movement.places;
        lit
    }

    /// Lights some samples of a frame. All samples of a pixel are in one tile.
    fn light_some(
        &mut self,
        shading: &mut Shading,
        (frame, samples): (&FrameSamples, Range<usize>),
        lit: &mut SamplesLight,
        (counts, seconds): (&mut [Lit; 2], &mut Seconds),
    ) {
        // Select the pixels that have each sample.
        let first = &frame.visible[0];
        let (width, height) = (first.matte.pixels.width(), first.matte.pixels.height());
        let mut count = Plane::filled(width, height, 0.0f32);
        let mut wanted_by_sample = Vec::new();
        for sample in samples.clone() {
            let wanted = match lit.importance.as_ref().filter(|_| sample > 0) {
                Some(map) => map.wanted(sample),
                None => Plane::filled(width, height, true),
            };
            if !wanted.samples().contains(&true) {
                break;
            }
            for (count, &own) in count.samples_mut().iter_mut().zip(wanted.samples()) {
                *count += f32::from(u8::from(own));
            }
            wanted_by_sample.push(wanted);
        }
        if wanted_by_sample.is_empty() {
            return;
        }

        // Compute coats on all ranks in a fixed order: coats share rays with nearby pixels of other tiles.
        let mut radiances = Vec::new();
        for (sample, wanted) in samples.clone().zip(&wanted_by_sample) {
            let visible = Visible { ranks: &*shading.ranks, ..frame.visible[sample] };
            radiances.push(self.coats.as_mut().map(|coats| {
                let lit = coats.light(&visible, Some(wanted), frame.tolerance);
                let radiance = lit.shown(visible.matte, visible.radiance.clone());
                counts[0].add_counts(lit);
                radiance
            }));
        }
        // Add the light of coats to the known radiance: relative thresholds depend on it.
        let mut job = Job { samples: Vec::new(), tolerance: frame.tolerance, tiles: Vec::new() };
        for ((sample, wanted), radiance) in samples.zip(wanted_by_sample).zip(&radiances) {
            let visible = frame.visible[sample];
            let radiance = radiance.as_ref().unwrap_or(visible.radiance);
            job.samples.push((Visible { radiance, ..visible }, wanted));
        }

        // Balance the tiles by the number of rays or by the predicted time.
        let weight = match (self.settings.cost, &self.cost) {
            (TileCost::Time, Some(cost)) => predicted(cost, &count, first.motion),
            _ => count.clone(),
        };
        job.tiles = equal_tiles(&weight, TILES_PER_RANK * self.workers.count());

        // Assemble the frames from the light of all tiles.
        let results = self.workers.work(&mut shading.layers, &job, counts);
        let dark = || Plane::filled(width, height, Vec3::ZERO);
        let mut pictures: Vec<Sample> =
            job.samples.iter().map(|_| Sample { direct: dark(), indirect: dark() }).collect();
        let mut records = RecordCounts::default();
        for result in &results {
            job.put(result, &mut pictures);
            seconds.add(&job, result, &count);
            records.in_use += result.records_in_use;
            records.computed += result.records_computed;
        }

        // Reset the record counts: they already cover all ranks. All other counts are summed over ranks later.
        counts[1].records = RecordCounts::default();
        lit.indirect.records += records;
        lit.samples.extend(pictures);
    }
}

/// Surfaces of all samples of a frame, to be lit by tiles.
struct FrameSamples<'a> {
    visible: Vec<Visible<'a>>,
    tolerance: &'a Tolerance<'a>,
}

/// CPU time and number of samples of each pixel.
struct Seconds {
    spent: Plane<f32>,
    /// Number of samples of each pixel.
    count: Plane<f32>,
}

impl Seconds {
    fn new(visible: &Visible) -> Self {
        let pixels = &visible.matte.pixels;
        let zero = Plane::filled(pixels.width(), pixels.height(), 0.0);
        Self { spent: zero.clone(), count: zero }
    }

    /// Distributes the time of a tile evenly over the samples of its pixels.
    fn add(&mut self, job: &Job, lit: &TileLight, count: &Plane<f32>) {
        let area = &job.tiles[lit.tile as usize];
        // Divide by the number of samples: only the time of the whole tile is measured.
        let all: f32 = area.places().map(|(x, y)| count.get(x, y)).sum();
        let each = lit.seconds as f32 / all.max(1.0);
        for (x, y) in area.places() {
            self.spent.row_mut(y)[x] += each * count.get(x, y);
            self.count.row_mut(y)[x] += count.get(x, y);
        }
    }

    /// Returns the CPU time per sample of each pixel \[s\].
    fn by_sample(&self) -> Plane<f32> {
        let Self { spent, count } = self;
        Plane::from_fn(spent.width(), spent.height(), |x, y| spent.get(x, y) / count.get(x, y).max(1.0))
    }
}

/// Returns the predicted CPU time of each pixel \[s\]: its `count` of samples times the previous time per sample on the
/// same surface. A newly visible surface has the previous time of its pixel.
fn predicted(before: &Plane<f32>, count: &Plane<f32>, motion: Option<&Correspondence>) -> Plane<f32> {
    let samples = before.samples();
    Plane::from_fn(count.width(), count.height(), |x, y| {
        let own = y * count.width() + x;
        let then = motion.and_then(|motion| motion.match_of(x, y)).map_or(own, |index| index as usize);
        count.get(x, y) * samples[then]
    })
}
