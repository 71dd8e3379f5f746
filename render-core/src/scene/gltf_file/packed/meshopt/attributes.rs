//! "Mode 0: attributes": byte-wise differences between neighboring elements, in groups of 16 that use as few bits as
//! possible.

use super::{Fault, LONG, SHORT};

/// Number of elements in a group.
const GROUP: usize = 16;
/// Maximum number of elements in a block.
const BLOCK: usize = 256;
/// Minimum size of the tail after the blocks \[bytes\], by version.
const TAIL: [usize; 2] = [32, 24];
/// Bits per difference in version 0, by the group's header.
const BITS_V0: [u8; 4] = [0, 2, 4, 8];
/// Bits per difference in version 1, by control mode and by the group's header.
const BITS_V1: [[u8; 4]; 2] = [[0, 1, 2, 4], [1, 2, 4, 8]];

/// Decodes `count` elements of `stride` bytes, a multiple of 4 up to 256.
pub(super) fn decode(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Fault> {
    // Read the version, and the tail with the base element and the channel modes.
    let version = match data.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        Some(_) => return Err("has an unknown version"),
        None => return Err(SHORT),
    };
    let channels = if version == 1 { stride / 4 } else { 0 };
    let tail = (stride + channels).max(TAIL[version]);
    let body = data.len().checked_sub(1 + tail).ok_or(SHORT)?;
    let (base, modes) = data[data.len() - stride - channels..].split_at(stride);

    // Each block has at least one byte per four columns. In version 0, it has at least one byte per column.
    let block = ((8192 / stride) & !(GROUP - 1)).min(BLOCK);
    let least = if version == 1 { stride / 4 } else { stride };
    if count.div_ceil(block).saturating_mul(least) > body {
        return Err(SHORT);
    }

    // Decode block by block. A channel has four byte columns, which are then interleaved to elements.
    let mut reader = BlockReader { data, at: 1, end: 1 + body };
    let mut last = [[0; 4]; 64];
    last[..stride / 4].copy_from_slice(base.as_chunks().0);
    let mut out = vec![0; count * stride];
    let mut columns = [[0; BLOCK]; 4];
    for part in out.chunks_mut(block * stride) {
        let elements = part.len() / stride;
        // Decode the four byte columns of each channel, by the control bits of version 1.
        let control = if version == 1 { reader.take(stride / 4)? } else { &[] };
        for channel in 0..stride / 4 {
            for (byte, column) in columns.iter_mut().enumerate() {
                let column = &mut column[..elements.next_multiple_of(GROUP)];
                match control.get(channel).map(|control| (control >> (2 * byte)) & 3) {
                    None => reader.groups(&BITS_V0, column)?,
                    Some(2) => column.fill(0),
                    Some(3) => column[..elements].copy_from_slice(reader.take(elements)?),
                    Some(mode) => reader.groups(&BITS_V1[usize::from(mode)], column)?,
                }
            }
            let last = &mut last[channel];
            let places = part[4 * channel..].chunks_mut(stride);
            // Accumulate the differences, by the channel's mode.
            match modes.get(channel).copied().unwrap_or(0) {
                0 => add_bytes(&columns, last, places),
                1 => add_shorts(&columns, last, places),
                mode if mode & 15 == 2 => mix_words(&columns, u32::from(mode >> 4), last, places),
                _ => return Err("has an unknown channel mode"),
            }
        }
    }
    if reader.at != reader.end { Err(LONG) } else { Ok(out) }
}

/// Reader of the blocks of a meshopt attribute stream.
struct BlockReader<'a> {
    data: &'a [u8],
    at: usize,
    /// Position of the tail.
    end: usize,
}

impl<'a> BlockReader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let taken = self.data[..self.end].get(self.at..).and_then(|rest| rest.get(..count)).ok_or(SHORT)?;
        self.at += count;
        Ok(taken)
    }

    /// Reads a column: first two bits per group, then the groups.
    fn groups(&mut self, bits: &[u8; 4], column: &mut [u8]) -> Result<(), Fault> {
        let headers = self.take((column.len() / GROUP).div_ceil(4))?;
        for (place, group) in column.as_chunks_mut::<GROUP>().0.iter_mut().enumerate() {
            match bits[usize::from((headers[place / 4] >> (2 * (place % 4))) & 3)] {
                0 => group.fill(0),
                8 => group.copy_from_slice(self.take(GROUP)?),
                bits => self.group(bits, group)?,
            }
        }
        Ok(())
    }

    /// Reads a group with `bits` bits per difference. If all bits are ones, a literal byte follows.
    fn group(&mut self, bits: u8, group: &mut [u8; GROUP]) -> Result<(), Fault> {
        let packed = self.take(usize::from(bits) * GROUP / 8)?;
        // The tail is longer than the possible literals, so the reads below need no bounds check.
        let literals = self.data.get(self.at..self.at + GROUP).ok_or(SHORT)?;
        let escape = (1u8 << bits) - 1;
        let mut used = 0;
        let per_byte = usize::from(8 / bits);
        for (byte, values) in packed.iter().zip(group.chunks_exact_mut(per_byte)) {
            for (place, value) in values.iter_mut().enumerate() {
                let place = place as u8;
                // Single bits start at the lowest bit. Pairs and nibbles start at the highest bit.
                let shift = if bits == 1 { place } else { 8 - bits - place * bits };
                let short = (byte >> shift) & escape;
                *value = if short == escape { literals[used] } else { short };
                used += usize::from(short == escape);
            }
        }
        self.take(used)?;
        Ok(())
    }
}

/// Decodes channel mode 0: byte differences.
fn add_bytes<'a>(columns: &[[u8; BLOCK]; 4], last: &mut [u8; 4], places: impl Iterator<Item = &'a mut [u8]>) {
    for (i, place) in places.enumerate() {
        for byte in 0..4 {
            // Undo the zigzag code of the difference.
            let code = columns[byte][i];
            last[byte] = last[byte].wrapping_add((code >> 1) ^ (code & 1).wrapping_neg());
        }
        place[..4].copy_from_slice(last);
    }
}

/// Decodes channel mode 1: differences between 16-bit numbers.
fn add_shorts<'a>(columns: &[[u8; BLOCK]; 4], last: &mut [u8; 4], places: impl Iterator<Item = &'a mut [u8]>) {
    let mut sums = [u16::from_le_bytes([last[0], last[1]]), u16::from_le_bytes([last[2], last[3]])];
    for (i, place) in places.enumerate() {
        for (half, sum) in sums.iter_mut().enumerate() {
            let code = u16::from_le_bytes([columns[2 * half][i], columns[2 * half + 1][i]]);
            *sum = sum.wrapping_add((code >> 1) ^ (code & 1).wrapping_neg());
            place[2 * half..2 * half + 2].copy_from_slice(&sum.to_le_bytes());
        }
    }
    last[..2].copy_from_slice(&sums[0].to_le_bytes());
    last[2..].copy_from_slice(&sums[1].to_le_bytes());
}

/// Decodes channel mode 2: exclusive or of 32-bit numbers, rotated to the left by the encoder.
fn mix_words<'a>(
    columns: &[[u8; BLOCK]; 4],
    rotation: u32,
    last: &mut [u8; 4],
    places: impl Iterator<Item = &'a mut [u8]>,
) {
    let mut word = u32::from_le_bytes(*last);
    for (i, place) in places.enumerate() {
        word ^= u32::from_le_bytes(columns.each_ref().map(|column| column[i])).rotate_right(rotation);
        place[..4].copy_from_slice(&word.to_le_bytes());
    }
    *last = word.to_le_bytes();
}
