//! Reading of pictures from a single file, a folder or a video.

use super::mpeg::MpegPictures;
use super::picture::Picture;
use super::png_file;
use perceptual::ColorMatrix;
use plane::Plane;
use render2mpeg::error::{Error, Result};
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Maximum side of a picture in a video \[pixels\], as in MPEG-2.
const LARGEST_SIDE: usize = 16383;
/// File endings of MPEG-1 and MPEG-2 videos, which need no other program.
const MPEG_ENDINGS: [&str; 9] = ["m2v", "m1v", "mpv", "mpg", "mpeg", "vob", "ts", "m2t", "m2ts"];
/// File endings of videos that ffmpeg decodes.
const FFMPEG_ENDINGS: [&str; 4] = ["mp4", "mkv", "avi", "mov"];

/// Iterator over the pictures of a file or folder.
pub struct Pictures {
    /// Path of the file or folder.
    pub path: PathBuf,
    source: FrameSource,
}

enum FrameSource {
    Files(std::vec::IntoIter<PathBuf>),
    Y4m(Box<y4m::Decoder<Box<dyn Read>>>),
    Mpeg(Box<MpegPictures>),
    /// Decoder of ffmpeg's output, and the process of ffmpeg, which is awaited at the end.
    Ffmpeg(Box<y4m::Decoder<Box<dyn Read>>>, Child),
}

impl Pictures {
    /// Opens an OpenEXR or PNG picture, a folder of pictures, or a video.
    ///
    /// # Errors
    /// If the path does not exist or cannot be read. The message names the supported formats.
    pub fn open(path: &Path) -> Result<Self> {
        let metadata = std::fs::metadata(path).map_err(Error::file(path, "cannot be read"))?;
        let source = if metadata.is_dir() {
            FrameSource::Files(pictures_in(path)?.into_iter())
        } else {
            // Choose the reader by the file ending.
            match ending(path).as_str() {
                "exr" | "png" => FrameSource::Files(vec![path.to_owned()].into_iter()),
                "y4m" => {
                    let file = File::open(path).map_err(Error::file(path, "cannot be read"))?;
                    FrameSource::Y4m(Box::new(y4m_decoder(path, Box::new(BufReader::new(file)))?))
                }
                video if MPEG_ENDINGS.contains(&video) => mpeg(path)?,
                video if FFMPEG_ENDINGS.contains(&video) => ffmpeg(path)?,
                _ => {
                    let endings = MPEG_ENDINGS.iter().chain(&FFMPEG_ENDINGS);
                    let videos = endings.map(|ending| format!(".{ending}")).collect::<Vec<_>>().join(", ");
                    let known = format!(
                        ": unknown format; compare pictures (.exr, .png), folders of pictures, or videos (.y4m, {videos})"
                    );
                    return Err(Error::content(path, known));
                }
            }
        };
        Ok(Self { path: path.to_owned(), source })
    }

    /// Opens a video in any format that ffmpeg decodes.
    ///
    /// # Errors
    /// If ffmpeg is not installed or finds no video.
    pub(crate) fn by_ffmpeg(path: &Path) -> Result<Self> {
        Ok(Self { path: path.to_owned(), source: ffmpeg(path)? })
    }
}

impl Iterator for Pictures {
    type Item = Result<Picture>;

    /// Returns the next picture, or an error that names its file.
    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.source {
            FrameSource::Files(paths) => paths.next().map(|path| read_picture(&path)),
            // YUV4MPEG2 does not signal a color matrix, so BT.601 is assumed.
            FrameSource::Y4m(decoder) => next_frame(&self.path, decoder, ColorMatrix::Bt601).transpose(),
            FrameSource::Mpeg(pictures) => pictures.next(),
            FrameSource::Ffmpeg(decoder, child) => {
                // After the last picture, check whether ffmpeg failed.
                match next_frame(&self.path, decoder, ColorMatrix::Bt709).transpose() {
                    None => match child.wait() {
                        Ok(status) if status.success() => None,
                        _ => Some(Err(Error::content(&self.path, ": ffmpeg could not decode the whole file"))),
                    },
                    picture => picture,
                }
            }
        }
    }
}

