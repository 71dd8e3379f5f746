//! Synthetic moving pictures, and the two decoders that check a stream.

use mpeg2enc::{Config, FrameRate, Packet, Picture, PictureType, SuppliedMotion, psnr};
use plane::{Correspondence, Plane};
use std::{
    io::Write,
    path::PathBuf,
    process::{Command, Stdio},
    sync::atomic::{AtomicU32, Ordering},
};

/// Returns an aperiodic texture with detail, at a position in pixels.
pub fn texture(x: f64, y: f64) -> f64 {
    let smooth = |x: f64, y: f64| {
        let hash = |x: i64, y: i64| {
            let mixed = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0x2545_f491_4f6c_dd1d);
            f64::from((mixed >> 40) as u8) - 127.5
        };
        let (i, j) = (x.floor() as i64, y.floor() as i64);
        // Interpolate smoothly between integer positions, without edges that vectors cannot follow.
        let soft = |t: f64| t * t * (3.0 - 2.0 * t);
        let (u, v) = (soft(x - x.floor()), soft(y - y.floor()));
        let upper = hash(i, j) * (1.0 - u) + hash(i + 1, j) * u;
        let lower = hash(i, j + 1) * (1.0 - u) + hash(i + 1, j + 1) * u;
        upper * (1.0 - v) + lower * v
    };
    126.0
        + 0.5 * smooth(x / 37.0, y / 37.0)
        + 0.3 * smooth(x / 11.0 + 90.0, y / 11.0)
        + 0.2 * smooth(x / 4.0, y / 4.0 + 70.0)
}

/// Returns a picture of the texture with its upper left corner at `(x, y)`.
pub fn pan(width: usize, height: usize, x: f64, y: f64) -> Picture {
    let at = |scale: f64, phase: f64| {
        move |i: usize, j: usize| {
            texture(scale * i as f64 + x + phase, scale * j as f64 + y + phase).round().clamp(16.0, 235.0) as u8
        }
    };
    let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
    Picture::new(
        Plane::from_fn(width, height, at(1.0, 0.0)),
        Plane::from_fn(chroma_width, chroma_height, at(2.0, 100.0)),
        Plane::from_fn(chroma_width, chroma_height, at(2.0, 300.0)),
    )
    .expect("the planes must match")
}

/// Returns frame `time` of moving content: a pan, a faster disc, flicker in a corner, and a shot change at frame 60.
pub fn moving(width: usize, height: usize, time: usize) -> Picture {
    let t = time as f64 + if time >= 60 { 5000.0 } else { 0.0 };
    let mut frame = pan(width, height, 1.7 * t, -0.6 * t);
    let [luma, ..] = frame.samples_mut();
    let (cx, cy, radius) = ((3.3 * t) % width as f64, height as f64 / 2.0, height as f64 / 5.0);
    for y in 0..height {
        for x in 0..width {
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            if dx * dx + dy * dy < radius * radius {
                luma[y * width + x] = (200.0 + 30.0 * (0.5 * dx).sin()) as u8;
            } else if x < width / 8 && y < height / 8 {
                luma[y * width + x] = ((x * 7919 + y * 104_729 + time * 31_337) % 251) as u8;
            }
        }
    }
    frame
}

/// Returns a picture of full-range noise with a seed.
pub fn noise(width: usize, height: usize, seed: u64) -> Picture {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut plane = |width: usize, height: usize| Plane::from_fn(width, height, |_, _| random.u8(..));
    let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
    Picture::new(plane(width, height), plane(chroma_width, chroma_height), plane(chroma_width, chroma_height))
        .expect("the planes must match")
}

/// Returns a motion field with the same vector everywhere.
pub fn uniform_motion(width: usize, height: usize, x: f32, y: f32) -> Correspondence {
    Correspondence::from_motion(Plane::filled(width, height, [x, y]))
}

/// Encodes frames without a motion field.
pub fn encode(config: Config, frames: impl Iterator<Item = Picture>) -> (Vec<u8>, Vec<Packet>) {
    let mut encoder = config.encoder().expect("a valid configuration");
    let packets: Vec<Packet> = frames.flat_map(|frame| encoder.push(&frame, SuppliedMotion::default())).collect();
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(encoder.finish().end);
    (stream, packets)
}

