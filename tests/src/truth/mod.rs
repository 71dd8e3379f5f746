//! A parser of films that shares no code with the encoder and compares header values with the stream.
//!
//! It reads MPEG-1 and MPEG-2 elementary streams, program streams and transport streams. References are to ISO/IEC 13818-1
//! and 13818-2.

mod bits;
mod elementary;
mod extracted;
mod program_stream;
mod transport_stream;
mod video;

pub use elementary::{Elementary, Group, Picture, Sequence};
pub use transport_stream::{clock_accuracy, clock_interval};

/// Returns the video of a film, and its wrong header values; none for other containers.
#[must_use]
pub fn measure(film: &[u8]) -> Option<(Elementary, Vec<String>)> {
    let (video, mut faults) = match film {
        [0, 0, 1, 0xb3, ..] => (Elementary::read(film), Vec::new()),
        [0, 0, 1, 0xba, ..] => {
            let (_, video, faults) = program_stream::read(film);
            (video, faults)
        }
        [0x47, ..] if film.len().is_multiple_of(188) => {
            let (_, video, faults) = transport_stream::read(film);
            (video, faults)
        }
        _ => return None,
    };
    faults.extend(video::faults(&video));
    Some((video, faults))
}

/// Checks all header values of a film.
///
/// # Panics
/// If a value is wrong; the message lists all of them.
pub fn assert_true(film: &[u8], name: &str) -> Option<Elementary> {
    let (video, faults) = measure(film)?;
    assert!(faults.is_empty(), "wrong header values in {name}: {faults:#?}");
    Some(video)
}
