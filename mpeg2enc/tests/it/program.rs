//! Tests of the example program, called with arguments like its process: exit codes, messages, files and streams.

use crate::common::*;
use example::{DONE, FAILED, Streams, WRONG_ARGUMENTS};
use mpeg2enc::{ElementaryStream, Picture};
use std::{
    io::Read,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU32, Ordering},
};

#[path = "../../examples/mpeg2enc/program/mod.rs"]
mod example;

/// Width and height of clips in pixels.
const SIZE: (usize, usize) = (32, 24);
/// Number of bytes of a frame with its marker.
const FRAME: usize = 6 + 32 * 24 * 3 / 2;
const HEADER: &str = "YUV4MPEG2 W32 H24 F25:1 Ip A1:1 C420jpeg";

/// A folder that is deleted when the value is dropped.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("mpeg2enc-program-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a folder");
        Self(path)
    }

    /// Returns the path of a file, as text.
    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().expect("a path of text").into()
    }

    /// Writes a file and returns its path.
    fn with(&self, name: &str, contents: &[u8]) -> String {
        std::fs::write(self.0.join(name), contents).expect("a file");
        self.path(name)
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).expect("a folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Exit code, standard output and standard error of a call.
#[derive(Debug)]
struct Called {
    code: u8,
    output: Vec<u8>,
    messages: String,
}

fn call_with(arguments: &[&str], mut input: impl Read + Send) -> Called {
    let (mut output, mut messages) = (Vec::new(), Vec::new());
    let streams = Streams { input: &mut input, output: &mut output, messages: &mut messages };
    let words = ["mpeg2enc"].iter().chain(arguments).map(Into::into);
    let code = example::run(words, streams);
    Called { code, output, messages: String::from_utf8(messages).expect("text") }
}

fn call(arguments: &[&str]) -> Called {
    call_with(arguments, std::io::empty())
}

impl Called {
    /// Checks that the call failed with one line that contains these words.
    fn fails(&self, code: u8, words: &[&str]) {
        assert_eq!(self.code, code, "{}", self.messages);
        assert!(self.messages.starts_with("mpeg2enc: ") && self.messages.lines().count() == 1, "{}", self.messages);
        for word in words {
            assert!(self.messages.contains(word), "{word} is not in {}", self.messages);
        }
    }

    fn succeeds(self) -> Self {
        assert_eq!(self.code, DONE, "{}", self.messages);
        self
    }
}

/// Returns a clip with this header.
fn clip_of(header: &str, frames: impl IntoIterator<Item = Picture>) -> Vec<u8> {
    let mut clip = format!("{header}\n").into_bytes();
    for mut frame in frames {
        clip.extend(b"FRAME\n");
        frame.samples_mut().iter().for_each(|samples| clip.extend_from_slice(samples));
    }
    clip
}

fn clip(header: &str, count: usize) -> Vec<u8> {
    clip_of(header, (0..count).map(|time| moving(SIZE.0, SIZE.1, time)))
}

/// Returns the number of pictures in a file, which must be complete.
fn pictures_in(path: impl AsRef<Path>) -> usize {
    let stream = std::fs::read(path).expect("a file");
    let stream = ElementaryStream::parse(&stream).expect("a stream");
    assert!(stream.is_ended);
    stream.units.len()
}

#[test]
fn lines_are_read_as_far_as_headers_go() {
    for (start, words) in [("YUV4MPEG2 W", ["byte 1024", "ffmpeg"]), ("", ["byte 0", "ffmpeg"])] {
        let endless = start.as_bytes().chain(std::io::repeat(b'1'));
        let called = call_with(&["-", "-o", "-"], endless);
        called.fails(FAILED, &["standard input", words[0], words[1]]);
        assert!(called.output.is_empty());
    }
    // The same limit applies to markers within the film.
    let endless = [&clip(HEADER, 2)[..], b"FRAME "].concat();
    call_with(&["-", "-o", "-"], endless.chain(std::io::repeat(b'1'))).fails(FAILED, &["frame 2", "FRAME 1111"]);
}

#[test]
fn damaged_markers_are_errors() {
    let folder = Folder::new();
    let (mut damaged, output) = (clip(HEADER, 6), folder.path("film.m2v"));
    let marker = HEADER.len() + 1 + 3 * FRAME;
    for wrong in ["FRXME\n", "FRAMES", "frame\n"] {
        damaged[marker..marker + 6].copy_from_slice(wrong.as_bytes());
        let input = folder.with("clip.y4m", &damaged);
        let place = format!("frame 3 at byte {marker}");
        call(&[&input, "-o", &output]).fails(FAILED, &[&input, &place, "recreate the clip", "the first 3 frames"]);
        assert_eq!(folder.names(), ["clip.y4m", "film.m2v.part"]);
        assert_eq!(pictures_in(folder.path("film.m2v.part")), 3);
    }
    // A frame marker may have parameters.
    let mut parameters = clip(HEADER, 2);
    let marker = HEADER.len() + 1 + FRAME;
    parameters.splice(marker + 5..marker + 6, *b" Ixyz\n");
    call(&[&folder.with("clip.y4m", &parameters), "-o", &output]).succeeds();
    assert_eq!(folder.names(), ["clip.y4m", "film.m2v"]);
}

#[test]
fn cut_clips_are_errors_that_keep_whole_frames() {
    let folder = Folder::new();
    let output = folder.with("film.m2v", b"an older film");
    let clip = clip(HEADER, 4);
    for cut in [HEADER.len() + 1 + 2 * FRAME + 3, HEADER.len() + 1 + 2 * FRAME + 6, HEADER.len() + 3 * FRAME] {
        let input = folder.with("clip.y4m", &clip[..cut]);
        call(&[&input, "-o", &output]).fails(FAILED, &["frame 2 at byte", "film.m2v.part contains the first 2 frames"]);
        assert_eq!(pictures_in(folder.path("film.m2v.part")), 2);
        assert_eq!(std::fs::read(&output).expect("a file"), b"an older film");
    }
    std::fs::remove_file(folder.path("film.m2v.part")).expect("a file");

    // A stream receives the complete frames, and the exit code reports the error.
    let called = call_with(&["-", "-o", "-"], &clip[..clip.len() - 1]);
    called.fails(FAILED, &["standard input: frame 3", "the output contains the first 3 frames"]);
    assert_eq!(ElementaryStream::parse(&called.output).expect("a stream").units.len(), 3);

    // An incomplete first frame leaves no output.
    let input = folder.with("clip.y4m", &clip[..200]);
    call(&[&input, "-o", &folder.path("new.m2v")]).fails(FAILED, &["frame 0 at byte 41"]);
    assert_eq!(folder.names(), ["clip.y4m", "film.m2v"]);
}

#[test]
fn clips_without_frames_are_errors() {
    let folder = Folder::new();
    let input = folder.with("clip.y4m", &clip(HEADER, 0));
    call(&[&input, "-o", &folder.path("film.m2v")]).fails(FAILED, &[&input, "no frame"]);
    assert_eq!(folder.names(), ["clip.y4m"]);
    let input = folder.with("clip.y4m", HEADER.as_bytes());
    call(&[&input, "-o", &folder.path("film.m2v")]).fails(FAILED, &["the file ends"]);
}

#[test]
fn numbers_out_of_range_are_wrong_arguments() {
    let folder = Folder::new();
    let (input, output) = (folder.with("clip.y4m", &clip(HEADER, 1)), folder.path("film.m2v"));
    for (option, value) in [
        ("--bitrate", "4295967"),
        ("--bitrate", "0"),
        ("--maxrate", "4294968"),
        ("--vbv", "16"),
        ("--gop", "133"),
        ("--bframes", "8"),
        ("--dc", "12"),
        ("--qscale", "9"),
        ("--threads", "1025"),
        ("--aspect", "3:1"),
        ("--matrix", "bt2020"),
    ] {
        let called = call(&[&input, "-o", &output, option, value]);
        assert_eq!(called.code, WRONG_ARGUMENTS, "{option} {value}");
        assert!(called.messages.contains(option) && called.messages.contains(value), "{}", called.messages);
    }
    // These options depend on each other, or on the clip.
    let wrong = |options: &[&str], words: &[&str]| {
        call(&[&[&input, "-o", &output], options].concat()).fails(WRONG_ARGUMENTS, words);
    };
    wrong(&["-b", "2", "--vbv", "100"], &["2000 bits a second", "6000 bits a second"]);
    wrong(&["--vbv", "100"], &["--maxrate"]);
    wrong(&["-b", "100", "--maxrate", "200"], &["--two-pass"]);
    wrong(&["-b", "90000"], &["80000000"]);
    wrong(&["--mpeg1", "--matrix", "fcc"], &["MPEG-1"]);
    call(&[&input, "-o", &folder.path("film.avi")]).fails(WRONG_ARGUMENTS, &["film.avi", "--container"]);
    call(&[&input, "-o", &folder.path("film")]).fails(WRONG_ARGUMENTS, &["film", ".mkv", "--container"]);
    assert_eq!(folder.names(), ["clip.y4m"]);
}

#[test]
fn rates_that_are_not_kept_are_told() {
    let folder = Folder::new();
    let (input, output) = (folder.with("clip.y4m", &clip(HEADER, 100)), folder.path("film.m2v"));
    let called = call(&[&input, "-o", &output, "-b", "6", "--gop", "1"]).succeeds();
    assert!(called.messages.contains("of 100 pictures are late") && called.messages.contains("--bitrate"));
    assert_eq!(called.messages.lines().count(), 1);
    let called = call(&[&input, "-o", &output, "-b", "500"]).succeeds();
    assert_eq!(called.messages, "");
}

#[test]
fn standard_streams_and_devices_are_written_as_they_are() {
    let folder = Folder::new();
    let (clip, output) = (clip(HEADER, 5), folder.path("film.m2v"));
    let input = folder.with("clip.y4m", &clip);
    let called = call(&[&input, "-o", &output]).succeeds();
    assert!(called.output.starts_with(b"5 frames, ") && called.messages.is_empty());
    assert_eq!(folder.names(), ["clip.y4m", "film.m2v"], "no temporary file must remain");
    let film = std::fs::read(&output).expect("a film");

    // The report must not be mixed into a film on standard output.
    for (from, to) in [("-", "-"), (&*input, "/dev/stdout"), ("/dev/stdin", "-")] {
        let called = call_with(&[from, "-o", to, "--verbose"], &clip[..]).succeeds();
        assert!(called.output == film, "{from} {to}");
        assert_eq!(called.messages.lines().count(), 6, "{}", called.messages);
    }
    let called = call_with(&["-", "-o", "-", "--container", "ts"], &clip[..]).succeeds();
    assert_eq!((called.output[0], called.output.len() % 188), (0x47, 0));
    call(&[&input, "-o", "/dev/null"]).succeeds();
    assert!(!Path::new("/dev/null.part").exists());
    let words = ["--two-pass", "encode from a file into a file"];
    call_with(&["-", "-o", &output, "-b", "100", "--two-pass"], &clip[..]).fails(WRONG_ARGUMENTS, &words);
    call(&[&input, "-o", "-", "-b", "100", "--two-pass"]).fails(WRONG_ARGUMENTS, &words);

    // A symbolic link is kept, and its target is replaced.
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path("film.m2v"), folder.path("link.m2v")).expect("a link");
        call(&[&input, "-o", &folder.path("link.m2v"), "--qscale", "30"]).succeeds();
        assert!(folder.0.join("link.m2v").is_symlink() && std::fs::read(&output).expect("a film") != film);
    }
}

