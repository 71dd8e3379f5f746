//! Plots of a sweep's figures.

use super::figures::{MethodRun, Outcome};
use super::method::{METHODS, Method};
use crate::page::{LinePlot, Series, StackedBars, Svg};

/// Plot with file name and caption.
pub struct Plot {
    /// Name of the plot's file.
    pub name: String,
    /// Drawing of the plot.
    pub svg: Svg,
    /// Caption below the plot.
    pub caption: String,
}

/// Returns all plots of `outcome`, starting with the most informative.
pub fn plots(outcome: &Outcome) -> Vec<Plot> {
    let mut plots = against_time(outcome);
    plots.extend(against_baselines(outcome));
    plots.extend(of_each_method(outcome));
    plots.extend(histograms(outcome));
    plots
}

/// Plots quality against CPU time, for all methods.
fn against_time(outcome: &Outcome) -> Vec<Plot> {
    let all = |_: &MethodRun| true;
    let seconds = |run: &MethodRun| run.seconds.total;
    // Omit pictures without PSNR, which equal the reference: plots skip NaN.
    let psnr = |run: &MethodRun| run.decoded.psnr_y.unwrap_or(f64::NAN);
    let rendered = |run: &MethodRun| run.rendered.relative_mse;
    let time = ("CPU s per frame", true);
    vec![
        plot(
            "decoded_psnr",
            axes(
                "After decoding: quality against time",
                time,
                ("PSNR of luma, dB", false),
                lines(outcome, all, seconds, psnr, never),
                None,
            ),
            "Decoded pictures against the uncompressed reference. The quantiser rises along each line from top to bottom. Solid: irradiance cache; dashed: one cut per pixel.",
        ),
        plot(
            "rendered_error",
            axes(
                "Before compression: error against time",
                time,
                ("relative MSE", true),
                lines(outcome, all, seconds, rendered, never),
                None,
            ),
            "Linear light against the reference. The codec masks the renderer's savings: compare with the plot above.",
        ),
    ]
}

/// Plots the steered methods against fixed thresholds of 2 %, per quantiser.
fn against_baselines(outcome: &Outcome) -> Vec<Plot> {
    let steered = |run: &MethodRun| run.kappa.is_some();
    // Omit runs without a baseline: plots skip NaN.
    let speedup = |run: &MethodRun| run.against_baseline.as_ref().map_or(f64::NAN, |beside| beside.speedup_indirect);
    let lost = |run: &MethodRun| run.against_baseline.as_ref().map_or(f64::NAN, |beside| beside.psnr_difference);
    // Plot bits as an increase in percent.
    let bits =
        |run: &MethodRun| 100.0 * (run.against_baseline.as_ref().map_or(f64::NAN, |beside| beside.bits_ratio) - 1.0);
    // Draw crosses for runs of unequal quality.
    let unequal = |run: &MethodRun| run.against_baseline.as_ref().is_some_and(|beside| !beside.equal_quality);
    vec![
        plot(
            "speedup",
            axes(
                "Speed-up of indirect light against 2 %",
                ("quantiser_scale", true),
                ("times as fast", false),
                lines(outcome, steered, qscale, speedup, unequal),
                Some((1.0, "2 %".into())),
            ),
            "Crosses: decoded quality is not equal (over 0.1 dB less, 1 % more bits or 10 % more flicker), so the speed-up does not count.",
        ),
        plot(
            "decoded_difference",
            axes(
                "Decoded PSNR compared with 2 %",
                ("quantiser_scale", true),
                ("dB more than with 2 %", false),
                lines(outcome, steered, qscale, lost, unequal),
                Some((0.0, "2 %".into())),
            ),
            "Quality is equal from −0.1 dB upward, if bits and flicker are equal too. Crosses: not equal.",
        ),
        plot(
            "bits_difference",
            axes(
                "Bits compared with 2 %",
                ("quantiser_scale", true),
                ("% more than with 2 %", false),
                lines(outcome, steered, qscale, bits, unequal),
                Some((0.0, "2 %".into())),
            ),
            "Coarser light has more noise, and noise costs bits. Quality is equal up to 1 %, if PSNR and flicker are equal too.",
        ),
    ]
}

/// Plots cut sizes and errors of each method, per quantiser.
fn of_each_method(outcome: &Outcome) -> Vec<Plot> {
    vec![
        plot(
            "cut_size",
            axes(
                "Cut size",
                ("quantiser_scale", true),
                ("mean clusters", true),
                // Omit path tracing, which has no lightcuts.
                lines(outcome, |run| run.lightcuts, qscale, |run| run.cut_size_mean, never),
                None,
            ),
            "Mean over all lightcuts. With the cache they are few, located where light changes most.",
        ),
        plot(
            "rmse",
            axes(
                "Errors before compression and after decoding",
                ("quantiser_scale", true),
                ("RMSE, code values", true),
                rmse_lines(outcome),
                None,
            ),
            "Against the uncompressed reference, of 255 code values; as in figure 6a of the paper.",
        ),
    ]
}

