//! Lines through points.

use super::PALETTE;
use super::axis::{Axis, short};
use super::svg::{Svg, TextStyle};

/// Size of a plot in units that are pixels where a page has room; narrow pages show it at three quarters, where 13 is still readable.
pub(super) const SIZE: (f64, f64) = (520.0, 360.0);
/// Left, right and top of the area between the axes.
pub(super) const AREA: (f64, f64, f64) = (74.0, 508.0, 34.0);
/// Height of a row of the legend.
const LEGEND_ROW: f64 = 19.0;
/// Letters of a name that has room in the legend beside two others.
const SHORT_NAME: usize = 17;

/// One line.
#[derive(Clone, Debug)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Place in [`PALETTE`].
    pub color: usize,
    /// Dashed with hollow points, or solid with filled ones.
    pub dashed: bool,
    /// Whether the points are drawn, too.
    pub points_shown: bool,
    /// Values along both axes; what cannot be drawn is left out.
    pub points: Vec<(f64, f64)>,
    /// Whether a point does not count, for each: those are crosses.
    pub crossed: Vec<bool>,
}

/// A plot of lines over common axes.
#[derive(Clone, Debug)]
pub struct LinePlot {
    /// Above it.
    pub title: String,
    /// Name and unit below.
    pub x_label: String,
    /// Name and unit at the left.
    pub y_label: String,
    /// Whether x goes by ratio.
    pub x_log: bool,
    /// Whether y goes by ratio.
    pub y_log: bool,
    /// The lines; later ones lie above.
    pub series: Vec<Series>,
    /// A line across at this y, with its name.
    pub level: Option<(f64, String)>,
}

impl LinePlot {
    /// Draws it.
    pub fn draw(&self) -> Svg {
        let mut svg = Svg::new(SIZE.0, SIZE.1, &self.title);
        let rows = self.series.len().div_ceil(columns(self.series.iter().map(|series| series.name.as_str())));
        let (left, right, top) = AREA;
        let bottom = SIZE.1 - 48.0 - LEGEND_ROW * rows as f64;
        let values = || self.series.iter().flat_map(|series| &series.points);
        let x = Axis::holding(values().map(|p| p.0), self.x_log, (left, right));
        let levels = self.level.iter().map(|(level, _)| *level);
        let y = Axis::holding(values().map(|p| p.1).chain(levels), self.y_log, (bottom, top));
        frame(&mut svg, (&self.title, &self.x_label, &self.y_label), (Some(&x), &y), bottom);
        if let Some((place, name)) = self.level.as_ref().and_then(|(level, name)| Some((y.place(*level)?, name))) {
            svg.rule((left, place), (right, place), "axis");
            svg.text((right - 4.0, place - 5.0), TextStyle { class: "soft", anchor: "end", size: 12.0 }, name);
        }
        for series in &self.series {
            let color = PALETTE[series.color % PALETTE.len()];
            let placed: Vec<(usize, (f64, f64))> =
                (0..).zip(&series.points).filter_map(|(i, &(a, b))| Some((i, (x.place(a)?, y.place(b)?)))).collect();
            let line: Vec<(f64, f64)> = placed.iter().map(|&(_, place)| place).collect();
            if line.len() > 1 {
                svg.polyline(&line, color, series.dashed);
            }
            if series.points_shown || line.len() == 1 {
                for (i, place) in placed {
                    let (a, b) = series.points[i];
                    let about = format!("{}: {}, {}", series.name, short3(a), short3(b));
                    if series.crossed.get(i).is_some_and(|&crossed| crossed) {
                        svg.cross(place, color, &about);
                    } else {
                        svg.point(place, color, !series.dashed, &about);
                    }
                }
            }
        }
        let entries: Vec<(&str, usize, bool)> =
            self.series.iter().map(|series| (series.name.as_str(), series.color, series.dashed)).collect();
        legend(&mut svg, &entries, bottom + 56.0);
        svg
    }
}

/// Three digits are enough to point at.
fn short3(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return short(0.0);
    }
    let scale = 10f64.powi(2 - value.abs().log10().floor() as i32);
    short((value * scale).round() / scale)
}

/// Title, axes, grid.
pub(super) fn frame(
    svg: &mut Svg,
    (title, x_label, y_label): (&str, &str, &str),
    (x, y): (Option<&Axis>, &Axis),
    bottom: f64,
) {
    let (left, right, top) = AREA;
    svg.text((left, 20.0), TextStyle { class: "ink", anchor: "start", size: 15.0 }, title);
    for (value, text) in y.ticks() {
        let Some(place) = y.place(value) else { continue };
        svg.rule((left, place), (right, place), "grid");
        svg.text((left - 7.0, place + 4.5), TextStyle { class: "soft", anchor: "end", size: 13.0 }, &text);
    }
    for (value, text) in x.map(Axis::ticks).unwrap_or_default() {
        let Some(place) = x.and_then(|x| x.place(value)) else { continue };
        svg.rule((place, bottom), (place, bottom + 4.0), "axis");
        svg.text((place, bottom + 18.0), TextStyle { class: "soft", anchor: "middle", size: 13.0 }, &text);
    }
    svg.rule((left, bottom), (right, bottom), "axis");
    svg.text((0.5 * (left + right), bottom + 36.0), TextStyle { class: "soft", anchor: "middle", size: 13.0 }, x_label);
    svg.text_upward((14.0, 0.5 * (top + bottom)), "soft", 13.0, y_label);
}

/// Entries of the legend in a row.
fn columns<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    let longest = names.map(|name| name.chars().count()).max().unwrap_or(0);
    if longest > SHORT_NAME { 2 } else { 3 }
}

/// Names with a piece of their line.
pub(super) fn legend(svg: &mut Svg, entries: &[(&str, usize, bool)], top: f64) {
    let columns = columns(entries.iter().map(|(name, ..)| *name));
    let column = (AREA.1 - AREA.0 + 46.0) / columns as f64;
    for (i, &(name, color, dashed)) in entries.iter().enumerate() {
        let x = AREA.0 - 46.0 + column * (i % columns) as f64;
        let y = top + LEGEND_ROW * (i / columns) as f64;
        svg.polyline(&[(x, y - 4.0), (x + 22.0, y - 4.0)], PALETTE[color % PALETTE.len()], dashed);
        svg.text((x + 28.0, y), TextStyle { class: "ink", anchor: "start", size: 13.0 }, name);
    }
}
