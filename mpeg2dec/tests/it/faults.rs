//! Faulty and odd streams, as reported by users of players.

use crate::common::{Decoded, decoded, encoded};
use mpeg2dec::{Decoder, DecoderOptions, PictureType};

const OPTIONS: &str = "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 5 -g 6 -f mpeg2video";

fn elementary() -> Vec<u8> {
    encoded("96x64", "m2v", OPTIONS)
}

/// Returns the offsets of a start code.
fn offsets(stream: &[u8], code: u8) -> Vec<usize> {
    (0..stream.len() - 3).filter(|&i| stream[i..i + 4] == [0, 0, 1, code]).collect()
}

fn count(decoded: &Decoded) -> usize {
    decoded.pictures.len()
}

#[test]
fn missing_sequence_end() {
    let stream = elementary();
    let end = offsets(&stream, 0xb7);
    let without = if let Some(&end) = end.last() { &stream[..end] } else { &stream[..] };
    assert_eq!(decoded(without, 100).raw(), decoded(&stream, 100).raw());
    assert_eq!(count(&decoded(without, 100)), 15);
}

#[test]
fn broken_time_codes_of_groups() {
    let mut stream = elementary();
    let whole = decoded(&stream, 100).raw();
    for offset in offsets(&stream, 0xb8) {
        stream[offset + 4..offset + 7].fill(0xff);
    }
    assert_eq!(decoded(&stream, 100).raw(), whole);
}

#[test]
fn missing_first_i_picture() {
    let stream = elementary();
    let pictures = offsets(&stream, 0);
    // The sequence header remains, without the first I picture.
    let group = offsets(&stream, 0xb8)[0];
    let without = [&stream[..group], &stream[pictures[1]..]].concat();
    let found = decoded(&without, 100);
    assert_eq!(found.pictures[0].flags().kind, PictureType::I, "waits for the next I picture");
    assert!(found.counts.dropped > 0 && count(&found) + found.counts.dropped as usize == 14);
    // All pictures are shown if requested.
    let options = DecoderOptions { show_incomplete: true, ..DecoderOptions::default() };
    let (mut decoder, mut shown) = (Decoder::new(options), 0);
    decoder.push(&without, |_| shown += 1);
    decoder.flush(|_| shown += 1);
    assert_eq!(shown, 14);
}

#[test]
fn packets_without_length_in_transport_streams() {
    // ffmpeg writes video packets without length for pictures of more than 64 KiB.
    let stream = encoded("1280x720", "ts", "-pix_fmt yuv420p -c:v mpeg2video -g 1 -q:v 1 -frames:v 3");
    let found = decoded(&stream, 5000);
    assert_eq!((count(&found), found.counts.concealed_macroblocks), (3, 0));
}

#[test]
fn stuffing_and_padding() {
    let stream = elementary();
    let whole = decoded(&stream, 100).raw();
    // Zero bytes before each start code.
    let (mut stuffed, mut from) = (Vec::new(), 0);
    for i in 0..stream.len() - 2 {
        if stream[i..i + 3] == [0, 0, 1] {
            stuffed.extend_from_slice(&stream[from..i]);
            stuffed.extend([0; 9]);
            from = i;
        }
    }
    stuffed.extend_from_slice(&stream[from..]);
    stuffed.extend([0; 5000]);
    assert_eq!(decoded(&stuffed, 100).raw(), whole);
    // Padding packets in a program stream.
    let program = encoded("96x64", "mpg", "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 5 -g 6 -f svcd");
    let packs = offsets(&program, 0xba);
    let padding = [&[0, 0, 1, 0xbe, 0, 50][..], &[0xff; 50]].concat();
    let padded = [&program[..packs[1]], &padding, &padding, &program[packs[1]..]].concat();
    assert_eq!(decoded(&padded, 100).raw(), decoded(&program, 100).raw());
}

#[test]
fn wrong_decoding_times() {
    let mut stream = encoded("96x64", "mpg", "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 5 -g 6 -f svcd");
    let whole = decoded(&stream, 100);
    for offset in offsets(&stream, 0xe0) {
        // PTS_DTS_flags 3: replace the bits of DTS.
        if stream[offset + 7] & 0xc0 == 0xc0 {
            stream[offset + 15..offset + 19].fill(0xff);
        }
    }
    let found = decoded(&stream, 100);
    assert_eq!(found.raw(), whole.raw());
    assert!(found.pictures.iter().zip(&whole.pictures).all(|(a, b)| a.time() == b.time()));
}

