//! HTML page of a sweep.

use super::data::csv_of;
use super::figures::{MethodRun, Outcome, RunPictures};
use super::maps::MapPicture;
use super::method::DEFAULT_METHOD;
use super::plots::Plot;
use super::table::{HEADINGS, cells};
use super::{Swept, maps};
use crate::compare::png_file;
use crate::page::{CUT_SIZE, PageStream, Playback, THRESHOLD, data_uri, download, gradient, player, render_template};
use minijinja::{Value, context};
use plane::Plane;
use render2mpeg::error::Result;

/// Rate of the films \[pictures per second\], lower than their own rate because films of a sweep are short.
const RATE: f64 = 6.0;
/// Columns of table 1 in the table of one method.
const ANSWER: [usize; 6] = [0, 11, 8, 12, 13, 14];

/// Returns the page: the figures of one method, a player that compares two films, and `plots`, tables and maps.
///
/// # Errors
/// If the page cannot be rendered, which is a bug.
pub fn page(swept: &Swept, plots: &[Plot]) -> Result<String> {
    let outcome = &swept.outcome;
    let settings = &outcome.settings;

    // Collect the plots, and the rows of table 1 grouped by kind of method and quantiser.
    let drawn = |plot: &Plot| {
        let file = download(&format!("{}.svg", plot.name), "image/svg+xml", plot.svg.file().as_bytes());
        context! { svg => plot.svg.inline(), caption => plot.caption.clone(), file }
    };
    let plots: Vec<Value> = plots.iter().map(drawn).collect();
    let mut before = None;
    let rows: Vec<Value> = outcome
        .rows()
        .map(|run| {
            let group = (run.lightcuts, run.cache, run.qscale);
            let first = before.replace(group) != Some(group);
            let pays = run.kappa.is_some() && run.against_baseline.as_ref().is_some_and(|beside| beside.equal_quality);
            context! { cells => cells(run, outcome.lights).to_vec(), first, pays }
        })
        .collect();

    // Collect the key figures of the sweep.
    let cheapest = outcome.references.iter().map(|reference| reference.seconds.total).fold(f64::INFINITY, f64::min);
    let ended = if outcome.interrupted { ", ended early" } else { "" };
    let tiles = vec![
        ("picture", format!("{}×{}", settings.render.size.width, settings.render.size.height)),
        ("frames", format!("{}", settings.render.frames)),
        ("lights in the tree", format!("{}", outcome.lights)),
        ("photons per frame", format!("{}", settings.render.photons)),
        ("every light", format!("{cheapest:.1} CPU s per frame")),
        ("this sweep", format!("{:.0} s{ended}", outcome.wall_seconds)),
    ];

    // Collect the pictures.
    let choices = choices(swept);
    // Compare the reference with the main method at the middle quantiser.
    let chosen = middle(swept, &choices);
    let answer = main_method(outcome);
    let answer_rows = outcome.runs.iter().filter(|run| Some(run.method) == answer.map(|run| run.method));
    render_template(
        "sweep.html",
        context! {
            title => settings.scene.file_stem().map(|stem| stem.to_string_lossy().into_owned()),
            scene => settings.scene.file_name().map(|name| name.to_string_lossy().into_owned()),
            counted => settings.render.frames.saturating_sub(1).max(1),
            findings => outcome.findings().into_iter().map(|finding| [finding.label, finding.text].to_vec()).collect::<Vec<_>>(),
            spread => format!("{:.0}", 100.0 * outcome.timing_spread()),
            headings => HEADINGS,
            check => outcome.decoder_check.as_ref().map(|check| context! {
                decoder => check.decoder,
                frames => check.frames,
                largest => check.largest_difference,
                equal => format!("{:.2}", 100.0 * check.equal_share),
            }),
            answer => answer.map(|run| run.label.clone()),
            is_default => answer.is_some_and(|run| run.method == DEFAULT_METHOD),
            answer_headings => ANSWER.map(|column| HEADINGS[column]),
            answer_rows => answer_rows.map(|run| ANSWER.map(|column| cells(run, outcome.lights)[column].clone()).to_vec()).collect::<Vec<_>>(),
            choices => choices.iter().map(|choice| choice.label.clone()).collect::<Vec<_>>(),
            chosen,
            player => film_player(&choices)?,
            rate => RATE as u32,
            poster => uri(&swept.truth),
            width => settings.render.size.width,
            height => settings.render.size.height,
            map_blocks => map_blocks(swept),
            gradient => gradient(),
            scales => [THRESHOLD, CUT_SIZE, maps::ERROR].map(|scale| context! {
                about => scale.about, low => scale.ends.0, high => scale.ends.1
            }),
            // Embed the figures as files.
            csv => download("sweep.csv", "text/csv", &csv_of(&outcome.runs)?),
            json => download("sweep.json", "application/json", swept.json_without_folders()?.as_bytes()),
            tiles, plots, rows,
        },
    )
}

