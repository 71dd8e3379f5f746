//! Decoder of elementary streams.

mod marks; // time stamps of the container
mod order; // display order
mod pictures; // decodes pictures

use crate::{
    bits::BitReader,
    captions::USER_DATA,
    header::CodedHeader,
    picture::DecodedPicture,
    sequence::{Matrices, Sequence},
    units::{StreamItem, UnitSplitter},
};
use marks::TimeMarks;
use mpeg2::Standard;
use pictures::{PictureDecoder, Started};

/// picture_start_code.
const PICTURE: u8 = 0x00;
/// First and last slice_start_code.
const SLICES: std::ops::RangeInclusive<u8> = 0x01..=0xaf;
const SEQUENCE_HEADER: u8 = 0xb3;
const EXTENSION: u8 = 0xb5;
const SEQUENCE_END: u8 = 0xb7;
const GROUP: u8 = 0xb8;
/// Maximum number of bytes of user data of a picture.
const USER_DATA_MAX: usize = 1 << 14;

/// Options of a decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DecoderOptions {
    /// Shows pictures with missing references, such as P pictures before the first I picture. Otherwise they are dropped.
    pub show_incomplete: bool,
    /// Maximum number of luma samples of a picture. Sequences with larger pictures are skipped.
    pub samples_max: usize,
}

impl Default for DecoderOptions {
    fn default() -> Self {
        Self { show_incomplete: false, samples_max: 1 << 24 }
    }
}

/// Numbers of events since a decoder was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DecoderCounts {
    /// Pictures passed to the caller.
    pub pictures: u64,
    /// Coded pictures without output: missing references or sequence header, no slices, or of an unknown type.
    pub dropped: u64,
    /// Slices that ended with an error.
    pub damaged_slices: u64,
    /// Macroblocks that were concealed.
    pub concealed_macroblocks: u64,
    /// Missing packets of transport streams; see [`Demuxer::lost_packets`](crate::Demuxer::lost_packets).
    pub lost_packets: u64,
}

/// A decoder of MPEG-1 and MPEG-2 elementary streams.
///
/// Pictures are passed to the caller in display order, as soon as they and their predecessors are complete. For containers see
/// [`Input`](crate::Input).
///
/// ```
/// use mpeg2dec::Decoder;
///
/// let stream = include_bytes!("../tests/data/small.m2v");
/// let (mut decoder, mut times) = (Decoder::default(), Vec::new());
/// for piece in stream.chunks(100) {
///     decoder.push(piece, |picture| times.push(picture.flags().temporal_reference));
/// }
/// decoder.flush(|picture| times.push(picture.flags().temporal_reference));
/// assert_eq!(times, [0, 1, 2, 3, 4, 5]);
/// ```
#[derive(Default)]
pub struct Decoder {
    units: UnitSplitter,
    marks: TimeMarks,
    syntax: Syntax,
    /// Number of pictures passed to the caller.
    shown: u64,
}

/// Returns a function that counts the pictures that it passes on.
fn counted(count: &mut u64, show: &mut dyn FnMut(DecodedPicture)) -> impl FnMut(DecodedPicture) {
    move |picture| {
        *count += 1;
        show(picture);
    }
}

impl Decoder {
    /// Returns a decoder with options.
    #[must_use]
    pub fn new(options: DecoderOptions) -> Self {
        Self { syntax: Syntax { pictures: PictureDecoder::new(options), ..Syntax::default() }, ..Self::default() }
    }

    /// Decodes bytes, in pieces of any size, and passes complete pictures to `show`.
    pub fn push(&mut self, bytes: &[u8], mut show: impl FnMut(DecodedPicture)) {
        self.receive(bytes, &mut show);
    }

    pub(crate) fn receive(&mut self, bytes: &[u8], show: &mut dyn FnMut(DecodedPicture)) {
        let Self { units, marks, syntax, shown } = self;
        let mut show = counted(shown, show);
        units.push(bytes, &mut |item| syntax.item(item, marks, &mut show));
    }

    /// Ends the stream: passes the remaining pictures to `show`. The decoder then accepts another stream.
    pub fn flush(&mut self, mut show: impl FnMut(DecodedPicture)) {
        self.end(&mut show);
    }

    pub(crate) fn end(&mut self, show: &mut dyn FnMut(DecodedPicture)) {
        let Self { units, marks, syntax, shown } = self;
        let mut show = counted(shown, show);
        units.flush(&mut |item| syntax.item(item, marks, &mut show));
        syntax.end_sequence(&mut show);
    }

