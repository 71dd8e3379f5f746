//! Containers of ffmpeg: pictures, time stamps and captions.

use crate::common::{Decoded, check, decoded, encoded, raw};
use mpeg2dec::{Demuxer, StreamFormat};

const VIDEO: &str = "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 3 -g 6 -c:a mp2";

fn times(decoded: &Decoded) -> Vec<i64> {
    decoded.pictures.iter().filter_map(mpeg2dec::DecodedPicture::time).collect()
}

/// Checks that each picture has a time, one frame period of 25 Hz after its predecessor.
fn check_times(feature: &str, decoded: &Decoded) {
    let times = times(decoded);
    assert_eq!(times.len(), decoded.pictures.len(), "{feature}");
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 3600), "{feature}: {times:?}");
}

#[test]
fn containers_of_ffmpeg() {
    for (feature, ending, options, format) in [
        ("program stream", "mpg", "-f mpeg", "mpeg"),
        ("program stream of MPEG-2", "vob", "-f svcd", "mpeg"),
        ("DVD", "vob", "-f dvd -muxrate 10080000", "mpeg"),
        ("transport stream", "ts", "", "mpegts"),
        ("transport stream of 192 bytes", "m2ts", "-mpegts_m2ts_mode 1", "mpegts"),
    ] {
        let stream = encoded("192x128", ending, &format!("{VIDEO} {options}"));
        let found = check(feature, "ffmpeg", &stream, format);
        assert_eq!(found.pictures.len(), 15);
        if format == "mpegts" {
            check_times(feature, &found);
        }
    }
    let stream = encoded("192x128", "mpg", "-pix_fmt yuv420p -c:v mpeg1video -bf 2 -q:v 3 -c:a mp2 -f mpeg");
    check("program stream of MPEG-1", "ffmpeg", &stream, "mpeg");
}

/// Adds 16 bytes after each packet, as for error correction.
fn with_204_bytes(stream: &[u8]) -> Vec<u8> {
    stream.chunks(188).flat_map(|packet| [packet, &[0x47; 16]].concat()).collect()
}

#[test]
fn transport_streams_of_204_bytes() {
    let stream = encoded("96x64", "ts", VIDEO);
    let (expected, found) = (decoded(&stream, 999), decoded(&with_204_bytes(&stream), 777));
    assert_eq!(expected.raw(), found.raw());
    assert_eq!(times(&expected), times(&found));
}

#[test]
fn pieces_of_any_size_give_the_same() {
    for (ending, options) in [("ts", ""), ("mpg", "-f mpeg"), ("mpg", "-f svcd"), ("m2ts", "-mpegts_m2ts_mode 1")] {
        let stream = encoded("96x64", ending, &format!("{VIDEO} {options}"));
        let whole = decoded(&stream, stream.len());
        for size in [1, 7, 188, 1000] {
            let found = decoded(&stream, size);
            assert_eq!(found.raw(), whole.raw(), "{ending} in pieces of {size}");
            assert_eq!(times(&found), times(&whole));
        }
    }
}

#[test]
fn time_stamps_continue_after_33_bits() {
    let start = (1i64 << 33) / 90_000 - 1;
    let stream = encoded("96x64", "ts", &format!("{VIDEO} -output_ts_offset {start} -muxdelay 0 -muxpreload 0"));
    let found = decoded(&stream, 4096);
    check_times("wrap", &found);
    let times = times(&found);
    assert!(times[0] < 1 << 33 && times[14] > 1 << 33 || times[0] > 1 << 32, "{times:?}");
}

/// Returns a program stream with its packets of unbounded length.
fn without_lengths(stream: &[u8]) -> Vec<u8> {
    let mut stream = stream.to_vec();
    for i in 0..stream.len() - 6 {
        if stream[i..i + 4] == [0, 0, 1, 0xe0] {
            stream[i + 4..i + 6].fill(0);
        }
    }
    stream
}

#[test]
fn packets_without_length_end_at_the_next_header() {
    let stream = encoded("96x64", "mpg", "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 3 -f svcd");
    let (expected, found) = (decoded(&stream, 500), decoded(&without_lengths(&stream), 500));
    assert_eq!(expected.raw(), found.raw());
}

#[test]
fn formats_are_reported() {
    for (ending, options, format) in [
        ("ts", "", StreamFormat::Transport { packet_size: 188 }),
        ("m2ts", "-mpegts_m2ts_mode 1", StreamFormat::Transport { packet_size: 192 }),
        ("mpg", "-f mpeg", StreamFormat::Program),
        ("m2v", "-f mpeg2video -an", StreamFormat::Elementary),
    ] {
        let stream = encoded("96x64", ending, &format!("{VIDEO} {options}"));
        let mut demuxer = Demuxer::default();
        demuxer.push(&stream, |_| ());
        assert_eq!(demuxer.format(), Some(format));
    }
}

#[test]
fn captions_are_passed_on() {
    let stream = encoded("96x64", "m2v", "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 3 -f mpeg2video");
    // Insert captions before the first slice of each picture.
    let (mut with_captions, mut from, mut number) = (Vec::new(), 0, 0);
    for i in 0..stream.len() - 4 {
        if stream[i..i + 4] == [0, 0, 1, 1] {
            with_captions.extend_from_slice(&stream[from..i]);
            with_captions
                .extend_from_slice(&[0, 0, 1, 0xb2, b'G', b'A', b'9', b'4', 3, 0x41, 0xff, 0xfc, 0x80, number]);
            with_captions.push(0xff);
            (from, number) = (i, number + 1);
        }
    }
    with_captions.extend_from_slice(&stream[from..]);
    let (plain, found) = (decoded(&stream, 100), decoded(&with_captions, 100));
    let mut bytes: Vec<u8> = found.pictures.iter().flat_map(|picture| picture.captions().map(|c| c.bytes[1])).collect();
    assert_ne!(bytes, (0..number).collect::<Vec<_>>(), "pictures are reordered");
    bytes.sort_unstable();
    assert_eq!(bytes, (0..number).collect::<Vec<_>>());
    assert!(plain.pictures.iter().zip(&found.pictures).all(|(a, b)| raw(a) == raw(b)));
}
