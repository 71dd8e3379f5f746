//! HTML page of a sweep.

use super::data::csv_of;
use super::figures::{MethodRun, RunPictures};
use super::maps::MapPicture;
use super::plots::Plot;
use super::table::{HEADINGS, cells};
use super::{Swept, maps};
use crate::compare::png_file;
use crate::page::{CUT_SIZE, THRESHOLD, data_uri, download, gradient, render_template};
use minijinja::{Value, context};
use plane::Plane;
use render2mpeg::error::Result;

/// Rate of the clip \[pictures per second\], lower than the films' rates because films of a sweep are short.
const CLIP_FPS: f64 = 6.0;

/// Returns the page: `plots` in order, tables, maps, pictures for side-by-side comparison, and a clip.
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
    let clip = clip(swept);
    // Select the reference and the run of the clip for the initial comparison.
    let chosen = middle(&shown(swept)).map_or(0, |place| place + 1);
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
                frames => check.frames,
                largest => check.largest_difference,
                equal => format!("{:.2}", 100.0 * check.equal_share),
            }),
            pictures => json(&choices.iter().map(|(label, uri)| [label, uri]).collect::<Vec<_>>())?,
            choices => choices.iter().map(|(label, _)| label.clone()).collect::<Vec<_>>(),
            chosen,
            first_pictures => [0, chosen].map(|i| choices[i].1.clone()),
            width => settings.render.size.width,
            height => settings.render.size.height,
            clip_label => clip.as_ref().map(|(label, _)| label.clone()),
            clip => clip.as_ref().map(|(_, uri)| uri.clone()),
            clip_fps => CLIP_FPS,
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

/// Formats JSON for embedding in a script.
fn json(value: &impl serde::Serialize) -> Result<String> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

fn uri(picture: &Plane<[u8; 3]>) -> String {
    data_uri("image/png", &png_file::encode(picture))
}

/// Returns the lightcut runs with their pictures. If any method has a cache, only methods with cache are included.
fn shown(swept: &Swept) -> Vec<(&MethodRun, &RunPictures)> {
    let runs = swept.outcome.runs.iter().zip(&swept.pictures).filter(|(run, _)| run.lightcuts);
    let runs: Vec<(&MethodRun, &RunPictures)> = runs.collect();
    let cached: Vec<_> = runs.iter().copied().filter(|(run, _)| run.cache).collect();
    let mut shown = if cached.is_empty() { runs } else { cached };
    shown.sort_by_key(|(run, _)| run.qscale);
    shown
}

/// Returns label and data URI of each picture for side-by-side comparison.
fn choices(swept: &Swept) -> Vec<(String, String)> {
    let mut choices = vec![("reference, uncompressed".to_owned(), uri(&swept.truth))];
    for (run, pictures) in shown(swept) {
        choices.push((format!("quantiser {}: {}", run.qscale, run.label), uri(&pictures.decoded)));
    }
    choices
}

/// Returns the index of the last run at the middle quantiser.
fn middle(shown: &[(&MethodRun, &RunPictures)]) -> Option<usize> {
    let qscale = shown.get(shown.len() / 2)?.0.qscale;
    shown.iter().rposition(|(run, _)| run.qscale == qscale)
}

/// Returns the label and the data URI of the clip of decoded pictures.
fn clip(swept: &Swept) -> Option<(String, String)> {
    let (place, pictures) = swept.clip.as_ref()?;
    let run = &swept.outcome.runs[*place];
    let film = png_file::animation(pictures, CLIP_FPS);
    Some((format!("{} at quantiser {}", run.label, run.qscale), data_uri("image/png", &film)))
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