fn plot(name: &str, drawn: LinePlot, caption: &str) -> Plot {
    Plot { name: name.into(), svg: drawn.draw(), caption: caption.into() }
}

/// Returns a plot with two axes. Each axis has a label and a flag that is true for a logarithmic axis.
fn axes(title: &str, x: (&str, bool), y: (&str, bool), series: Vec<Series>, level: Option<(f64, String)>) -> LinePlot {
    LinePlot { title: title.into(), x_label: x.0.into(), y_label: y.0.into(), x_log: x.1, y_log: y.1, series, level }
}

fn qscale(run: &MethodRun) -> f64 {
    f64::from(run.qscale)
}

fn never(_: &MethodRun) -> bool {
    false
}

/// Returns one line per method, with a point per quantiser.
fn lines(
    outcome: &Outcome,
    wanted: impl Fn(&MethodRun) -> bool,
    x: impl Fn(&MethodRun) -> f64,
    y: impl Fn(&MethodRun) -> f64,
    crossed: impl Fn(&MethodRun) -> bool,
) -> Vec<Series> {
    let runs: Vec<&MethodRun> = outcome.runs.iter().filter(|run| wanted(run)).collect();
    runs.chunk_by(|a, b| a.method == b.method)
        .map(|runs| Series {
            name: runs[0].label.clone(),
            color: color_of(runs[0]),
            dashed: !runs[0].cache,
            points_shown: true,
            points: runs.iter().map(|run| (x(run), y(run))).collect(),
            crossed: runs.iter().map(|run| crossed(run)).collect(),
        })
        .collect()
}

fn color_of(run: &MethodRun) -> usize {
    Method::named(run.method).map_or(0, |method| method.color)
}

fn rmse_lines(outcome: &Outcome) -> Vec<Series> {
    // Prefer methods with a lightcut for every pixel, as in the paper.
    let cached = !outcome.runs.iter().any(|run| run.lightcuts && !run.cache);
    let wanted = move |run: &MethodRun| run.lightcuts && run.cache == cached;
    let rmse = |psnr: Option<f64>| psnr.map_or(0.0, |psnr| 255.0 * 10f64.powf(-psnr / 20.0));
    let mut series = lines(outcome, wanted, qscale, |run| rmse(run.rendered.psnr_y), never);
    let mut decoded = lines(outcome, wanted, qscale, |run| rmse(run.decoded.psnr_y), never);

    // Give each line its own color: lines before compression use the colors that are still free.
    let taken: Vec<usize> = decoded.iter().map(|line| line.color).collect();
    let free = (0..METHODS.len()).filter(|color| !taken.contains(color));
    for (line, color) in series.iter_mut().zip(free) {
        (line.name, line.dashed, line.color) = (format!("{}, rendered", first_word(&line.name)), true, color);
    }
    for line in &mut decoded {
        (line.name, line.dashed) = (format!("{}, decoded", first_word(&line.name)), false);
    }
    series.extend(decoded);
    series
}

fn first_word(label: &str) -> &str {
    label.split(',').next().unwrap_or(label)
}

/// Plots histograms of error divided by threshold, for the steered methods at the middle quantiser.
fn histograms(outcome: &Outcome) -> Vec<Plot> {
    // Select the middle of the measured quantisers.
    let mut qscales: Vec<u32> = outcome.runs.iter().map(|run| run.qscale).collect();
    qscales.sort_unstable();
    qscales.dedup();
    let middle = qscales.get(qscales.len() / 2).copied();
    let runs = outcome.runs.iter().filter(|run| run.kappa.is_some() && Some(run.qscale) == middle);
    runs.filter_map(histogram).collect()
}

/// Plots the histogram of a run; `None` if the run has no thresholds.
fn histogram(run: &MethodRun) -> Option<Plot> {
    let histogram = run.error_by_threshold.as_ref()?;
    let starts = (0..histogram.shares.len()).map(|i| histogram.bin * i as f64);
    // Use different colors for ratios within the threshold and for larger ratios.
    let columns = starts
        .clone()
        .zip(&histogram.shares)
        .map(|(start, &share)| if start < 1.0 - 1e-9 { vec![100.0 * share, 0.0] } else { vec![0.0, 100.0 * share] });
    let bars = StackedBars {
        title: format!("{} at {}: true error / threshold", run.label, run.qscale),
        x_label: "|error| / threshold of pixels".into(),
        y_label: "% of pixels".into(),
        parts: vec![("within".into(), 2), ("beyond".into(), 3)],
        names: starts.map(|start| format!("{start:.2}")).collect(),
        columns: columns.collect(),
    };
    let caption = format!(
        "{:.1} % of pixels are within their threshold; the median is {:.2} of it, the 95th percentile {:.2}; {:.1} % exceed the plot. As in figure 7 of the paper.",
        100.0 * histogram.within,
        histogram.median,
        histogram.p95,
        100.0 * histogram.above
    );
    Some(Plot { name: format!("histogram_{}_{}", run.method, run.qscale), svg: bars.draw(), caption })
}
