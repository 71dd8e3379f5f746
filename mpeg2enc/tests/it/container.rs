//! Program and transport streams: timestamps of pictures, and the unchanged elementary stream.

use crate::common::*;
use mpeg2enc::{Config, Container, FrameRate, Multiplexer, Packet, PictureType, Rate, Standard, SuppliedMotion};
use std::process::{Command, Stdio};

/// Returns the packets of an encoder in the order of coding, and its sequence_end_code.
fn packets(config: &Config, frames: usize) -> (Vec<Packet>, Vec<u8>) {
    let mut encoder = config.clone().with_lookahead(Config::LOOKAHEAD_MAX).encoder().expect("a valid configuration");
    let mut packets: Vec<Packet> =
        (0..frames).flat_map(|time| encoder.push(&moving(96, 80, time), SuppliedMotion::default())).collect();
    let finish = encoder.finish();
    packets.extend(finish.packets);
    (packets, finish.end)
}

/// Returns the file, and the elementary stream inside.
fn wrapped(container: Container, config: &Config, packets: &[Packet], end: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let mut multiplexer = Multiplexer::new(container, config);
    let mut file: Vec<u8> = packets.iter().flat_map(|packet| multiplexer.push(packet.clone())).collect();
    file.extend(multiplexer.finish(end));
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(end);
    (file, stream)
}

fn output_of(program: &str, arguments: &[&str]) -> Vec<u8> {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).output().unwrap_or_else(|error| {
        panic!("{program} cannot be run ({error}); these tests need ffmpeg, ffprobe and mpeg2dec on the PATH")
    });
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.is_empty(), "{program} {arguments:?}: {messages}");
    output.stdout
}

/// Returns settings for both containers, with names.
fn configurations() -> Vec<(Config, &'static str)> {
    let config = |fps| Config::new(96, 80, FrameRate::from_fps(fps).expect("a rate of Table 6-4"));
    let constant = Rate::Constant { bits_per_second: 400_000, buffer_bits: 200_000 };
    let capped = Rate::Capped { bits_per_second: 300_000, buffer_bits: 150_000 };
    vec![
        (config(25.0), "without B pictures"),
        (config(23.976).with_b_pictures(2).with_quantiser_scale(2), "with B pictures"),
        (config(59.94).with_b_pictures(2).with_rate(constant), "at a constant rate"),
        (config(30.0).with_b_pictures(1).with_rate(capped).with_quantiser_scale(4), "below a rate"),
        (config(30.0).with_b_pictures(2).with_standard(Standard::Mpeg1), "of MPEG-1"),
    ]
}

#[test]
fn pictures_are_due_at_the_frame_rate() {
    for (config, what) in configurations() {
        let (packets, end) = packets(&config, 50);
        for container in [Container::Program, Container::Transport] {
            let (file, _) = wrapped(container, &config, &packets, &end);
            let file = StreamFile::new(&file);
            let shown =
                ["-v", "warning", "-err_detect", "explode", "-show_entries", "packet=pts,dts", "-of", "csv=p=0"];
            let listed = String::from_utf8(output_of("ffprobe", &[&shown[..], &[file.path()]].concat())).unwrap();
            let times: Vec<[i64; 2]> = listed
                .lines()
                .filter(|line| !line.is_empty())
                .map(|line| {
                    let mut numbers = line.split(',').map(|number| number.parse().expect("a time"));
                    [numbers.next().expect("pts"), numbers.next().expect("dts")]
                })
                .collect();
            assert_eq!(times.len(), packets.len(), "{container:?} {what}: {listed}");
            // Timestamps are multiples of 1/90 000 s, so allow one unit of rounding.
            let fps = config_fps(what);
            let reorder = u64::from(packets.iter().any(|packet| packet.picture_type == PictureType::B));
            let at = |frames: u64| times[0][1] as f64 + 90_000.0 * frames as f64 / fps;
            for (i, (packet, [pts, dts])) in packets.iter().zip(&times).enumerate() {
                let (decoded, shown) = (at(i as u64), at(packet.display_index + reorder));
                assert!(
                    (*dts as f64 - decoded).abs() <= 1.0,
                    "{container:?} {what}, packet {i}: {dts} is not {decoded}"
                );
                assert!((*pts as f64 - shown).abs() <= 1.0, "{container:?} {what}, packet {i}: {pts} is not {shown}");
                assert!(dts <= pts);
            }
        }
    }
}