/// Encodes frames, optionally with motion to the previous frame. Returns the packets in display order.
pub fn encode_ahead(
    config: Config,
    frames: impl Iterator<Item = Picture>,
    motion: Option<&Correspondence>,
) -> (Vec<u8>, Vec<Packet>) {
    let mut encoder = config.with_lookahead(Config::LOOKAHEAD_MAX).encoder().expect("a valid configuration");
    let known = SuppliedMotion::from(motion);
    let mut packets: Vec<Packet> = frames.flat_map(|frame| encoder.push(&frame, known)).collect();
    let finish = encoder.finish();
    packets.extend(finish.packets);
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(finish.end);
    packets.sort_by_key(|packet| packet.display_index);
    (stream, packets)
}

pub fn largest_difference(a: &Picture, b: &Picture) -> u8 {
    let of = |a: &Plane<u8>, b: &Plane<u8>| {
        a.samples().iter().zip(b.samples()).map(|(&a, &b)| a.abs_diff(b)).max().expect("a plane has samples")
    };
    of(a.luma(), b.luma()).max(of(a.cb(), b.cb())).max(of(a.cr(), b.cr()))
}

/// Differences between decoded pictures and reconstructions.
#[derive(Debug, Default)]
pub struct Distance {
    pub largest: u8,
    pub squares: u64,
    pub samples: u64,
}

impl Distance {
    fn add(&mut self, a: &Picture, b: &Picture) {
        self.largest = self.largest.max(largest_difference(a, b));
        for (a, b) in a.planes().into_iter().zip(b.planes()) {
            let square = |(&a, &b): (&u8, &u8)| u64::from(a.abs_diff(b)).pow(2);
            self.squares += a.samples().iter().zip(b.samples()).map(square).sum::<u64>();
            self.samples += a.samples().len() as u64;
        }
    }
}

/// Checks that both decoders show the reconstruction. The tolerance is one for each prediction up to the picture and one for
/// the picture itself, the allowed mismatch of transforms. Errors rarely add up, so more than [`FARTHEST`] always fails.
pub fn check(stream: &[u8], packets: &[Packet], what: &str) {
    measure_distances(stream, packets, what, &mut Default::default());
}

/// Maximum difference between a decoded sample and the reconstruction.
const FARTHEST: usize = 2;

/// Runs [`check`], and adds the differences of ffmpeg and mpeg2dec to `distances`.
pub fn measure_distances(stream: &[u8], packets: &[Packet], what: &str, distances: &mut [Distance; 2]) {
    let (width, height) = (packets[0].reconstruction.width(), packets[0].reconstruction.height());
    let decoders = [
        ("ffmpeg", decode_ffmpeg(stream, width, height, "faani")),
        ("mpeg2dec", decode_mpeg2dec(stream, width, height)),
    ];
    check_own_decoder(stream, packets);
    let predictions = predictions(packets);
    for ((decoder, frames), sum) in decoders.into_iter().zip(distances) {
        assert_eq!(frames.len(), packets.len(), "{decoder} must show every picture of {what}");
        for (i, (frame, packet)) in frames.iter().zip(packets).enumerate() {
            sum.add(frame, &packet.reconstruction);
            let difference = largest_difference(frame, &packet.reconstruction);
            let allowed = (predictions[i] + 1).min(FARTHEST);
            assert!(
                usize::from(difference) <= allowed,
                "{decoder}, picture {i} ({:?}) of {what}: {difference}, not {allowed}",
                packet.picture_type
            );
        }
    }
}

/// Returns the number of predictions between each picture and an I picture, in display order.
fn predictions(packets: &[Packet]) -> Vec<usize> {
    let mut depths = vec![0; packets.len()];
    let mut last = 0;
    for (i, packet) in packets.iter().enumerate() {
        match packet.picture_type {
            PictureType::I => last = 0,
            PictureType::P => last += 1,
            PictureType::B => continue,
        }
        depths[i] = last;
    }
    let is_anchor = |i: &usize| packets[*i].picture_type != PictureType::B;
    for i in (0..packets.len()).filter(|i| !is_anchor(i)) {
        let before = (0..i).rev().find(is_anchor).map_or(0, |i| depths[i]);
        let after = (i..packets.len()).find(is_anchor).map_or(0, |i| depths[i]);
        depths[i] = before.max(after) + 1;
    }
    depths
}

