//! The page of a single run: what each frame took, and what became of it.

use super::ImportanceSum;
use super::bars::StackedBars;
use super::html::render_template;
use super::line_plot::{LinePlot, Series};
use crate::error::Result;
use crate::report::{FrameReport, Report};
use minijinja::value::Serde;
use minijinja::{Value, context};

/// A page of a report: stage times, bits, PSNR, cut sizes, thresholds and κ of each frame, and the plan. `importance` has the maps
/// of where people look, if any.
///
/// # Errors
/// A fault of our own.
pub fn run_page(report: &Report, importance: &ImportanceSum) -> Result<String> {
    let summary = &report.summary;
    let mut tiles = vec![
        ("frames", format!("{}{}", summary.frames, if summary.interrupted { ", interrupted" } else { "" })),
        ("CPU s a frame", format!("{:.2}", summary.seconds.total)),
        ("by the clock", format!("{:.1} s", summary.wall_seconds)),
        ("bits", format!("{:.0} kbit/s", summary.bits * report.settings.fps / 1000.0)),
        ("luma PSNR", summary.psnr_y.map_or("equal".into(), |psnr| format!("{psnr:.1} dB"))),
        ("mean threshold", format!("{:.1} %", 100.0 * summary.threshold_mean_relative)),
    ];
    if let Some(bytes) = summary.peak_memory_bytes {
        tiles.push(("memory at most", format!("{:.0} MB", bytes as f64 / 1e6)));
    }
    let mut drawn = plots(&report.frames);
    drawn.extend(importance.draw());
    let plots: Vec<String> = drawn.iter().map(super::Svg::inline).collect();
    let settings: Vec<(String, String)> = match serde_json::to_value(&report.settings)? {
        serde_json::Value::Object(all) => all.into_iter().map(|(name, value)| (name, plain(&value))).collect(),
        _ => Vec::new(),
    };
    render_template(
        "run.html",
        context! {
            title => report.scene.file.file_stem().map(|stem| stem.to_string_lossy().into_owned()),
            scene => report.scene.file.display().to_string(),
            size => format!("{}×{}", report.settings.size.width, report.settings.size.height),
            fps => plain(&report.settings.fps.into()),
            qscale => report.settings.qscale,
            triangles => report.scene.triangles,
            tiles, plots, settings,
            plan => Value::from(Serde(&report.plan)),
            warnings => report.scene.warnings.clone(),
        },
    )
}

/// JSON as a person writes it.
fn plain(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Null => "–".into(),
        serde_json::Value::String(text) => text.clone(),
        serde_json::Value::Number(number) => number.to_string().trim_end_matches(".0").to_owned(),
        other => other.to_string(),
    }
}

/// A number of a frame.
type Figure = fn(&FrameReport) -> f64;

fn plots(frames: &[FrameReport]) -> Vec<super::Svg> {
    let stages: [(&str, Figure); 9] = [
        ("scene", |f| f.seconds.update),
        ("photons", |f| f.seconds.photons),
        ("light tree", |f| f.seconds.tree),
        ("primary rays", |f| f.seconds.visibility),
        ("direct light", |f| f.seconds.direct),
        ("indirect light", |f| f.seconds.indirect),
        ("tone curve", |f| f.seconds.tone_map),
        ("encoding", |f| f.seconds.encode),
        ("masking", |f| f.seconds.thresholds),
    ];
    // Colors that differ most for the stages that take most.
    let colors = [6, 1, 7, 5, 2, 0, 8, 3, 4];
    let times = StackedBars {
        title: "CPU seconds of the stages".into(),
        x_label: "frame".into(),
        y_label: "CPU s".into(),
        parts: stages.iter().zip(colors).map(|((name, _), color)| ((*name).to_owned(), color)).collect(),
        names: frames.iter().map(|frame| frame.index.to_string()).collect(),
        columns: frames.iter().map(|frame| stages.iter().map(|(_, seconds)| seconds(frame)).collect()).collect(),
    };
    let kinds = [("I", 3), ("P", 0), ("B", 2)];
    let kinds: Vec<(&str, usize)> =
        kinds.into_iter().filter(|(kind, _)| frames.iter().any(|frame| frame.picture_type == *kind)).collect();
    let bits = StackedBars {
        title: "Bits of the pictures".into(),
        x_label: "frame".into(),
        y_label: "kbit".into(),
        parts: kinds.iter().map(|(kind, color)| (format!("{kind} pictures"), *color)).collect(),
        names: frames.iter().map(|frame| frame.index.to_string()).collect(),
        columns: frames
            .iter()
            .map(|frame| {
                let of = |kind: &str| if frame.picture_type == kind { frame.bits as f64 / 1000.0 } else { 0.0 };
                kinds.iter().map(|(kind, _)| of(kind)).collect()
            })
            .collect(),
    };
    let line = |title: &str, y_label: &str, (name, color): (&str, usize), value: Figure| LinePlot {
        title: title.into(),
        x_label: "frame".into(),
        y_label: y_label.into(),
        x_log: false,
        y_log: false,
        series: vec![Series {
            name: name.into(),
            color,
            dashed: false,
            points_shown: frames.len() <= 40,
            points: frames.iter().map(|frame| (f64::from(frame.index), value(frame))).collect(),
            crossed: Vec::new(),
        }],
        level: None,
    };
    let mut plots = vec![
        times.draw(),
        bits.draw(),
        // Equal pictures have no PSNR, and leave a gap.
        line("PSNR of the decoded luma", "dB", ("against the uncompressed picture", 2), |frame| {
            frame.psnr_y.unwrap_or(f64::NAN)
        })
        .draw(),
        line("Size of cuts", "clusters", ("mean", 0), |frame| frame.cut_size_mean).draw(),
        line("Thresholds", "% of luminance", ("mean threshold", 3), |frame| 100.0 * frame.threshold_mean_relative)
            .draw(),
        line("κ, the multiplier on what masking allows", "κ", ("κ", 4), |frame| frame.kappa.unwrap_or(f64::NAN)).draw(),
    ];
    if frames.iter().any(|frame| frame.samples_mean.is_some()) {
        let samples = |frame: &FrameReport| frame.samples_mean.unwrap_or(f64::NAN);
        plots.push(line("Samples to the pixel", "samples", ("mean", 5), samples).draw());
    }
    plots
}
