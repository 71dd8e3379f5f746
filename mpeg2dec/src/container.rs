//! Containers: program and transport streams (ISO/IEC 13818-1, 11172-1).

mod clock; // time stamps
mod pes; // packet headers
mod probe; // recognizes formats
mod program; // program streams
mod sections; // tables of transport streams
mod transport; // transport streams

use probe::probe;
use program::ProgramDemuxer;
use transport::TransportDemuxer;

/// Format of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StreamFormat {
    /// Video without a container.
    Elementary,
    /// Program stream of MPEG-1 or MPEG-2, such as `.mpg` and `.vob`.
    Program,
    /// Transport stream, such as `.ts` and `.m2ts`.
    Transport {
        /// Bytes of a packet: 188, 192 (with a time code) or 204 (with error correction).
        packet_size: usize,
    },
}

/// Bytes of the first video stream of a container.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DemuxedData<'a> {
    /// Bytes of the elementary stream.
    pub bytes: &'a [u8],
    /// Presentation time of the first picture that starts in these bytes, in units of 1/90000 s.
    pub time: Option<i64>,
}

/// Extracts the first video stream from a container.
///
/// The format is recognized from at most 64 KiB. Bytes without a known format are passed on as an elementary stream.
///
/// ```
/// use mpeg2dec::{Demuxer, StreamFormat};
///
/// let mut demuxer = Demuxer::default();
/// let mut stream = Vec::new();
/// demuxer.push(include_bytes!("../tests/data/small.m2v"), |data| stream.extend_from_slice(data.bytes));
/// assert_eq!(demuxer.format(), Some(StreamFormat::Elementary));
/// assert_eq!(stream, include_bytes!("../tests/data/small.m2v"));
/// ```
#[derive(Default)]
pub struct Demuxer {
    state: DemuxerState,
    /// Number of missing packets of the streams that have ended.
    lost_packets: u64,
}

/// State of a demultiplexer.
enum DemuxerState {
    /// Bytes before the format is recognized.
    Unknown(FirstBytes),
    Elementary,
    Program(Box<ProgramDemuxer>),
    Transport(Box<TransportDemuxer>),
}

/// First bytes of a stream.
#[derive(Default)]
struct FirstBytes {
    bytes: Vec<u8>,
    /// Number of bytes at which recognition is tried again. It doubles, because each try reads all bytes.
    next_probe: usize,
}

impl FirstBytes {
    /// Adds bytes and returns the format, if it is recognized.
    fn add(&mut self, bytes: &[u8], is_last: bool) -> Option<StreamFormat> {
        self.bytes.extend_from_slice(bytes);
        let is_last = is_last || self.bytes.len() >= probe::BYTES_MAX;
        if self.bytes.len() < self.next_probe && !is_last {
            return None;
        }
        self.next_probe = (2 * self.bytes.len()).max(4);
        probe(&self.bytes, is_last)
    }
}

impl Default for DemuxerState {
    fn default() -> Self {
        Self::Unknown(FirstBytes::default())
    }
}

impl Demuxer {
    /// Accepts bytes, in pieces of any size, and passes the data of the video stream to `receive`.
    pub fn push(&mut self, bytes: &[u8], mut receive: impl FnMut(DemuxedData)) {
        self.extract(bytes, &mut receive);
    }

    fn extract(&mut self, bytes: &[u8], receive: &mut dyn FnMut(DemuxedData)) {
        match &mut self.state {
            DemuxerState::Unknown(start) => {
                // Copy only the bytes needed for recognition.
                let (head, rest) = bytes.split_at(bytes.len().min(probe::BYTES_MAX));
                let Some(format) = start.add(head, !rest.is_empty()) else { return };
                self.begin(format, receive);
                self.extract(rest, receive);
            }
            DemuxerState::Elementary if bytes.is_empty() => {}
            DemuxerState::Elementary => receive(DemuxedData { bytes, time: None }),
            DemuxerState::Program(program) => program.push(bytes, receive),
            DemuxerState::Transport(transport) => transport.push(bytes, receive),
        }
    }

    /// Processes the collected bytes in a format.
    fn begin(&mut self, format: StreamFormat, receive: &mut dyn FnMut(DemuxedData)) {
        let state = match format {
            StreamFormat::Elementary => DemuxerState::Elementary,
            StreamFormat::Program => DemuxerState::Program(Box::default()),
            StreamFormat::Transport { packet_size } => {
                DemuxerState::Transport(Box::new(TransportDemuxer::new(packet_size)))
            }
        };
        if let DemuxerState::Unknown(start) = std::mem::replace(&mut self.state, state) {
            self.extract(&start.bytes, receive);
        }
    }

    /// Ends the stream. The demultiplexer then accepts another one.
    pub fn flush(&mut self, mut receive: impl FnMut(DemuxedData)) {
        if let DemuxerState::Unknown(start) = &mut self.state
            && let Some(format) = start.add(&[], true)
        {
            self.begin(format, &mut receive);
        }
        match &mut self.state {
            DemuxerState::Program(program) => program.flush(&mut receive),
            DemuxerState::Transport(transport) => transport.flush(&mut receive),
            DemuxerState::Unknown(_) | DemuxerState::Elementary => {}
        }
        self.lost_packets = self.lost_packets();
        self.state = DemuxerState::default();
    }

    /// Returns the number of video packets that are missing in transport streams, modulo 16 in each gap. Other formats do not
    /// number their packets.
    #[must_use]
    pub fn lost_packets(&self) -> u64 {
        let current = if let DemuxerState::Transport(transport) = &self.state { transport.lost_packets() } else { 0 };
        self.lost_packets + current
    }

    /// Returns the format of the stream, after its first bytes were recognized.
    #[must_use]
    pub fn format(&self) -> Option<StreamFormat> {
        match &self.state {
            DemuxerState::Unknown(_) => None,
            DemuxerState::Elementary => Some(StreamFormat::Elementary),
            DemuxerState::Program(_) => Some(StreamFormat::Program),
            DemuxerState::Transport(transport) => {
                Some(StreamFormat::Transport { packet_size: transport.packet_size() })
            }
        }
    }
}