#[test]
fn two_passes_leave_one_film() {
    let folder = Folder::new();
    let (input, output) = (folder.with("clip.y4m", &clip(HEADER, 10)), folder.path("film.m2v"));
    let called = call(&[&input, "-o", &output, "-b", "100", "--two-pass"]).succeeds();
    assert!(called.messages.lines().all(|line| line.starts_with("quantiser_scale ")));
    assert_eq!((folder.names(), pictures_in(&output)), (vec!["clip.y4m".into(), "film.m2v".into()], 10));
}

/// Returns aspect_ratio_information of the stream from a clip with this header, or the failed call.
fn aspect_of(header: &str, options: &[&str]) -> Result<u8, Called> {
    let called = call_with(&[&["-", "-o", "-"], options].concat(), &clip(header, 1)[..]);
    if called.code == DONE { Ok(called.output[7] >> 4) } else { Err(called) }
}

#[test]
fn fields_of_headers_are_obeyed_or_refused() {
    let with = |from: &str, to: &str| HEADER.replace(from, to);
    let is_fine = |header: &str| aspect_of(header, &[]).is_ok();
    let refused = |header: &str, words: &[&str]| {
        let called = aspect_of(header, &[]).expect_err("an error");
        called.fails(FAILED, &[&["standard input"], words].concat());
    };
    assert!(is_fine(HEADER) && is_fine(&with(" Ip", "")) && is_fine(&with("Ip", "I?")));
    for kind in ["It", "Ib", "Im"] {
        refused(&with("Ip", kind), &[kind, "interlaced", "bwdif"]);
    }
    refused(&with("Ip", "Iz"), &["Iz"]);

    // 32×24 samples with an aspect ratio of 4:3 make a 16:9 picture.
    for (field, code) in [("A1:1", 1), ("A4:3", 3), ("A1657:1000", 4), ("A0:0", 1), ("", 1)] {
        assert_eq!(aspect_of(&with("A1:1", field), &[]).ok(), Some(code), "{field}");
    }
    refused(&with("A1:1", "A5:1"), &["5:1", "--aspect", "setsar"]);
    refused(&with("A1:1", "A5"), &["A5"]);
    assert_eq!(aspect_of(&with("A1:1", "A5:1"), &["--aspect", "4:3"]).ok(), Some(2));

    assert!(is_fine(&with("C420jpeg", "C420paldv XYSCSS=420JPEG XFOO")));
    for format in ["C422", "C420p10", "Cmono"] {
        refused(&with("C420jpeg", format), &[format, "yuv420p"]);
    }
    refused(&format!("{HEADER} XCOLORRANGE=MAYBE"), &["MAYBE"]);
    refused(&with("F25:1", "F26:1"), &["26 frames a second"]);
    refused(&with("F25:1", "F25"), &["F25"]);
    refused(&with("W32", "W-2"), &["W-2"]);
    refused(&with(" H24", ""), &["field H"]);
    call_with(&["-", "-o", "-"], format!("{}\n", with("W32", "W99999")).as_bytes()).fails(FAILED, &["99999x24"]);
}

