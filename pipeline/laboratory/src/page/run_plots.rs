//! The figures of a run frame by frame: plots of what changes, numbers for what does not.

use super::axis::short;
use super::bars::StackedBars;
use super::line_plot::{LinePlot, Series};
use super::svg::Svg;
use pipeline::report::FrameReport;

/// Columns side by side, at most: of longer films each is the mean of several frames.
const MOST_COLUMNS: usize = 200;
/// Frames whose points are marked each, at most.
const MOST_MARKED: usize = 40;
/// Values of one series differ if they do by more than this share: sums of floats may differ by rounding.
const SAME: f64 = 1e-9;

/// A number of a frame.
type Figure = fn(&FrameReport) -> f64;

/// Figures as they are shown.
#[derive(Default)]
pub(super) struct Figures {
    /// Names for files, and drawings.
    pub plots: Vec<(&'static str, Svg)>,
    /// Series that are the same in every frame, in words: the name and the number.
    pub constant: Vec<(String, String)>,
}

/// A figure over the frames.
struct FigureRow {
    /// For the file.
    file: &'static str,
    title: &'static str,
    unit: &'static str,
    /// The line's name and color.
    line: (&'static str, usize),
    /// Not a number where there is none.
    value: Figure,
}

const ROWS: [FigureRow; 8] = [
    FigureRow {
        file: "psnr",
        title: "PSNR of the decoded luma",
        unit: "dB",
        line: ("against the uncompressed picture", 2),
        // Equal pictures have no PSNR, and leave a gap.
        value: |frame| frame.psnr_y.unwrap_or(f64::NAN),
    },
    FigureRow {
        file: "cuts",
        title: "Size of cuts",
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
        title: "Pixels of which some light was computed",
        unit: "% of lit pixels",
        line: ("computed, not carried", 6),
        value: |frame| 100.0 * frame.figures.shaded_share,
    },
    FigureRow {
        file: "rays",
        title: "Shadow rays",
        unit: "thousands",
        line: ("of direct light and cuts", 1),
        value: |frame| frame.figures.shadow_rays as f64 / 1000.0,
    },
    FigureRow {
        file: "kappa",
        title: "κ, the multiplier on what masking allows",
        unit: "κ",
        line: ("κ", 4),
        value: |frame| frame.figures.kappa.unwrap_or(f64::NAN),
    },
    FigureRow {
        file: "samples",
        title: "Samples to the pixel",
        unit: "samples",
        line: ("mean", 5),
        value: |frame| frame.figures.samples_mean.unwrap_or(f64::NAN),
    },
    FigureRow {
        file: "qscale",
        title: "quantiser_scale of the pictures",
        unit: "quantiser_scale",
        line: ("of the picture", 7),
        value: |frame| f64::from(frame.qscale),
    },
];

impl Figures {
    /// Of `frames`, in display order.
    pub fn of(frames: &[FrameReport]) -> Self {
        let mut figures = Self::default();
        figures.add_columns("seconds", "CPU seconds of the stages", "CPU s", stages(frames));
        figures.add_columns("bits", "Bits of the pictures", "kbit", kinds(frames));
        ROWS.iter().for_each(|row| figures.add(row, frames));
        figures
    }

    /// Draws `parts` as columns, or says their sum where all columns are the same.
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

    /// Draws a line, or says its number where that stays; nothing of what no frame has.
    fn add(&mut self, row: &FigureRow, frames: &[FrameReport]) {
        let points: Vec<(f64, f64)> = frames.iter().map(|frame| (f64::from(frame.index), (row.value)(frame))).collect();
        let values: Vec<f64> = points.iter().map(|point| point.1).collect();
        if values.iter().all(|value| value.is_nan()) {
            return;
        }
        if let Some(value) = constant(&values) {
            let unit = if row.unit == row.line.0 || row.title.starts_with(row.unit) { "" } else { row.unit };
            self.constant.push((row.title.into(), format!("{} {unit}", digits(value)).trim_end().to_owned()));
            return;
        }
        let series = Series {
            name: row.line.0.into(),
            color: row.line.1,
            dashed: false,
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

/// The value that all have; none if they differ, or some frames have none.
fn constant(values: &[f64]) -> Option<f64> {
    let first = *values.first()?;
    values.iter().all(|value| (value - first).abs() <= SAME * first.abs()).then_some(first)
}

/// A number with four digits.
fn digits(value: f64) -> String {
    let scale = if value == 0.0 { 1.0 } else { 10f64.powi(3 - value.abs().log10().floor() as i32) };
    short((value * scale).round() / scale)
}

/// Parts of columns, with their names and colors.
struct Columns {
    parts: Vec<(String, usize)>,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// Frames of a column.
    every: usize,
}

impl Columns {
    /// At most [`MOST_COLUMNS`]: means of frames that follow each other.
    fn few(self) -> Self {
        let every = self.columns.len().div_ceil(MOST_COLUMNS).max(1);
        let mean = |columns: &[Vec<f64>]| {
            let sum = |part: usize| columns.iter().map(|column| column[part]).sum::<f64>();
            (0..self.parts.len()).map(|part| sum(part) / columns.len() as f64).collect()
        };
        let columns = self.columns.chunks(every).map(mean).collect();
        Self { columns, names: self.names.into_iter().step_by(every).collect(), every, parts: self.parts }
    }
}

fn stages(frames: &[FrameReport]) -> Columns {
    // Colors that differ most beside each other.
    let stages: [(&str, usize, Figure); 9] = [
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
