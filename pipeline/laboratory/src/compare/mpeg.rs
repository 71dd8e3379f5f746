//! Reading of MPEG-1 and MPEG-2 videos with the crate `mpeg2dec`.

use super::picture::Picture;
use mpeg2dec::{ChromaFormat, DecodedPicture, DecoderCounts, Input, SampleComponent};
use perceptual::ColorMatrix;
use plane::Plane;
use render2mpeg::error::{Error, Result};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Bytes decoded at once. A piece contains few pictures, which limits memory.
const PIECE: usize = 1 << 10;
/// Remedy for incomplete films.
const AGAIN: &str = "copy or render the film again";

/// Iterator over the pictures of a video. Damage is an error, because figures of concealed pictures would be wrong.
pub(super) struct MpegPictures {
    path: PathBuf,
    file: BufReader<File>,
    input: Input,
    /// Decoded pictures that were not returned yet.
    ready: VecDeque<DecodedPicture>,
    /// Number of bytes read so far.
    position: u64,
    /// Number of pictures returned so far.
    count: u64,
    /// Width and height of the first picture \[pixels\].
    size: Option<(usize, usize)>,
    has_ended: bool,
}

impl MpegPictures {
    /// Opens a video and decodes its first picture. Returns `None` if the file contains no MPEG-1 or MPEG-2 video.
    ///
    /// # Errors
    /// If the file is empty, cannot be read, or its first pictures cannot be decoded.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let file = BufReader::new(File::open(path).map_err(Error::file(path, "cannot be read"))?);
        let mut pictures = Self {
            path: path.to_owned(),
            file,
            input: Input::default(),
            ready: VecDeque::new(),
            position: 0,
            count: 0,
            size: None,
            has_ended: false,
        };
        while pictures.ready.is_empty() && !pictures.has_ended {
            pictures.read_piece()?;
        }
        if pictures.position == 0 {
            return Err(pictures.error(format!("the file is empty; {AGAIN}")));
        }
        Ok((!pictures.ready.is_empty()).then_some(pictures))
    }

    fn error(&self, problem: impl std::fmt::Display) -> Error {
        Error::content(&self.path, format!(": {problem}"))
    }

    /// Decodes the next bytes of the file, or ends the stream after the last byte.
    fn read_piece(&mut self) -> Result<()> {
        let mut piece = [0; PIECE];
        let length = self.file.read(&mut piece).map_err(Error::file(&self.path, "cannot be read"))?;
        let ready = &mut self.ready;
        if length == 0 {
            self.input.flush(|picture| ready.push_back(picture));
            self.has_ended = true;
        } else {
            self.input.push(&piece[..length], |picture| ready.push_back(picture));
        }
        self.position += length as u64;
        self.check_counts()
    }

    /// Reports pictures and packets that are missing so far.
    fn check_counts(&self) -> Result<()> {
        let DecoderCounts { dropped, lost_packets, .. } = self.input.counts();
        let byte = self.position;
        // Without a sequence, the stream is of another codec.
        if self.input.sequence().is_none() {
            return Ok(());
        }
        match (dropped, lost_packets) {
            (0, 0) => Ok(()),
            (0, 1) => Err(self.error(format!("a packet is missing before byte {byte}; {AGAIN}"))),
            (0, lost) => Err(self.error(format!("{lost} packets are missing before byte {byte}; {AGAIN}"))),
            _ if self.has_ended => {
                Err(self.error(format!("the last picture has no data, because the file is truncated; {AGAIN}")))
            }
            _ => Err(self.error(format!(
                "a picture before byte {byte} refers to pictures that are not in the file; \
                 start the film with a closed group of pictures"
            ))),
        }
    }

    /// Converts a decoded picture, and checks that it is undamaged and as large as the first one.
    fn checked(&mut self, picture: &DecodedPicture) -> Result<Picture> {
        let (frame, damage) = (self.count, picture.damage());
        if damage.slices > 0 || damage.macroblocks > 0 {
            let byte = self.position;
            return Err(self.error(match self.has_ended {
                true => format!("frame {frame} is damaged or truncated at the end of the file, byte {byte}; {AGAIN}"),
                false => format!("frame {frame} is damaged, before byte {byte}; {AGAIN}"),
            }));
        }
        let sequence = picture.sequence();
        let size = (sequence.width, sequence.height);
        let first = *self.size.get_or_insert(size);
        if size != first {
            let ((w, h), (v, k)) = (size, first);
            let problem = format!("frame {frame} has {w}x{h} pixels, but frame 0 has {v}x{k}; split the film there");
            return Err(self.error(problem));
        }
        // Streams without a matrix use BT.601, as ffmpeg assumes.
        let matrix = match sequence.color.map_or(2, |color| color.matrix) {
            1 => ColorMatrix::Bt709,
            0..=6 => ColorMatrix::Bt601,
            other => {
                let problem = format!("matrix_coefficients {other} are not supported; convert the film to .y4m");
                return Err(self.error(problem));
            }
        };
        self.count += 1;
        Ok(Picture::Video(to_420(picture), matrix))
    }
}

