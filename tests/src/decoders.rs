//! Decodes our streams with ffmpeg and mpeg2dec, which are independent of our code.

use mpeg2enc::Picture;
use plane::Plane;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(decoder: &str, arguments: &[&str]) -> Output {
    let output = Command::new(decoder).args(arguments).stdin(Stdio::null()).output();
    output.unwrap_or_else(|error| {
        panic!("{decoder} cannot be run ({error}): install it, for instance with: apt-get install ffmpeg mpeg2dec")
    })
}

/// Returns ffmpeg's name of a video's format, by file extension.
fn format_of(video: &str) -> &'static str {
    match video.rsplit('.').next() {
        Some("mpg") => "mpeg",
        Some("ts") => "mpegts",
        Some("mp4") => "mov",
        Some("mkv") => "matroska",
        _ => "mpegvideo",
    }
}

/// Decodes a video with ffmpeg; any warning is a failure.
pub fn decode_ffmpeg(video: &Path, (width, height): (usize, usize)) -> Vec<Picture> {
    let video = video.to_str().expect("a path in UTF-8");
    let strict = ["-nostdin", "-v", "warning", "-xerror", "-f", format_of(video), "-i", video];
    let raw = ["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "yuv420p", "-"];
    let output = run("ffmpeg", &[&strict[..], &raw].concat());
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.is_empty(), "ffmpeg printed messages: {messages}");
    pictures(&output.stdout, (width, height))
}

/// Counts the pictures that ffmpeg decodes from a stream that may be truncated anywhere.
pub fn tolerant_frame_count(video: &Path, (width, height): (usize, usize)) -> usize {
    let video = video.to_str().expect("a path in UTF-8");
    let arguments = ["-nostdin", "-v", "quiet", "-f", format_of(video), "-i", video, "-fps_mode", "passthrough"];
    let output = run("ffmpeg", &[&arguments[..], &["-f", "rawvideo", "-pix_fmt", "yuv420p", "-"]].concat());
    pictures(&output.stdout, (width, height)).len()
}

/// Decodes a video with mpeg2dec (libmpeg2), which outputs whole macroblocks.
pub fn decode_mpeg2dec(video: &Path, (width, height): (usize, usize)) -> Vec<Picture> {
    let output = run("mpeg2dec", &["-o", "pgmpipe", video.to_str().expect("a path in UTF-8")]);
    assert!(output.status.success(), "mpeg2dec failed: {}", String::from_utf8_lossy(&output.stderr));
    let mut rest = &output.stdout[..];
    let mut frames = Vec::new();
    while !rest.is_empty() {
        // Each picture is a gray map: luma on top, both chroma planes side by side below.
        let ([map_width, map_height], start) = pgm_header(rest);
        let samples = &rest[start..start + map_width * map_height];
        rest = &rest[start + map_width * map_height..];
        let at = |x: usize, y: usize| samples[y * map_width + x];
        // Discard the padding of whole macroblocks.
        let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
        let chroma =
            |left: usize| Plane::from_fn(chroma_width, chroma_height, |x, y| at(x + left, map_height * 2 / 3 + y));
        let luma = Plane::from_fn(width, height, at);
        frames.push(Picture::new(luma, chroma(0), chroma(map_width / 2)).expect("planes that belong together"));
    }
    frames
}

/// Returns width and height, and the offset of the samples.
fn pgm_header(bytes: &[u8]) -> ([usize; 2], usize) {
    let mut words = Vec::new();
    let mut position = 0;
    while words.len() < 4 {
        // Read the four words of the header: type, width, height and maximum.
        let length = bytes[position..].iter().position(u8::is_ascii_whitespace).expect("a header of four words");
        words.push(std::str::from_utf8(&bytes[position..position + length]).expect("a header in ASCII"));
        position += length + 1;
    }
    assert_eq!((words[0], words[3]), ("P5", "255"), "a binary gray map");
    ([words[1], words[2]].map(|word| word.parse().expect("a number")), position)
}

/// Reads the frames of a YUV4MPEG2 file with 4:2:0 chroma.
pub fn read_y4m(path: &Path, size: (usize, usize)) -> Vec<Picture> {
    let mut file = y4m::decode(BufReader::new(File::open(path).expect("the y4m file is there"))).expect("a header");
    assert_eq!((file.get_width(), file.get_height()), size);
    assert!(matches!(file.get_colorspace(), y4m::Colorspace::C420mpeg2), "{:?}", file.get_colorspace());
    let mut frames = Vec::new();
    loop {
        match file.read_frame() {
            Ok(frame) => frames.push(picture([frame.get_y_plane(), frame.get_u_plane(), frame.get_v_plane()], size)),
            Err(y4m::Error::EOF) => return frames,
            Err(error) => panic!("frame {}: {error}", frames.len()),
        }
    }
}

/// Builds a picture from the samples of luma and chroma.
fn picture(planes: [&[u8]; 3], (width, height): (usize, usize)) -> Picture {
    let half = (width.div_ceil(2), height.div_ceil(2));
    let plane = |k: usize, (width, height)| Plane::from_vec(width, height, planes[k].to_vec());
    Picture::new(plane(0, (width, height)), plane(1, half), plane(2, half)).expect("planes that belong together")
}

/// Splits concatenated raw planar 4:2:0 pictures.
fn pictures(bytes: &[u8], (width, height): (usize, usize)) -> Vec<Picture> {
    // Split the output into pictures, which ffmpeg writes without headers.
    let (luma, chroma) = (width * height, width.div_ceil(2) * height.div_ceil(2));
    let size = luma + 2 * chroma;
    assert_eq!(bytes.len() % size, 0, "whole pictures of {width}x{height}");
    let planes = |bytes: &[u8]| {
        let (y, rest) = bytes.split_at(luma);
        picture([y, &rest[..chroma], &rest[chroma..]], (width, height))
    };
    bytes.chunks_exact(size).map(planes).collect()
}
