//! Ranks that take tiles on demand, as threads and in simulation. Their light differs from one rank's only in the records
//! available for interpolation.

use perceptual::YCbCr;
use pipeline::Run;
use pipeline::checkpoint::Checkpoints;
use pipeline::observe::Observer;
use pipeline::team::Team;
use render_core::ranks::{Network, ThreadMail, ThreadRanks};
use render_core::scene::Scene;
use render2mpeg::settings::{Settings, Switch};
use render2mpeg::{Options, Render, Report};
use renderer::plan::Plan;
use renderer::settings::{SampleCount, Thresholds};
use renderer::{SimulatedFrame, SimulatedRanks};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use tests::{Moving, checkered_room, cornell, load};

/// A network without latency.
const INSTANT: Network = Network { latency: 0.0, bandwidth: f64::INFINITY };

/// Largest loss of PSNR by tiles \[dB\]. The few records in these films are at other positions, which changes PSNR by ±1 dB.
const WORSE: f64 = 2.0;

/// Luma of every frame.
#[derive(Default)]
struct Frames(Mutex<Vec<Vec<f32>>>);

impl Observer for Frames {
    fn picture(&self, _: u32, picture: &YCbCr) {
        self.0.lock().unwrap().push(picture.luma.samples().to_vec());
    }
}

/// Pictures, bytes and report of a finished film.
struct Made {
    frames: Vec<Vec<f32>>,
    bytes: Vec<u8>,
    report: Report,
}

/// A small film with few lights, divided into `tiles` unless the string is empty.
struct Film {
    scene: Scene,
    settings: Settings,
}

impl Film {
    fn new(scene: &Path, folder: &Path, tiles: &str, change: impl Fn(&mut Options)) -> Self {
        let mut options = Options {
            output: Some(folder.join("film.m2v")),
            frames: Some(3),
            size: "64x48".parse().ok(),
            vpls: Some(200),
            photons: Some(40_000),
            tiles: (!tiles.is_empty()).then(|| tiles.parse().expect("tiles")),
            ..Options::default()
        };
        change(&mut options);
        let (scene, settings) = load(scene, options);
        Self { scene, settings }
    }

    fn ended(&self, mut film: Render) -> Made {
        let frames = Frames::default();
        film.write_to(&self.settings.output).unwrap();
        let report = film.finish(Run { observer: &frames, ..Run::default() }).expect("a report");
        let bytes = std::fs::read(&self.settings.output).unwrap();
        Made { frames: frames.0.into_inner().unwrap(), bytes, report }
    }

    /// Renders the film on `count` ranks, each a thread.
    fn by_ranks(&self, count: usize) -> Made {
        let plan = Plan::new(&self.scene, &self.settings.render);
        let checkpoints = Checkpoints::off();
        let mail = ThreadMail::new(count).into_iter();
        let ranks = ThreadRanks::new(count).into_iter().zip(ThreadRanks::new(count));
        let mut teams: Vec<Team> = ranks
            .zip(mail)
            .map(|((prepare, shade), mail)| Team {
                prepare: Arc::new(prepare),
                shade: Arc::new(shade),
                mail: Arc::new(mail),
            })
            .collect();
        std::thread::scope(|scope| {
            let plan = &plan;
            let follow = |team: Team| scope.spawn(move || Render::follow(&self.scene, &self.settings, plan, &team));
            let others: Vec<_> = teams.split_off(1).into_iter().map(follow).collect();
            let made = self.ended(Render::among(&self.scene, &self.settings, plan, &checkpoints, &teams[0]).unwrap());
            for other in others {
                other.join().expect("no rank panics").expect("no rank fails");
            }
            made
        })
    }

    /// Renders the film on `count` simulated ranks, and returns their times and counts.
    fn simulated(&self, count: usize, network: Network) -> (Made, Vec<SimulatedFrame>) {
        let plan = Plan::new(&self.scene, &self.settings.render);
        let checkpoints = Checkpoints::off();
        let ranks = SimulatedRanks::new(count, network);
        let mut film = Render::new(&self.scene, &self.settings, &plan, &checkpoints).unwrap();
        film.simulate(ranks.clone());
        (self.ended(film), ranks.frames())
    }
}

/// PSNR between the luma of two films \[dB\], over all frames.
fn psnr(a: &Made, b: &Made) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in a.frames.iter().flatten().zip(b.frames.iter().flatten()) {
        sum += f64::from(a - b).powi(2);
        count += 1.0;
    }
    10.0 * (219f64.powi(2) * count / sum).log10()
}

