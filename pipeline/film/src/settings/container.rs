//! Choice of the container from an output's file name.

use super::chunks::FrameRange;
use super::coded_rate::CodedRate;
use crate::error::{Error, Result};
use mpeg2enc::Container;
use pipeline::streams::is_stream;
use std::path::Path;

/// File endings of films, as listed in messages.
const ENDINGS: &str = ".mpg, .mp4, .mkv, .ts, .vob or .m2v";

/// Returns the container of a film at `output`, chosen by file ending; `None` for unknown endings.
///
/// Standard output, devices and pipes without an ending receive a program stream, which players recognize without a
/// file name. With a `range` they receive an elementary stream, because every part of a film is an elementary stream.
pub fn container_of(output: &Path, range: Option<FrameRange>) -> Option<Container> {
    let of_stream = || match range {
        Some(_) => Container::Elementary,
        None => Container::Program,
    };
    Container::of(output).or_else(|| is_stream(output).then(of_stream))
}

/// Returns the error for an output with an unknown or missing ending.
pub fn unknown_ending(output: &Path) -> Error {
    let name = output.display();
    Error::Options(match output.extension() {
        Some(_) => format!("{name}: unknown film format; name the output {ENDINGS}"),
        None => format!("{name}: the ending selects the film's format; name the output {ENDINGS}"),
    })
}

/// Checks that a part of a film is written as an elementary stream, which can be joined to other parts.
///
/// # Errors
/// If `output` has another ending.
pub(super) fn check_part(range: Option<FrameRange>, output: &Path) -> Result<()> {
    if range.is_none() || container_of(output, range) == Some(Container::Elementary) {
        return Ok(());
    }
    let name = output.display();
    Err(Error::Options(format!(
        "{name}: --range writes a part, which is an elementary stream; name it .m2v and make the film with render2mpeg join"
    )))
}

/// Checks that DVD-Video supports a film's frame rate.
///
/// # Errors
/// If `output` is a DVD-Video file and DVD-Video does not support the rate.
pub fn check_disc(output: &Path, range: Option<FrameRange>, fps: f64) -> Result<()> {
    let rate = CodedRate::of(fps).map(|coded| coded.rate.fraction());
    // Accept an invalid rate here, because the encoder reports it.
    let has_rate = [Ok((24_000, 1001)), Ok((25, 1)), Ok((30_000, 1001))].contains(&rate);
    if has_rate || rate.is_err() || container_of(output, range) != Some(Container::Disc) {
        return Ok(());
    }
    let name = output.display();
    let text = "use one of these with --fps, or name the output .mpg";
    Err(Error::Options(format!("{name}: DVD-Video has 23.976, 25 or 29.97 pictures per second, not {fps}: {text}")))
}
