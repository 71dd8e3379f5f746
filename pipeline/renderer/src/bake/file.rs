//! File format of baked light.
//!
//! ```text
//! "R2SL"  version (u32)  fingerprint (u64)  number of sections (u32)
//! for each section:  tag (4 bytes)  length (u64)  CRC-32 of its bytes (u32)
//! CRC-32 of all preceding bytes (u32)
//! bytes of the sections, in order                                                                         all little-endian
//! ```
//!
//! Readers select sections by tag and ignore sections with unknown tags.

use pipeline::error::{Error, Result};
use pipeline::output::Output;
use std::fs::File;
use std::io::Read;
use std::path::Path;

const MAGIC: [u8; 4] = *b"R2SL";
/// Version of the file layout. New kinds of sections do not change it.
const VERSION: u32 = 2;
/// Number of bytes between the magic number and the table.
const FIXED: u64 = 16;
/// Number of bytes of a section's entry in the table.
const ENTRY: usize = 16;
/// Remedy in the messages for invalid files.
const AGAIN: &str = "run `render2mpeg bake` again";

/// A baked-light file: tagged sections of bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionFile {
    /// Fingerprint of the scene; see [`fingerprint`](super::fingerprint()).
    pub fingerprint: u64,
    /// Tags of four ASCII characters, each with the bytes of its section. If a tag is repeated, its first section is
    /// used.
    pub sections: Vec<([u8; 4], Vec<u8>)>,
}

impl SectionFile {
    /// Writes the file and returns its length in bytes. An existing file is replaced only by the complete new one.
    ///
    /// # Errors
    /// If the folder does not exist or is not writable, or the disk is full.
    pub fn write(&self, path: &Path) -> Result<u64> {
        let mut file = Output::create(path)?;
        file.write(&self.header())?;
        for (_, bytes) in &self.sections {
            file.write(bytes)?;
        }
        let length = file.written().length;
        file.finish()?;
        Ok(length)
    }

    /// Reads the file and verifies its checksums.
    ///
    /// # Errors
    /// If the file cannot be read, is truncated or damaged, or has another format or version.
    pub fn read(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::file(path, "cannot be read"))?;
        let length = file.metadata().map_err(Error::file(path, "cannot be read"))?.len();
        SectionReader { path, source: file, left: length }.file()
    }

    /// Returns the bytes of the section `tag`; `path` is only used in the error message.
    ///
    /// # Errors
    /// If the file lacks that section.
    pub fn section(&self, path: &Path, tag: [u8; 4]) -> Result<&[u8]> {
        match self.optional(tag) {
            Some(bytes) => Ok(bytes),
            None => Err(Error::content(path, format!(": the section {} is missing: {AGAIN}", tag.escape_ascii()))),
        }
    }

    /// Returns the bytes of the section `tag`; `None` if the file lacks that section.
    #[must_use]
    pub fn optional(&self, tag: [u8; 4]) -> Option<&[u8]> {
        self.sections.iter().find(|(found, _)| *found == tag).map(|(_, bytes)| &bytes[..])
    }

    /// Checks that the light was baked for the scene with this `fingerprint`; `path` is only used in the error message.
    ///
    /// # Errors
    /// If the fingerprint differs from the file's.
    pub fn check_scene(&self, path: &Path, fingerprint: u64) -> Result<()> {
        if self.fingerprint == fingerprint {
            return Ok(());
        }
        let problem = format!(" was baked for another scene, or the scene has changed: {AGAIN}");
        Err(Error::content(path, problem))
    }

    /// Returns all bytes before the data of the first section.
    fn header(&self) -> Vec<u8> {
        // Write the fixed fields: magic number, version, fingerprint, number of sections.
        let count = u32::try_from(self.sections.len()).expect("fewer than 2³² sections");
        let mut header = Vec::new();
        header.extend(MAGIC);
        header.extend(VERSION.to_le_bytes());
        header.extend(self.fingerprint.to_le_bytes());
        header.extend(count.to_le_bytes());
        // Write the table of sections.
        for (tag, bytes) in &self.sections {
            header.extend(tag);
            header.extend((bytes.len() as u64).to_le_bytes());
            header.extend(crc32fast::hash(bytes).to_le_bytes());
        }
        header.extend(crc32fast::hash(&header).to_le_bytes());
        header
    }
}

/// An entry of the table of sections.
struct SectionEntry {
    tag: [u8; 4],
    length: u64,
    sum: u32,
}

/// Reads a file from start to end.
struct SectionReader<'a, R> {
    path: &'a Path,
    source: R,
    /// Number of unread bytes.
    left: u64,
}

