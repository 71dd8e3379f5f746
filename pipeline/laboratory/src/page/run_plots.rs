//! Figures of a run per frame: varying figures as plots, constant figures as numbers.

use super::axis::short;
use super::bars::StackedBars;
use super::line_plot::{LinePlot, Series};
use super::svg::Svg;
use pipeline::report::FrameReport;

/// Maximum number of bars. In longer films, each bar is the mean of several frames.
const MOST_COLUMNS: usize = 200;
/// Maximum number of frames in a plot that marks every point.
const MOST_MARKED: usize = 40;
/// Maximum relative difference between values of a series that count as equal. Sums of floats may differ by rounding.
const SAME: f64 = 1e-9;

/// Function that returns a figure of a frame.
type Figure = fn(&FrameReport) -> f64;

/// Figures to show on the page.
#[derive(Default)]
pub(super) struct Figures {
    /// File name and drawing of each plot.
    pub plots: Vec<(&'static str, Svg)>,
    /// Name and value of each series that is constant over the film.
    pub constant: Vec<(String, String)>,
}

/// Figure that is plotted over the frames.
struct FigureRow {
    /// Name of the plot's file.
    file: &'static str,
    title: &'static str,
    unit: &'static str,
    /// Name and color number of the line.
    line: (&'static str, usize),
    /// Value of the figure in a frame; NaN if the frame has none.
    value: Figure,
}

const ROWS: [FigureRow; 8] = [
    FigureRow {
        file: "psnr",
        title: "PSNR of the decoded luma",
        unit: "dB",
        line: ("against the uncompressed picture", 2),
        // Omit equal pictures, which have no PSNR.
        value: |frame| frame.psnr_y.unwrap_or(f64::NAN),
    },
    FigureRow {
        file: "cuts",
        title: "Cut size",
        unit: "clusters",
        line: ("mean", 0),
        value: |frame| frame.figures.cut_size_mean,
    },
    FigureRow {
        file: "thresholds",
        title: "Thresholds",
        unit: "% of luminance",
        line: ("mean threshold", 3),
        value: |frame| 100.0 * frame.figures.threshold_mean_relative,
    },
    FigureRow {
        file: "shaded",
        title: "Pixels with some computed light",
        unit: "% of lit pixels",
        line: ("computed, not reprojected", 6),
        value: |frame| 100.0 * frame.figures.shaded_share,
    },
    FigureRow {
        file: "rays",
        title: "Shadow rays",
        unit: "thousands",
        line: ("direct light and cuts", 1),
        value: |frame| frame.figures.shadow_rays as f64 / 1000.0,
    },
    FigureRow {
        file: "kappa",
        title: "κ, multiplier on masking thresholds",
        unit: "κ",
        line: ("κ", 4),
        value: |frame| frame.figures.kappa.unwrap_or(f64::NAN),
    },
    FigureRow {
        file: "samples",
        title: "Samples per pixel",
        unit: "samples",
        line: ("mean", 5),
        value: |frame| frame.figures.samples_mean.unwrap_or(f64::NAN),
    },
    FigureRow {
        file: "qscale",
        title: "quantiser_scale of the pictures",
        unit: "quantiser_scale",
        line: ("per picture", 7),
        value: |frame| f64::from(frame.qscale),
    },
];

impl Figures {
    /// Collects the figures of `frames`, in display order.
    pub fn of(frames: &[FrameReport]) -> Self {
        let mut figures = Self::default();
        figures.add_columns("seconds", "CPU seconds of the stages", "CPU s", stages(frames));
        figures.add_columns("bits", "Bits per picture", "kbit", kinds(frames));
        ROWS.iter().for_each(|row| figures.add(row, frames));
        figures
    }

    /// Draws `parts` as stacked bars, or lists the sum if it is constant.
    fn add_columns(&mut self, file: &'static str, title: &str, unit: &str, parts: Columns) {
        let sums: Vec<f64> = parts.columns.iter().map(|column| column.iter().sum()).collect();
        if let Some(sum) = constant(&sums) {
            self.constant.push((title.into(), format!("{} {unit}", digits(sum))));
            return;
        }
        let bars = parts.few();
        let drawn = StackedBars {
            title: if bars.every > 1 { format!("{title}, means of {} frames", bars.every) } else { title.into() },
            x_label: "frame".into(),
            y_label: unit.into(),
            parts: bars.parts,
            names: bars.names,
            columns: bars.columns,
        };
        self.plots.push((file, drawn.draw()));
    }

