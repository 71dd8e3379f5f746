//! Writes the saliency map of a picture. `bench/saliency.py` compares it with an independent program.
//!
//! `cargo run --release -p render2mpeg-perceptual --example saliency -- PICTURE.ppm MAP.pfm [MOTION.pfm]`
//!
//! PICTURE is a binary 8-bit PPM (P6). MOTION is a color PFM (PF, little-endian) with u_x in red and u_y in green
//! \[pixels/frame\]. MAP is a gray PFM.

use plane::Plane;
use std::{env, fs, process::ExitCode};

/// Picture size and samples of a PPM or PFM file.
struct Portable {
    width: usize,
    height: usize,
    samples: Vec<u8>,
}

/// Reads a PPM or PFM file with three samples of `bytes` bytes per pixel.
fn read(path: &str, magic: &str, bytes: usize) -> Result<Portable, String> {
    let file = fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let mut words = file.split(u8::is_ascii_whitespace).map(|word| String::from_utf8_lossy(word).into_owned());
    let mut header = [(); 4].map(|()| words.next().unwrap_or_default());
    let header_bytes = header.iter().map(|word| word.len() + 1).sum::<usize>();
    let fourth = header[3].parse::<f32>().unwrap_or_default();
    let [width, height] = [1, 2].map(|i| std::mem::take(&mut header[i]).parse().unwrap_or_default());
    let samples = file.get(header_bytes..).unwrap_or_default().to_vec();
    let whole = header[0] == magic && fourth == if bytes == 1 { 255.0 } else { -1.0 };
    if !whole || samples.len() != 3 * bytes * width * height {
        return Err(format!("{path} is no {magic} file of the kind that is read here"));
    }
    Ok(Portable { width, height, samples })
}

/// Reads display values from a PPM file.
fn read_picture(path: &str) -> Result<Plane<[f32; 3]>, String> {
    let Portable { width, height, samples } = read(path, "P6", 1)?;
    let value = |at: usize| f32::from(samples[at]) / 255.0;
    Ok(Plane::from_fn(width, height, |x, y| [0, 1, 2].map(|i| value(3 * (y * width + x) + i))))
}

/// Reads motion from a PFM file, which stores rows from bottom to top.
fn read_motion(path: &str) -> Result<Plane<[f32; 2]>, String> {
    let Portable { width, height, samples } = read(path, "PF", 4)?;
    let value = |at: usize| f32::from_le_bytes([0, 1, 2, 3].map(|byte| samples[4 * at + byte]));
    Ok(Plane::from_fn(width, height, |x, y| [0, 1].map(|i| value(3 * ((height - 1 - y) * width + x) + i))))
}

/// Writes a plane as a gray PFM file.
fn write(path: &str, map: &Plane<f32>) -> Result<(), String> {
    let mut file = format!("Pf\n{} {}\n-1\n", map.width(), map.height()).into_bytes();
    for y in (0..map.height()).rev() {
        map.row(y).iter().for_each(|value| file.extend(value.to_le_bytes()));
    }
    fs::write(path, file).map_err(|error| format!("{path}: {error}"))
}

fn run(arguments: &[String]) -> Result<(), String> {
    let (picture, map, motion) = match arguments {
        [picture, map] => (picture, map, None),
        [picture, map, motion] => (picture, map, Some(read_motion(motion)?)),
        _ => return Err("saliency PICTURE.ppm MAP.pfm [MOTION.pfm]".to_owned()),
    };
    write(map, &perceptual::saliency(&read_picture(picture)?, motion.as_ref()))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}
