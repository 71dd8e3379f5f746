//! Page of a single run: the film, and cost and quality of each frame.

use super::choices::{choices, plain, usual_without_folders, without_folders};
use super::data::{csv_of, download, drawing};
use super::film::FilmWatch;
use super::html::render_template;
use super::run_plots::Figures;
use minijinja::value::Serde;
use minijinja::{Value, context};
use render2mpeg::error::Result;
use render2mpeg::report::Report;
use render2mpeg::settings::Settings;

/// Command and default settings of a film.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// Command, as formatted by [`command_line`](super::command_line).
    pub command: String,
    /// Default settings of a film of the same scene, if known.
    pub usual: Option<Settings>,
}

/// Returns the page of a run: the film with a player, maps, and the figures of each frame as plots and files.
/// The page contains file names without folders.
///
/// # Errors
/// If the page cannot be rendered, which is a bug.
pub fn run_page(report: &Report, film: &FilmWatch, made: &Made) -> Result<String> {
    film.add_earlier_frames(&report.settings.output);
    // Hide the machine's folders.
    let report = &without_folders(report);
    let stem = report.scene.file.file_stem().map_or("film".into(), |stem| stem.to_string_lossy().into_owned());

    // Draw the plots, which can also be saved as files.
    let figures = Figures::of(&report.frames);
    let plot = |(name, svg): &(&str, _)| drawing(&format!("{stem}-{name}.svg"), svg);
    let plots: Vec<Value> = figures.plots.iter().map(plot).collect();

    // Collect data that may be missing: default settings and maps.
    let usual = usual_without_folders(made.usual.as_ref());
    let maps = film.maps();
    let (map_frame, maps) = maps.map_or((None, Vec::new()), |(index, maps)| (Some(index), maps));
    render_template(
        "run.html",
        context! {
            title => stem.clone(),
            scene => report.scene.file.display().to_string(),
            output => report.settings.output.display().to_string(),
            size => format!("{}×{}", report.settings.render.size.width, report.settings.render.size.height),
            width => report.settings.render.size.width,
            height => report.settings.render.size.height,
            fps => plain(&report.settings.render.fps.into()),
            qscale => report.settings.render.qscale,
            triangles => report.scene.triangles,
            command => made.command.clone(),
            poster => film.poster()?,
            player => film.player()?,
            omitted => film.omitted(),
            importance => film.importance().map(|svg| drawing(&format!("{stem}-importance.svg"), &svg)),
            tiles => tiles(report),
            constant => figures.constant,
            settings => Value::from(Serde(&choices(&report.settings, usual.as_ref())?)),
            is_usual_known => usual.is_some(),
            plan => Value::from(Serde(&report.plan)),
            warnings => report.scene.warnings.clone(),
            csv => download(&format!("{stem}-frames.csv"), "text/csv", csv_of(&report.frames)?.as_bytes()),
            json => download(&format!("{stem}-report.json"), "application/json", &serde_json::to_vec(report)?),
            map_is_played => map_frame.is_some_and(|index| film.plays(index)),
            plots, map_frame, maps,
        },
    )
}

/// Returns the figures of the whole film.
fn tiles(report: &Report) -> Vec<(&'static str, String)> {
    let summary = &report.summary;
    let mut tiles = vec![
        ("frames", format!("{}{}", summary.frames, if summary.interrupted { ", interrupted" } else { "" })),
        ("CPU s per frame", format!("{:.2}", summary.seconds.total)),
        ("wall-clock time", format!("{:.1} s", summary.wall_seconds)),
        ("bits", format!("{:.0} kbit/s", summary.bits * report.settings.render.fps / 1000.0)),
        ("luma PSNR", summary.psnr_y.map_or("equal".into(), |psnr| format!("{psnr:.1} dB"))),
        ("mean threshold", format!("{:.1} %", 100.0 * summary.threshold_mean_relative)),
    ];
    // Omit peak memory on systems that do not report it.
    if let Some(bytes) = summary.peak_memory_bytes {
        tiles.push(("peak memory", format!("{:.0} MB", bytes as f64 / 1e6)));
    }
    tiles
}
