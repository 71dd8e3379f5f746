//! Tests that decoded pictures equal the encoder's reconstructions in MPEG-1 streams (ISO/IEC 11172-2).

use crate::common::*;
use mpeg2enc::{Config, Effort, FrameRate, Rate, Standard};

fn mpeg1(width: usize, height: usize) -> Config {
    config(width, height).with_standard(Standard::Mpeg1)
}

/// Minimum agreement in dB. As with MPEG-2, transforms of decoders are sometimes off by one, and predictions inherit these
/// errors.
const AGREEMENT_DB: f64 = 55.0;

#[test]
fn quantisers_efforts_and_sizes() {
    for (quantiser_scale, effort, (width, height)) in [
        (2, Effort::Best, (96, 80)),
        (8, Effort::Fast, (176, 144)),
        (16, Effort::Balanced, (100, 50)),
        (30, Effort::Best, (176, 144)),
        (62, Effort::Balanced, (17, 33)),
    ] {
        let settings =
            mpeg1(width, height).with_b_pictures(2).with_effort(effort).with_quantiser_scale(quantiser_scale);
        let frames = (45..75).map(|time| moving(width, height, time));
        let (stream, packets) = encode_ahead(settings, frames, None);
        assert_eq!(stream[12..16], [0, 0, 1, 0xb8], "no extension between sequence header and group");
        check(&stream, &packets, &format!("{width}x{height} at {quantiser_scale}, {effort:?}"));
    }
}

/// Codes noise, which has arbitrary vectors and levels that need long escapes.
#[test]
fn levels_up_to_255() {
    let settings = mpeg1(64, 48).with_b_pictures(1).with_quantiser_scale(2).with_gop(6);
    let (stream, packets) = encode_ahead(settings, (0..12).map(|time| noise(64, 48, time)), None);
    check(&stream, &packets, "noise");
}

#[test]
fn without_delay() {
    let (stream, packets) = encode(mpeg1(96, 80).with_quantiser_scale(10), (0..40).map(|time| moving(96, 80, time)));
    check_decoders(&stream, &packets, AGREEMENT_DB);
}

#[test]
fn a_constant_rate_is_stated_and_kept() {
    let rate = Rate::Constant { bits_per_second: 400_000, buffer_bits: 200_000 };
    let settings = mpeg1(176, 144).with_b_pictures(2).with_rate(rate);
    let (stream, packets) = encode_ahead(settings, (0..100).map(|time| moving(176, 144, time)), None);
    check_decoders(&stream, &packets, AGREEMENT_DB);
    // bit_rate, in units of 400 bits per second, follows two sizes of 12 bits and two codes of 4.
    let bit_rate = u32::from_be_bytes(stream[8..12].try_into().unwrap()) >> 14;
    assert_eq!(bit_rate, 1000);
    let bits: u64 = packets.iter().map(|packet| packet.bits).sum();
    assert!(bits.abs_diff(400_000 * 4) < 16_000, "{bits} bits in four seconds");
}

#[test]
fn what_it_does_not_have_is_an_error() {
    let message = |config: Config| config.encoder().expect_err("an error").to_string();
    assert_eq!(
        message(mpeg1(64, 48).with_quantiser_scale(7)),
        "MPEG-1 does not have this quantiser_scale: use an even value from 2 to 62"
    );
    assert!(message(mpeg1(64, 48).with_quantiser_scale(64)).contains("2 to 62"));
    assert!(message(mpeg1(64, 48).with_intra_dc_precision(10)).contains("8 bits"));
    assert!(message(mpeg1(64, 48).with_alternate_scan(true)).contains("alternate scan"));
    assert!(message(Config::new(4096, 48, FrameRate::FPS_25).with_standard(Standard::Mpeg1)).contains("4095"));
    let mut encoder = mpeg1(64, 48).encoder().unwrap();
    assert!(encoder.set_quantiser_scale(3).is_err() && encoder.set_quantiser_scale(12).is_ok());
}
