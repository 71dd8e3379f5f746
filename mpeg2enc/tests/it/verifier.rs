//! Tests of rates and buffers that are too small for the pictures: they are refused, or late pictures are reported.

use crate::common::*;
use mpeg2enc::{BufferVerifier, Config, ConfigError, Picture, Rate, Standard};

#[test]
fn rates_below_the_smallest_pictures_are_refused() {
    // There are 5 rows of macroblocks: 144 + 5·48 bits per picture in MPEG-2, 72 + 5·48 bits in MPEG-1.
    for (standard, picture_bits) in [(Standard::Mpeg2, 384), (Standard::Mpeg1, 312)] {
        let settings = |bits_per_second| {
            let rate = Rate::Constant { bits_per_second, buffer_bits: 100_000 };
            config(96, 80).with_standard(standard).with_lookahead(30).with_rate(rate)
        };
        let rate_least = 25 * picture_bits;
        let error = settings(2000).validate().expect_err("an error");
        assert!(
            matches!(error, ConfigError::TooFewBits { picture_bits: bits, rate_least: least, .. }
                if (bits, least) == (picture_bits, rate_least)),
            "{error}"
        );
        assert!(error.to_string().contains("2000 bits a second") && !error.to_string().contains('\n'), "{error}");
        assert!(
            settings(rate_least as u32 - 400).validate().is_err() && settings(rate_least as u32).validate().is_ok()
        );
    }
    // 1024 rows do not fit into the smallest buffer.
    let rate = Rate::Capped { bits_per_second: 8_000_000, buffer_bits: 16_384 };
    let error = config(16, 16_383).with_lookahead(30).with_rate(rate).validate().expect_err("an error");
    assert!(error.to_string().contains("a buffer of 16384 bits"), "{error}");
}

/// In a static film no picture is smaller than the bound.
#[test]
fn pictures_are_no_smaller_than_the_bound() {
    for (standard, picture_bits) in [(Standard::Mpeg2, 384), (Standard::Mpeg1, 312)] {
        let settings = config(96, 80).with_standard(standard).with_b_pictures(2).with_quantiser_scale(62);
        let (_, packets) = encode_ahead(settings, (0..12).map(|_| Picture::black(96, 80)), None);
        let smallest = packets.iter().map(|packet| packet.bits).min().expect("packets");
        assert!((picture_bits..2 * picture_bits).contains(&smallest), "{smallest} bits in {standard:?}");
    }
}

/// Returns the delay of each packet in seconds, in the order of coding.
fn lateness(settings: Config, frames: impl Iterator<Item = Picture>) -> Vec<f64> {
    let mut verifier = BufferVerifier::new(&settings).expect("a bounded rate");
    let mut encoder = settings.encoder().expect("a valid configuration");
    let mut late = Vec::new();
    let mut take =
        |packets: Vec<mpeg2enc::Packet>| late.extend(packets.iter().map(|packet| verifier.take(packet.bits)));
    frames.for_each(|frame| take(encoder.push(&frame, mpeg2enc::SuppliedMotion::default())));
    take(encoder.finish().packets);
    late
}

#[test]
fn pictures_that_come_late_are_told() {
    for rate in [
        |bits_per_second| Rate::Constant { bits_per_second, buffer_bits: 100_000 },
        |bits_per_second| Rate::Capped { bits_per_second, buffer_bits: 100_000 },
    ] {
        let settings = |bits_per_second| config(96, 80).with_lookahead(30).with_rate(rate(bits_per_second));
        let late = lateness(settings(400_000), (0..30).map(|time| moving(96, 80, time)));
        assert!(late.len() == 30 && late.iter().all(|&late| late == 0.0), "{late:?}");

        // I pictures of noise take more than 400 bits at the coarsest quantiser.
        let late = lateness(settings(10_000).with_gop(1), (0..75).map(|time| noise(96, 80, time)));
        assert!(late[0] == 0.0 && late[74] > 0.5, "{late:?}");
    }
    assert!(BufferVerifier::new(&config(96, 80)).is_none());
}
