//! Tests that decoded pictures equal the encoder's reconstructions.

use crate::common::*;
use mpeg2enc::{Level, Packet, SuppliedMotion};
use plane::Plane;

/// Minimum agreement in a group of 15 pictures, in dB. In each picture both decoders' integer transforms are off by one in 1 to 2
/// % of the samples, and later pictures inherit these errors.
const AGREEMENT_DB: f64 = 55.0;

#[test]
fn a_hundred_frames_at_every_kind_of_quantiser() {
    for quantiser_scale in [1, 2, 8, 16, 48, 62, 112] {
        let settings = config(96, 80).with_quantiser_scale(quantiser_scale);
        let (stream, packets) = encode(settings, (0..100).map(|time| moving(96, 80, time)));
        check_decoders(&stream, &packets, AGREEMENT_DB);
    }
}

#[test]
fn sizes_that_are_not_whole_macroblocks() {
    for (width, height, frames) in [
        (1, 1, 100),
        (2, 2, 20),
        (17, 33, 100),
        (16, 16, 20),
        (33, 17, 40),
        (500, 300, 20),
        (512, 512, 6),
        (5, 2900, 4),
    ] {
        let settings = config(width, height).with_quantiser_scale(6).with_gop(15);
        let (stream, packets) = encode(settings, (0..frames).map(|time| moving(width, height, time)));
        check_decoders(&stream, &packets, AGREEMENT_DB);
    }
}

#[test]
fn groups_of_one() {
    let settings = config(64, 48).with_gop(1).with_quantiser_scale(10);
    let (stream, packets) = encode(settings, (0..30).map(|time| moving(64, 48, time)));
    check_decoders(&stream, &packets, AGREEMENT_DB);
}

/// Codes the longest group, in which mismatch persists. An exact inverse transform has no mismatch. The errors of the decoders
/// accumulate like a random walk, with a step size that depends on their precision.
#[test]
fn no_drift_over_131_predicted_pictures() {
    for quantiser_scale in [4, 16] {
        let settings = config(176, 144).with_gop(132).with_quantiser_scale(quantiser_scale);
        let (stream, packets) = encode(settings, (0..140).map(|time| moving(176, 144, time)));
        let exact = check_agreement("ffmpeg", &decode_ffmpeg(&stream, 176, 144, "faani"), &packets, 70.0);
        let mean = |range: std::ops::Range<usize>| {
            let length = range.len() as f64;
            exact[range].iter().map(|db| db.min(90.0)).sum::<f64>() / length
        };
        let (early, late) = (mean(5..35), mean(102..132));
        assert!(late > early - 12.0, "agreement falls from {early:.1} to {late:.1} dB");
        check_decoders(&stream, &packets, 42.0);
    }
}

#[test]
fn noise_needs_escape_codes_and_survives() {
    for quantiser_scale in [1, 3, 40] {
        let settings = config(48, 32).with_quantiser_scale(quantiser_scale).with_gop(4);
        let (stream, packets) = encode(settings, (0..8).map(|seed| noise(48, 32, seed)));
        check_decoders(&stream, &packets, AGREEMENT_DB - 5.0);
        if quantiser_scale == 1 {
            for packet in &packets {
                assert!(packet.psnr_y > 44.0, "quantiser_scale 1 is nearly lossless, not {} dB", packet.psnr_y);
            }
        }
    }
}

#[test]
fn finer_intra_dc_is_understood() {
    for bits in [9, 10, 11] {
        let settings = config(80, 48).with_intra_dc_precision(bits).with_quantiser_scale(20).with_gop(5);
        let (stream, packets) = encode(settings, (0..12).map(|time| moving(80, 48, time)));
        check_decoders(&stream, &packets, AGREEMENT_DB);
    }
}

#[test]
fn the_quantiser_may_change_between_pictures() {
    let mut encoder = config(80, 48).encoder().unwrap();
    let mut packets = Vec::new();
    for (time, quantiser_scale) in [1, 62, 112, 7, 24, 2, 8, 5].into_iter().cycle().take(20).enumerate() {
        encoder.set_quantiser_scale(quantiser_scale).unwrap();
        packets.extend(encoder.push(&moving(80, 48, time), SuppliedMotion::default()));
    }
    assert!(encoder.set_quantiser_scale(9).is_err());
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(encoder.finish().end);
    check_decoders(&stream, &packets, AGREEMENT_DB);
}

