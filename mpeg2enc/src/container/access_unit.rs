//! Pictures as containers take them.

use crate::{Packet, PictureType};

/// A coded picture with the headers in front of it (13818-1, 2.1.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessUnit {
    /// Its part of the elementary stream; an I picture's begins with sequence and group headers.
    pub data: Vec<u8>,
    /// Place of the picture among all of the stream in the order in which they are shown, from 0.
    pub display_index: u64,
    /// I, P or B.
    pub picture_type: PictureType,
}

impl From<Packet> for AccessUnit {
    fn from(packet: Packet) -> Self {
        let Packet { data, display_index, picture_type, .. } = packet;
        Self { data, display_index, picture_type }
    }
}
