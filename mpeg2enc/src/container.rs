//! Streams that say when each picture is due: program streams (`.mpg`) and transport streams (`.ts`) of ISO/IEC
//! 13818-1:2000, MP4 in fragments (`.mp4`) and Matroska (`.mkv`) around the elementary stream.
//!
//! Numbers of clauses and tables in this module are those of 13818-1, but for the last two, whose files name their own standards.
//! All of them are written from the first byte to the last, and nothing that was written changes later.

mod access_unit;
mod clock;
mod description;
mod matroska;
mod mp4;
mod pes;
mod program;
mod schedule;
mod stated;
mod transport;

use crate::{Config, PictureType, Rate, header::SEQUENCE_END_CODE};
pub use access_unit::AccessUnit;
use clock::Clock;
use description::Description;
use pes::StreamPicture;
use schedule::Schedule;
use stated::stated_rate;
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
    /// MP4 in fragments of a group of pictures each, `.mp4`: for editing programs, and players that show MPEG-2.
    Mp4,
    /// Matroska, `.mkv`: for players.
    Matroska,
}

impl Container {
    /// The container for a file's ending: `.m2v`, `.m1v`, `.mpv`; `.mpg`, `.mpeg`; `.vob`; `.ts`, `.m2t`; `.mp4`; `.mkv`.
    /// `None` for all others, and where there is no ending.
    ///
    /// ```
    /// use mpeg2enc::Container;
    /// assert_eq!(Container::of("film.TS".as_ref()), Some(Container::Transport));
    /// assert_eq!(Container::of("film.avi".as_ref()), None);
    /// assert_eq!(Container::of("film".as_ref()), None);
    /// ```
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "m2v" | "m1v" | "mpv" => Some(Self::Elementary),
            "mpg" | "mpeg" => Some(Self::Program),
            "vob" => Some(Self::Disc),
            "ts" | "m2t" => Some(Self::Transport),
            "mp4" => Some(Self::Mp4),
            "mkv" => Some(Self::Matroska),
            _ => None,
        }
    }
}

/// Wraps packets as they come out of an encoder.
///
/// Pictures are due at the frame rate. What arrives when is that of a decoder whose buffer is as large as the stream states,
/// filled at the bit rate that it states, as soon as there is room, and a second before it is needed at most. Everything is
/// there in time unless even the coarsest quantiser is not coarse enough, and at a constant rate just as vbv_delay states.
///
/// Packs of a program stream have 2048 bytes at most, those of a disc just as many, and each picture begins with one. In MP4 and
/// Matroska a group of pictures is written when the next one begins.
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
#[derive(Clone)]
#[must_use = "packets are wrapped by it"]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Multiplexer {
    wrapper: Wrapper,
    clock: Clock,
    /// Whether the first picture may state another bit rate and buffer than settings have: at a constant quantiser.
    is_open: bool,
    /// The last packet: what ends the sequence belongs to it.
    waiting: Option<StreamPicture>,
}

#[derive(Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Wrapper {
    Elementary,
    Program(program::Writer),
    Transport(transport::Writer),
    Mp4(mp4::Writer),
    Matroska(matroska::Writer),
}

impl Multiplexer {
    /// For the packets of an encoder with these settings.
    pub fn new(container: Container, config: &Config) -> Self {
        let schedule = Schedule::new(config);
        let (numerator, denominator) = config.stated_frame_rate().fraction();
        // Only streams of 13818-1 have times of bytes, and only in Matroska are there none of decoding.
        let start = match container {
            Container::Mp4 | Container::Matroska => 0,
            _ => schedule.start(),
        };
        let reorder = u64::from(config.b_pictures > 0 && container != Container::Matroska);
        let pulldown = config.pulldown;
        let clock = Clock { frame_rate: (numerator.into(), denominator.into()), start, count: 0, reorder, pulldown };
        let wrapper = match container {
            Container::Elementary => Wrapper::Elementary,
            Container::Program | Container::Disc => {
                let is_disc = container == Container::Disc;
                Wrapper::Program(program::Writer::new(schedule, config.stated_frame_rate().fps(), is_disc))
            }
            Container::Transport => Wrapper::Transport(transport::Writer::new(schedule, config)),
            Container::Mp4 => {
                let description = Description::new(config);
                let begin = reorder * description.period();
                Wrapper::Mp4(mp4::Writer::new(description, begin))
            }
            Container::Matroska => Wrapper::Matroska(matroska::Writer::new(Description::new(config))),
        };
        Self { wrapper, clock, is_open: config.rate == Rate::ConstantQuantiser, waiting: None }
    }

