//! Division of an elementary stream at its start codes (5.2.3).

/// Maximum size of a unit in bytes. A larger one is no part of a video stream and is discarded.
const UNIT_MAX: usize = 4 << 20;
/// Maximum number of bytes that are searched at once.
const STEP: usize = 1 << 16;

/// Position of a start code, or the unit that begins with it.
pub(crate) enum StreamItem<'a> {
    /// Last byte of a start code, and the offset of its first byte in the stream. All earlier units have ended.
    Code { code: u8, offset: u64 },
    /// Data of the unit, up to the next start code.
    Unit { code: u8, data: &'a [u8] },
}

/// Collects bytes and finds start codes.
#[derive(Default)]
pub(crate) struct UnitSplitter {
    /// Bytes from the start of the current unit.
    buffer: Vec<u8>,
    /// Offset of the buffer in the stream.
    base: u64,
    /// Number of bytes without the beginning of another start code.
    searched: usize,
    /// Code of the current unit. `None` before the first start code.
    code: Option<u8>,
}

impl UnitSplitter {
    /// Returns the offset of the next byte that is pushed.
    pub fn offset(&self) -> u64 {
        self.base + self.buffer.len() as u64
    }

    /// Appends bytes and passes all complete units to `receive`.
    pub fn push(&mut self, bytes: &[u8], receive: &mut dyn FnMut(StreamItem)) {
        for piece in bytes.chunks(STEP) {
            self.buffer.extend_from_slice(piece);
            self.search(receive);
        }
    }

    /// Passes the last unit to `receive` and forgets all bytes.
    pub fn flush(&mut self, receive: &mut dyn FnMut(StreamItem)) {
        if let Some(code) = self.code.take() {
            receive(StreamItem::Unit { code, data: self.buffer.get(4..).unwrap_or_default() });
        }
        self.base = self.offset();
        self.buffer.clear();
        self.searched = 0;
    }

    fn search(&mut self, receive: &mut dyn FnMut(StreamItem)) {
        let mut start = 0;
        while let Some(found) = find_prefix(&self.buffer, self.searched) {
            // Wait for the last byte of the start code.
            let Some(&code) = self.buffer.get(found + 3) else {
                self.searched = found;
                self.discard(start);
                return;
            };
            if let Some(ended) = self.code {
                receive(StreamItem::Unit { code: ended, data: &self.buffer[start + 4..found] });
            }
            receive(StreamItem::Code { code, offset: self.base + found as u64 });
            self.code = Some(code);
            (start, self.searched) = (found, found + 4);
        }
        // A start code may begin with the last two bytes.
        self.searched = self.searched.max(self.buffer.len().saturating_sub(2));
        if self.code.is_none() || self.buffer.len() - start > UNIT_MAX {
            self.code = None;
            start = self.buffer.len().saturating_sub(2);
        }
        self.discard(start);
    }

    /// Removes the first bytes of the buffer.
    fn discard(&mut self, count: usize) {
        if count == 0 {
            return;
        }
        self.buffer.copy_within(count.., 0);
        self.buffer.truncate(self.buffer.len() - count);
        self.base += count as u64;
        self.searched -= count.min(self.searched);
    }
}

/// Returns the first position from `from` on with the bytes 0, 0, 1.
pub(crate) fn find_prefix(bytes: &[u8], from: usize) -> Option<usize> {
    let mut i = from + 2;
    while let Some(&last) = bytes.get(i) {
        // A byte above 1 is in no prefix.
        if last > 1 {
            i += 3;
        } else if last == 1 && bytes[i - 1] == 0 && bytes[i - 2] == 0 {
            return Some(i - 2);
        } else {
            i += 1;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_do_not_depend_on_pieces() {
        let stream = [9, 9, 0, 0, 1, 0xb3, 1, 2, 3, 0, 0, 0, 1, 0, 7, 0, 0, 1, 1, 0, 0, 2, 0, 0, 1, 0xb7];
        let units = |size: usize| {
            let (mut splitter, mut found) = (UnitSplitter::default(), Vec::new());
            let mut receive = |item: StreamItem| match item {
                StreamItem::Code { code, offset } => found.push((code, offset, Vec::new())),
                StreamItem::Unit { code, data } => found.push((code, u64::MAX, data.to_vec())),
            };
            stream.chunks(size).for_each(|piece| splitter.push(piece, &mut receive));
            splitter.flush(&mut receive);
            found
        };
        let whole = units(stream.len());
        let codes: Vec<u8> = whole.iter().map(|(code, ..)| *code).collect();
        assert_eq!(codes, [0xb3, 0xb3, 0, 0, 1, 1, 0xb7, 0xb7]);
        assert_eq!(whole[0].1, 2);
        assert_eq!(whole[1].2, [1, 2, 3, 0]);
        (1..stream.len()).for_each(|size| assert_eq!(units(size), whole));
    }
}
