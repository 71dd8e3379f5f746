//! Limits of the syntax, checked by ffmpeg at its strictest and by mpeg2dec. They include the largest levels, every escape code,
//! the longest vectors, and the smallest and widest pictures. Further limits are streams of one picture, long durations and full
//! buffers.
//!
//! This file does not repeat the checks in `decode.rs`, `lookahead.rs` and `container.rs`.

use crate::common::*;
use mpeg2enc::{
    Config, Container, Effort, FrameRate, Multiplexer, Packet, Picture, PictureType, Rate, Standard, SuppliedMotion,
};
use plane::Plane;
use std::process::{Command, Stdio};

/// Returns a picture with the same pattern in all three planes.
fn patterned(width: usize, height: usize, at: impl Fn(usize, usize) -> u8) -> Picture {
    let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
    let plane = |width, height| Plane::from_fn(width, height, &at);
    Picture::new(plane(width, height), plane(chroma_width, chroma_height), plane(chroma_width, chroma_height)).unwrap()
}

/// Returns black and white blocks by the sign of a DCT basis function: the largest coefficient of 8-bit samples, for 64
/// frequencies.
fn wave(u: usize, v: usize, inverted: bool) -> Picture {
    let cosine = |k: usize, f: usize| ((2 * k + 1) as f64 * f as f64 * std::f64::consts::PI / 16.0).cos();
    patterned(32, 32, |x, y| if (cosine(x % 8, u) * cosine(y % 8, v) > 0.0) != inverted { 255 } else { 0 })
}

/// All weights and quantiser_scale are 1. Levels would far exceed their range and are clamped to ±2047 (MPEG-2) and ±255
/// (MPEG-1). Decoders still show the encoder's reconstruction, for every frequency, both signs, intra and predicted.
#[test]
fn levels_at_their_limit() {
    let mut flat = [1; 64];
    flat[0] = 8;
    for standard in [Standard::Mpeg2, Standard::Mpeg1] {
        let scale = if standard == Standard::Mpeg2 { 1 } else { 2 };
        for effort in [Effort::Fast, Effort::Best] {
            let settings = config(32, 32)
                .with_standard(standard)
                .with_matrices(flat, [1; 64])
                .with_quantiser_scale(scale)
                .with_effort(effort)
                // Predict only once: for samples half-way between two values, the decoders' rounding errors accumulate.
                .with_gop(2);
            let frames = (0..64).flat_map(|k| [wave(k % 8, k / 8, k % 3 == 0), wave(k % 8, k / 8, k % 3 != 0)]);
            let (stream, packets) = encode(settings, frames);
            check(&stream, &packets, &format!("waves in {standard:?}, {effort:?}"));
        }
    }
}

/// With the default matrices at quantiser_scale 1 no level is clamped: even the worst blocks are nearly preserved.
#[test]
fn the_finest_quantiser_is_nearly_lossless_for_the_worst_blocks() {
    let settings = config(32, 32).with_quantiser_scale(1).with_gop(3);
    let (stream, packets) = encode(settings, (0..64).map(|k| wave(k % 8, k / 8, k % 2 == 0)));
    check(&stream, &packets, "waves");
    for (k, packet) in packets.iter().enumerate() {
        assert!(packet.psnr_y > 40.0, "wave {k}: {} dB", packet.psnr_y);
    }
}

/// Codes random blocks for all scans, tables, efforts and precisions; most of their runs and levels need escapes.
#[test]
fn escape_codes_in_every_table_and_scan() {
    for (k, (zero, alternate)) in [(false, false), (false, true), (true, false), (true, true)].into_iter().enumerate() {
        let table = if zero { mpeg2enc::CoefficientTable::Zero } else { mpeg2enc::CoefficientTable::One };
        for scale in [1, 2, 7] {
            let settings = config(48, 32)
                .with_intra_table(table)
                .with_alternate_scan(alternate)
                .with_intra_dc_precision(8 + k as u32)
                .with_quantiser_scale(scale)
                .with_gop(3);
            // Sparse noise has long runs before large levels; dense noise has short runs.
            let sparse = |seed: usize| {
                patterned(48, 32, move |x, y| if (x * 31 + y * 17 + seed * 7).is_multiple_of(53) { 255 } else { 16 })
            };
            let frames = (0..6).map(|n| if n % 2 == 0 { noise(48, 32, n as u64 + 40) } else { sparse(n) });
            let (stream, packets) = encode(settings, frames);
            check(&stream, &packets, &format!("{table:?}, alternate {alternate}, quantiser_scale {scale}"));
        }
    }
}