fn config_fps(what: &str) -> f64 {
    match what {
        "without B pictures" => 25.0,
        "with B pictures" => 24000.0 / 1001.0,
        "at a constant rate" => 60000.0 / 1001.0,
        _ => 30.0,
    }
}

#[test]
fn ffmpeg_finds_the_elementary_stream_and_nothing_to_complain_about() {
    for (config, what) in configurations() {
        let (packets, end) = packets(&config, 50);
        for container in [Container::Program, Container::Transport] {
            let (file, stream) = wrapped(container, &config, &packets, &end);
            let file = StreamFile::new(&file);
            let input = ["-nostdin", "-v", "warning", "-xerror", "-err_detect", "explode", "-i", file.path()];
            let copied = output_of("ffmpeg", &[&input[..], &["-c", "copy", "-f", "mpeg2video", "-"]].concat());
            assert!(copied == stream, "{container:?} {what}: {} bytes, not {}", copied.len(), stream.len());
            // Check with mpeg2dec too, which has its own demultiplexer.
            let md5 = |of: &[&str], file: &StreamFile| {
                let arguments = [of, &["-o", "md5", file.path()]].concat();
                Command::new("mpeg2dec").args(arguments).output().expect("mpeg2dec can be run").stdout
            };
            let demultiplex: &[&str] = if container == Container::Program { &["-s"] } else { &["-t", "0x100"] };
            let pictures = md5(&[], &StreamFile::new(&stream));
            assert!(pictures.len() > 32 * packets.len(), "a checksum of each picture");
            assert!(md5(demultiplex, &file) == pictures, "{container:?} {what}");
            let decoded =
                output_of("ffmpeg", &[&input[..], &["-f", "rawvideo", "-fps_mode", "passthrough", "-"]].concat());
            assert_eq!(decoded.len(), packets.len() * 96 * 80 * 3 / 2, "{container:?} {what}");
        }
    }
}

/// Packs of a program stream (arrival of the first byte, payload sizes), and decoding times of pictures.
#[derive(Default)]
struct Read {
    packs: Vec<(f64, usize, usize)>,
    decoded: Vec<f64>,
    mux_rate: f64,
    /// P-STD_buffer_size_bound in bytes.
    buffer: usize,
}