#[test]
fn a_stream_may_end_after_any_picture() {
    let settings = config(64, 48).with_gop(4);
    let (_, packets) = encode(settings, (0..6).map(|time| moving(64, 48, time)));
    for count in 1..=packets.len() {
        let mut stream: Vec<u8> = packets[..count].iter().flat_map(|packet| packet.data.iter().copied()).collect();
        stream.extend([0, 0, 1, 0xb7]);
        check_decoders(&stream, &packets[..count], AGREEMENT_DB);
    }
}

#[test]
fn wide_vectors_at_every_level() {
    // Jump far once in each direction: vectors are as long as the level allows, forward and backward.
    for (level, width, height) in [(Level::Low, 352, 64), (Level::Main, 720, 64), (Level::High, 64, 720)] {
        let mut encoder = config(width, height).with_level(level).with_gop(8).encoder().unwrap();
        let mut packets = Vec::new();
        let [x, y] = if width > height { [250.5, 0.0] } else { [0.0, 125.5] };
        for time in 0..6 {
            let (here, sign) = if time % 2 == 0 { (0.0, -1.0) } else { (1.0, 1.0) };
            let motion = uniform_motion(width, height, sign * x, sign * y);
            let frame = pan(width, height, here * f64::from(x), here * f64::from(y));
            packets.extend(encoder.push(&frame, SuppliedMotion::from(&motion)));
        }
        let predicted: u32 = packets[1..].iter().map(|packet| packet.statistics.inter).sum();
        assert!(predicted > 40, "the vectors must reach visible content: {predicted} macroblocks");
        let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
        stream.extend(encoder.finish().end);
        check_decoders(&stream, &packets, AGREEMENT_DB);
    }
}

#[test]
fn a_multiple_of_4096_is_coded_one_larger() {
    // The low twelve bits of horizontal_size must not all be zero; the display size contains the requested size.
    let (stream, packets) = encode(config(4096, 20), (0..3).map(|time| moving(4096, 20, time)));
    for frames in [decode_ffmpeg(&stream, 4097, 20, "auto"), decode_mpeg2dec(&stream, 4096, 20)] {
        assert_eq!(frames.len(), packets.len());
        for (frame, packet) in frames.iter().zip(&packets) {
            let shown = Plane::from_fn(4096, 20, |x, y| frame.luma().get(x, y));
            assert!(mpeg2enc::psnr(&shown, packet.reconstruction.luma()) > AGREEMENT_DB);
        }
    }
}

/// Planes of packets have the requested size, even if more is coded.
#[test]
fn a_multiple_of_4096_takes_weights_and_gives_planes_of_its_own_size() {
    for (width, height) in [(4096usize, 20usize), (20, 8192), (12_288, 16)] {
        let (columns, rows) = (width.div_ceil(16), height.div_ceil(16));
        for lookahead in [0, 2] {
            let mut encoder = config(width, height).with_lookahead(lookahead).encoder().expect("a valid configuration");
            let weights = Plane::filled(columns, rows, 0.5);
            let frames = (0..2).map(|time| moving(width, height, time));
            let mut packets: Vec<Packet> =
                frames.flat_map(|frame| encoder.push_weighted(&frame, SuppliedMotion::default(), &weights)).collect();
            packets.extend(encoder.finish().packets);
            assert_eq!(packets.len(), 2);
            for packet in packets {
                let kinds = &packet.macroblock_kinds;
                assert_eq!((kinds.width(), kinds.height()), (columns, rows), "{width}x{height}");
                assert_eq!(packet.coded().luma().width(), width, "{width}x{height}");
            }
        }
    }
}

#[test]
fn the_largest_sizes() {
    for (width, height) in [(16383, 18), (18, 16383)] {
        let (stream, packets) = encode(config(width, height), (0..2).map(|time| moving(width, height, time)));
        check_decoders(&stream, &packets, AGREEMENT_DB);
    }
}