    /// Sets the presentation time, in units of 1/90000 s, of the next picture that starts in the bytes pushed later.
    pub fn set_time(&mut self, time: i64) {
        self.marks.add(self.units.offset(), time);
    }

    /// Returns the numbers of pictures and errors.
    #[must_use]
    pub fn counts(&self) -> DecoderCounts {
        DecoderCounts { pictures: self.shown, ..self.syntax.pictures.counts() }
    }

    /// Returns the current sequence, after its first picture has started.
    #[must_use]
    pub fn sequence(&self) -> Option<&Sequence> {
        self.syntax.pictures.sequence()
    }
}

/// State of the syntax above slices.
#[derive(Default)]
struct Syntax {
    /// Sequence header, with the extensions received so far.
    sequence: Option<Sequence>,
    matrices: Option<Matrices>,
    /// Header of a picture without slices so far.
    header: Option<CodedHeader>,
    /// Time of the picture in `header`.
    time: Option<i64>,
    /// User data before the first slice.
    user_data: Vec<u8>,
    pictures: PictureDecoder,
}

impl Syntax {
    fn item(&mut self, item: StreamItem, marks: &mut TimeMarks, show: &mut dyn FnMut(DecodedPicture)) {
        match item {
            StreamItem::Code { code, offset } => {
                // Any other start code ends a picture. A field may wait for the second one.
                if !SLICES.contains(&code) {
                    self.pictures.finish(show);
                }
                match code {
                    PICTURE => self.time = marks.take(offset),
                    SEQUENCE_END => self.end_sequence(show),
                    _ => {}
                }
            }
            StreamItem::Unit { code, data } => self.unit(code, data, show),
        }
    }

    /// Passes all pictures to `show` and forgets the references.
    fn end_sequence(&mut self, show: &mut dyn FnMut(DecodedPicture)) {
        self.pictures.finish(show);
        self.pictures.end_sequence(show);
        self.drop_header();
    }

    /// Counts a picture without slices.
    fn drop_header(&mut self) {
        if self.header.take().is_some() {
            self.pictures.drop_picture();
        }
    }

    fn unit(&mut self, code: u8, data: &[u8], show: &mut dyn FnMut(DecodedPicture)) {
        let mut bits = BitReader::new(data);
        match code {
            SEQUENCE_HEADER => {
                self.sequence = Sequence::read(&mut bits);
                let mut matrices = Matrices::DEFAULT;
                // The last flag of the header's fixed part precedes the matrices.
                matrices.load(&mut bits, 2);
                self.matrices = Some(matrices);
                self.drop_header();
            }
            EXTENSION => self.extension(&mut bits),
            GROUP => {
                bits.read(25); // time_code
                self.pictures.start_group(bits.flag(), bits.flag());
                self.drop_header();
            }
            PICTURE => {
                self.drop_header();
                let is_mpeg1 = self.sequence.is_none_or(|sequence| sequence.standard == Standard::Mpeg1);
                self.header = CodedHeader::read(&mut bits).filter(|header| is_mpeg1 || !header.is_dc_only);
                if self.header.is_none() {
                    self.pictures.drop_picture();
                }
            }
            0xb2 if self.user_data.len() + data.len() <= USER_DATA_MAX => {
                self.user_data.extend_from_slice(&USER_DATA);
                self.user_data.extend_from_slice(data);
            }
            _ if SLICES.contains(&code) => {
                match (self.header.take(), &self.sequence, &self.matrices) {
                    (Some(header), Some(sequence), Some(matrices)) => {
                        let started = Started { header, sequence, matrices, time: self.time.take() };
                        self.pictures.start(started, &mut self.user_data, show);
                    }
                    (Some(_), ..) => self.pictures.drop_picture(),
                    (None, ..) => {}
                }
                self.pictures.slice(code, data);
            }
            _ => {}
        }
    }

    fn extension(&mut self, bits: &mut BitReader) {
        match (bits.read(4), &mut self.sequence, &mut self.header) {
            (1, Some(sequence), None) => sequence.extend(bits),
            (2, Some(sequence), None) => sequence.describe_color(bits),
            (3, ..) => {
                if let Some(matrices) = &mut self.matrices {
                    matrices.load(bits, 4);
                }
            }
            (8, _, Some(header)) => header.extend(bits),
            _ => {}
        }
    }
}
