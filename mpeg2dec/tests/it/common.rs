//! Encoders and decoders that are installed, and comparisons of their pictures.

use mpeg2dec::{DecodedPicture, DecoderCounts, Input, SampleComponent};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::atomic::{AtomicU32, Ordering},
};

/// Returns the path of a new temporary file with this name ending.
pub fn temporary(ending: &str) -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{}-{number}.{ending}", std::process::id()))
}

/// Runs ffmpeg.
pub fn ffmpeg(arguments: &[&str]) -> Output {
    let output = Command::new("ffmpeg").args(["-nostdin", "-y", "-v", "warning"]).args(arguments).output();
    output.unwrap_or_else(|error| panic!("ffmpeg cannot be run ({error}): apt-get install ffmpeg"))
}

/// Encodes a moving pattern with noise. `size` is such as `96x64`; `ending` selects the container.
pub fn encoded(size: &str, ending: &str, options: &str) -> Vec<u8> {
    let path = temporary(ending);
    let source =
        format!("testsrc2=s=192x128:r=25:d=0.6,noise=alls=20:allf=t:all_seed=5,scale={}", size.replace('x', ":"));
    let sound = ["-f", "lavfi", "-i", "sine=d=0.6"];
    let sound = if options.contains("-c:a") { &sound[..] } else { &[] };
    let options: Vec<&str> = options.split_whitespace().collect();
    let file = path.to_str().expect("a path in UTF-8");
    let output = ffmpeg(&[&["-f", "lavfi", "-i", &source], sound, &options, &[file]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = fs::read(&path).expect("an encoded file");
    fs::remove_file(path).expect("a temporary file");
    bytes
}

/// Decodes with libavcodec and its floating-point inverse transform, to concatenated raw pictures.
pub fn libavcodec(stream: &[u8], format: &str) -> Vec<u8> {
    let path = temporary("stream");
    fs::write(&path, stream).expect("a temporary file");
    let file = path.to_str().expect("a path in UTF-8");
    let input = ["-xerror", "-threads", "1", "-idct", "faani", "-f", format, "-i", file];
    let output = ffmpeg(&[&input[..], &["-map", "0:v:0", "-fps_mode", "passthrough", "-f", "rawvideo", "-"]].concat());
    fs::remove_file(path).expect("a temporary file");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ffmpeg printed messages: {messages}");
    output.stdout
}

/// Runs a program with a file as input and output. Returns `None`, with a message, if the program is not installed.
pub fn run_if_installed(program: &str, arguments: &[&str], input: &Path) -> Option<Output> {
    let file = fs::File::open(input).expect("an input file");
    match Command::new(program).args(arguments).stdin(Stdio::from(file)).output() {
        Ok(output) => Some(output),
        Err(error) => {
            eprintln!("NOT TESTED: {program} cannot be run ({error}): apt-get install mjpegtools");
            None
        }
    }
}

/// Pictures of a stream, in display order.
#[derive(Default)]
pub struct Decoded {
    pub pictures: Vec<DecodedPicture>,
    pub counts: DecoderCounts,
}

impl Decoded {
    /// Returns the samples of all pictures, as ffmpeg writes them.
    pub fn raw(&self) -> Vec<u8> {
        self.pictures.iter().flat_map(raw).collect()
    }
}

/// Returns the visible samples of a picture: luma, then chroma.
pub fn raw(picture: &DecodedPicture) -> Vec<u8> {
    let planes = SampleComponent::ALL.map(|component| picture.plane(component));
    planes.iter().flat_map(|plane| plane.rows()).flatten().copied().collect()
}

/// Decodes a stream in pieces of `size` bytes.
pub fn decoded(stream: &[u8], size: usize) -> Decoded {
    let (mut input, mut pictures) = (Input::default(), Vec::new());
    for piece in stream.chunks(size) {
        input.push(piece, |picture| pictures.push(picture));
    }
    input.flush(|picture| pictures.push(picture));
    Decoded { pictures, counts: input.counts() }
}

/// Compares the pictures of a stream with libavcodec's and prints a row of a table. They must have the same number, differ by
/// at most 1, and have a mean squared error of at most 0.02.
pub fn check(feature: &str, source: &str, stream: &[u8], format: &str) -> Decoded {
    let (ours, theirs) = (decoded(stream, 4096), libavcodec(stream, format));
    let raw = ours.raw();
    let count = ours.pictures.len();
    assert!(count > 0, "{feature} of {source}: no pictures; {:?}", ours.counts);
    let picture_size = raw.len() / count;
    assert_eq!(raw.len(), theirs.len(), "{feature} of {source}: {count} pictures of {picture_size} bytes");
    let (mut largest, mut sum) = (0, 0.0);
    for (i, (&a, &b)) in raw.iter().zip(&theirs).enumerate() {
        let difference = a.abs_diff(b);
        let (picture, place) = (i / picture_size, i % picture_size);
        assert!(difference <= 1, "{feature} of {source}: {a} is not {b} at {place} of picture {picture}");
        largest = largest.max(difference);
        sum += f64::from(difference).powi(2);
    }
    let mean_square = sum / raw.len() as f64;
    println!("| {feature} | {source} | {count} | {largest} | {mean_square:.5} |");
    assert!(mean_square <= 0.02, "{feature} of {source}: mean square {mean_square}");
    assert_eq!((ours.counts.damaged_slices, ours.counts.concealed_macroblocks), (0, 0), "{feature} of {source}");
    ours
}
