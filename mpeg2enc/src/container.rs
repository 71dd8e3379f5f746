//! Streams that say when each picture is due: program streams (`.mpg`) and transport streams (`.ts`) of ISO/IEC
//! 13818-1:2000 around the elementary stream.
//!
//! Numbers of clauses and tables in this module are those of that standard.

mod access_unit;
mod clock;
mod pes;
mod program;
mod schedule;
mod transport;

use crate::{Config, header::SEQUENCE_END_CODE};
pub use access_unit::AccessUnit;
use clock::Clock;
use pes::Picture;
use schedule::Schedule;
use std::{fmt, path::Path};

/// The container around a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Container {
    /// Nothing: the video elementary stream itself, `.m2v`.
    #[default]
    Elementary,
    /// A program stream, `.mpg`: for files.
    Program,
    /// A program stream with empty packs for navigation, `.vob`: for programs that author DVD-Video, which fill them.
    Disc,
    /// A transport stream, `.ts`: for where bytes get lost.
    Transport,
}

impl Container {
    /// Bytes that end a stream in this container, for one that is cut short after any picture: sequence_end_code (H.262, 6.2.1),
    /// MPEG_program_end_code (H.222.0, 2.5.3.2), nothing for a transport stream.
    #[must_use]
    pub fn end_code(self) -> &'static [u8] {
        match self {
            Self::Elementary => &[0, 0, 1, SEQUENCE_END_CODE],
            Self::Program | Self::Disc => &program::END,
            Self::Transport => &[],
        }
    }

    /// The container for a file's ending: `.m2v`, `.m1v`, `.mpv` or no ending; `.mpg`, `.mpeg`; `.vob`; `.ts`,
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
            "mpg" | "mpeg" => Some(Self::Program),
            "vob" => Some(Self::Disc),
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
/// Packs of a program stream have 2048 bytes, and each picture begins with one.
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
#[must_use = "packets are wrapped by it"]
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
            Container::Program | Container::Disc => {
                let is_disc = container == Container::Disc;
                Wrapper::Program(program::Writer::new(schedule, config.frame_rate.fps(), is_disc))
            }
            Container::Transport => Wrapper::Transport(transport::Writer::new(schedule, config.standard)),
        };
        Self { wrapper, clock, waiting: None }
    }

    /// Takes the next picture in the order of coding, a [`Packet`](crate::Packet) or one of a stream that was written before, and
    /// gives what can be written now: all but that picture.
    pub fn push(&mut self, picture: impl Into<AccessUnit>) -> Vec<u8> {
        let AccessUnit { data, display_index, picture_type } = picture.into();
        let times = self.clock.next(display_index);
        let is_entry = picture_type == crate::PictureType::I;
        let before = self.waiting.replace(Picture { data, times, is_entry });
        before.map_or(Vec::new(), |picture| self.wrap(picture))
    }

    /// The remaining bytes, with `sequence_end` as the encoder gives it, and the end of the stream.
    pub fn finish(mut self, sequence_end: &[u8]) -> Vec<u8> {
        let mut picture = self.waiting.take();
        if let Some(picture) = &mut picture {
            picture.data.extend(sequence_end);
        }
        match (self.wrapper, picture) {
            (Wrapper::Elementary, Some(picture)) => picture.data,
            (Wrapper::Program(mut writer), Some(picture)) => writer.put(&picture, &program::END),
            (Wrapper::Transport(mut writer), Some(picture)) => {
                let mut out = writer.put(&picture);
                out.extend(writer.finish());
                out
            }
            (Wrapper::Program(_), None) => [sequence_end, &program::END].concat(),
            (_, None) => sequence_end.to_vec(),
        }
    }

    fn wrap(&mut self, picture: Picture) -> Vec<u8> {
        match &mut self.wrapper {
            Wrapper::Elementary => picture.data,
            Wrapper::Program(writer) => writer.put(&picture, &[]),
            Wrapper::Transport(writer) => writer.put(&picture),
        }
    }
}

impl fmt::Debug for Multiplexer {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Multiplexer").finish_non_exhaustive()
    }
}
