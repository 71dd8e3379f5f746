//! Table 1 of \[Herzog08\] for a scene, and findings as text.

use super::figures::{AgainstBaseline, MethodRun, Outcome};
use serde::Serialize;
use std::fmt::Write;

/// Headings of the columns that [`cells`] returns.
pub const HEADINGS: [&str; 15] = [
    "qscale",
    "method",
    "threshold",
    "swaps",
    "cut size",
    "T light",
    "T eye",
    "T direct",
    "T LC",
    "T mask",
    "T code",
    "T frame",
    "decoded PSNR",
    "bits",
    "speed-up",
];

/// Returns a row of table 1 in \[Herzog08\], in CPU seconds per frame. T light is the time for photons and tree, T eye
/// for primary rays and motion, T LC for indirect light. Masking, encoding and decoded quality are additional columns.
pub fn cells(run: &MethodRun, lights: u32) -> [String; 15] {
    let s = &run.seconds;
    let beside = run.against_baseline.as_ref();
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let time = |seconds: f64| format!("{seconds:.3}");
    // Replace the lightcut columns of path tracing with a dash.
    let of_cuts = |text: String| if run.lightcuts { text } else { "–".into() };
    let psnr = run.decoded.psnr_y.map_or("equal".into(), |psnr| format!("{psnr:.2} dB"));
    // Show differences from the baseline only for steered methods.
    let difference =
        beside.filter(|_| run.kappa.is_some()).map_or(String::new(), |b| format!(" ({:+.2})", b.psnr_difference));
    let ratio = beside
        .filter(|_| run.kappa.is_some())
        .map_or(String::new(), |b| format!(" ({:+.1} %)", 100.0 * (b.bits_ratio - 1.0)));
    [
        run.qscale.to_string(),
        run.label.clone(),
        of_cuts(percent(run.threshold_mean_relative)),
        of_cuts(percent(run.tree_swaps_share)),
        of_cuts(percent(run.cut_size_mean / f64::from(lights.max(1)))),
        of_cuts(time(s.anchors + s.photons + s.tree + s.update)),
        of_cuts(time(s.visibility)),
        of_cuts(time(s.direct)),
        of_cuts(time(s.indirect)),
        time(s.thresholds),
        time(s.encode + s.tone_map),
        time(s.total),
        format!("{psnr}{difference}"),
        format!("{:.1} kbit{ratio}", run.bits / 1000.0),
        speedup(run),
    ]
}

/// Returns the speed-up of indirect light as text, if quality is equal.
fn speedup(run: &MethodRun) -> String {
    match &run.against_baseline {
        None => "–".into(),
        Some(_) if run.kappa.is_none() => "×1.0".into(),
        Some(beside) if beside.equal_quality => format!("×{:.2}", beside.speedup_indirect),
        Some(_) => "not equal".into(),
    }
}