    /// Draws a figure as a line, or lists the value if it is constant. Omits figures without values.
    fn add(&mut self, row: &FigureRow, frames: &[FrameReport]) {
        let points: Vec<(f64, f64)> = frames.iter().map(|frame| (f64::from(frame.index), (row.value)(frame))).collect();
        let values: Vec<f64> = points.iter().map(|point| point.1).collect();
        if values.iter().all(|value| value.is_nan()) {
            return;
        }
        if let Some(value) = constant(&values) {
            // Omit a unit that the title or the line already names.
            let unit = if row.unit == row.line.0 || row.title.starts_with(row.unit) { "" } else { row.unit };
            self.constant.push((row.title.into(), format!("{} {unit}", digits(value)).trim_end().to_owned()));
            return;
        }
        let series = Series {
            name: row.line.0.into(),
            color: row.line.1,
            dashed: false,
            // Mark every point in short films only.
            points_shown: frames.len() <= MOST_MARKED,
            points,
            crossed: Vec::new(),
        };
        let plot = LinePlot {
            title: row.title.into(),
            x_label: "frame".into(),
            y_label: row.unit.into(),
            x_log: false,
            y_log: false,
            series: vec![series],
            level: None,
        };
        self.plots.push((row.file, plot.draw()));
    }
}

/// Returns the common value; `None` if the values differ or some are missing.
fn constant(values: &[f64]) -> Option<f64> {
    let first = *values.first()?;
    values.iter().all(|value| (value - first).abs() <= SAME * first.abs()).then_some(first)
}

/// Formats a number with four digits.
fn digits(value: f64) -> String {
    let scale = if value == 0.0 { 1.0 } else { 10f64.powi(3 - value.abs().log10().floor() as i32) };
    short((value * scale).round() / scale)
}

/// Stacked bars, with name and color of each stacked value.
struct Columns {
    parts: Vec<(String, usize)>,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// Number of frames per bar.
    every: usize,
}

impl Columns {
    /// Reduces the bars to at most [`MOST_COLUMNS`] means of consecutive frames.
    fn few(self) -> Self {
        let every = self.columns.len().div_ceil(MOST_COLUMNS).max(1);
        // Average each stacked value over the frames of a bar.
        let mean = |columns: &[Vec<f64>]| {
            let sum = |part: usize| columns.iter().map(|column| column[part]).sum::<f64>();
            (0..self.parts.len()).map(|part| sum(part) / columns.len() as f64).collect()
        };
        let columns = self.columns.chunks(every).map(mean).collect();
        Self { columns, names: self.names.into_iter().step_by(every).collect(), every, parts: self.parts }
    }
}

fn stages(frames: &[FrameReport]) -> Columns {
    // Choose neighboring colors that differ as much as possible.
    let stages: [(&str, usize, Figure); 10] = [
        ("anchors", 9, |f| f.figures.seconds.anchors),
        ("scene", 6, |f| f.figures.seconds.update),
        ("photons", 1, |f| f.figures.seconds.photons),
        ("light tree", 7, |f| f.figures.seconds.tree),
        ("primary rays", 5, |f| f.figures.seconds.visibility),
        ("direct light", 2, |f| f.figures.seconds.direct),
        ("indirect light", 0, |f| f.figures.seconds.indirect),
        ("tone curve", 8, |f| f.figures.seconds.tone_map),
        ("encoding", 3, |f| f.figures.seconds.encode),
        ("masking", 4, |f| f.figures.seconds.thresholds),
    ];
    Columns {
        parts: stages.iter().map(|(name, color, _)| ((*name).to_owned(), *color)).collect(),
        names: frames.iter().map(|frame| frame.index.to_string()).collect(),
        columns: frames.iter().map(|frame| stages.iter().map(|(.., seconds)| seconds(frame)).collect()).collect(),
        every: 1,
    }
}

fn kinds(frames: &[FrameReport]) -> Columns {
    let mut kinds = vec![("I", 3), ("P", 0), ("B", 2)];
    // Omit picture types that do not occur.
    kinds.retain(|(kind, _)| frames.iter().any(|frame| frame.picture_type == *kind));
    let bits = |frame: &FrameReport| {
        let of = |kind: &str| if frame.picture_type == kind { frame.bits as f64 / 1000.0 } else { 0.0 };
        kinds.iter().map(|(kind, _)| of(kind)).collect()
    };
    Columns {
        parts: kinds.iter().map(|(kind, color)| (format!("{kind} pictures"), *color)).collect(),
        names: frames.iter().map(|frame| frame.index.to_string()).collect(),
        columns: frames.iter().map(bits).collect(),
        every: 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_is_a_number_and_what_changes_has_few_columns() {
        assert_eq!((constant(&[2.0, 2.0]), constant(&[2.0, 2.1]), constant(&[2.0, f64::NAN])), (Some(2.0), None, None));
        assert_eq!((constant(&[]), constant(&[0.0, 0.0]), constant(&[0.3, 0.1 + 0.2])), (None, Some(0.0), Some(0.3)));
        assert_eq!((digits(12345.678), digits(0.0), digits(0.25)), ("12350".into(), "0".into(), "0.25".into()));
        let columns = Columns {
            parts: vec![("a".into(), 0)],
            names: (0..500).map(|i| i.to_string()).collect(),
            columns: (0..500).map(|i| vec![f64::from(i)]).collect(),
            every: 1,
        };
        let few = columns.few();
        assert_eq!((few.every, few.columns.len(), few.names.len()), (3, 167, 167));
        assert_eq!((few.columns[1][0], few.names[1].as_str()), (4.0, "3"));
    }
}
