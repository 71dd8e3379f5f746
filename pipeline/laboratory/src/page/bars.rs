//! Stacked bar charts.

use super::axis::Axis;
use super::line_plot::{AREA, Labels, LegendEntry, SIZE, frame, height_and_bottom, legend};
use super::svg::{Rectangle, Svg, TextStyle, at};

/// Maximum number of columns with tooltips: more tooltips would take up most of a page.
const MOST_TITLED: usize = 150;

/// Stacked bar chart.
#[derive(Clone, Debug)]
pub struct StackedBars {
    /// Title above the chart.
    pub title: String,
    /// Label of the x axis.
    pub x_label: String,
    /// Label and unit of the y axis.
    pub y_label: String,
    /// Name and color number of each stacked value, from bottom to top.
    pub parts: Vec<(String, usize)>,
    /// Labels of the columns; some are omitted if space is short.
    pub names: Vec<String>,
    /// Values of each column, one per entry of `parts`.
    pub columns: Vec<Vec<f64>>,
}

impl StackedBars {
    /// Draws the chart.
    pub fn draw(&self) -> Svg {
        let (left, right, top) = AREA;
        let named = if self.parts.len() > 1 { self.parts.len().div_ceil(3) } else { 0 };
        let (height, bottom) = height_and_bottom(named);
        let mut svg = Svg::new(SIZE.0, height, &self.title);

        // Draw axes and labels.
        let heights = self.columns.iter().map(|column| column.iter().sum::<f64>());
        let y = Axis::holding(heights.chain([0.0]), false, bottom, top);
        let labels = Labels { title: &self.title, x: &self.x_label, y: &self.y_label };
        frame(&mut svg, labels, None, &y, bottom);

        // Draw columns from the bottom up, and the labels for which space suffices.
        let width = (right - left) / self.columns.len().max(1) as f64;
        let gap = if width > 8.0 { 0.16 * width } else { 0.0 };
        // Reserve 34 pixels for each label.
        let every = (self.columns.len() as f64 * 34.0 / (right - left)).ceil().max(1.0) as usize;
        let titled = self.columns.len() <= MOST_TITLED;
        for (i, column) in self.columns.iter().enumerate() {
            let x = left + width * i as f64;
            let mut below = 0.0;
            for (&value, (name, color)) in column.iter().zip(&self.parts) {
                let (Some(low), Some(high)) = (y.place(below), y.place(below + value)) else { continue };
                below += value;
                // Omit bars that are too low to see.
                if low - high > 0.02 {
                    let about = if titled {
                        format!("{} {}: {name} {value:.3}", self.x_label, self.names[i])
                    } else {
                        String::new()
                    };
                    let bar = Rectangle { x: x + 0.5 * gap, y: high, width: width - gap, height: low - high };
                    svg.bar(bar, *color, &about);
                }
            }
            if i % every == 0 {
                svg.text(
                    at(x + 0.5 * width, bottom + 18.0),
                    TextStyle { class: "soft", anchor: "middle", size: 13.0 },
                    &self.names[i],
                );
            }
        }

        // Omit the legend if all values are of the same kind.
        if self.parts.len() > 1 {
            let entry =
                |(name, color): &(String, usize)| LegendEntry { name: name.clone(), color: *color, dashed: None };
            let entries: Vec<LegendEntry> = self.parts.iter().map(entry).collect();
            legend(&mut svg, &entries, bottom + 56.0);
        }
        svg
    }
}