impl Outcome {
    /// Returns the table as text for a terminal.
    pub fn table(&self) -> String {
        let rows: Vec<[String; 15]> = self.rows().map(|run| cells(run, self.lights)).collect();
        // Align each column to its widest cell, including the heading.
        let width = |column: usize| {
            let cells = rows.iter().map(|row| row[column].chars().count());
            cells.chain([HEADINGS[column].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..HEADINGS.len()).map(width).collect();
        let mut text = String::new();
        let headings = HEADINGS.map(str::to_owned);
        for row in std::iter::once(&headings).chain(&rows) {
            let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:>width$}"));
            let _ = writeln!(text, "{}", cells.collect::<Vec<String>>().join("  "));
        }
        // Append the findings below the table.
        if self.interrupted {
            let _ = writeln!(text, "\nThis sweep ended early: unmeasured runs are missing.");
        }
        for Finding { label, text: words } in self.findings() {
            let _ = writeln!(text, "\n{label}: {words}");
        }
        text
    }

    /// Returns the runs in the order of the table: sorted by cache, quantiser, and method.
    pub fn rows(&self) -> impl Iterator<Item = &MethodRun> {
        let mut runs: Vec<&MethodRun> = self.runs.iter().collect();
        runs.sort_by_key(|run| (!run.lightcuts, run.cache, run.qscale));
        runs.into_iter()
    }

    /// Returns the relative variation of the time for equal work between runs. The work is photons, light tree and
    /// primary rays, which are equal in all films. Variation is half the range of the times, divided by their mean.
    pub fn timing_spread(&self) -> f64 {
        let films = self.runs.iter().filter(|run| run.lightcuts).map(|run| &run.seconds);
        let same: Vec<f64> = films.map(|s| s.anchors + s.update + s.photons + s.tree + s.visibility).collect();
        let mean = same.iter().sum::<f64>() / same.len().max(1) as f64;
        let most = same.iter().copied().fold(0.0, f64::max);
        let least = same.iter().copied().fold(f64::INFINITY, f64::min);
        if mean > 0.0 { 0.5 * (most - least) / mean } else { 0.0 }
    }

    /// Returns the findings on each steered method: at which quantisers coupling saves time, and at which it does not.
    pub fn findings(&self) -> Vec<Finding> {
        let steered: Vec<&MethodRun> = self.runs.iter().filter(|run| run.kappa.is_some()).collect();
        // Require a saving above the variation between equal measurements.
        let notable = NOTABLE.max(1.0 + self.timing_spread());
        steered.chunk_by(|a, b| a.method == b.method).map(|runs| finding(runs, notable)).collect()
    }
}

/// Finding on a method.
#[derive(Serialize)]
pub struct Finding {
    /// Label of the method in plots.
    pub label: String,
    /// Text of the finding, in a few sentences.
    pub text: String,
}

/// Minimum ratio that counts as saved time: two equal measurements may differ by this ratio. If times vary more, the
/// variation is the minimum.
const NOTABLE: f64 = 1.05;

fn finding(runs: &[&MethodRun], notable: f64) -> Finding {
    // Sort the runs into faster at equal quality, not faster, and unequal quality.
    let beside: Vec<(u32, &AgainstBaseline)> =
        runs.iter().filter_map(|run| Some((run.qscale, run.against_baseline.as_ref()?))).collect();
    let (equal, other): (Vec<_>, Vec<_>) = beside.iter().copied().partition(|(_, b)| b.equal_quality);
    let (pays, not): (Vec<_>, Vec<_>) = equal.into_iter().partition(|(_, b)| b.speedup_indirect >= notable);
    let mut sentences = Vec::new();
    // Describe the quantisers at which coupling saves time.
    if !pays.is_empty() {
        let speed = range(&pays, |b| b.speedup_indirect);
        let cuts = range(&pays, |b| b.cut_size_ratio);
        let rays = range(&pays, |b| b.shadow_rays_ratio);
        let whole = range(&pays, |b| b.speedup_total);
        sentences.push(format!(
            "{speed} times as fast as with 2 % at quantiser {}, at equal decoded quality or better; whole frames {whole} times, cuts {cuts} times smaller, shadow rays {rays} times fewer.",
            list(&pays)
        ));
    }
    // Describe the quantisers at which quality is equal but time is not saved.
    if !not.is_empty() {
        let speed = range(&not, |b| b.speedup_indirect);
        sentences
            .push(format!("At {} coupling does not pay: at equal quality it is {speed} times as fast.", list(&not)));
    }
    // Report the largest differences where quality is not equal.
    if !other.is_empty() {
        let psnr = farthest(&other, |b| b.psnr_difference);
        let bits = farthest(&other, |b| 100.0 * (b.bits_ratio - 1.0));
        let flicker = farthest(&other, |b| 100.0 * (b.flicker_ratio - 1.0));
        sentences.push(format!(
            "At {} decoded quality is not equal (up to {psnr:+.2} dB, {bits:+.1} % of bits, {flicker:+.0} % of flicker): no speed-up is claimed.",
            list(&other)
        ));
    }
    if beside.is_empty() {
        sentences.push("No baseline was run.".into());
    }
    let label = runs.first().map_or(String::new(), |run| run.label.clone());
    Finding { label, text: sentences.join(" ") }
}

fn list(runs: &[(u32, &AgainstBaseline)]) -> String {
    runs.iter().map(|(qscale, _)| qscale.to_string()).collect::<Vec<String>>().join(", ")
}

/// Formats the range of a figure as text, or as a single number if both ends agree to two decimals.
fn range(runs: &[(u32, &AgainstBaseline)], figure: impl Fn(&AgainstBaseline) -> f64) -> String {
    let figures = || runs.iter().map(|(_, beside)| figure(beside));
    let least = format!("{:.2}", figures().fold(f64::INFINITY, f64::min));
    let most = format!("{:.2}", figures().fold(0.0, f64::max));
    if least == most { most } else { format!("{least} to {most}") }
}

/// Returns the value of the figure that is farthest from 0.
fn farthest(runs: &[(u32, &AgainstBaseline)], figure: impl Fn(&AgainstBaseline) -> f64) -> f64 {
    let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
    runs.iter().map(|(_, beside)| figure(beside)).fold(0.0, larger)
}
