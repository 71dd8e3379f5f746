//! Encodes a YUV4MPEG2 file (4:2:0, 8 bits) to an MPEG-2 elementary stream:
//!
//! ```text
//! ffmpeg -f lavfi -i testsrc2=size=512x512:rate=25:duration=2 -pix_fmt yuv420p clip.y4m
//! cargo run --release -p mpeg2enc --example encode_y4m -- clip.y4m clip.m2v 8 15
//! ```
//! The last two arguments are quantiser_scale and the distance of I pictures.

use mpeg2enc::{Config, Frame, FrameRate};
use plane::Plane;
use std::{
    error::Error,
    fs::File,
    io::{BufRead, BufReader, BufWriter, Read, Write},
    time::{Duration, Instant},
};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, input, output, quantiser_scale, gop] = &arguments[..] else {
        return Err("usage: encode_y4m INPUT.y4m OUTPUT.m2v QUANTISER_SCALE GOP".into());
    };
    let mut input = BufReader::new(File::open(input)?);
    let header = read_line(&mut input)?;
    let (width, height, fps) = parse_header(&header)?;
    let mut encoder = Config::new(width, height, FrameRate::from_fps(fps)?)
        .with_quantiser_scale(quantiser_scale.parse()?)
        .with_gop(gop.parse()?)
        .encoder()?;
    let mut output = BufWriter::new(File::create(output)?);
    let (mut bits, mut psnr, mut frames, mut time) = (0, 0.0, 0, Duration::ZERO);
    while read_line(&mut input)?.starts_with("FRAME") {
        let mut plane = |width: usize, height: usize| -> std::io::Result<Plane<u8>> {
            let mut samples = vec![0; width * height];
            input.read_exact(&mut samples)?;
            Ok(Plane::from_vec(width, height, samples))
        };
        let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
        let luma = plane(width, height)?;
        let frame = Frame::new(luma, plane(chroma_width, chroma_height)?, plane(chroma_width, chroma_height)?)?;
        let start = Instant::now();
        let packet = encoder.push(&frame, None);
        time += start.elapsed();
        output.write_all(&packet.data)?;
        bits += packet.bits;
        psnr += packet.psnr_y.min(100.0);
        frames += 1;
    }
    output.write_all(&encoder.finish())?;
    output.flush()?;
    let count = f64::from(frames.max(1));
    println!(
        "{frames} frames, {:.1} kbit/s, {:.3} dB (mean PSNR of luma), {:.1} frames/s",
        bits as f64 / count * fps / 1000.0,
        psnr / count,
        count / time.as_secs_f64()
    );
    Ok(())
}

fn read_line(input: &mut impl BufRead) -> std::io::Result<String> {
    let mut line = Vec::new();
    input.read_until(b'\n', &mut line)?;
    Ok(String::from_utf8_lossy(&line).trim_end().into())
}

/// Width, height and frames a second of a line such as `YUV4MPEG2 W512 H512 F25:1 Ip C420jpeg`.
fn parse_header(line: &str) -> Result<(usize, usize, f64), Box<dyn Error>> {
    if !line.starts_with("YUV4MPEG2") {
        return Err("this is not a YUV4MPEG2 file".into());
    }
    let value = |tag: char| line.split(' ').skip(1).find_map(|word| word.strip_prefix(tag));
    if value('C').is_some_and(|format| !format.starts_with("420") || format.starts_with("420p1")) {
        return Err("only 4:2:0 of 8 bits can be encoded".into());
    }
    let (numerator, denominator) = value('F').and_then(|rate| rate.split_once(':')).ok_or("the file states no rate")?;
    let fps = numerator.parse::<f64>()? / denominator.parse::<f64>()?;
    Ok((
        value('W').ok_or("the file states no width")?.parse()?,
        value('H').ok_or("the file states no height")?.parse()?,
        fps,
    ))
}