/// Parses a program stream according to 2.5.3, independently of the writer. Packs of a disc fill sectors; others must not
/// contain padding.
fn read_program(file: &[u8], is_disc: bool) -> Read {
    let bits = |bytes: &[u8], first: usize, count: usize| -> u64 {
        (first..first + count).fold(0, |value, i| value << 1 | u64::from(bytes[i / 8] >> (7 - i % 8) & 1))
    };
    let stamp = |bytes: &[u8], first: usize| {
        bits(bytes, first, 3) << 30 | bits(bytes, first + 4, 15) << 15 | bits(bytes, first + 20, 15)
    };
    let mut read = Read::default();
    let mut at = 0;
    while file[at..][..4] != [0, 0, 1, 0xb9] {
        let start = at;
        assert_eq!(file[at..][..4], [0, 0, 1, 0xba], "a pack at {at}");
        let header = &file[at + 4..];
        let clock = stamp(header, 2) * 300 + bits(header, 38, 9);
        read.mux_rate = 50.0 * bits(header, 48, 22) as f64;
        at += 14;
        if file[at..][..4] == [0, 0, 1, 0xbb] {
            read.buffer = 1024 * bits(&file[at + 13..], 3, 13) as usize;
            at += 6 + bits(&file[at + 4..], 0, 16) as usize;
        }
        // A navigation pack has two packets of private_stream_2 and no video.
        if is_disc && file[at..][..4] == [0, 0, 1, 0xbf] {
            at = start + 2048;
            continue;
        }
        assert_eq!(file[at..][..4], [0, 0, 1, 0xe0], "a video packet at {at}");
        let (length, fields) = (bits(&file[at + 4..], 0, 16) as usize, file[at + 8] as usize);
        match bits(&file[at + 7..], 0, 2) {
            0b10 => read.decoded.push(stamp(&file[at + 9..], 4) as f64 / 90_000.0),
            0b11 => read.decoded.push(stamp(&file[at + 14..], 4) as f64 / 90_000.0),
            _ => {}
        }
        let data = length - 3 - fields;
        at += 6 + length;
        if is_disc && file[at..][..4] == [0, 0, 1, 0xbe] {
            let padding = bits(&file[at + 4..], 0, 16) as usize;
            assert!(padding > 0 && file[at + 6..][..padding].iter().all(|&byte| byte == 0xff), "padding at {at}");
            at += 6 + padding;
        }
        // The end code belongs to the last sector.
        let end = if at + 4 == file.len() { 4 } else { 0 };
        let size = at + end - start;
        assert!(if is_disc { size == 2048 } else { size <= 2048 }, "the pack at {start} of {size} bytes");
        read.packs.push((clock as f64 / 27e6, at - start, data));
    }
    assert_eq!(at + 4, file.len(), "no bytes after the end");
    read
}

#[test]
fn packs_come_one_after_the_other_and_in_time() {
    for (config, what) in configurations() {
        let (packets, end) = packets(&config, 100);
        let (file, _) = wrapped(Container::Program, &config, &packets, &end);
        let read = read_program(&file, false);
        assert_eq!(read.decoded.len(), packets.len());
        let mut sizes: Vec<usize> = packets.iter().map(|packet| packet.data.len()).collect();
        *sizes.last_mut().unwrap() += end.len();
        let mut ends = 0;
        // Count the bytes of the stream that must have arrived when each picture is decoded.
        let needed: Vec<usize> = sizes
            .iter()
            .map(|size| {
                ends += size;
                ends
            })
            .collect();
        let mut free = 0.0;
        let (mut sent, mut picture) = (0, 0);
        for &(clock, size, data) in &read.packs {
            assert!(clock >= free - 1e-6, "{what}: a pack at {clock}, although the previous pack ends at {free}");
            free = clock + size as f64 / read.mux_rate;
            sent += data;
            while picture < needed.len() && needed[picture] <= sent {
                assert!(free <= read.decoded[picture], "{what}: picture {picture} is late");
                picture += 1;
            }
            let decoded: usize = read.decoded.iter().take_while(|&&time| time <= clock).count();
            let held = sent - decoded.checked_sub(1).map_or(0, |last| needed[last].min(sent));
            let buffer = match what {
                "at a constant rate" => 200_000 / 16_384 * 2048,
                "below a rate" => 150_000 / 16_384 * 2048,
                _ => 475_136 / 8,
            };
            assert!(held <= read.buffer, "{what}: {held} bytes in a buffer of {}", read.buffer);
            // The headers only account for a hundredth of a second at the rate, and for two packs.
            assert!(
                read.buffer <= buffer + (0.01 * read.mux_rate) as usize + 5120,
                "{what}: a buffer of {}",
                read.buffer
            );
        }
        assert_eq!((sent, picture), (ends, needed.len()));
    }
}

