//! Packets of the image viewer tev: length, type and content, in little-endian order.
//!
//! | packet | content after the length and the type |
//! |---|---|
//! | `CreateImage`, 4 | focus, name, width, height, number of channels, names of channels |
//! | `UpdateImageV3`, 6 | focus, name, number and names of channels, x, y, width, height, offsets, strides, samples |
//!
//! Lengths include themselves and have 32 bits, as all numbers except the offsets and strides with 64 bits. A focus is
//! one byte. Texts end in a zero byte.

use plane::Plane;
use std::ops::Range;

const CREATE_IMAGE: u8 = 4;
const UPDATE_IMAGE: u8 = 6;
/// Channels of a picture, in the order of their samples.
const CHANNELS: [&str; 3] = ["R", "G", "B"];
/// Maximum size of a packet's samples \[bytes\]: tev has a buffer of 1 MiB, which also contains the other fields.
const LARGEST: usize = (1 << 20) - (1 << 14);

/// Unfinished packet.
struct ViewerPacket(Vec<u8>);

impl ViewerPacket {
    /// Begins a packet of an image, with space for its length.
    fn new(kind: u8, has_focus: bool, name: &str) -> Self {
        let mut packet = Self(vec![0, 0, 0, 0, kind, has_focus.into()]);
        packet.text(name);
        packet
    }

    /// Appends a text without its zero bytes.
    fn text(&mut self, text: &str) {
        self.0.extend(text.bytes().filter(|&byte| byte != 0));
        self.0.push(0);
    }

    fn numbers(&mut self, numbers: &[usize]) {
        for &number in numbers {
            let number = i32::try_from(number).expect("sizes of pictures are limited");
            self.0.extend(number.to_le_bytes());
        }
    }

    fn channels(&mut self) {
        self.numbers(&[CHANNELS.len()]);
        CHANNELS.iter().for_each(|name| self.text(name));
    }

    /// Returns the bytes of the packet, with its length.
    fn finish(mut self) -> Vec<u8> {
        let length = u32::try_from(self.0.len()).expect("packets are short");
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

/// Returns the packet that creates an image, or replaces the image of this name.
pub(super) fn create_image(name: &str, width: usize, height: usize) -> Vec<u8> {
    let mut packet = ViewerPacket::new(CREATE_IMAGE, true, name);
    packet.numbers(&[width, height]);
    packet.channels();
    packet.finish()
}

/// Returns the packets that fill an image, each with some rows.
pub(super) fn update_image<'a>(name: &'a str, radiance: &'a Plane<[f32; 3]>) -> impl Iterator<Item = Vec<u8>> + 'a {
    let height = radiance.height();
    let rows = (LARGEST / (radiance.width() * size_of::<[f32; 3]>()).max(1)).max(1);
    (0..height).step_by(rows).map(move |first| update_rows(name, radiance, first..height.min(first + rows)))
}

fn update_rows(name: &str, radiance: &Plane<[f32; 3]>, rows: Range<usize>) -> Vec<u8> {
    let mut packet = ViewerPacket::new(UPDATE_IMAGE, false, name);
    packet.channels();
    packet.numbers(&[0, rows.start, radiance.width(), rows.len()]);

    // The channels of a pixel are adjacent: offsets 0, 1, 2, and a stride of 3 floats.
    for number in [0_i64, 1, 2, 3, 3, 3] {
        packet.0.extend(number.to_le_bytes());
    }
    for row in rows {
        for sample in radiance.row(row).as_flattened() {
            packet.0.extend(sample.to_le_bytes());
        }
    }
    packet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_as_in_pbrt_and_tev() {
        let created = create_image("a\0b", 2, 1);
        let expected = b"\x1b\0\0\0\x04\x01ab\0\x02\0\0\0\x01\0\0\0\x03\0\0\0R\0G\0B\0";
        assert_eq!(created[..], expected[..]);
        let updated: Vec<_> = update_image("a", &Plane::from_fn(1, 1, |_, _| [1.0, -2.0, 0.5])).collect();
        let mut expected = b"\x5e\0\0\0\x06\0a\0\x03\0\0\0R\0G\0B\0".to_vec();
        expected.extend(b"\0\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0");
        for number in [0, 1, 2, 3, 3, 3] {
            expected.extend([number, 0, 0, 0, 0, 0, 0, 0]);
        }
        expected.extend(b"\0\0\x80\x3f\0\0\0\xc0\0\0\0\x3f");
        assert_eq!(updated, [expected]);
    }

    #[test]
    fn large_pictures_are_sent_in_rows() {
        let picture = Plane::from_fn(1000, 200, |x, y| [x as f32, y as f32, 0.0]);
        let packets: Vec<_> = update_image("name", &picture).collect();
        assert!(packets.len() > 2 && packets.iter().all(|packet| packet.len() <= 1 << 20));
        let row = |packet: &[u8], at: usize| i32::from_le_bytes(packet[at..at + 4].try_into().unwrap());
        // The rows follow the type, the focus, the name, the number of channels, their names and x.
        let first_row = 4 + 1 + 1 + 5 + 4 + 6 + 4;
        let mut next = 0;
        for packet in &packets {
            assert_eq!(row(packet, first_row), next);
            next += row(packet, first_row + 8);
        }
        assert_eq!(next, 200);
    }
}