fn scenes(folder: &Path) -> [PathBuf; 2] {
    let moving = folder.join("moving.glb");
    checkered_room(Moving::Box).write(&moving);
    [cornell(), moving]
}

/// Each kind of record exchange, with one sample and with several by importance.
#[test]
fn ranks_that_take_tiles_make_the_picture_of_one_that_takes_none() {
    let folder = tempfile::tempdir().unwrap();
    type Change = fn(&mut Options);
    fn larger(options: &mut Options) {
        (options.frames, options.size, options.vpls, options.photons) = (Some(2), "128x96".parse().ok(), None, None);
        // Tiled frames have one sample.
        options.samples = Some(SampleCount::Each(1));
    }
    let kinds: [Change; 2] = [larger, |options| {
        larger(options);
        (options.importance, options.samples) = ("saliency:1".parse().ok(), Some(SampleCount::Each(3)));
    }];
    for scene in scenes(folder.path()) {
        for change in kinds {
            // Each film is about as close to one lightcut per pixel as the film without tiles.
            let exact = Film::new(&scene, folder.path(), "", |options| {
                change(options);
                (options.cache, options.thresholds) = (Some(Switch::Off), Some(Thresholds::Fixed(0.005)));
            });
            let exact = exact.by_ranks(1);
            let bound = psnr(&Film::new(&scene, folder.path(), "", change).by_ranks(1), &exact);
            for (tiles, count) in
                [("rays,none", 1), ("rays,none", 3), ("rays,central:4", 3), ("rays,each:4", 3), ("time,each:1", 2)]
            {
                let made = Film::new(&scene, folder.path(), tiles, change).by_ranks(count);
                let near = psnr(&made, &exact);
                assert!(near > bound - WORSE, "{tiles} on {count} ranks: {near} dB, without tiles {bound}");
                assert_eq!(made.report.frames.len(), 2);
            }
        }
    }
}

/// One simulated rank gives the bits of one real rank; several differ no more than real ranks may.
#[test]
fn imagined_ranks_do_what_ranks_do() {
    let folder = tempfile::tempdir().unwrap();
    for scene in scenes(folder.path()) {
        let film = |tiles: &str| Film::new(&scene, folder.path(), tiles, |_| ());
        let one = film("rays,each:8");
        let (alone, frames) = one.simulated(1, INSTANT);
        assert!(alone.bytes == one.by_ranks(1).bytes, "one rank is one rank");
        assert!(frames.iter().all(|frame| frame.messages == 0 && frame.tiles == 8));

        let whole = Film::new(&scene, folder.path(), "", |_| ()).by_ranks(1);
        let mut computed = Vec::new();
        for tiles in ["rays,none", "rays,central:1", "rays,each:1"] {
            let (made, frames) = film(tiles).simulated(4, INSTANT);
            assert!(psnr(&made, &whole) > 38.0, "{tiles}: {} dB", psnr(&made, &whole));
            for (frame, reported) in frames.iter().zip(&made.report.frames) {
                assert_eq!((frame.records, frame.tiles), (reported.figures.cache_new, 32), "{tiles}");
                assert!(frame.most_busy <= frame.seconds + 1e-9 && frame.all_busy <= 4.0 * frame.most_busy + 1e-9);
            }
            computed.push(frames[0].records);
        }
        // Ranks that exchange no records compute the most records.
        assert!(computed[0] > computed[1] && computed[0] > computed[2], "{computed:?}");
        assert!(computed[2] >= alone.report.frames[0].figures.cache_new, "{computed:?}");
    }
}

/// A slow network delays the same work.
#[test]
fn messages_take_the_time_of_the_network() {
    let folder = tempfile::tempdir().unwrap();
    let film = Film::new(&cornell(), folder.path(), "rays,central:1", |options| options.frames = Some(1));
    let [(_, fast), (_, slow)] =
        [INSTANT, Network { latency: 10.0, bandwidth: 1e3 }].map(|network| film.simulated(2, network));
    // Rank 1 requests work and receives it, and all ranks receive the frame's light: at least two latencies each.
    assert!(slow[0].seconds > fast[0].seconds + 40.0, "{} s, without latency {} s", slow[0].seconds, fast[0].seconds);
    assert!(slow[0].bytes > 0 && slow[0].messages >= 2);
}