/// Tests a last picture of every size near a pack, so that padding, stuffing and end code occur in all combinations.
#[test]
fn packs_of_discs_are_sectors_whatever_is_left_in_them() {
    let (packets, end) = packets(&config(96, 80), 1);
    for size in (1990..2010).chain(4000..4040) {
        let mut picture = packets[0].clone();
        picture.data.resize(size, 0xff);
        for (container, is_disc) in [(Container::Disc, true), (Container::Program, false)] {
            let (file, stream) = wrapped(container, &config(96, 80), std::slice::from_ref(&picture), &end);
            let read = read_program(&file, is_disc);
            assert_eq!(read.packs.iter().map(|&(_, _, data)| data).sum::<usize>(), stream.len(), "{size} bytes");
            if is_disc {
                assert_eq!(file.len() % 2048, 0, "{size} bytes");
            } else {
                // The file adds only headers: pack headers, packet headers and one system header.
                assert!(file.len() - stream.len() <= 15 + 40 * read.packs.len(), "{size} bytes in {}", file.len());
            }
        }
    }
}

/// Tests short films, which have few packets: ffmpeg misdetected them or did not detect them.
#[test]
fn short_transport_streams_are_recognized() {
    let config = config(96, 80).with_quantiser_scale(62);
    for count in 1..=6 {
        let (packets, end) = packets(&config, count);
        let (file, stream) = wrapped(Container::Transport, &config, &packets, &end);
        let file = StreamFile::new(&file);
        let entries = ["-count_packets", "-show_entries", "format=format_name:stream=nb_read_packets"];
        let arguments = [&["-v", "warning"], &entries[..], &["-of", "default=nw=1:nk=1", file.path()]].concat();
        let listed = String::from_utf8(output_of("ffprobe", &arguments)).expect("text");
        let told: Vec<&str> = listed.lines().collect();
        assert!(told.contains(&"mpegts") && told.contains(&&*count.to_string()), "{count} pictures: {listed}");
        let input = ["-nostdin", "-v", "warning", "-xerror", "-i", file.path()];
        let copied = output_of("ffmpeg", &[&input[..], &["-c", "copy", "-f", "mpeg2video", "-"]].concat());
        assert!(copied == stream, "{count} pictures");
    }
}

/// Authoring programs expect packets of private_stream_2 at bytes 38 and 1024 of the sector before each I picture.
#[test]
fn discs_have_packs_for_navigation() {
    let config = config(96, 80).with_b_pictures(2).with_gop(6);
    let (packets, end) = packets(&config, 20);
    let (file, stream) = wrapped(Container::Disc, &config, &packets, &end);
    let is_navigation = |sector: &[u8]| sector[38..44] == [0, 0, 1, 0xbf, 0x03, 0xd4] && sector[44] == 0;
    let sectors: Vec<&[u8]> = file.chunks(2048).collect();
    let mut entries = 0;
    for (number, sector) in sectors.iter().enumerate() {
        assert_eq!((sector.len(), &sector[..4]), (2048, &[0, 0, 1, 0xba][..]), "sector {number}");
        if is_navigation(sector) {
            assert_eq!(sector[1024..1031], [0, 0, 1, 0xbf, 0x03, 0xfa, 1], "sector {number}");
            entries += 1;
        }
        // The sector of an I picture contains a sequence header after the packet header.
        let header = 14 + 9 + usize::from(sector[22]);
        if sector[14..18] == [0, 0, 1, 0xe0] && sector[header..][..4] == [0, 0, 1, 0xb3] {
            assert!(is_navigation(sectors[number - 1]), "sector {number}");
        }
    }
    assert_eq!(entries, packets.iter().filter(|packet| packet.picture_type == PictureType::I).count());

    let file = StreamFile::new(&file);
    // ffmpeg warns about navigation packets without timestamps, even in its own files.
    let input = ["-nostdin", "-v", "error", "-xerror", "-i", file.path()];
    let copied = output_of("ffmpeg", &[&input[..], &["-c", "copy", "-f", "mpeg2video", "-"]].concat());
    assert!(copied == stream);
}
