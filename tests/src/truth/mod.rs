//! A parser of films that shares nothing with the encoder: each number that a stream states, next to what it is.
//!
//! Elementary streams of MPEG-1 and MPEG-2, program and transport streams. References are to ISO/IEC 13818-1 and 13818-2.

mod bits;
mod carried;
mod elementary;
mod program_stream;
mod transport_stream;
mod video;

pub use elementary::{Elementary, Group, Picture, Sequence};
pub use transport_stream::{clock_accuracy, clock_interval};

/// The video of a film, and statements that do not hold. Other containers than these three are left out.
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

/// Checks all that a film states.
///
/// # Panics
/// If something does not hold; the message lists it.
pub fn assert_true(film: &[u8], name: &str) -> Option<Elementary> {
    let (video, faults) = measure(film)?;
    assert!(faults.is_empty(), "{name} states what does not hold: {faults:#?}");
    Some(video)
}