impl Iterator for MpegPictures {
    type Item = Result<Picture>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ready.is_empty() && !self.has_ended {
            if let Err(error) = self.read_piece() {
                return Some(Err(error));
            }
        }
        let picture = self.ready.pop_front()?;
        Some(self.checked(&picture))
    }
}

/// Returns the visible samples of a picture, with chroma of half the width and height.
fn to_420(picture: &DecodedPicture) -> plane::Picture {
    let samples = |component| {
        let plane = picture.plane(component);
        Plane::from_vec(plane.width, plane.height, plane.rows().flatten().copied().collect())
    };
    let chroma = |component| match picture.sequence().chroma {
        ChromaFormat::Yuv420 => samples(component),
        ChromaFormat::Yuv422 => with_half_the_rows(&samples(component)),
        ChromaFormat::Yuv444 => with_half_the_columns(&with_half_the_rows(&samples(component))),
    };
    let (cb, cr) = (chroma(SampleComponent::Cb), chroma(SampleComponent::Cr));
    plane::Picture::new(samples(SampleComponent::Y), cb, cr).expect("chroma of half of the size")
}

/// Returns the means of pairs of rows. Chroma rows of 4:2:0 are between two rows of 4:2:2.
fn with_half_the_rows(plane: &Plane<u8>) -> Plane<u8> {
    let last = plane.height() - 1;
    let sum = |x, y| u16::from(plane.get(x, 2 * y)) + u16::from(plane.get(x, last.min(2 * y + 1)));
    Plane::from_fn(plane.width(), plane.height().div_ceil(2), |x, y| sum(x, y).div_ceil(2) as u8)
}

/// Returns every second column, filtered with weights of ¼, ½ and ¼. Chroma columns of 4:2:0 have the positions of even
/// columns.
fn with_half_the_columns(plane: &Plane<u8>) -> Plane<u8> {
    let last = plane.width() - 1;
    let at = |x: usize, y| u16::from(plane.get(x.min(last), y));
    let sum = |x: usize, y| at((2 * x).saturating_sub(1), y) + 2 * at(2 * x, y) + at(2 * x + 1, y);
    Plane::from_fn(plane.width().div_ceil(2), plane.height(), |x, y| ((sum(x, y) + 2) / 4) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chroma_keeps_its_mean_and_odd_edges() {
        let ramp = Plane::from_fn(5, 3, |x, y| (10 * x + 4 * y) as u8);
        let rows = with_half_the_rows(&ramp);
        assert_eq!((rows.width(), rows.height()), (5, 2));
        assert_eq!((rows.get(2, 0), rows.get(2, 1)), (22, 28));
        let columns = with_half_the_columns(&rows);
        assert_eq!((columns.width(), columns.height()), (3, 2));
        assert_eq!([0, 1, 2].map(|x| columns.get(x, 0)), [5, 22, 40]);
    }
}