/// Tests vectors out of the picture on every side, and NaN vectors. The stream only refers to existing samples.
#[test]
fn vectors_beyond_the_picture() {
    let (width, height) = (48, 32);
    for motion in [
        [1e30, 0.0],
        [-1e30, 1e30],
        [f32::NAN, f32::INFINITY],
        [500.0, 500.0],
        [-47.5, -31.5],
        [32.0, 16.0],
        [f32::MIN_POSITIVE, -f32::MIN_POSITIVE],
    ] {
        let mut encoder = config(width, height).with_gop(6).encoder().unwrap();
        let field = uniform_motion(width, height, motion[0], motion[1]);
        let packets: Vec<_> =
            (0..6).flat_map(|n| encoder.push(&moving(width, height, n), SuppliedMotion::from(&field))).collect();
        let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.clone()).collect();
        stream.extend(encoder.finish().end);
        check(&stream, &packets, &format!("motion {motion:?}"));
    }
}

/// Codes a film of one picture, with settings that expect more pictures.
#[test]
fn streams_of_one_picture() {
    for (width, height) in [(1, 1), (16, 16), (33, 7)] {
        for rate in [
            Rate::ConstantQuantiser,
            Rate::Constant { bits_per_second: 400_000, buffer_bits: 200_000 },
            Rate::Capped { bits_per_second: 400_000, buffer_bits: 200_000 },
        ] {
            for effort in [Effort::Fast, Effort::Balanced, Effort::Best] {
                let settings = config(width, height).with_b_pictures(3).with_rate(rate).with_effort(effort);
                let (stream, packets) = encode_ahead(settings, std::iter::once(moving(width, height, 3)), None);
                assert_eq!((packets.len(), packets[0].picture_type), (1, PictureType::I));
                check(&stream, &packets, &format!("{width}x{height}, {rate:?}, {effort:?}"));
            }
        }
    }
}

/// Ends a film without frames: nothing is coded, and nothing fails.
#[test]
fn streams_of_no_picture() {
    let settings = config(16, 16).with_b_pictures(2);
    for settings in [settings.clone().with_lookahead(2), settings.with_b_pictures(0)] {
        assert!(settings.encoder().unwrap().finish().packets.is_empty());
    }
}

fn output_of(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).output();
    let output = output.unwrap_or_else(|error| panic!("{program} cannot be run ({error}); install ffmpeg"));
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.is_empty(), "{program} {arguments:?}: {messages}");
    String::from_utf8(output.stdout).expect("text")
}

/// Codes a hundred thousand pictures: temporal_reference and time codes wrap many times, and the 90 kHz timestamps exceed 31
/// bits. All timestamps follow the frame rate to one tick.
#[test]
fn a_hundred_thousand_pictures_keep_their_times() {
    const COUNT: usize = 100_000;
    let config = Config::new(16, 16, FrameRate::from_fps(23.976).unwrap()).with_gop(132).with_effort(Effort::Fast);
    for (container, name) in [(Container::Program, "mpg"), (Container::Transport, "ts")] {
        let mut multiplexer = Multiplexer::new(container, &config);
        let mut encoder = config.clone().encoder().unwrap();
        let frames = [0u8, 1].map(|k| patterned(16, 16, |_, _| 100 + 20 * k));
        let still = uniform_motion(16, 16, 0.0, 0.0);
        let mut file = Vec::new();
        for n in 0..COUNT {
            // Change the picture occasionally.
            for packet in encoder.push(&frames[n / 5000 % 2], SuppliedMotion::from(&still)) {
                file.extend(multiplexer.push(packet));
            }
        }
        file.extend(multiplexer.finish(&encoder.finish().end));
        let path = std::env::temp_dir().join(format!("mpeg2enc-long-{}.{name}", std::process::id()));
        std::fs::write(&path, &file).unwrap();
        let arguments = ["-v", "error", "-select_streams", "v", "-show_entries", "packet=pts", "-of", "csv=p=0"];
        let text = output_of("ffprobe", &[&arguments[..], &[path.to_str().unwrap()]].concat());
        std::fs::remove_file(&path).unwrap();
        let times: Vec<i64> = text.lines().filter_map(|line| line.split(',').next()?.parse().ok()).collect();
        assert_eq!(times.len(), COUNT, "{name}: ffprobe must find every picture");
        for (n, time) in times.iter().enumerate() {
            // 90 kHz · 1001 / 24000 is 3753.75: rounding errors must not accumulate.
            let exact = n as f64 * 90_000.0 * 1001.0 / 24_000.0;
            let off = (time - times[0]) as f64 - exact;
            assert!(off.abs() <= 1.0, "{name}, picture {n}: {off} ticks off");
        }
    }
}

