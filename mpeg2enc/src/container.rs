//! Containers with timestamps: program streams (`.mpg`) and transport streams (`.ts`) of ISO/IEC 13818-1:2000, fragmented MP4
//! (`.mp4`) and Matroska (`.mkv`).
//!
//! Clause and table numbers in this module refer to 13818-1, except in the files of MP4 and Matroska, which name their own
//! standards. All files are written sequentially; bytes already written never change.

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

/// Container of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Container {
    /// No container: the video elementary stream, `.m2v`.
    #[default]
    Elementary,
    /// A program stream, `.mpg`, for files.
    Program,
    /// A program stream with empty navigation packs, `.vob`, for DVD-Video authoring programs, which fill these packs.
    Disc,
    /// A transport stream, `.ts`, for lossy channels such as broadcast.
    Transport,
    /// MP4 with one fragment per group of pictures, `.mp4`, for editing programs and players that support MPEG-2.
    Mp4,
    /// Matroska, `.mkv`, for players.
    Matroska,
}

impl Container {
    /// Returns the container for a file extension: `.m2v`, `.m1v`, `.mpv`; `.mpg`, `.mpeg`; `.vob`; `.ts`, `.m2t`; `.mp4`;
    /// `.mkv`. `None` for other extensions, or without an extension.
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

/// Wraps an encoder's packets in a container.
///
/// Pictures are due at the frame rate. Bytes arrive at a decoder with the stream's buffer size and bit rate. They arrive as soon
/// as the buffer has room, at most a second early. All pictures are in time unless even the coarsest quantiser takes too many
/// bits. At a constant rate the times agree with vbv_delay.
///
/// Packs of a program stream have at most 2048 bytes, and exactly 2048 on a disc; each picture begins with a new pack. In MP4
/// and Matroska a group of pictures is written when the next group begins.
///
/// ```
/// use mpeg2enc::{Config, Container, FrameRate, SuppliedMotion, Multiplexer, Picture};
///
/// let config = Config::new(64, 48, FrameRate::FPS_25);
/// let mut multiplexer = Multiplexer::new(Container::Program, &config);
/// let mut encoder = config.encoder()?;
/// let mut file = Vec::new();
/// for _ in 0..3 {
///     for packet in encoder.push(&Picture::black(64, 48), SuppliedMotion::default()) {
///         file.extend(multiplexer.push(packet));
///     }
/// }
/// file.extend(multiplexer.finish(&encoder.finish().end));
/// assert_eq!(file[..4], [0, 0, 1, 0xba]); // pack_start_code
/// # Ok::<(), mpeg2enc::ConfigError>(())
/// ```
#[derive(Clone)]
#[must_use = "a multiplexer only wraps packets pushed to it"]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Multiplexer {
    wrapper: Wrapper,
    clock: Clock,
    /// Whether the first picture may contain another bit rate and buffer size than the settings, as at a constant quantiser.
    is_open: bool,
    /// The last packet, delayed because the end of the sequence is appended to it.
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
    /// Makes a multiplexer for the packets of an encoder with these settings.
    pub fn new(container: Container, config: &Config) -> Self {
        let schedule = Schedule::new(config);
        let (numerator, denominator) = config.stated_frame_rate().fraction();
        // Only streams of 13818-1 have arrival times of bytes, and Matroska has no decoding times.
        let start = match container {
            Container::Mp4 | Container::Matroska => 0,
            _ => schedule.start(),
        };
        // Matroska has only display times, so reordering causes no delay.
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
                // The edit list skips the time before the first displayed picture.
                let begin = reorder * description.period();
                Wrapper::Mp4(mp4::Writer::new(description, begin))
            }
            Container::Matroska => Wrapper::Matroska(matroska::Writer::new(Description::new(config))),
        };
        Self { wrapper, clock, is_open: config.rate == Rate::ConstantQuantiser, waiting: None }
    }

    /// Writes the duration of `count` pictures at the beginning of the file, if the container supports it. If the film becomes
    /// shorter, this duration is too long.
    pub fn with_pictures(mut self, count: u64) -> Self {
        match &mut self.wrapper {
            Wrapper::Mp4(writer) => writer.set_pictures(count),
            Wrapper::Matroska(writer) => writer.set_pictures(count),
            Wrapper::Elementary | Wrapper::Program(_) | Wrapper::Transport(_) => {}
        }
        self
    }

    /// Accepts the next picture in the order of coding: a [`Packet`](crate::Packet), or an access unit of an existing stream.
    /// Returns the bytes that can be written now, which exclude that picture.
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

    /// Returns the bytes that [`finish`](Self::finish) would return now, with the sequence_end_code that ends any stream
    /// (13818-2, 6.2.1). They complete a file that ends after the last picture. Before the first picture they are empty.
    #[must_use]
    pub fn ending(&self) -> Vec<u8> {
        match self.waiting {
            Some(_) => self.clone().finish(&[0, 0, 1, SEQUENCE_END_CODE]),
            None => Vec::new(),
        }
    }

    /// Returns the remaining bytes, with the encoder's `sequence_end`, and ends the stream.
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

    /// Adapts the arrival times to a decoder with this bit rate and buffer size.
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