impl<R: Read> SectionReader<'_, R> {
    fn file(mut self) -> Result<SectionFile> {
        let (fingerprint, table) = self.header()?;
        // Check all lengths before allocating memory for a section.
        let total = table.iter().try_fold(0u64, |sum, entry| sum.checked_add(entry.length));
        match total {
            Some(total) if total == self.left => {}
            Some(total) if total < self.left => return Err(self.damaged("its end")),
            _ => return Err(self.cut_short()),
        }
        // Read and verify the sections.
        let mut sections = Vec::with_capacity(table.len());
        for SectionEntry { tag, length, sum } in table {
            let bytes = self.take(length)?;
            if crc32fast::hash(&bytes) != sum {
                return Err(self.damaged(&format!("the section {}", tag.escape_ascii())));
            }
            sections.push((tag, bytes));
        }
        Ok(SectionFile { fingerprint, sections })
    }

    /// Reads the fingerprint and the table of sections.
    fn header(&mut self) -> Result<(u64, Vec<SectionEntry>)> {
        // Check the format and the version.
        let magic = self.take(self.left.min(MAGIC.len() as u64))?;
        if magic != MAGIC {
            let problem = ": not a file of baked light: name a file written by `render2mpeg bake`";
            return Err(Error::content(self.path, problem));
        }
        let fixed = self.take(FIXED)?;
        let version = number(&fixed[..4]);
        if version != u64::from(VERSION) {
            let problem = format!(": baked light has version {version}, this program reads version {VERSION}: {AGAIN}");
            return Err(Error::content(self.path, problem));
        }
        // Read the table, and verify the checksum of all preceding bytes.
        let table = self.take(number(&fixed[12..16]) * ENTRY as u64)?;
        let sum = self.take(4)?;
        let mut found = crc32fast::Hasher::new();
        [&magic, &fixed, &table].into_iter().for_each(|bytes| found.update(bytes));
        if number(&sum) != u64::from(found.finalize()) {
            return Err(self.damaged("its header"));
        }

        // Decode the table only after its checksum has been verified.
        let mut entries = Vec::new();
        for bytes in table.chunks_exact(ENTRY) {
            entries.push(SectionEntry {
                tag: [bytes[0], bytes[1], bytes[2], bytes[3]],
                length: number(&bytes[4..12]),
                sum: number(&bytes[12..16]) as u32,
            });
        }
        Ok((number(&fixed[4..12]), entries))
    }

    /// Reads the next `count` bytes.
    fn take(&mut self, count: u64) -> Result<Vec<u8>> {
        if count > self.left {
            return Err(self.cut_short());
        }
        // Grow the buffer while reading: sparse files may be larger than memory.
        let mut bytes = Vec::new();
        if usize::try_from(count).map_or(true, |count| bytes.try_reserve_exact(count).is_err()) {
            let problem = format!(": a section of {count} bytes does not fit into memory: bake it with fewer texels");
            return Err(Error::content(self.path, problem));
        }
        self.source.by_ref().take(count).read_to_end(&mut bytes).map_err(Error::file(self.path, "cannot be read"))?;
        if bytes.len() as u64 != count {
            return Err(self.cut_short());
        }
        self.left -= count;
        Ok(bytes)
    }

    fn cut_short(&self) -> Error {
        Error::content(self.path, format!(": the file is truncated: {AGAIN}"))
    }

    fn damaged(&self, place: &str) -> Error {
        Error::content(self.path, format!(": the file is damaged in {place}: {AGAIN}"))
    }
}

