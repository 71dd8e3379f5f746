//! Transport streams (13818-1, 2.4).

use super::{
    DemuxedData,
    clock::TimeUnwrapper,
    pes::{HEADER_MAX, PesHeader, is_video},
    probe::SYNC,
    sections::{SectionReader, program_map_pid, video_pid},
};

/// Bytes of a packet without a time code or error correction.
const PACKET: usize = 188;
/// PID of the program association table.
const ASSOCIATION_PID: u16 = 0;

/// Demultiplexer of transport streams.
pub(super) struct TransportDemuxer {
    packet_size: usize,
    /// Whether a packet ended at the start of the next bytes.
    is_synchronous: bool,
    /// Bytes of an incomplete packet.
    buffer: Vec<u8>,
    clock: TimeUnwrapper,
    association: SectionReader,
    map: SectionReader,
    map_pid: Option<u16>,
    /// PID of the video stream, from the program map table.
    video_pid: Option<u16>,
    /// PID of the first video packet, if there is no program map table.
    guessed_pid: Option<u16>,
    /// continuity_counter of the last video packet with payload.
    counter: Option<u8>,
    /// Number of video packets that are missing, from gaps in continuity_counter, whose values repeat after 16 packets.
    lost: u64,
    /// Bytes of an incomplete PES header.
    header: Vec<u8>,
    /// Whether the header of the PES packet is incomplete.
    in_header: bool,
    time: Option<i64>,
}

/// Payload of a transport packet.
struct TransportPayload<'a> {
    pid: u16,
    /// payload_unit_start_indicator.
    starts: bool,
    counter: u8,
    /// discontinuity_indicator: the counter starts again.
    restarts: bool,
    bytes: &'a [u8],
}

impl<'a> TransportPayload<'a> {
    /// Reads a packet of 188 bytes. `None` if it has no usable payload.
    fn read(packet: &'a [u8]) -> Option<Self> {
        let &[_, flags, low, control] = packet.first_chunk()?;
        let (has_error, is_scrambled) = (flags & 0x80 != 0, control & 0xc0 != 0);
        let has_payload = control & 0x10 != 0;
        if has_error || is_scrambled || !has_payload {
            return None;
        }
        // Skip the adaptation field.
        let field = if control & 0x20 != 0 { 1 + usize::from(*packet.get(4)?) } else { 0 };
        Some(Self {
            pid: u16::from_be_bytes([flags & 0x1f, low]),
            starts: flags & 0x40 != 0,
            counter: control & 0x0f,
            restarts: field > 1 && packet.get(5)? & 0x80 != 0,
            bytes: packet.get(4 + field..).filter(|bytes| !bytes.is_empty())?,
        })
    }
}

impl TransportDemuxer {
    pub fn new(packet_size: usize) -> Self {
        Self {
            packet_size,
            is_synchronous: false,
            buffer: Vec::new(),
            clock: TimeUnwrapper::default(),
            association: SectionReader::default(),
            map: SectionReader::default(),
            map_pid: None,
            video_pid: None,
            guessed_pid: None,
            counter: None,
            lost: 0,
            header: Vec::new(),
            in_header: false,
            time: None,
        }
    }

    pub fn packet_size(&self) -> usize {
        self.packet_size
    }

    pub fn lost_packets(&self) -> u64 {
        self.lost
    }

    pub fn push(&mut self, bytes: &[u8], receive: &mut dyn FnMut(DemuxedData)) {
        for piece in bytes.chunks(64 * self.packet_size) {
            let mut buffer = std::mem::take(&mut self.buffer);
            buffer.extend_from_slice(piece);
            let used = self.packets(&buffer, receive);
            buffer.drain(..used);
            self.buffer = buffer;
        }
    }

    /// Processes a last packet without the bytes that follow it.
    pub fn flush(&mut self, receive: &mut dyn FnMut(DemuxedData)) {
        let buffer = std::mem::take(&mut self.buffer);
        if let Some(packet) = buffer.get(..PACKET).filter(|packet| packet[0] == SYNC) {
            self.packet(packet, receive);
        }
    }

    /// Processes complete packets and returns the number of their bytes.
    fn packets(&mut self, bytes: &[u8], receive: &mut dyn FnMut(DemuxedData)) -> usize {
        let mut position = 0;
        // After other bytes, a packet is accepted only if a sync byte follows it too.
        while let Some(unit) = bytes.get(position..position + self.packet_size) {
            let packet = &unit[..PACKET];
            if packet[0] == SYNC && !self.is_synchronous {
                match bytes.get(position + self.packet_size) {
                    Some(&next) => self.is_synchronous = next == SYNC,
                    None => break,
                }
            }
            self.is_synchronous &= packet[0] == SYNC;
            if self.is_synchronous {
                self.packet(packet, receive);
            }
            position += if self.is_synchronous { self.packet_size } else { 1 };
        }
        position
    }

    fn packet(&mut self, packet: &[u8], receive: &mut dyn FnMut(DemuxedData)) {
        let Some(payload) = TransportPayload::read(packet) else { return };
        if payload.pid == ASSOCIATION_PID {
            if let Some(section) = self.association.push(payload.bytes, payload.starts) {
                self.map_pid = program_map_pid(section).or(self.map_pid);
            }
        } else if Some(payload.pid) == self.map_pid {
            if let Some(section) = self.map.push(payload.bytes, payload.starts) {
                self.video_pid = video_pid(section).or(self.video_pid);
            }
        } else if self.is_video(&payload) {
            // Packets may be sent twice.
            if self.counter != Some(payload.counter) {
                let last = self.counter.replace(payload.counter).filter(|_| !payload.restarts);
                self.lost += last.map_or(0, |last| u64::from(payload.counter.wrapping_sub(last + 1) & 0x0f));
                self.video(payload, receive);
            }
        }
    }

    /// Returns whether a packet belongs to the video stream.
    fn is_video(&mut self, payload: &TransportPayload) -> bool {
        if self.video_pid.is_none() && self.guessed_pid.is_none() {
            let is_pes = payload.starts && payload.bytes.starts_with(&[0, 0, 1]);
            if is_pes && payload.bytes.get(3).copied().is_some_and(is_video) {
                self.guessed_pid = Some(payload.pid);
            }
        }
        Some(payload.pid) == self.video_pid.or(self.guessed_pid)
    }

    fn video(&mut self, payload: TransportPayload, receive: &mut dyn FnMut(DemuxedData)) {
        let bytes = payload.bytes;
        if payload.starts {
            self.header.clear();
            self.in_header = true;
        } else if !self.in_header {
            return self.pass_on(bytes, receive);
        }
        // Headers may continue in the next packet.
        let before = self.header.len();
        self.header.extend_from_slice(bytes);
        let Some(header) = PesHeader::read(&self.header) else {
            self.in_header = self.header.len() <= HEADER_MAX;
            return;
        };
        self.in_header = false;
        self.time = header.time.map(|stamp| self.clock.unwrap(stamp));
        self.pass_on(bytes.get(header.length.saturating_sub(before)..).unwrap_or_default(), receive);
    }

    fn pass_on(&mut self, bytes: &[u8], receive: &mut dyn FnMut(DemuxedData)) {
        if !bytes.is_empty() {
            receive(DemuxedData { bytes, time: self.time.take() });
        }
    }
}
