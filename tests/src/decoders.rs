//! ffmpeg and mpeg2dec: what others make of our streams.

use mpeg2enc::Picture;
use plane::Plane;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(decoder: &str, arguments: &[&str]) -> Output {
    let output = Command::new(decoder).args(arguments).stdin(Stdio::null()).output();
    output.unwrap_or_else(|error| {
        panic!("{decoder} cannot be run ({error}): install it, for instance with: apt-get install ffmpeg mpeg2dec")
    })
}

/// ffmpeg's name of what a video is, by its ending.
fn format_of(video: &str) -> &'static str {
    match video.rsplit('.').next() {
        Some("mpg") => "mpeg",
        Some("ts") => "mpegts",
        Some("mp4") => "mov",
        Some("mkv") => "matroska",
        _ => "mpegvideo",
    }
}

/// Decodes with ffmpeg; any warning is a failure.
pub fn decode_ffmpeg(video: &Path, (width, height): (usize, usize)) -> Vec<Picture> {
    let video = video.to_str().expect("a path in UTF-8");
    let strict = ["-nostdin", "-v", "warning", "-xerror", "-f", format_of(video), "-i", video];
    let raw = ["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "yuv420p", "-"];
    let output = run("ffmpeg", &[&strict[..], &raw].concat());
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.is_empty(), "ffmpeg has something to say: {messages}");
    pictures(&output.stdout, (width, height))
}

/// Pictures that ffmpeg finds in a stream that may be cut off anywhere.
pub fn tolerant_frame_count(video: &Path, (width, height): (usize, usize)) -> usize {
    let video = video.to_str().expect("a path in UTF-8");
    let arguments = ["-nostdin", "-v", "quiet", "-f", format_of(video), "-i", video, "-fps_mode", "passthrough"];
    let output = run("ffmpeg", &[&arguments[..], &["-f", "rawvideo", "-pix_fmt", "yuv420p", "-"]].concat());
    pictures(&output.stdout, (width, height)).len()
}

/// Decodes with mpeg2dec (libmpeg2), which gives pictures in whole macroblocks.
pub fn decode_mpeg2dec(video: &Path, (width, height): (usize, usize)) -> Vec<Picture> {
    let output = run("mpeg2dec", &["-o", "pgmpipe", video.to_str().expect("a path in UTF-8")]);
    assert!(output.status.success(), "mpeg2dec failed: {}", String::from_utf8_lossy(&output.stderr));
    let mut rest = &output.stdout[..];
    let mut frames = Vec::new();
    while !rest.is_empty() {
        // A gray map of luma above both chroma planes side by side.
        let ([map_width, map_height], start) = pgm_header(rest);
        let samples = &rest[start..start + map_width * map_height];
        rest = &rest[start + map_width * map_height..];
        let at = |x: usize, y: usize| samples[y * map_width + x];
        let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
        let chroma =
            |left: usize| Plane::from_fn(chroma_width, chroma_height, |x, y| at(x + left, map_height * 2 / 3 + y));
        let luma = Plane::from_fn(width, height, at);
        frames.push(Picture::new(luma, chroma(0), chroma(map_width / 2)).expect("planes that belong together"));
    }
    frames
}

/// Width and height, and where the samples start.
fn pgm_header(bytes: &[u8]) -> ([usize; 2], usize) {
    let mut words = Vec::new();
    let mut position = 0;
    while words.len() < 4 {
        let length = bytes[position..].iter().position(u8::is_ascii_whitespace).expect("a header of four words");
        words.push(std::str::from_utf8(&bytes[position..position + length]).expect("a header in ASCII"));
        position += length + 1;
    }
    assert_eq!((words[0], words[3]), ("P5", "255"), "a binary gray map");
    ([words[1], words[2]].map(|word| word.parse().expect("a number")), position)
}

/// The frames of a YUV4MPEG2 file of 4:2:0 pictures.
pub fn read_y4m(path: &Path, size: (usize, usize)) -> Vec<Picture> {
    let bytes = std::fs::read(path).expect("the y4m file is there");
    let end = bytes.iter().position(|&byte| byte == b'\n').expect("a header line");
    let header = std::str::from_utf8(&bytes[..end]).expect("a header in ASCII");
    let (width, height) = size;
    assert!(header.starts_with(&format!("YUV4MPEG2 W{width} H{height} ")) && header.contains(" C420"), "{header}");
    let marker = b"FRAME\n";
    let frames = bytes[end + 1..].chunks(marker.len() + picture_bytes(size));
    frames
        .map(|frame| {
            assert!(frame.starts_with(marker), "each frame begins with its marker");
            pictures(&frame[marker.len()..], size).pop().expect("a whole frame")
        })
        .collect()
}

fn picture_bytes((width, height): (usize, usize)) -> usize {
    width * height + 2 * width.div_ceil(2) * height.div_ceil(2)
}

/// Raw planar 4:2:0 pictures, one after the other.
fn pictures(bytes: &[u8], (width, height): (usize, usize)) -> Vec<Picture> {
    let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
    let size = picture_bytes((width, height));
    assert_eq!(bytes.len() % size, 0, "whole pictures of {width}x{height}");
    let plane = |bytes: &[u8], width, height| Plane::from_vec(width, height, bytes.to_vec());
    bytes
        .chunks_exact(size)
        .map(|picture| {
            let (luma, chroma) = picture.split_at(width * height);
            let (cb, cr) = chroma.split_at(chroma_width * chroma_height);
            let chroma = |bytes| plane(bytes, chroma_width, chroma_height);
            Picture::new(plane(luma, width, height), chroma(cb), chroma(cr)).expect("planes that belong together")
        })
        .collect()
}
