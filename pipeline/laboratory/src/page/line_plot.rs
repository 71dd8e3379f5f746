//! Line plots.

use super::axis::{Axis, short};
use super::svg::{Point, Rectangle, Svg, TextStyle, at};

/// Width and height of a plot at full size \[pixels\]. Narrow pages scale plots to three quarters, where font size 13
/// is still readable.
pub(super) const SIZE: (f64, f64) = (520.0, 360.0);
/// Left edge, right edge and top of the plot area \[pixels\].
pub(super) const AREA: (f64, f64, f64) = (74.0, 508.0, 34.0);
/// Height of a row of the legend \[pixels\].
const LEGEND_ROW: f64 = 19.0;
/// Width of a digit next to an axis plus a gap \[pixels\], for narrow pages with large digits.
const DIGIT: f64 = 11.5;
/// Maximum number of marks on a line if not every point is marked.
const MARKS: usize = 6;
/// Maximum length of names in a legend with three names per row \[characters\].
const SHORT_NAME: usize = 17;

/// Line of a plot.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name of the line in the legend.
    pub name: String,
    /// Number of the line's color and mark.
    pub color: usize,
    /// True for a dashed line with hollow points, false for a solid line with filled points.
    pub dashed: bool,
    /// True if every point is marked.
    pub points_shown: bool,
    /// Points (x, y); points that cannot be drawn are omitted.
    pub points: Vec<(f64, f64)>,
    /// True for each point that is not counted and is drawn as a cross.
    pub crossed: Vec<bool>,
}

/// Plot of lines over common axes.
#[derive(Clone, Debug)]
pub struct LinePlot {
    /// Title above the plot.
    pub title: String,
    /// Label and unit of the x axis.
    pub x_label: String,
    /// Label and unit of the y axis.
    pub y_label: String,
    /// True if the x axis is logarithmic.
    pub x_log: bool,
    /// True if the y axis is logarithmic.
    pub y_log: bool,
    /// Lines of the plot; later lines are drawn on top.
    pub series: Vec<Series>,
    /// Position y of a horizontal line, and the line's name.
    pub level: Option<(f64, String)>,
}

impl LinePlot {
    /// Draws the plot.
    pub fn draw(&self) -> Svg {
        // Reserve space for the legend.
        let rows = self.series.len().div_ceil(columns(self.series.iter().map(|series| series.name.as_str())));
        let (height, bottom) = height_and_bottom(rows);
        let mut svg = Svg::new(SIZE.0, height, &self.title);
        let (left, right, top) = AREA;

        // Fit the axes to all points and to the level.
        let values = || self.series.iter().flat_map(|series| &series.points);
        let x = Axis::holding(values().map(|p| p.0), self.x_log, left, right);
        let levels = self.level.iter().map(|(level, _)| *level);
        let y = Axis::holding(values().map(|p| p.1).chain(levels), self.y_log, bottom, top);
        let labels = Labels { title: &self.title, x: &self.x_label, y: &self.y_label };
        frame(&mut svg, labels, Some(&x), &y, bottom);

        // Draw the level first, below the lines.
        if let Some((place, name)) = self.level.as_ref().and_then(|(level, name)| Some((y.place(*level)?, name))) {
            svg.rule(at(left, place), at(right, place), "axis");
            svg.text(at(right - 4.0, place - 5.0), TextStyle { class: "soft", anchor: "end", size: 12.0 }, name);
        }
        self.series.iter().for_each(|series| self.draw_line(&mut svg, series, &x, &y));

        // Show each line in the legend.
        let entry = |series: &Series| LegendEntry {
            name: series.name.clone(),
            color: series.color,
            dashed: Some(series.dashed),
        };
        let entries: Vec<LegendEntry> = self.series.iter().map(entry).collect();
        legend(&mut svg, &entries, bottom + 56.0);
        svg
    }

    /// Draws a line and marks: every point, or a few points of a long line.
    fn draw_line(&self, svg: &mut Svg, series: &Series, x: &Axis, y: &Axis) {
        // Omit points that an axis cannot show.
        let placed: Vec<(usize, Point)> =
            (0..).zip(&series.points).filter_map(|(i, &(a, b))| Some((i, at(x.place(a)?, y.place(b)?)))).collect();
        let line: Vec<Point> = placed.iter().map(|&(_, place)| place).collect();
        if line.len() > 1 {
            svg.polyline(&line, series.color, series.dashed);
        }

        // Mark only a few points of long lines.
        let every = if series.points_shown || line.len() == 1 { 1 } else { line.len().div_ceil(MARKS) };
        for (i, place) in placed.into_iter().skip(every / 2).step_by(every) {
            let (a, b) = series.points[i];
            let about = format!("{}: {}, {}", series.name, short3(a), short3(b));
            if series.crossed.get(i).is_some_and(|&crossed| crossed) {
                svg.cross(place, series.color, &about);
            } else {
                svg.point(place, series.color, !series.dashed, &about);
            }
        }
    }
}