fn uri(picture: &Plane<[u8; 3]>) -> String {
    data_uri("image/png", &png_file::encode(picture))
}

/// Film that the player can show.
struct FilmChoice<'a> {
    label: String,
    stream: &'a PageStream,
    /// Run of the film; `None` for the reference.
    run: Option<&'a MethodRun>,
}

/// Returns the films of lightcut runs, after the reference. If any method has a cache, only methods with cache are
/// included.
fn choices(swept: &Swept) -> Vec<FilmChoice<'_>> {
    let label = "reference, quantiser 1".to_owned();
    let mut choices = vec![FilmChoice { label, stream: &swept.reference, run: None }];
    let has_cache = swept.outcome.runs.iter().any(|run| run.lightcuts && run.cache);
    for (run, stream) in swept.outcome.runs.iter().zip(&swept.streams) {
        if run.lightcuts && run.cache == has_cache {
            let label = format!("quantiser {}: {}", run.qscale, run.label);
            choices.push(FilmChoice { label, stream, run: Some(run) });
        }
    }
    // Omit films whose first group of pictures exceeds the limit.
    choices.retain(|choice| choice.stream.positions().is_some());
    choices.sort_by_key(|choice| choice.run.map(|run| run.qscale));
    choices
}

/// Returns the data of the player; `None` without films.
fn film_player(choices: &[FilmChoice<'_>]) -> Result<Option<Value>> {
    let streams: Vec<&PageStream> = choices.iter().map(|choice| choice.stream).collect();
    let Some(shown) = streams.first().and_then(|stream| stream.positions()) else { return Ok(None) };
    let playback = Playback { rate: RATE, first: 0, repeats: 1, start: *shown.end(), plays: false };
    player(&streams, playback).map(Some)
}

/// Returns the last run of the default method, or else of the last method with lightcuts, preferably with cache.
fn main_method(outcome: &Outcome) -> Option<&MethodRun> {
    let runs = || outcome.runs.iter().rev().filter(|run| run.lightcuts);
    runs().find(|run| run.method == DEFAULT_METHOD).or(runs().find(|run| run.cache)).or(runs().next())
}

/// Returns the index of the film of the main method at the middle quantiser.
fn middle(swept: &Swept, choices: &[FilmChoice<'_>]) -> usize {
    let main = main_method(&swept.outcome).map(|run| run.method);
    let mut places = Vec::new();
    for (place, choice) in choices.iter().enumerate() {
        if choice.run.is_some_and(|run| Some(run.method) == main) {
            places.push(place);
        }
    }
    places.get(places.len() / 2).copied().unwrap_or(0)
}

/// Returns the maps of each steered method, with one column per quantiser. Methods without cache are preferred, because
/// each of their pixels has a lightcut.
fn map_blocks(swept: &Swept) -> Vec<Value> {
    let steered = || swept.outcome.runs.iter().zip(&swept.pictures).filter(|(run, _)| run.kappa.is_some());
    let by_pixel = steered().any(|(run, _)| !run.cache);
    let runs: Vec<(&MethodRun, &RunPictures)> = steered().filter(|(run, _)| run.cache != by_pixel).collect();
    let block = |runs: &[(&MethodRun, &RunPictures)]| {
        let columns: Vec<Value> = runs.iter().filter_map(|(run, pictures)| map_column(run, pictures)).collect();
        context! { label => runs[0].0.label.clone(), columns }
    };
    runs.chunk_by(|a, b| a.0.method == b.0.method).map(block).collect()
}

/// Returns a column with the maps and the decoded picture of a run; `None` for path tracing, which has no maps.
fn map_column(run: &MethodRun, pictures: &RunPictures) -> Option<Value> {
    let maps = maps::pictures(pictures.maps.as_ref()?);
    let under = [
        format!("{:.0} % on average", 100.0 * run.threshold_mean_relative),
        format!("{:.0} on average", run.cut_size_mean),
        run.rendered.psnr_y.map_or("equal".into(), |psnr| format!("PSNR {psnr:.1} dB")),
    ];
    let mut column: Vec<Value> = Vec::new();
    for (MapPicture { scale, picture }, under) in maps.iter().zip(under) {
        column.push(context! { name => scale.about, uri => uri(picture), under });
    }
    column.push(context! {
        name => "decoded",
        uri => uri(&pictures.decoded),
        under => run.decoded.psnr_y.map_or("equal".into(), |psnr| format!("PSNR {psnr:.1} dB")),
    });
    Some(context! { qscale => run.qscale, pictures => column })
}
