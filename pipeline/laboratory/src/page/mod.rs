//! Figures as plots, and plots, tables and pictures as one HTML page that needs nothing else.
//!
//! Plots are drawn as SVG: inside of a page they take its fonts and its light or dark colors, as files they bring their own.

mod axis; // numbers to places
mod marks; // shapes of points
mod palette; // colors for all eyes
mod svg; // shapes

mod bars;
mod line_plot;
mod map;

mod pictures; // bytes of pictures
mod scale; // numbers to colors

mod film; // what a page shows of a film, gathered while it is made
mod frame_maps;

mod choices; // settings in words
mod command; // the command that made a film
mod data; // figures as files
mod run_plots;

mod html;
mod run;

pub use bars::StackedBars;
pub use command::command_line;
pub use data::download;
pub use film::FilmWatch;
pub use frame_maps::WATCHED;
pub use html::{data_uri, render_template};
pub use line_plot::{LinePlot, Series};
pub use run::{Made, run_page};
pub use scale::{CUT_SIZE, Scale, THRESHOLD, gradient};
pub use svg::Svg;
