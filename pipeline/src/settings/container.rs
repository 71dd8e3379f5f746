//! The container that an output's name says.

use super::chunks::FrameRange;
use crate::error::{Error, Result};
use crate::places::is_stream;
use mpeg2enc::Container;
use std::path::Path;

/// Endings of films, for messages.
const ENDINGS: &str = ".mpg, .mp4, .mkv, .ts, .vob or .m2v";

/// The container of a film at `output`, by its ending; `None` for unknown endings.
///
/// Standard output, devices and pipes without one take a program stream, which programs recognize without a name. A part of a film,
/// with a `range`, is an elementary stream there too.
pub(crate) fn container_of(output: &Path, range: Option<FrameRange>) -> Option<Container> {
    let of_stream = || match range {
        Some(_) => Container::Elementary,
        None => Container::Program,
    };
    Container::of(output).or_else(|| is_stream(output).then(of_stream))
}

/// The error about a name that says no container.
pub(crate) fn unknown_ending(output: &Path) -> Error {
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
