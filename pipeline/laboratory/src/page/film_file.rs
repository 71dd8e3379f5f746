//! Coded pictures in the file of a finished film.

use mpeg2dec::Demuxer;
use mpeg2enc::{AccessUnit, ElementaryStream};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes read at once.
const PIECE: usize = 1 << 16;

/// Reads the pictures of a film in coding order, at least `limit` bytes if the film is longer. Returns `None` for files
/// that cannot be read, and for MP4 and Matroska.
pub(super) fn coded_pictures(path: &Path, limit: usize) -> Option<Vec<AccessUnit>> {
    let mut file = File::open(path).ok().filter(|file| file.metadata().is_ok_and(|data| data.is_file()))?;
    let (mut demuxer, mut stream, mut piece) = (Demuxer::default(), Vec::new(), vec![0; PIECE]);
    while stream.len() <= limit {
        let length = file.read(&mut piece).ok()?;
        if length == 0 {
            demuxer.flush(|data| stream.extend_from_slice(data.bytes));
            break;
        }
        demuxer.push(&piece[..length], |data| stream.extend_from_slice(data.bytes));
    }
    ElementaryStream::parse(&stream).ok().map(|stream| stream.units)
}