pub fn config(width: usize, height: usize) -> Config {
    Config::new(width, height, FrameRate::FPS_25)
}

/// A file that is deleted when the value is dropped.
pub struct StreamFile(PathBuf);

impl StreamFile {
    pub fn new(stream: &[u8]) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("mpeg2enc-{}-{number}.m2v", std::process::id()));
        std::fs::File::create(&path).and_then(|mut file| file.write_all(stream)).expect("a temporary file");
        Self(path)
    }

    pub fn path(&self) -> &str {
        self.0.to_str().expect("a path in UTF-8")
    }
}

impl Drop for StreamFile {
    fn drop(&mut self) {
        // A remaining temporary file does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Runs a program that must succeed; returns its output and its messages.
pub fn run(program: &str, arguments: &[&str]) -> (Vec<u8>, String) {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).output().unwrap_or_else(|error| {
        panic!("{program} cannot be run ({error}); these tests need the programs ffmpeg and mpeg2dec on the PATH")
    });
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{program} {arguments:?} failed: {messages}");
    (output.stdout, messages)
}

/// Decodes with ffmpeg at its strictest; any message is a failure.
///
/// With `aggressive`, ffmpeg treats the four bytes of a sequence_end_code as excess data of a slice. This check therefore runs
/// without these bytes. A second check, only of warnings, includes them. `idct` is the inverse transform: `auto`, or `faani` for
/// the floating-point one nearest to the definition.
pub fn decode_ffmpeg(stream: &[u8], width: usize, height: usize, idct: &str) -> Vec<Picture> {
    let (body, end) = stream.split_at(stream.len() - 4);
    assert_eq!(end, [0, 0, 1, 0xb7], "the stream must end with sequence_end_code");
    let common = ["-nostdin", "-v", "warning", "-xerror", "-threads", "1", "-idct", idct, "-f", "mpegvideo"];
    // Probe enough bytes for a few pictures of noise; with fewer, ffmpeg cannot estimate their rate and warns.
    let common = [&common[..], &["-probesize", "100M"]].concat();
    let decode = |stream: &[u8], flags: &[&str], output: &[&str]| {
        let file = StreamFile::new(stream);
        let input = ["-i", file.path(), "-fps_mode", "passthrough"];
        let (bytes, messages) = run("ffmpeg", &[&common[..], flags, &input, output, &["-"]].concat());
        // Ignore two warnings that do not concern the stream: about ffmpeg's own raw output of tiny pictures, and about the
        // duration of a file that contains a bit rate.
        let elsewhere = ["The bitrate parameter is set too low", "Estimating duration from bitrate"];
        let is_about_stream = |line: &&str| !elsewhere.iter().any(|text| line.contains(text));
        let messages: Vec<&str> = messages.lines().filter(is_about_stream).collect();
        assert!(messages.is_empty(), "ffmpeg printed messages: {messages:?}");
        bytes
    };
    decode(stream, &[], &["-f", "null"]);
    let strict = ["-err_detect", "crccheck+bitstream+buffer+compliant+aggressive+explode"];
    let bytes = decode(body, &strict, &["-f", "rawvideo", "-pix_fmt", "yuv420p"]);
    let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
    let (luma_size, chroma_size) = (width * height, chroma_width * chroma_height);
    assert_eq!(bytes.len() % (luma_size + 2 * chroma_size), 0, "ffmpeg must return whole pictures of {width}x{height}");
    bytes
        .chunks_exact(luma_size + 2 * chroma_size)
        .map(|picture| {
            let (luma, chroma) = picture.split_at(luma_size);
            let (cb, cr) = chroma.split_at(chroma_size);
            Picture::new(
                Plane::from_vec(width, height, luma.to_vec()),
                Plane::from_vec(chroma_width, chroma_height, cb.to_vec()),
                Plane::from_vec(chroma_width, chroma_height, cr.to_vec()),
            )
            .expect("the planes must match")
        })
        .collect()
}

/// Decodes with mpeg2dec (libmpeg2).
pub fn decode_mpeg2dec(stream: &[u8], width: usize, height: usize) -> Vec<Picture> {
    let file = StreamFile::new(stream);
    let (bytes, _) = run("mpeg2dec", &["-o", "pgmpipe", file.path()]);
    let mut rest = &bytes[..];
    let mut frames = Vec::new();
    while !rest.is_empty() {
        // mpeg2dec writes a grayscale map in whole macroblocks: luma above both chroma planes, which are side by side.
        let (header, start) = pgm_header(rest);
        let [map_width, map_height] = header;
        let samples = &rest[start..start + map_width * map_height];
        rest = &rest[start + map_width * map_height..];
        let luma_height = map_height * 2 / 3;
        let at = |x: usize, y: usize| samples[y * map_width + x];
        let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
        let chroma =
            |offset: usize| Plane::from_fn(chroma_width, chroma_height, |x, y| at(x + offset, luma_height + y));
        frames.push(
            Picture::new(Plane::from_fn(width, height, at), chroma(0), chroma(map_width / 2))
                .expect("the planes must match"),
        );
    }
    frames
}

/// Returns width and height, and the offset of the samples.
fn pgm_header(bytes: &[u8]) -> ([usize; 2], usize) {
    let mut words = Vec::new();
    let mut position = 0;
    while words.len() < 4 {
        let end =
            position + bytes[position..].iter().position(u8::is_ascii_whitespace).expect("a header of four words");
        words.push(std::str::from_utf8(&bytes[position..end]).expect("a header of ASCII words"));
        position = end + 1;
    }
    assert_eq!((words[0], words[3]), ("P5", "255"), "a binary grayscale map");
    ([words[1], words[2]].map(|word| word.parse().expect("a number")), position)
}

/// Returns the minimum PSNR of the three planes, in dB.
pub fn agreement(a: &Picture, b: &Picture) -> f64 {
    let of_plane = |a: &Plane<u8>, b: &Plane<u8>| {
        // If there are few samples, a single difference of one would violate any limit in dB.
        let few = a.samples().len() < 256;
        let near = a.samples().iter().zip(b.samples()).all(|(&a, &b)| a.abs_diff(b) <= 1);
        if few && near { f64::INFINITY } else { psnr(a, b) }
    };
    of_plane(a.luma(), b.luma()).min(of_plane(a.cb(), b.cb())).min(of_plane(a.cr(), b.cr()))
}

/// Checks that both decoders agree with the reconstructions to at least this many dB.
pub fn check_decoders(stream: &[u8], packets: &[Packet], at_least: f64) {
    let (width, height) = (packets[0].reconstruction.width(), packets[0].reconstruction.height());
    check_agreement("ffmpeg", &decode_ffmpeg(stream, width, height, "auto"), packets, at_least);
    check_agreement("mpeg2dec", &decode_mpeg2dec(stream, width, height), packets, at_least);
    check_own_decoder(stream, packets);
}

/// Checks that the decoder of this project shows exactly the reconstructions.
fn check_own_decoder(stream: &[u8], packets: &[Packet]) {
    let (mut decoder, mut count) = (mpeg2dec::Decoder::default(), 0);
    let mut show = |picture: mpeg2dec::DecodedPicture| {
        let planes = packets[count].reconstruction.planes();
        for (plane, component) in planes.into_iter().zip(mpeg2dec::SampleComponent::ALL) {
            let rows = picture.plane(component);
            assert!(rows.rows().eq(plane.rows()), "{component:?} of picture {count} differs from the reconstruction");
        }
        count += 1;
    };
    decoder.push(stream, &mut show);
    decoder.flush(&mut show);
    assert_eq!(count, packets.len(), "{:?}", decoder.counts());
}

/// Returns the agreement of decoded pictures with the reconstructions in dB, after checking its minimum.
pub fn check_agreement(decoder: &str, frames: &[Picture], packets: &[Packet], at_least: f64) -> Vec<f64> {
    assert_eq!(frames.len(), packets.len(), "{decoder} must show every picture");
    let agreements = frames.iter().zip(packets).map(|(frame, packet)| agreement(frame, &packet.reconstruction));
    let agreements: Vec<f64> = agreements.collect();
    for (i, (&db, packet)) in agreements.iter().zip(packets).enumerate() {
        let (width, height, scale) = (frames[i].width(), frames[i].height(), packet.quantiser_scale);
        assert!(
            db >= at_least,
            "{decoder}, picture {i} of {width}x{height}, quantiser_scale {scale}: {db:.1} dB from the reconstruction"
        );
    }
    agreements
}