/// Returns the height of a plot with `rows` of the legend, and the bottom of the plot area. Additional rows extend the
/// plot below the plot area.
pub(super) fn height_and_bottom(rows: usize) -> (f64, f64) {
    let height = SIZE.1 + LEGEND_ROW * rows.saturating_sub(3) as f64;
    (height, height - 48.0 - LEGEND_ROW * rows as f64)
}

/// Formats a number with three digits, for tooltips.
fn short3(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return short(0.0);
    }
    let scale = 10f64.powi(2 - value.abs().log10().floor() as i32);
    short((value * scale).round() / scale)
}

/// Texts around a plot, for title and axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Labels<'a> {
    /// Title above the plot.
    pub title: &'a str,
    /// Name and unit below the x axis.
    pub x: &'a str,
    /// Name and unit left of the y axis.
    pub y: &'a str,
}

/// Draws title, axes and grid.
pub(super) fn frame(svg: &mut Svg, labels: Labels, x: Option<&Axis>, y: &Axis, bottom: f64) {
    let (left, right, top) = AREA;
    svg.text(at(left, 20.0), TextStyle { class: "ink", anchor: "start", size: 15.0 }, labels.title);
    // Draw a grid line and a label for each tick of the y axis.
    for (value, text) in y.ticks() {
        let Some(place) = y.place(value) else { continue };
        svg.rule(at(left, place), at(right, place), "grid");
        svg.text(at(left - 7.0, place + 4.5), TextStyle { class: "soft", anchor: "end", size: 13.0 }, &text);
    }

    // Draw ticks and labels of the x axis.
    let mut free = 0.0;
    for (value, text) in x.map(Axis::ticks).unwrap_or_default() {
        let Some(place) = x.and_then(|x| x.place(value)) else { continue };
        svg.rule(at(place, bottom), at(place, bottom + 4.0), "axis");
        // Skip labels that would overlap the previous label.
        let room = DIGIT * text.chars().count() as f64;
        if place - 0.5 * room < free {
            continue;
        }
        free = place + 0.5 * room;
        // Align the last label to the edge if it would exceed the drawing.
        let (place, anchor) = if free > SIZE.0 { (SIZE.0 - 1.0, "end") } else { (place, "middle") };
        svg.text(at(place, bottom + 18.0), TextStyle { class: "soft", anchor, size: 13.0 }, &text);
    }

    // Draw the x axis, and the labels of both axes.
    svg.rule(at(left, bottom), at(right, bottom), "axis");
    let x_label = x.map_or_else(|| labels.x.to_owned(), |x| x.label(labels.x));
    svg.text(
        at(0.5 * (left + right), bottom + 36.0),
        TextStyle { class: "soft", anchor: "middle", size: 13.0 },
        &x_label,
    );
    svg.text_upward(at(14.0, 0.5 * (top + bottom)), "soft", 13.0, &y.label(labels.y));
}

/// Returns the number of legend entries in a row.
fn columns<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    let longest = names.map(|name| name.chars().count()).max().unwrap_or(0);
    if longest > SHORT_NAME { 2 } else { 3 }
}

/// Entry of a legend.
pub(super) struct LegendEntry {
    /// Name of the line or stacked value.
    pub name: String,
    /// Number of the entry's color and mark.
    pub color: usize,
    /// True for a dashed line; `None` for bars.
    pub dashed: Option<bool>,
}

/// Draws the legend: each name with a piece of its line and its mark, or with its color.
pub(super) fn legend(svg: &mut Svg, entries: &[LegendEntry], top: f64) {
    let columns = columns(entries.iter().map(|entry| entry.name.as_str()));
    let column = (AREA.1 - AREA.0 + 46.0) / columns as f64;
    for (i, LegendEntry { name, color, dashed }) in entries.iter().enumerate() {
        let x = AREA.0 - 46.0 + column * (i % columns) as f64;
        let y = top + LEGEND_ROW * (i / columns) as f64;
        match *dashed {
            Some(dashed) => {
                svg.polyline(&[at(x, y - 4.0), at(x + 22.0, y - 4.0)], *color, dashed);
                svg.point(at(x + 11.0, y - 4.0), *color, !dashed, "");
            }
            None => {
                let square = Rectangle { x: x + 6.0, y: y - 10.0, width: 12.0, height: 12.0 };
                svg.bar(square, *color, "");
            }
        }
        svg.text(at(x + 28.0, y), TextStyle { class: "entry", anchor: "start", size: 13.0 }, name);
    }
}
