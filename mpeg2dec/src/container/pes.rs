//! Headers of PES packets (13818-1, 2.4.3.6; 11172-1, 2.4.3.3).

/// Maximum size of a PES header in bytes: 9 and PES_header_data_length, or the stuffing of MPEG-1 with time stamps.
pub(super) const HEADER_MAX: usize = 9 + 255;

/// Header of a PES packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PesHeader {
    /// Number of bytes before the payload, from the start code on.
    pub length: usize,
    /// Presentation time stamp of 33 bits.
    pub time: Option<i64>,
}

/// Returns whether a stream identifier belongs to video.
pub(super) fn is_video(stream_id: u8) -> bool {
    stream_id & 0xf0 == 0xe0
}

impl PesHeader {
    /// Reads the header of a packet, from its start code on. `None` if more bytes are needed.
    ///
    /// An invalid header has no time stamp; its payload starts at the first byte that is no part of a header.
    pub fn read(packet: &[u8]) -> Option<Self> {
        let marker = *packet.get(6)?;
        if marker & 0xc0 == 0x80 {
            let (flags, data_length) = (*packet.get(7)?, *packet.get(8)?);
            let length = 9 + usize::from(data_length);
            let has_time = flags & 0x80 != 0 && data_length >= 5;
            let time = if has_time { Some(time_stamp(packet.get(9..14)?)) } else { None };
            return (packet.len() >= length).then_some(Self { length, time });
        }
        Self::read_mpeg1(packet)
    }

    fn read_mpeg1(packet: &[u8]) -> Option<Self> {
        let mut i = 6;
        while *packet.get(i)? == 0xff && i < HEADER_MAX - 16 {
            i += 1; // stuffing_byte
        }
        if packet.get(i)? & 0xc0 == 0x40 {
            i += 2; // STD_buffer_scale and STD_buffer_size
        }
        match packet.get(i)? >> 4 {
            2 => Some(Self { length: i + 5, time: Some(time_stamp(packet.get(i..i + 5)?)) }),
            3 => {
                let stamps = packet.get(i..i + 10)?;
                Some(Self { length: i + 10, time: Some(time_stamp(&stamps[..5])) })
            }
            0 => Some(Self { length: i + 1, time: None }),
            _ => Some(Self { length: i, time: None }),
        }
    }
}

/// Reads a time stamp from five bytes with marker bits.
fn time_stamp(bytes: &[u8]) -> i64 {
    let byte = |i: usize| i64::from(bytes[i]);
    (byte(0) >> 1 & 7) << 30 | byte(1) << 22 | (byte(2) >> 1) << 15 | byte(3) << 7 | byte(4) >> 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_stamps_of_both_standards() {
        let stamp = [0x21, 0x00, 0x05, 0xbf, 0x21]; // 90000
        let mpeg2 = [&[0, 0, 1, 0xe0, 0, 0, 0x80, 0x80, 5][..], &stamp, &[9]].concat();
        assert_eq!(PesHeader::read(&mpeg2), Some(PesHeader { length: 14, time: Some(90000) }));
        let mpeg1 = [&[0, 0, 1, 0xe0, 0, 20, 0xff, 0xff, 0x60, 0x2e][..], &stamp, &[9]].concat();
        assert_eq!(PesHeader::read(&mpeg1), Some(PesHeader { length: 15, time: Some(90000) }));
        (0..14).for_each(|length| assert_eq!(PesHeader::read(&mpeg2[..length]), None));
        assert_eq!(PesHeader::read(&[0, 0, 1, 0xe0, 0, 3, 0x0f]), Some(PesHeader { length: 7, time: None }));
    }
}