/// Codes noise, which can be neither predicted nor compressed much, with the smallest buffers at low and high rates. Decoders
/// accept the stream. Where a picture would exceed the buffer, its quantiser is coarser and the stream stays playable.
#[test]
fn buffers_at_their_edge() {
    let (width, height) = (64, 48);
    for (bits_per_second, buffer_bits) in [(100_000, 16_384), (1_000_000, 16_384 * 3), (15_000_000, 1_835_008)] {
        for constant in [true, false] {
            let rate = match constant {
                true => Rate::Constant { bits_per_second, buffer_bits },
                false => Rate::Capped { bits_per_second, buffer_bits },
            };
            for b_pictures in [0, 2] {
                let settings =
                    config(width, height).with_rate(rate).with_b_pictures(b_pictures).with_quantiser_scale(1);
                // Code black, then noise, then black: no bits could be saved in advance.
                let frames = (0..40)
                    .map(|n| if n / 10 % 2 == 1 { noise(width, height, n) } else { Picture::black(width, height) });
                let mut encoder = settings.with_lookahead(Config::LOOKAHEAD_MAX).encoder().unwrap();
                let mut packets: Vec<_> =
                    frames.flat_map(|frame| encoder.push(&frame, SuppliedMotion::default())).collect();
                let finish = encoder.finish();
                packets.extend(finish.packets);
                let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.clone()).collect();
                stream.extend(finish.end);
                let what = format!("{rate:?}, {b_pictures} B pictures");
                never_runs_dry(&packets, rate, &what);
                packets.sort_by_key(|packet| packet.display_index);
                check(&stream, &packets, &what);
            }
        }
    }
}

/// Checks a decoder's buffer by its definition (C.3): bits arrive at the rate while there is room, and each picture is removed
/// when due. The initial fullness is the maximum, or at a constant rate the value of the first vbv_delay.
fn never_runs_dry(packets: &[Packet], rate: Rate, what: &str) {
    let (Rate::Constant { bits_per_second, buffer_bits } | Rate::Capped { bits_per_second, buffer_bits }) = rate else {
        panic!("a bounded rate")
    };
    let mut fullness = f64::from(buffer_bits);
    if let Rate::Constant { .. } = rate {
        let data = &packets[0].data;
        let start = data.windows(4).position(|code| code == [0, 0, 1, 0]).expect("picture_start_code");
        let delay =
            u32::from(data[start + 5] & 7) << 13 | u32::from(data[start + 6]) << 5 | u32::from(data[start + 7]) >> 3;
        fullness = f64::from(delay) / 90_000.0 * f64::from(bits_per_second) + 8.0 * (start + 4) as f64;
    }
    for packet in packets {
        fullness -= packet.bits as f64;
        assert!(fullness >= 0.0, "{what}: for picture {} {} bits are missing", packet.display_index, -fullness);
        fullness = (fullness + f64::from(bits_per_second) / 25.0).min(f64::from(buffer_bits));
    }
}

/// Containers can be made from settings that every encoder refuses.
#[test]
fn containers_of_impossible_rates() {
    for rate in [
        Rate::Constant { bits_per_second: 0, buffer_bits: 0 },
        Rate::Capped { bits_per_second: 0, buffer_bits: u32::MAX },
        Rate::Constant { bits_per_second: u32::MAX, buffer_bits: u32::MAX },
    ] {
        let settings = config(16, 16).with_rate(rate);
        use Container::{Elementary, Matroska, Mp4, Program, Transport};
        for container in [Elementary, Program, Transport, Mp4, Matroska] {
            let _ = Multiplexer::new(container, &settings);
        }
        assert!(settings.with_lookahead(Config::LOOKAHEAD_MAX).encoder().is_err());
    }
}

/// Tests look-aheads longer than the film, with and without given motion.
#[test]
fn short_films_with_many_b_pictures() {
    for count in 1..=9 {
        let mut encoder = config(32, 32).with_b_pictures(7).with_gop(132).with_lookahead(30).encoder().unwrap();
        let field = uniform_motion(32, 32, 0.5, -0.5);
        let known = SuppliedMotion { to_previous: Some(&field), to_next: Some(&field) };
        let mut packets: Vec<_> = (0..count).flat_map(|n| encoder.push(&moving(32, 32, n), known)).collect();
        let finish = encoder.finish();
        packets.extend(finish.packets);
        let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.clone()).collect();
        stream.extend(finish.end);
        packets.sort_by_key(|packet| packet.display_index);
        check(&stream, &packets, &format!("{count} frames"));
    }
}