#[test]
fn full_range_becomes_limited_range() {
    let frames = || (0..3).map(|time| noise(SIZE.0, SIZE.1, time));
    let limited = frames().map(|mut frame| {
        for (samples, steps) in frame.samples_mut().into_iter().zip([219.0, 224.0, 224.0]) {
            samples.iter_mut().for_each(|sample| *sample = (16.0 + f64::from(*sample) * steps / 255.0).round() as u8);
        }
        frame
    });
    let encode = |field: &str, clip: Vec<u8>| {
        let called = call_with(&["-", "-o", "-", "-q", "1"], &clip[..]).succeeds();
        assert_eq!(called.messages.contains("limited range"), field.ends_with("FULL"));
        called.output
    };
    let of = |field: &str, frames: Vec<Picture>| encode(field, clip_of(&format!("{HEADER} {field}"), frames));
    let full = of("XCOLORRANGE=FULL", frames().collect());
    assert!(full == of("XCOLORRANGE=LIMITED", limited.collect()));
    assert!(full != of("XOTHER=FULLY", frames().collect()));
}

/// YUV4MPEG2 contains no matrix, and programs that write it assume BT.601.
#[test]
fn the_matrix_of_a_clip_is_that_of_bt601() {
    let called = call_with(&["-", "-o", "-"], &clip(HEADER, 1)[..]).succeeds();
    assert!(called.output.windows(8).any(|bytes| bytes == [0, 0, 1, 0xb5, 0x2b, 1, 1, 6]));
}

#[test]
fn colors_reach_the_stream() {
    let options = ["--primaries", "bt470bg", "--transfer", "smpte170m", "--matrix", "fcc"];
    let called = call_with(&[&["-", "-o", "-"], &options[..]].concat(), &clip(HEADER, 1)[..]).succeeds();
    let extension = [0, 0, 1, 0xb5, 0x2b, 5, 6, 4];
    assert!(called.output.windows(8).any(|bytes| bytes == extension));
}
