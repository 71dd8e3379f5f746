//! Closed captions in user data (ATSC A/53 part 4, and line 21 data of DVDs).

/// Start code of user data.
pub(crate) const USER_DATA: [u8; 4] = [0, 0, 1, 0xb2];

/// Two bytes of closed captions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaptionPair {
    /// cc_type: CEA-608 of field 1 (0) or field 2 (1), continued CEA-708 packet (2), first pair of a CEA-708 packet (3).
    pub kind: u8,
    /// Caption bytes, with their parity bits in CEA-608.
    pub bytes: [u8; 2],
}

/// Iterator over the closed captions of a picture.
#[derive(Clone, Debug)]
pub struct Captions<'a> {
    /// User data units after the current one.
    units: &'a [u8],
    /// Remaining triplets of the current unit.
    triplets: &'a [u8],
    is_dvd: bool,
}

impl<'a> Captions<'a> {
    pub(crate) fn new(units: &'a [u8]) -> Self {
        Self { units, triplets: &[], is_dvd: false }
    }

    /// Starts the next unit. Returns false after the last one.
    fn next_unit(&mut self) -> bool {
        let Some(start) = find(self.units) else { return false };
        let unit = &self.units[start + 4..];
        let end = find(unit).unwrap_or(unit.len());
        (self.units, self.triplets) = (&unit[end..], &[]);
        match &unit[..end] {
            // The count of triplets has 5 bits, after process_cc_data_flag.
            [b'G', b'A', b'9', b'4', 3, flags, _, triplets @ ..] if flags & 0x40 != 0 => {
                self.triplets = &triplets[..triplets.len().min(3 * usize::from(flags & 31))];
                self.is_dvd = false;
            }
            [b'C', b'C', 1, 0xf8, count, triplets @ ..] => {
                self.triplets = &triplets[..triplets.len().min(3 * usize::from(count & 0x7f))];
                self.is_dvd = true;
            }
            _ => {}
        }
        true
    }
}

fn find(units: &[u8]) -> Option<usize> {
    units.windows(4).position(|window| window == USER_DATA)
}

impl Iterator for Captions<'_> {
    type Item = CaptionPair;

    fn next(&mut self) -> Option<CaptionPair> {
        loop {
            let [head, a, b, rest @ ..] = self.triplets else {
                if self.next_unit() {
                    continue;
                }
                return None;
            };
            let (head, bytes) = (*head, [*a, *b]);
            self.triplets = rest;
            // DVDs mark field 1 with 0xff and field 2 with 0xfe. A/53 has cc_valid and cc_type in the low bits.
            if self.is_dvd && head >= 0xfe {
                return Some(CaptionPair { kind: 0xff - head, bytes });
            } else if !self.is_dvd && head & 4 != 0 {
                return Some(CaptionPair { kind: head & 3, bytes });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn valid_pairs_are_found() {
        let mut data = USER_DATA.to_vec();
        data.extend(b"other");
        data.extend(USER_DATA);
        data.extend(b"GA94");
        data.extend([3, 0x40 | 3, 0xff, 0xfc, 0x94, 0x20, 0xf8, 1, 2, 0xff, 3, 4, 0xff]);
        let found: Vec<CaptionPair> = Captions::new(&data).collect();
        assert_eq!(found, [CaptionPair { kind: 0, bytes: [0x94, 0x20] }, CaptionPair { kind: 3, bytes: [3, 4] }]);
        assert_eq!(Captions::new(&data[..data.len() - 5]).count(), 1, "truncated");
        assert_eq!(Captions::new(&[]).count(), 0);
    }
}
