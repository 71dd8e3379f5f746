//! Compares the decoding speed of one thread with `ffmpeg -threads 1`: `bench_decode [FILE…]`.
//!
//! Without files, ffmpeg makes two clips: 720p with 6 Mbit/s, and interlaced 1080 lines with 15 Mbit/s.

use mpeg2dec::Input;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use std::{fs, io};

/// Number of runs, of which the fastest counts.
const RUNS: usize = 5;
/// Source and options of the clips.
const CLIPS: [(&str, &str, &str); 2] = [
    (
        "720p.m2v",
        "mandelbrot=s=1280x720:r=25:start_scale=1.5:end_scale=0.3:end_pts=150,noise=alls=4:allf=t:all_seed=1",
        "-frames:v 150 -b:v 6M -maxrate 8M -bufsize 3M",
    ),
    (
        "1080i.m2v",
        "testsrc2=s=1920x1080:r=50:d=6,noise=alls=6:allf=t:all_seed=1,tinterlace=interleave_top",
        "-frames:v 150 -flags +ildct+ilme -b:v 15M -maxrate 18M -bufsize 6M",
    ),
];

/// Makes the clips in the temporary folder.
fn clips() -> Result<Vec<PathBuf>, io::Error> {
    let mut paths = Vec::new();
    for (name, source, options) in CLIPS {
        let path = std::env::temp_dir().join(name);
        let status = Command::new("ffmpeg")
            .args(["-v", "error", "-y", "-f", "lavfi", "-i", source, "-pix_fmt", "yuv420p"])
            .args(["-c:v", "mpeg2video", "-bf", "2", "-g", "12"])
            .args(options.split(' '))
            .arg(&path)
            .status()?;
        if !status.success() {
            return Err(io::Error::other("ffmpeg failed"));
        }
        paths.push(path);
    }
    Ok(paths)
}

/// Returns the number of pictures and the time in seconds of this decoder.
fn ours(stream: &[u8]) -> (u64, f64) {
    let (mut input, start) = (Input::default(), Instant::now());
    for piece in stream.chunks(1 << 16) {
        input.push(piece, |_| ());
    }
    input.flush(|_| ());
    (input.counts().pictures, start.elapsed().as_secs_f64())
}

/// Returns the time of ffmpeg in seconds, without its start.
fn theirs(path: &Path) -> Result<f64, io::Error> {
    let output = Command::new("ffmpeg")
        .args(["-nostdin", "-hide_banner", "-benchmark", "-threads", "1", "-i"])
        .arg(path)
        .args(["-f", "null", "-"])
        .output()?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let time = text.split("rtime=").nth(1).and_then(|rest| rest.split('s').next());
    time.and_then(|time| time.parse().ok()).ok_or_else(|| io::Error::other("ffmpeg printed no time"))
}

fn main() -> Result<(), io::Error> {
    let mut paths: Vec<PathBuf> = std::env::args().skip(1).map(PathBuf::from).collect();
    if paths.is_empty() {
        paths = clips()?;
    }
    println!("| Clip | Pictures | mpeg2dec, pictures/s | libavcodec, pictures/s | Ratio |\n|---|---|---|---|---|");
    for path in paths {
        let stream = fs::read(&path)?;
        let (mut pictures, mut best, mut reference) = (0, f64::INFINITY, f64::INFINITY);
        // Alternate, so that both see the same load of the machine.
        for _ in 0..RUNS {
            let (count, seconds) = ours(&stream);
            (pictures, best) = (count, best.min(seconds));
            reference = reference.min(theirs(&path)?);
        }
        let (rate, reference) = (pictures as f64 / best, pictures as f64 / reference);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        println!("| {name} | {pictures} | {rate:.0} | {reference:.0} | {:.2} |", rate / reference);
    }
    Ok(())
}
