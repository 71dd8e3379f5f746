//! Parsing of elementary streams.

use crate::common::*;
use mpeg2enc::{AccessUnit, Config, ElementaryStream, FrameRate, Standard, StreamError, SuppliedMotion};

/// Returns the packets of moving pictures as access units, and the bytes of the whole stream.
fn stream(config: &Config, frames: usize) -> (Vec<AccessUnit>, Vec<u8>) {
    let mut encoder = config.clone().encoder().expect("a valid configuration");
    let mut units: Vec<AccessUnit> = Vec::new();
    for time in 0..frames {
        units.extend(encoder.push(&moving(96, 80, time), SuppliedMotion::default()).into_iter().map(AccessUnit::from));
    }
    let finish = encoder.finish();
    units.extend(finish.packets.into_iter().map(AccessUnit::from));
    let mut bytes: Vec<u8> = units.iter().flat_map(|unit| unit.data.iter().copied()).collect();
    bytes.extend(finish.end);
    (units, bytes)
}

fn config() -> Config {
    Config::new(96, 80, FrameRate::FPS_25).with_gop(7)
}

#[test]
fn its_pictures_are_the_packets() {
    let constant = mpeg2enc::Rate::Constant { bits_per_second: 4_000_000, buffer_bits: 400_000 };
    for config in [
        config(),
        config().with_quantiser_scale(1),
        config().with_lookahead(30).with_b_pictures(3),
        config().with_lookahead(30).with_b_pictures(2).with_standard(Standard::Mpeg1),
        // Small pictures are padded with user data.
        config().with_lookahead(30).with_rate(constant),
    ] {
        let (units, bytes) = stream(&config, 23);
        let parsed = ElementaryStream::parse(&bytes).expect("a stream");
        assert_eq!(parsed.units, units);
        assert!(parsed.is_ended && parsed.begins_closed);
        assert!(units[0].data.starts_with(&parsed.sequence_header));
    }
}

/// Time codes count pictures within seconds (6.3.8); 29.97 frames per second are numbered like 30.
#[test]
fn time_codes_go_on_from_the_first_number() {
    for (fps, number, time_code) in [
        (25.0, 0, [0, 0, 0, 0]),
        (25.0, 24, [0, 0, 0, 24]),
        (29.97, 30 * 3600 + 30 * 61 + 7, [1, 1, 1, 7]),
        (60.0, 60 * 86_400 + 1, [0, 0, 0, 1]),
    ] {
        let rate = FrameRate::from_fps(fps).expect("a rate of Table 6-4");
        let config = Config::new(96, 80, rate);
        let (_, bytes) = stream(&config.with_first_number(number), 1);
        assert_eq!(ElementaryStream::parse(&bytes).expect("a stream").time_code, time_code, "{number} at {fps}");
    }
    // The number affects only time codes, not the order of pictures.
    let [(plain, _), (later, _)] = [0, 25].map(|number| stream(&config().with_first_number(number), 9));
    let differing = |(a, b): (&AccessUnit, &AccessUnit)| a.data.iter().zip(&b.data).filter(|(a, b)| a != b).count();
    assert_eq!(plain.iter().zip(&later).map(differing).collect::<Vec<_>>(), [1, 0, 0, 0, 0, 0, 0, 1, 0]);
    assert!(plain.iter().map(|unit| unit.display_index).eq(0..9));
    assert!(later.iter().map(|unit| unit.display_index).eq(0..9));
}

#[test]
fn what_is_no_whole_stream_is_noticed() {
    let (units, bytes) = stream(&config(), 9);
    let parse = ElementaryStream::parse;
    assert_eq!(parse(b"").unwrap_err(), StreamError::NoSequenceHeader);
    assert_eq!(parse(b"RIFF....").unwrap_err(), StreamError::NoSequenceHeader);
    assert_eq!(parse(&bytes[4..]).unwrap_err(), StreamError::NoSequenceHeader);
    let headers = ElementaryStream::parse(&bytes).unwrap().sequence_header.len();
    assert_eq!(parse(&bytes[..headers]).unwrap_err(), StreamError::NoPicture);

    // A truncated stream has no end code, and at most its last picture is incomplete.
    for length in headers + 8..bytes.len() {
        match parse(&bytes[..length]) {
            Ok(stream) => {
                assert!(!stream.is_ended, "{length}");
                let whole = stream.units.len() - 1;
                assert_eq!(stream.units[..whole], units[..whole], "{length}");
            }
            Err(error) => assert!(!matches!(error, StreamError::AfterEnd { .. }), "{length}: {error}"),
        }
    }

    // Two concatenated streams are an error.
    assert_eq!(parse(&[&bytes[..], &bytes].concat()).unwrap_err(), StreamError::AfterEnd { at: bytes.len() - 4 });
    let (_, other) = stream(&config().with_standard(Standard::Mpeg1).with_quantiser_scale(8), 2);
    let without_end = &bytes[..bytes.len() - 4];
    let joined = [without_end, &other].concat();
    assert_eq!(parse(&joined).unwrap_err(), StreamError::OtherHeader { at: without_end.len() });
}
