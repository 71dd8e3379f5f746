//! Pictures as input of containers.

use crate::{Packet, PictureType};

/// A coded picture and the headers that precede it (13818-1, 2.1.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessUnit {
    /// Bytes of the elementary stream; an I picture begins with sequence and group headers.
    pub data: Vec<u8>,
    /// Position of the picture in display order, from 0.
    pub display_index: u64,
    /// Picture type: I, P or B.
    pub picture_type: PictureType,
}

impl From<Packet> for AccessUnit {
    fn from(packet: Packet) -> Self {
        let Packet { data, display_index, picture_type, .. } = packet;
        Self { data, display_index, picture_type }
    }
}