/// Decodes up to eight little-endian bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs;

    const NAME: &str = "nave.slf";

    fn example() -> SectionFile {
        let sections = vec![(*b"GRID", vec![1, 2, 3]), (*b"NONE", vec![]), (*b"RADI", (0..=255).collect())];
        SectionFile { fingerprint: 0x0123_4567_89ab_cdef, sections }
    }

    fn bytes_of(file: &SectionFile) -> Vec<u8> {
        let mut bytes = file.header();
        file.sections.iter().for_each(|(_, section)| bytes.extend(section));
        bytes
    }

    fn parsed(bytes: &[u8]) -> Result<SectionFile> {
        SectionReader { path: Path::new(NAME), source: bytes, left: bytes.len() as u64 }.file()
    }

    /// Returns the error message for a file with content `bytes`. The message must be one line with the file's name.
    fn message(bytes: &[u8]) -> String {
        let text = parsed(bytes).unwrap_err().chain();
        assert!(text.starts_with(NAME) && !text.contains('\n') && text.contains("render2mpeg bake"), "{text}");
        text
    }

    /// Returns a header with a valid checksum and one table entry for each of `lengths`.
    fn claiming(lengths: &[u64]) -> Vec<u8> {
        let sections = lengths.iter().map(|_| (*b"GRID", vec![])).collect();
        let mut header = SectionFile { fingerprint: 7, sections }.header();
        header.truncate(header.len() - 4);
        for (k, length) in lengths.iter().enumerate() {
            header[20 + k * ENTRY + 4..][..8].copy_from_slice(&length.to_le_bytes());
        }
        header.extend(crc32fast::hash(&header).to_le_bytes());
        header
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        let file = example();
        let length = file.write(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), bytes_of(&file));
        assert_eq!(length, 20 + 3 * 16 + 4 + 3 + 256);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file remains");
        assert_eq!(SectionFile::read(&path).unwrap(), file);
        assert_eq!(file.section(&path, *b"GRID").unwrap(), [1, 2, 3]);
        assert!(file.section(&path, *b"NONE").unwrap().is_empty());
    }

    #[test]
    fn every_changed_byte_and_every_cut_is_noticed() {
        let bytes = bytes_of(&example());
        for place in 0..bytes.len() {
            for change in [0x01, 0x10, 0xff] {
                let mut changed = bytes.clone();
                changed[place] ^= change;
                message(&changed);
            }
            let text = message(&bytes[..place]);
            assert!(
                text.contains(if place < 4 { "not a file of baked light" } else { "truncated" }),
                "truncated at {place}: {text}"
            );
        }
        assert!(message(&[&bytes[..], &[0]].concat()).contains("damaged in its end"));
    }

    #[test]
    fn messages_say_what_is_wrong_and_what_helps() {
        let bytes = bytes_of(&example());
        let with = |place: usize, byte: u8| {
            let mut changed = bytes.clone();
            changed[place] = byte;
            message(&changed)
        };
        assert!(message(b"").contains("not a file of baked light"));
        assert!(message(b"RIFF and more").contains("not a file of baked light"));
        assert_eq!(
            with(4, 3),
            "nave.slf: baked light has version 3, this program reads version 2: run `render2mpeg bake` again"
        );
        assert!(with(9, 0).contains("damaged in its header"));
        assert!(with(bytes.len() - 1, 0).contains("damaged in the section RADI"));
        let path = Path::new(NAME);
        assert_eq!(
            example().section(path, *b"SUN\n").unwrap_err().to_string(),
            "nave.slf: the section SUN\\n is missing: run `render2mpeg bake` again"
        );
        assert!(example().check_scene(path, example().fingerprint).is_ok());
        assert_eq!(
            example().check_scene(path, 1).unwrap_err().to_string(),
            "nave.slf was baked for another scene, or the scene has changed: run `render2mpeg bake` again"
        );
    }

    #[test]
    fn no_memory_is_taken_for_what_is_only_claimed() {
        for lengths in [&[1][..], &[1 << 50], &[u64::MAX], &[u64::MAX, 1], &[u64::MAX, u64::MAX, 2], &[0, 5]] {
            assert!(message(&claiming(lengths)).contains("truncated"), "{lengths:?}");
        }
        // Claim the largest possible number of sections.
        let mut bytes = claiming(&[]);
        bytes[16..20].fill(0xff);
        assert!(message(&bytes).contains("truncated"));
        assert_eq!(parsed(&claiming(&[])).unwrap(), SectionFile { fingerprint: 7, sections: vec![] });
    }

    #[test]
    fn what_cannot_be_opened_is_named() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path(), &folder.path().join("none.slf")] {
            let text = SectionFile::read(path).unwrap_err().chain();
            assert!(text.contains(path.to_str().unwrap()) && text.contains("cannot be read"), "{text}");
        }
    }

    proptest! {
        #[test]
        fn sections_of_all_kinds_come_back(fingerprint: u64, sections: Vec<([u8; 4], Vec<u8>)>) {
            let file = SectionFile { fingerprint, sections };
            prop_assert_eq!(parsed(&bytes_of(&file)).unwrap(), file);
        }

        #[test]
        fn random_bytes_are_no_file(bytes: Vec<u8>) {
            message(&bytes);
            // Read random bytes after a valid magic number and version.
            message(&[&MAGIC[..], &VERSION.to_le_bytes(), &bytes].concat());
        }

        #[test]
        fn random_lengths_are_checked(lengths: Vec<u64>, bytes: Vec<u8>) {
            let total = lengths.iter().map(|&length| u128::from(length)).sum::<u128>();
            prop_assume!(total != bytes.len() as u128);
            message(&[claiming(&lengths), bytes].concat());
        }
    }
}
