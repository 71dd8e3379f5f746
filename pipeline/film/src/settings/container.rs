//! The container that an output's name says.

use super::chunks::FrameRange;
use super::coded_rate::CodedRate;
use crate::error::{Error, Result};
use mpeg2enc::Container;
use pipeline::streams::is_stream;
use std::path::Path;

/// Endings of films, for messages.
const ENDINGS: &str = ".mpg, .mp4, .mkv, .ts, .vob or .m2v";

/// The container of a film at `output`, by its ending; `None` for unknown endings.
///
/// Standard output, devices and pipes without one take a program stream, which programs recognize without a name. A part of a film,
/// with a `range`, is an elementary stream there too.
pub fn container_of(output: &Path, range: Option<FrameRange>) -> Option<Container> {
    let of_stream = || match range {
        Some(_) => Container::Elementary,
        None => Container::Program,
    };
    Container::of(output).or_else(|| is_stream(output).then(of_stream))
}

/// The error about a name that says no container.
pub fn unknown_ending(output: &Path) -> Error {
    let name = output.display();
    Error::Options(match output.extension() {
        Some(_) => format!("{name}: such files are not written; name the output {ENDINGS}"),
        None => format!("{name}: an ending says what the film is; name the output {ENDINGS}"),
    })
}

/// A part of a film is an elementary stream, which can be joined to others.
///
/// # Errors
/// `output` is another file.
pub(super) fn check_part(range: Option<FrameRange>, output: &Path) -> Result<()> {
    if range.is_none() || container_of(output, range) == Some(Container::Elementary) {
        return Ok(());
    }
    let name = output.display();
    Err(Error::Options(format!(
        "{name}: --range makes a part, which is an elementary stream; name it .m2v, and let render2mpeg join make the film"
    )))
}

/// Whether DVD-Video has a film's rate.
///
/// # Errors
/// `output` is for a disc, and it has not.
pub fn check_disc(output: &Path, range: Option<FrameRange>, fps: f64) -> Result<()> {
    let rate = CodedRate::of(fps).map(|coded| coded.rate.fraction());
    let has_rate = [Ok((24_000, 1001)), Ok((25, 1)), Ok((30_000, 1001))].contains(&rate);
    if has_rate || rate.is_err() || container_of(output, range) != Some(Container::Disc) {
        return Ok(());
    }
    let name = output.display();
    let text = "use one of these with --fps, or name the output .mpg";
    Err(Error::Options(format!("{name}: DVD-Video has 23.976, 25 or 29.97 pictures a second, and not {fps}: {text}")))
}