    /// States at the beginning of the file, where the container can, how long `count` pictures are. A film of fewer states too much.
    pub fn with_pictures(mut self, count: u64) -> Self {
        match &mut self.wrapper {
            Wrapper::Mp4(writer) => writer.set_pictures(count),
            Wrapper::Matroska(writer) => writer.set_pictures(count),
            Wrapper::Elementary | Wrapper::Program(_) | Wrapper::Transport(_) => {}
        }
        self
    }

    /// Takes the next picture in the order of coding, a [`Packet`](crate::Packet) or one of a stream that was written before, and
    /// gives what can be written now: all but that picture.
    pub fn push(&mut self, picture: impl Into<AccessUnit>) -> Vec<u8> {
        let AccessUnit { data, display_index, picture_type } = picture.into();
        if std::mem::take(&mut self.is_open)
            && let Some((bit_rate, buffer_size)) = stated_rate(&data)
        {
            self.restate(bit_rate, buffer_size);
        }
        let times = self.clock.next(display_index);
        let (is_entry, is_disposable) = (picture_type == PictureType::I, picture_type == PictureType::B);
        let before = self.waiting.replace(StreamPicture { data, times, is_entry, is_disposable });
        before.map_or(Vec::new(), |picture| self.wrap(picture))
    }

    /// Bytes that [`finish`](Self::finish) would give now, after the sequence_end_code that ends any stream (13818-2, 6.2.1): for a file that
    /// is to end here in case no more comes. Nothing before the first picture.
    #[must_use]
    pub fn ending(&self) -> Vec<u8> {
        match self.waiting {
            Some(_) => self.clone().finish(&[0, 0, 1, SEQUENCE_END_CODE]),
            None => Vec::new(),
        }
    }

    /// The remaining bytes, with `sequence_end` as the encoder gives it, and the end of the stream.
    pub fn finish(mut self, sequence_end: &[u8]) -> Vec<u8> {
        let Some(mut picture) = self.waiting.take() else {
            let end: &[u8] = if matches!(self.wrapper, Wrapper::Program(_)) { &program::END } else { &[] };
            return [sequence_end, end].concat();
        };
        picture.data.extend(sequence_end);
        match self.wrapper {
            Wrapper::Elementary => picture.data,
            Wrapper::Program(mut writer) => writer.put(&picture, &program::END),
            Wrapper::Transport(mut writer) => [writer.put(&picture), writer.finish()].concat(),
            Wrapper::Mp4(mut writer) => [writer.put(picture), writer.finish()].concat(),
            Wrapper::Matroska(mut writer) => [writer.put(picture), writer.finish()].concat(),
        }
    }

    /// Wraps for a decoder with this bit rate and buffer.
    fn restate(&mut self, bit_rate: u32, buffer_size: u32) {
        match &mut self.wrapper {
            Wrapper::Program(writer) => self.clock.start = writer.restate(bit_rate, buffer_size),
            Wrapper::Transport(writer) => self.clock.start = writer.restate(bit_rate, buffer_size),
            Wrapper::Mp4(writer) => writer.restate(buffer_size),
            Wrapper::Elementary | Wrapper::Matroska(_) => {}
        }
    }

    fn wrap(&mut self, picture: StreamPicture) -> Vec<u8> {
        match &mut self.wrapper {
            Wrapper::Elementary => picture.data,
            Wrapper::Program(writer) => writer.put(&picture, &[]),
            Wrapper::Transport(writer) => writer.put(&picture),
            Wrapper::Mp4(writer) => writer.put(picture),
            Wrapper::Matroska(writer) => writer.put(picture),
        }
    }
}

impl fmt::Debug for Multiplexer {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Multiplexer").finish_non_exhaustive()
    }
}