impl Drop for Pictures {
    fn drop(&mut self) {
        // Stop ffmpeg if its output was not read to the end.
        if let FrameSource::Ffmpeg(_, child) = &mut self.source {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn ending(path: &Path) -> String {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Returns the pictures in a folder, sorted by name.
fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let context = |error| Error::file(folder, "cannot be read")(error);
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(context)? {
        let path = entry.map_err(context)?.path();
        if matches!(ending(&path).as_str(), "exr" | "png") {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(Error::content(folder, ": no .exr or .png files in this folder"));
    }
    paths.sort();
    Ok(paths)
}

fn read_picture(path: &Path) -> Result<Picture> {
    if ending(path) == "png" {
        return Ok(Picture::Display(png_file::read(path)?));
    }
    linear_picture(path)
}

fn linear_picture(path: &Path) -> Result<Picture> {
    let layers = render_core::image_file::read_layers(path).map_err(Error::other)?;
    let radiance = layers.colors("").ok_or_else(|| Error::content(path, ": no channels R, G and B"))?;
    Ok(Picture::Linear { radiance, variance: layers.colors("variance.") })
}

/// Maximum length of a header \[bytes\] (ours). Headers written by ffmpeg are shorter than 100 bytes.
const LONGEST_HEADER: usize = 1024;

fn y4m_decoder(path: &Path, input: Box<dyn Read>) -> Result<y4m::Decoder<Box<dyn Read>>> {
    let (header, input) = header_and_all(input).map_err(Error::file(path, "cannot be read"))?;
    // Check the sides first, because the decoder multiplies them before it checks its limits.
    let sides = header.split(|&byte| byte == b' ').filter(|word| matches!(word.first(), Some(b'W' | b'H')));
    for side in sides.map(|word| String::from_utf8_lossy(&word[1..]).trim().to_owned()) {
        if !side.parse().is_ok_and(|side| (1..=LARGEST_SIDE).contains(&side)) {
            let problem = format!(": invalid picture side {side}; sides must be in 1..={LARGEST_SIDE}");
            return Err(Error::content(path, problem));
        }
    }
    // Limit the memory that the decoder allocates for the size in the header.
    let limits = y4m::Limits { bytes: LARGEST_SIDE * LARGEST_SIDE * 3 / 2 + 2 * LARGEST_SIDE };
    let decoder = y4m::Decoder::new_with_limits(input, limits)
        .map_err(|error| Error::content(path, format!(" is not a YUV4MPEG2 video: {error}")))?;
    use y4m::Colorspace::{C420, C420jpeg, C420mpeg2, C420paldv};
    if !matches!(decoder.get_colorspace(), C420 | C420jpeg | C420mpeg2 | C420paldv) {
        let problem = ": only 8-bit 4:2:0 videos are supported; convert it with ffmpeg -pix_fmt yuv420p";
        return Err(Error::content(path, problem));
    }
    Ok(decoder)
}

/// Returns the first line, up to the maximum length of a header, and the whole input including this line.
fn header_and_all(mut input: Box<dyn Read>) -> std::io::Result<(Vec<u8>, Box<dyn Read>)> {
    // Read single bytes, to stop right after the header.
    let mut header = Vec::new();
    let mut byte = [0];
    while header.len() < LONGEST_HEADER && header.last() != Some(&b'\n') && input.read(&mut byte)? == 1 {
        header.push(byte[0]);
    }
    let all = Box::new(Cursor::new(header.clone()).chain(input));
    Ok((header, all))
}

fn next_frame(path: &Path, decoder: &mut y4m::Decoder<Box<dyn Read>>, matrix: ColorMatrix) -> Result<Option<Picture>> {
    let (width, height) = (decoder.get_width(), decoder.get_height());
    let frame = match decoder.read_frame() {
        Ok(frame) => frame,
        Err(y4m::Error::EOF) => return Ok(None),
        Err(error) => return Err(Error::content(path, format!(": the video is truncated: {error}"))),
    };
    let plane = |samples: &[u8], width, height| Plane::from_vec(width, height, samples.to_vec());
    // Round the chroma size up if a side is odd.
    let chroma = |samples| plane(samples, width.div_ceil(2), height.div_ceil(2));
    let (cb, cr) = (chroma(frame.get_u_plane()), chroma(frame.get_v_plane()));
    let picture = plane::Picture::new(plane(frame.get_y_plane(), width, height), cb, cr);
    Ok(Some(Picture::Video(picture.expect("chroma of half of the size"), matrix)))
}

/// Opens an MPEG-1 or MPEG-2 video. Streams of other codecs in the same containers are decoded by ffmpeg.
fn mpeg(path: &Path) -> Result<FrameSource> {
    if let Some(pictures) = MpegPictures::open(path)? {
        return Ok(FrameSource::Mpeg(Box::new(pictures)));
    }
    let Ok(child) = start_ffmpeg(path, Stdio::null()) else {
        let problem = ": no MPEG-1 or MPEG-2 video in this file; install ffmpeg for other codecs";
        return Err(Error::content(path, problem));
    };
    pictures_of(path, child).ok_or_else(|| Error::content(path, ": no video in this file; name a film"))
}

/// Opens a video with ffmpeg, whose messages go to standard error.
fn ffmpeg(path: &Path) -> Result<FrameSource> {
    let child = start_ffmpeg(path, Stdio::inherit()).map_err(|error| {
        let problem = format!(": cannot start ffmpeg to decode it ({error}); install ffmpeg, or compare .y4m videos");
        Error::content(path, problem)
    })?;
    pictures_of(path, child).ok_or_else(|| Error::content(path, ": ffmpeg finds no video in it"))
}

/// Starts ffmpeg as the decoder, with `messages` as its standard error.
fn start_ffmpeg(path: &Path, messages: Stdio) -> std::io::Result<Child> {
    Command::new("ffmpeg")
        .args(["-nostdin", "-v", "error", "-i"])
        .arg(path)
        // Convert to BT.709, because films that do not signal a matrix use BT.601.
        .args(["-vf", "scale=out_color_matrix=bt709"])
        .args(["-fps_mode", "passthrough", "-f", "yuv4mpegpipe", "-pix_fmt", "yuv420p", "-"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(messages)
        .spawn()
}

/// Returns the pictures that ffmpeg decodes; `None` if it finds no video.
fn pictures_of(path: &Path, mut child: Child) -> Option<FrameSource> {
    let output = child.stdout.take().expect("it was requested");
    match y4m_decoder(path, Box::new(BufReader::new(output))) {
        Ok(decoder) => Some(FrameSource::Ffmpeg(Box::new(decoder), child)),
        Err(_) => {
            // Collect the exit status, so that no zombie process remains.
            let _ = child.wait();
            None
        }
    }
}
