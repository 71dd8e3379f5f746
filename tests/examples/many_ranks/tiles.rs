//! Ranks that take tiles on demand: the figures of [Debattista05], for the same kinds of runs.

use crate::arguments::Arguments;
use crate::replicated::NETWORKS;
use pipeline::Run;
use pipeline::checkpoint::Checkpoints;
use pipeline::observe::Observer;
use pipeline::perceptual::YCbCr;
use pipeline::team::Team;
use render_core::ranks::{LoggedAlone, LoggedRun, Network, Ranks};
use render_core::{process_seconds, scene};
use render2mpeg::settings::Switch;
use render2mpeg::{Options, Render, Settings};
use renderer::plan::Plan;
use renderer::settings::Thresholds;
use renderer::{SimulatedFrame, SimulatedRanks};
use std::sync::{Arc, Mutex};

/// Numbers of ranks for the first frame, in addition to one rank.
const COUNTS: [usize; 4] = [2, 4, 16, 64];
/// Kinds of record exchange between ranks.
const WAYS: [&str; 3] = ["none", "central:16", "each:16"];
/// Relative threshold of each cut in the picture that serves as the reference.
const EXACT: f32 = 0.01;

/// Prints the first frame's time for increasing numbers of ranks and each record exchange, like Figure 6.
pub fn first_frame(arguments: &Arguments) -> anyhow::Result<()> {
    let one = |options: Options| Options { frames: Some(1), ..options };
    let exact = Options { cache: Some(Switch::Off), thresholds: Some(Thresholds::Fixed(EXACT)), ..Options::default() };
    let exact = film(arguments, one(merged(arguments, exact)), None)?;
    let (name, network) = &NETWORKS[1];
    println!("{name}\n\n| ranks | {} |", WAYS.map(|way| format!("{way}: s, records, dB")).join(" | "));
    println!("|---|{}", "---|".repeat(WAYS.len()));
    for count in [1].into_iter().chain(COUNTS) {
        // One rank has no other rank to exchange records with.
        let mut cells = Vec::new();
        for way in WAYS.into_iter().take(if count == 1 { 1 } else { WAYS.len() }) {
            let tiles = format!("{},{way}", arguments.cost).parse().ok();
            let options = one(merged(arguments, Options { tiles, ..Options::default() }));
            let made = film(arguments, options, Some((count, *network)))?;
            let frame = made.frames[0];
            let psnr = psnr(&made.luma, &exact.luma);
            cells.push(format!("{:.3}, {}, {psnr:.2}", frame.seconds, frame.records));
        }
        println!("| {count} | {} |", cells.join(" | "));
    }
    Ok(())
}

/// Prints a walk on one rank and on many, with uniform sampling and by importance, like Figures 7 and 8.
pub fn walk(arguments: &Arguments) -> anyhow::Result<()> {
    let (name, network) = &NETWORKS[1];
    println!(
        "{name}\n\n| ranks | rays | tiles, s | whole film, s | factor | CPU s of the busiest | records | dB against the first row |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let tiles = format!("{},{}", arguments.cost, arguments.records).parse().ok();
    let mut first: Option<(f64, Vec<f32>)> = None;
    for count in [1, arguments.ranks] {
        let by_importance = arguments.options.importance.clone().map(Some);
        for importance in [None].into_iter().chain(by_importance) {
            let everywhere = importance.is_none();
            let options = merged(arguments, Options { tiles, importance, ..Options::default() });
            let made = film(arguments, options, Some((count, *network)))?;
            let in_tiles: f64 = made.frames.iter().map(|frame| frame.seconds).sum();
            let records: u64 = made.frames.iter().map(|frame| frame.records).sum();
            let (seconds, luma) = first.get_or_insert_with(|| (made.seconds, made.luma.clone()));
            println!(
                "| {count} | {} | {in_tiles:.2} | {:.2} | × {:.1} | {:.2} | {records} | {:.1} |",
                if everywhere { "everywhere" } else { "by importance" },
                made.seconds,
                *seconds / made.seconds,
                made.busiest,
                psnr(&made.luma, luma),
            );
        }
    }
    Ok(())
}

/// Returns the options of a row: `more`, with size, frames and samples from the arguments.
fn merged(arguments: &Arguments, more: Options) -> Options {
    let Options { size, frames, samples, .. } = arguments.options;
    Options { size, frames, samples, ..more }
}

/// A film on simulated ranks.
struct Made {
    /// Wall-clock time of the whole film with one processor per rank \[s\].
    seconds: f64,
    /// CPU time of the busiest rank \[s\].
    busiest: f64,
    frames: Vec<SimulatedFrame>,
    /// Luma of all frames.
    luma: Vec<f32>,
}

/// Stores the luma of all frames.
#[derive(Default)]
struct Luma(Mutex<Vec<f32>>);

impl Observer for Luma {
    fn picture(&self, _: u32, picture: &YCbCr) {
        self.0.lock().expect("no thread panics").extend_from_slice(picture.luma.samples());
    }
}

/// Renders a film, with tiles on simulated `ranks` if given. Other work is shared in rounds.
fn film(arguments: &Arguments, options: Options, ranks: Option<(usize, Network)>) -> anyhow::Result<Made> {
    let (folder, before) = (tempfile::tempdir()?, process_seconds());
    let options = Options { output: Some(folder.path().join("film.m2v")), ..options };
    let scene = scene::load(&arguments.scene)?;
    let settings = Settings::new(arguments.scene.clone(), &scene, &options)?;
    let plan = Plan::new(&scene, &settings.render);
    let checkpoints = Checkpoints::off();
    let logged = [Arc::new(LoggedAlone::default()), Arc::new(LoggedAlone::default())];
    let team = Team { prepare: logged[0].clone(), shade: logged[1].clone(), ..Team::alone() };
    let (count, network) = ranks.unwrap_or((1, NETWORKS[1].1));
    let simulated = SimulatedRanks::new(count, network);

    // The film, and its CPU time.
    let luma = Luma::default();
    let mut render = Render::among(&scene, &settings, &plan, &checkpoints, &team)?;
    if ranks.is_some() {
        render.simulate(simulated.clone());
    }
    render.write_to(&settings.output)?;
    let report = render.finish(Run { observer: &luma, ..Run::default() })?;

    // All work except tiles.
    let frames = simulated.frames();
    let in_tiles: f64 = frames.iter().map(|frame| frame.all_busy).sum();
    let mut run = LoggedRun { cpu: process_seconds() - before - in_tiles, ..LoggedRun::default() };
    for frame in &report.frames {
        let seconds = &frame.figures.seconds;
        run.of_first_rank += seconds.tone_map + seconds.encode + seconds.thresholds;
    }
    for one in &logged {
        run.loops.extend(one.log().expect("it keeps one").loops());
    }
    let mut rest = run.on(count, &network);
    for frame in &frames {
        rest.seconds += frame.seconds;
        rest.busiest += frame.most_busy;
    }
    Ok(Made { seconds: rest.seconds, busiest: rest.busiest, frames, luma: luma.0.into_inner()? })
}

/// PSNR of luma \[dB\].
fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += f64::from(a - b).powi(2);
    }
    10.0 * (219f64.powi(2) * a.len() as f64 / sum).log10()
}
