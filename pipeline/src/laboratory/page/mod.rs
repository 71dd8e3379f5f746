//! Figures as plots, and plots, tables and pictures as one HTML page that needs nothing else.
//!
//! Plots are drawn as SVG: inside of a page they take its fonts and its light or dark colors, as files they bring their own.

mod axis;
mod bars;
mod html;
mod line_plot;
mod map;
mod run;
mod svg;

pub use bars::StackedBars;
pub use html::{data_uri, render_template};
pub use line_plot::{LinePlot, Series};
pub use map::ImportanceSum;
pub use run::run_page;
pub use svg::Svg;

/// Colors of lines and bars, to be told apart on white and on black, and with deficient color vision by their lightness.
pub const PALETTE: [&str; 9] =
    ["#3b82d0", "#e0912a", "#2a9d6f", "#d64550", "#9067c6", "#45b3c7", "#8b9098", "#b5762f", "#c86aa0"];
