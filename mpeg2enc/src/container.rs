//! Streams that say when each picture is due: program streams (`.mpg`) and transport streams (`.ts`) of ISO/IEC
//! 13818-1:2000 around the elementary stream.
//!
//! Numbers of clauses and tables in this module are those of that standard.

mod pes;
mod program;
mod schedule;
mod transport;

use crate::{Config, Packet};
use pes::Times;
use schedule::Schedule;
use std::path::Path;

/// What a stream is wrapped into.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Container {
    /// Nothing: the video elementary stream itself, `.m2v`.
    #[default]
    Elementary,
    /// A program stream, `.mpg`: for files.
    Program,
    /// A transport stream, `.ts`: for where bytes get lost.
    Transport,
}

impl Container {
    /// The container that a file's ending asks for: `.m2v`, `.m1v`, `.mpv` or no ending; `.mpg`, `.mpeg`, `.vob`; `.ts`,
    /// `.m2t`. `None` for all others.
    ///
    /// ```
    /// use mpeg2enc::Container;
    /// assert_eq!(Container::of("film.TS".as_ref()), Some(Container::Transport));
    /// assert_eq!(Container::of("film.mp4".as_ref()), None);
    /// ```
    pub fn of(path: &Path) -> Option<Self> {
        let Some(ending) = path.extension() else { return Some(Self::Elementary) };
        match ending.to_str()?.to_ascii_lowercase().as_str() {
            "m2v" | "m1v" | "mpv" => Some(Self::Elementary),
            "mpg" | "mpeg" | "vob" => Some(Self::Program),
            "ts" | "m2t" => Some(Self::Transport),
            _ => None,
        }
    }
}

/// Wraps packets as they come out of an encoder.
///
/// Pictures are due at the frame rate. What arrives when is that of a decoder whose buffer is as large as the stream states,
/// filled at the bit rate that it states, as soon as there is room, and a second before it is needed at most. With a bounded
/// [`Rate`](crate::Rate) everything is there in time, and at a constant rate just as vbv_delay says. Pictures at a constant
/// quantiser that exceed what their level allows come late; files play all the same.
///
/// ```
/// use mpeg2enc::{Config, Container, FrameRate, KnownMotion, Multiplexer, Picture};
///
/// let config = Config::new(64, 48, FrameRate::FPS_25);
/// let mut multiplexer = Multiplexer::new(Container::Program, &config);
/// let mut encoder = config.encoder()?;
/// let mut file = Vec::new();
/// for _ in 0..3 {
///     for packet in encoder.push(&Picture::black(64, 48), KnownMotion::default()) {
///         file.extend(multiplexer.push(packet));
///     }
/// }
/// file.extend(multiplexer.finish(&encoder.finish().end));
/// assert_eq!(file[..4], [0, 0, 1, 0xba]); // pack_start_code
/// # Ok::<(), mpeg2enc::ConfigError>(())
/// ```
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Multiplexer {
    wrapper: Wrapper,
    clock: Clock,
    /// The last packet: what ends the sequence belongs to it.
    waiting: Option<Picture>,
}

#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Wrapper {
    Elementary,
    Program(program::Writer),
    Transport(transport::Writer),
}

/// A picture's part of the elementary stream.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Picture {
    data: Vec<u8>,
    times: Times,
    /// Can a decoder begin here?
    is_entry: bool,
}

/// When pictures are decoded and shown.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Clock {
    /// Numerator and denominator of the frame rate.
    frame_rate: (u64, u64),
    /// From the first byte to the first picture that is decoded, in units of 1/27 000 000 s.
    start: u64,
    /// Pictures decoded so far.
    count: u64,
    /// Frame periods by which pictures are shown later than they were decoded if none are in front of them: 1 where there
    /// may be B pictures (low_delay, 13818-2 6.3.5).
    reorder: u64,
}

impl Clock {
    fn next(&mut self, display_index: u64) -> Times {
        let (numerator, denominator) = self.frame_rate;
        let at = |frames: u64| self.start + frames * CLOCK * denominator / numerator;
        let times = Times { decoding: at(self.count), presentation: at(display_index + self.reorder) };
        self.count += 1;
        times
    }
}

/// Units of the system clock in a second (2.4.2.1).
const CLOCK: u64 = 27_000_000;

impl Multiplexer {
    /// For the packets of an encoder with these settings.
    pub fn new(container: Container, config: &Config) -> Self {
        let schedule = Schedule::new(config);
        let (numerator, denominator) = config.frame_rate.fraction();
        let clock = Clock {
            frame_rate: (numerator.into(), denominator.into()),
            start: schedule.start(),
            count: 0,
            reorder: u64::from(config.b_pictures > 0),
        };
        let wrapper = match container {
            Container::Elementary => Wrapper::Elementary,
            Container::Program => Wrapper::Program(program::Writer::new(schedule, config.frame_rate.fps())),
            Container::Transport => Wrapper::Transport(transport::Writer::new(schedule, config.standard)),
        };
        Self { wrapper, clock, waiting: None }
    }

    /// Takes the next packet in the order of coding, and gives what can be written now: all but the last picture.
    pub fn push(&mut self, packet: Packet) -> Vec<u8> {
        let times = self.clock.next(packet.display_index);
        let is_entry = packet.picture_type == crate::PictureType::I;
        let before = self.waiting.replace(Picture { data: packet.data, times, is_entry });
        before.map_or(Vec::new(), |picture| self.wrap(picture))
    }

    /// What is left, with `sequence_end` as the encoder gives it, and the end of the stream.
    pub fn finish(mut self, sequence_end: &[u8]) -> Vec<u8> {
        let mut out = match self.waiting.take() {
            Some(mut picture) => {
                picture.data.extend(sequence_end);
                self.wrap(picture)
            }
            None => sequence_end.to_vec(),
        };
        if let Wrapper::Program(_) = self.wrapper {
            out.extend(program::END);
        }
        out
    }

    fn wrap(&mut self, picture: Picture) -> Vec<u8> {
        match &mut self.wrapper {
            Wrapper::Elementary => picture.data,
            Wrapper::Program(writer) => writer.put(&picture),
            Wrapper::Transport(writer) => writer.put(&picture),
        }
    }
}
