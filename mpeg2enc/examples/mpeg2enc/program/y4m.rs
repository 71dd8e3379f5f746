//! Reader of YUV4MPEG2 frames.
//!
//! A line has at most [`LINE_MAX`] bytes, so that a file of another type takes no memory.

use anyhow::{Context, Result, bail, ensure};
use mpeg2enc::{AspectRatio, FrameRate, Picture};
use std::io::{BufRead, Read};

/// Maximum length of a line in bytes, including its end; usual headers have about a hundred bytes.
const LINE_MAX: u64 = 1024;
/// First word of the file header.
const MAGIC: &str = "YUV4MPEG2";
/// First word of a frame header.
const FRAME: &str = "FRAME";
/// Suggested remedy for clips that cannot be encoded.
pub const MAKE: &str = "make a clip with ffmpeg -i FILM -pix_fmt yuv420p clip.y4m";

/// Fields of a file's first line.
#[derive(Debug)]
pub struct Format {
    pub width: usize,
    pub height: usize,
    pub frame_rate: FrameRate,
    /// Width and height of a sample as a ratio, if known.
    sample: Option<(u32, u32)>,
    /// Whether code values range from 0 to 255.
    pub is_full_range: bool,
}

impl Format {
    /// Returns the aspect ratio of the standard for these pictures; the default is square samples.
    pub fn aspect(&self) -> Result<AspectRatio> {
        let Some((width, height)) = self.sample else { return Ok(AspectRatio::SquareSamples) };
        AspectRatio::of_samples(self.width, self.height, (width, height)).with_context(|| {
            format!(
                "the standard has no aspect ratio for samples of {width}:{height} (field A); set one with --aspect, or scale \
                 to square samples with ffmpeg -i FILM -vf scale=iw*sar:ih,setsar=1 -pix_fmt yuv420p clip.y4m"
            )
        })
    }
}

/// Reader of the frames that follow the file header.
pub struct Reader<R> {
    input: R,
    pub format: Format,
    /// Number of bytes read so far.
    at: u64,
    /// Index of the next frame.
    frame: u64,
    line: Vec<u8>,
}

impl<R: BufRead> Reader<R> {
    /// Reads the file header and returns a reader of the frames.
    pub fn new(mut input: R) -> Result<Self> {
        let mut line = Vec::new();
        (&mut input).take(LINE_MAX).read_until(b'\n', &mut line)?;
        ensure!(line.starts_with(MAGIC.as_bytes()), "byte 0: the file does not begin with {MAGIC}; {MAKE}");
        if line.last() != Some(&b'\n') {
            let what = if line.len() as u64 == LINE_MAX { "the first line continues" } else { "the file ends" };
            bail!("byte {}: {what} where the header should end with a newline; {MAKE}", line.len());
        }
        let format = parse_header(String::from_utf8_lossy(&line).trim_end())?;
        Ok(Self { input, format, at: line.len() as u64, frame: 0, line })
    }

    /// Returns the number of frames read.
    pub fn count(&self) -> u64 {
        self.frame
    }

    /// Reads the next frame into `frame`; returns false at the end of the file.
    pub fn read(&mut self, frame: &mut Picture) -> Result<bool> {
        let (number, start) = (self.frame, self.at);
        let place = || format!("frame {number} at byte {start}");
        // The clip ends where no further line begins.
        self.line.clear();
        (&mut self.input).take(LINE_MAX).read_until(b'\n', &mut self.line).with_context(place)?;
        if self.line.is_empty() {
            return Ok(false);
        }

        // The marker is a separate line, possibly with parameters.
        let rest = self.line.strip_prefix(FRAME.as_bytes());
        if !rest.is_some_and(|rest| matches!(rest, [b'\n'] | [b' ', .., b'\n'])) {
            let found = String::from_utf8_lossy(&self.line[..self.line.len().min(16)]).into_owned();
            bail!("{}: expected a line {FRAME}, found {found:?}; recreate the clip", place());
        }
        self.at += self.line.len() as u64;

        // Count the bytes of partial reads, so that an error reports the exact position.
        for samples in frame.samples_mut() {
            let (mut read, size) = (0, samples.len());
            while read < size {
                match self.input.read(&mut samples[read..]) {
                    Ok(0) => bail!(
                        "{}: the file ends within the frame, at byte {}; recreate the clip",
                        place(),
                        self.at + read as u64
                    ),
                    Ok(bytes) => read += bytes,
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(error).with_context(place),
                }
            }
            self.at += size as u64;
        }
        if self.format.is_full_range {
            limit_range(frame);
        }
        self.frame += 1;
        Ok(true)
    }
}

/// Maps code values 0 … 255 to 16 … 235 in luma and 16 … 240 in chroma, the only range of MPEG-2.
fn limit_range(frame: &mut Picture) {
    for (samples, steps) in frame.samples_mut().into_iter().zip([219, 224, 224]) {
        for sample in samples {
            *sample = (16 + (u32::from(*sample) * steps + 127) / 255) as u8;
        }
    }
}

/// Parses a line such as `YUV4MPEG2 W512 H512 F25:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED`.
fn parse_header(line: &str) -> Result<Format> {
    let value = |tag: &str| line.split(' ').skip(1).find_map(|word| word.strip_prefix(tag));
    let number = |tag: &str, name: &str| -> Result<usize> {
        let text = value(tag).with_context(|| format!("the header has no {name} (field {tag}); {MAKE}"))?;
        text.parse().with_context(|| format!("the {name} {tag}{text} is not a number; {MAKE}"))
    };
    let pair = |tag: &str, text: &str| -> Result<(u32, u32)> {
        let parts = text.split_once(':').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
        parts.with_context(|| format!("{tag}{text} is not a ratio of two numbers; {MAKE}"))
    };

    // This encoder supports only progressive 4:2:0 pictures with 8 bits per sample.
    match value("I") {
        None | Some("p" | "?" | "") => {}
        Some(kind @ ("t" | "b" | "m")) => bail!(
            "frames are interlaced (I{kind}), but only progressive ones can be encoded; deinterlace with ffmpeg -i FILM -vf \
             bwdif -pix_fmt yuv420p clip.y4m"
        ),
        Some(kind) => bail!("I{kind} is not an interlacing mode of {MAGIC}; {MAKE}"),
    }
    if let Some(format) = value("C").filter(|format| !format.starts_with("420") || format.starts_with("420p1")) {
        bail!("only 4:2:0 with 8 bits can be encoded, not C{format}; {MAKE}");
    }

    // 0:0 represents an unknown aspect ratio.
    let sample = value("A").map(|text| pair("A", text)).transpose()?.filter(|&sample| sample != (0, 0));
    let is_full_range = match value("XCOLORRANGE=") {
        None | Some("LIMITED") => false,
        Some("FULL") => true,
        Some(range) => bail!("XCOLORRANGE={range} is neither FULL nor LIMITED; {MAKE}"),
    };
    // The frame rate must have a code in the standard.
    let rate = value("F").with_context(|| format!("the header has no frame rate (field F); {MAKE}"))?;
    let (numerator, denominator) = pair("F", rate)?;
    let frame_rate = FrameRate::from_fps(f64::from(numerator) / f64::from(denominator))?;
    Ok(Format { width: number("W", "width")?, height: number("H", "height")?, frame_rate, sample, is_full_range })
}
