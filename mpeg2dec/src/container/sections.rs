//! Program tables of transport streams (13818-1, 2.4.4).

/// Maximum size of a section in bytes.
const SECTION_MAX: usize = 1024;
/// stream_type of MPEG-1 and MPEG-2 video (Table 2-34).
const VIDEO_TYPES: [u8; 2] = [1, 2];

/// Collects the sections of one table from packets.
#[derive(Default)]
pub(super) struct SectionReader {
    bytes: Vec<u8>,
}

impl SectionReader {
    /// Accepts the payload of a packet. Returns a complete section.
    pub fn push(&mut self, payload: &[u8], starts: bool) -> Option<&[u8]> {
        let mut payload = payload;
        if starts {
            // pointer_field is the number of bytes before the section.
            let skipped = usize::from(*payload.first()?);
            payload = payload.get(1 + skipped..)?;
            self.bytes.clear();
        } else if self.bytes.is_empty() {
            return None;
        }
        let room = SECTION_MAX + 3 - self.bytes.len().min(SECTION_MAX + 3);
        self.bytes.extend_from_slice(&payload[..payload.len().min(room)]);
        let &[_, high, low] = self.bytes.first_chunk()?;
        let length = 3 + usize::from(u16::from_be_bytes([high & 0x0f, low]));
        self.bytes.get(..length)
    }
}

/// Returns the PID of the first program map table in a program association section.
pub(super) fn program_map_pid(section: &[u8]) -> Option<u16> {
    if *section.first()? != 0 {
        return None;
    }
    let programs = section.get(8..section.len().saturating_sub(4))?;
    // Program 0 refers to network information.
    let program = programs.chunks_exact(4).find(|program| program[..2] != [0, 0])?;
    Some(u16::from_be_bytes([program[2] & 0x1f, program[3]]))
}

/// Returns the PID of the first video stream in a program map section.
pub(super) fn video_pid(section: &[u8]) -> Option<u16> {
    if *section.first()? != 2 {
        return None;
    }
    let descriptors = usize::from(u16::from_be_bytes([*section.get(10)? & 0x0f, *section.get(11)?]));
    let mut streams = section.get(12 + descriptors..section.len().saturating_sub(4))?;
    while let [kind, high, low, info_high, info_low, rest @ ..] = streams {
        if VIDEO_TYPES.contains(kind) {
            return Some(u16::from_be_bytes([high & 0x1f, *low]));
        }
        streams = rest.get(usize::from(u16::from_be_bytes([info_high & 0x0f, *info_low]))..)?;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_lead_to_the_video() {
        let association = [0, 0, 0xb0, 13, 0, 1, 0xc1, 0, 0, 0, 1, 0xf0, 0x42, 1, 2, 3, 4];
        let mut reader = SectionReader::default();
        assert_eq!(reader.push(&association, true).and_then(program_map_pid), Some(0x1042));
        let map =
            [2, 0xb0, 23, 0, 1, 0xc1, 0, 0, 0xe1, 0, 0xf0, 0, 3, 0xe1, 1, 0xf0, 0, 2, 0xe1, 0, 0xf0, 0, 1, 2, 3, 4];
        assert_eq!(video_pid(&map), Some(0x100));
        for length in 0..map.len() {
            let _ = (video_pid(&map[..length]), program_map_pid(&map[..length]));
        }
        for length in 0..8 {
            assert_eq!(program_map_pid(&association[..length]), None);
        }
        // A section in two packets.
        assert_eq!(reader.push(&association[..6], true), None);
        assert_eq!(reader.push(&association[6..], false).and_then(program_map_pid), Some(0x1042));
    }
}
