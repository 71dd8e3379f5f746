//! Plots, tables and pictures as one self-contained HTML page.
//!
//! Plots are SVG drawings. In a page, they use the page's fonts and its light or dark colors. As files, they contain
//! their own fonts and colors.

mod axis; // positions of values
mod marks; // shapes of points
mod palette; // colors for any color vision
mod svg; // shapes

mod bars;
mod line_plot;
mod map;

mod pictures; // pictures as data URIs
mod scale; // colors of values

mod film_file; // coded pictures of a file
mod stream; // embedded films

mod film; // data of a film's page
mod frame_maps;

mod choices; // settings as text
mod command; // the command that made a film
mod data; // embedded data files
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
pub use stream::{PageStream, Playback, player};
pub use svg::Svg;