#[test]
fn garbage_before_the_first_start_code() {
    let stream = elementary();
    let garbage: Vec<u8> = (0..3000u32).map(|i| (i * 37 % 251) as u8 | 2).collect();
    assert_eq!(decoded(&[&garbage, &stream[..]].concat(), 100).raw(), decoded(&stream, 100).raw());
    for ending in ["ts", "mpg"] {
        let stream = encoded("96x64", ending, "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 5 -g 6");
        assert_eq!(count(&decoded(&[&garbage, &stream[..]].concat(), 1000)), 15, "{ending}");
    }
}

#[test]
fn garbage_between_transport_packets() {
    let stream = encoded("96x64", "ts", "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 5 -g 6");
    let mut random = fastrand::Rng::with_seed(3);
    let mut with_garbage = Vec::new();
    for (number, packet) in stream.chunks(188).enumerate() {
        with_garbage.extend_from_slice(packet);
        if number % 5 == 0 {
            // Any bytes except the sync byte.
            with_garbage.extend((0..random.usize(1..300)).map(|_| random.u8(..) & 0xbf | 0x80));
        }
    }
    assert_eq!(decoded(&with_garbage, 1000).raw(), decoded(&stream, 1000).raw());
}

#[test]
fn truncated_last_picture() {
    let stream = elementary();
    let last = *offsets(&stream, 0).last().expect("pictures");
    let found = decoded(&stream[..last + (stream.len() - last) / 2], 100);
    assert_eq!(count(&found), 15);
    assert!(found.counts.concealed_macroblocks > 0);
}

#[test]
fn picture_without_slices() {
    let stream = elementary();
    let pictures = offsets(&stream, 0);
    let slice = pictures[5] + offsets(&stream[pictures[5]..], 1)[0];
    // Repeat the headers of a picture without its slices.
    let repeated = [&stream[..slice], &stream[pictures[5]..]].concat();
    let found = decoded(&repeated, 100);
    assert_eq!((count(&found), found.counts.dropped), (15, 1));
    assert_eq!(found.raw(), decoded(&stream, 100).raw());
}

#[test]
fn repeated_sequence_header_with_another_size() {
    let (large, small) = (elementary(), encoded("64x48", "m2v", OPTIONS));
    let found = decoded(&[&large[..], &small, &large].concat(), 100);
    assert_eq!(count(&found), 45);
    let widths: Vec<usize> = found.pictures.iter().map(|picture| picture.sequence().width).collect();
    assert_eq!((widths[14], widths[15], widths[29], widths[30]), (96, 64, 64, 96));
    // A header of another size without pictures of this size.
    let header = &small[..offsets(&small, 0xb8)[0]];
    let group = offsets(&large, 0xb8)[1];
    let interrupted = [&large[..group], header, &large[group..]].concat();
    assert!(count(&decoded(&interrupted, 100)) >= 6);
}

#[test]
fn open_group_after_a_broken_link() {
    let mut stream = elementary();
    let whole = decoded(&stream, 100);
    // Set broken_link of the second group: its leading B pictures have no reference.
    let groups = offsets(&stream, 0xb8);
    assert_eq!(stream[groups[1] + 7] & 0x40, 0, "an open group");
    stream[groups[1] + 7] |= 0x20;
    let found = decoded(&stream, 100);
    assert_eq!((count(&found), found.counts.dropped), (count(&whole) - 2, 2));
}

#[test]
fn single_field_at_the_end() {
    let stream = crate::random::field_stream();
    let pictures = offsets(&stream, 0);
    let found = decoded(&stream[..*pictures.last().expect("fields")], 100);
    assert_eq!(count(&found), 7, "the other field is repeated");
    assert!(found.counts.concealed_macroblocks > 0);
}

#[test]
fn missing_transport_packets_are_counted() {
    let stream = encoded("96x64", "ts", "-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 5 -g 6");
    assert_eq!(decoded(&stream, 1000).counts.lost_packets, 0);
    // ffmpeg's first PID is 256.
    let is_video = |packet: &[u8]| packet[1] & 31 == 1;
    let video: Vec<usize> = (0..stream.len() / 188).filter(|n| is_video(&stream[188 * n..])).collect();
    for lost in [vec![video[5]], video[5..8].to_vec(), vec![video[video.len() - 2]]] {
        let packets = stream.chunks(188).enumerate().filter(|(n, _)| !lost.contains(n));
        let rest: Vec<u8> = packets.flat_map(|(_, packet)| packet).copied().collect();
        assert_eq!(decoded(&rest, 1000).counts.lost_packets, lost.len() as u64);
    }
}
