//! MP4 and Matroska, which are written by groups of pictures: times, seeking, and the unchanged elementary stream.

use crate::common::*;
use mpeg2enc::{
    AspectRatio, ColorDescription, ColorPrimaries, Config, Container, FrameRate, MatrixCoefficients, Multiplexer,
    Packet, PictureType, Standard, SuppliedMotion, TransferCharacteristics,
};

const BOTH: [Container; 2] = [Container::Mp4, Container::Matroska];

/// An encoded film: settings, packets and the end of the stream.
struct Film {
    config: Config,
    /// Packets in the order of coding.
    packets: Vec<Packet>,
    end: Vec<u8>,
}

impl Film {
    fn new(config: Config, frames: usize) -> Self {
        let config = config.with_lookahead(Config::LOOKAHEAD_MAX);
        let mut encoder = config.clone().encoder().expect("a valid configuration");
        let pictures = (0..frames).map(|time| moving(96, 80, time));
        let mut packets: Vec<Packet> =
            pictures.flat_map(|picture| encoder.push(&picture, SuppliedMotion::default())).collect();
        let finish = encoder.finish();
        packets.extend(finish.packets);
        Self { config, packets, end: finish.end }
    }

    /// Returns the elementary stream.
    fn stream(&self) -> Vec<u8> {
        let mut stream: Vec<u8> = self.packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
        stream.extend(&self.end);
        stream
    }

    /// Returns a multiplexer with the duration of all pictures, and the file after the first `count` packets with its ending.
    fn begun(&self, container: Container, count: usize) -> (Multiplexer, Vec<u8>) {
        let mut multiplexer = Multiplexer::new(container, &self.config).with_pictures(self.packets.len() as u64);
        let packets = self.packets[..count].iter();
        let file = packets.flat_map(|packet| multiplexer.push(packet.clone())).collect();
        (multiplexer, file)
    }

    fn file(&self, container: Container) -> StreamFile {
        let (multiplexer, mut file) = self.begun(container, self.packets.len());
        file.extend(multiplexer.finish(&self.end));
        StreamFile::new(&file)
    }
}

/// Returns the output of a program that must not print warnings.
fn told_by(program: &str, arguments: &[&str]) -> String {
    let (output, messages) = run(program, arguments);
    assert!(messages.is_empty(), "{program} {arguments:?}: {messages}");
    String::from_utf8(output).expect("text")
}

/// Returns the entries that ffprobe reads, one line for each packet, stream or file.
fn probed(file: &StreamFile, entries: &str) -> Vec<String> {
    let arguments = ["-v", "error", "-err_detect", "explode", "-show_entries", entries, "-of", "csv=p=0", file.path()];
    let text = told_by("ffprobe", &arguments);
    let lines = text.lines().map(|line| line.trim_end_matches(','));
    lines.filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

fn films() -> Vec<(Film, f64)> {
    let config = |fps| Config::new(96, 80, FrameRate::from_fps(fps).expect("a rate of Table 6-4"));
    vec![
        (Film::new(config(25.0), 50), 25.0),
        (Film::new(config(23.976).with_b_pictures(2), 50), 24000.0 / 1001.0),
        (Film::new(config(59.94).with_b_pictures(3).with_gop(7), 31), 60000.0 / 1001.0),
        (Film::new(config(30.0).with_b_pictures(2).with_closed_gop(true), 40), 30.0),
        (Film::new(config(30.0).with_b_pictures(1).with_standard(Standard::Mpeg1), 40), 30.0),
        (Film::new(config(24.0).with_gop(1), 3), 24.0),
        (Film::new(config(50.0), 1), 50.0),
    ]
}

#[test]
fn pictures_are_shown_at_the_frame_rate() {
    for (film, fps) in films() {
        for container in BOTH {
            let file = film.file(container);
            // Matroska counts milliseconds.
            let tolerance = if container == Container::Mp4 { 2e-6 } else { 0.000_501 };
            let lines = probed(&file, "packet=pts_time,flags");
            assert_eq!(lines.len(), film.packets.len(), "{container:?}: {lines:?}");
            for (packet, line) in film.packets.iter().zip(&lines) {
                let (time, flags) = line.split_once(',').expect("two entries");
                let due = packet.display_index as f64 / fps;
                let time: f64 = time.parse().expect("a time");
                assert!((time - due).abs() <= tolerance, "{container:?}, {fps}: {time} is not {due}");
                assert_eq!(flags.starts_with('K'), packet.picture_type == PictureType::I, "{container:?}: {line}");
            }
            let codec = probed(&file, "stream=codec_name").concat();
            let is_mpeg1 = !film.stream().windows(4).any(|bytes| bytes == [0, 0, 1, 0xb5]);
            assert_eq!(codec, if is_mpeg1 { "mpeg1video" } else { "mpeg2video" }, "{container:?}");
            let told = probed(&file, "stream=avg_frame_rate").concat();
            let (numerator, denominator) = told.split_once('/').expect("a fraction");
            let rate = numerator.parse::<f64>().expect("a number") / denominator.parse::<f64>().expect("a number");
            assert!(film.packets.len() < 2 || (rate / fps - 1.0).abs() < 0.01, "{container:?}: {told}, not {fps}");
            let seconds: f64 = probed(&file, "format=duration")[0].parse().expect("seconds");
            let expected = film.packets.len() as f64 / fps;
            assert!((seconds - expected).abs() < 0.001, "{container:?}: {seconds} s, not {expected}");
        }
    }
}

#[test]
fn the_elementary_stream_comes_out_again() {
    for (film, _) in films() {
        let pictures = decode(&StreamFile::new(&film.stream()), &[]);
        for container in BOTH {
            let file = film.file(container);
            let input = ["-nostdin", "-v", "warning", "-xerror", "-err_detect", "explode", "-i", file.path()];
            let (copied, messages) = run("ffmpeg", &[&input[..], &["-c", "copy", "-f", "mpeg2video", "-"]].concat());
            // Matroska has no decoding times: ffmpeg invents some and then warns about them.
            let is_of_file = |line: &&str| !line.is_empty() && !line.contains("non monotonically increasing dts");
            let messages: Vec<&str> = messages.lines().filter(is_of_file).collect();
            assert!(messages.is_empty(), "{container:?}: {messages:?}");
            assert!(copied == film.stream(), "{container:?}: {} bytes, not {}", copied.len(), film.stream().len());
            assert!(decode(&file, &[]) == pictures, "{container:?}");
        }
    }
}

/// Returns the pictures decoded by ffmpeg, with options before the file.
fn decode(file: &StreamFile, options: &[&str]) -> Vec<u8> {
    let input = [&["-nostdin", "-v", "error"], options, &["-i", file.path()]].concat();
    let output = ["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "yuv420p", "-"];
    run("ffmpeg", &[&input[..], &output].concat()).0
}

#[test]
fn films_are_sought_in() {
    const PICTURE: usize = 96 * 80 * 3 / 2;
    for (film, fps) in films() {
        let count = film.packets.len();
        let all = decode(&StreamFile::new(&film.stream()), &[]);
        for container in BOTH {
            let file = film.file(container);
            for place in [count / 3, count / 2, count - 1] {
                // Seek to half a picture before the display time, because Matroska rounds times.
                let seconds = ((place as f64 - 0.5) / fps).max(0.0);
                let rest = decode(&file, &["-ss", &format!("{seconds:.6}")]);
                assert!(rest == all[place * PICTURE..], "{container:?}, {fps}: not the pictures from {place} on");
            }
        }
    }
}

/// A file that ends after any picture contains all pictures so far, and its tables.
#[test]
fn files_end_anywhere() {
    let film = Film::new(Config::new(96, 80, FrameRate::FPS_25).with_b_pictures(2).with_gop(6), 20);
    let all = [Container::Elementary, Container::Program, Container::Transport, Container::Mp4, Container::Matroska];
    for container in all {
        assert_eq!(film.begun(container, 0).0.ending(), []);
        for count in [1, 5, 6, 7, 13, film.packets.len()] {
            let (multiplexer, mut file) = film.begun(container, count);
            file.extend(multiplexer.ending());
            let file = StreamFile::new(&file);
            let told = probed(&file, "packet=size");
            assert_eq!(told.len(), count, "{container:?}, {count}: {told:?}");
        }
        // After the last picture, the ending equals the regular end of the file.
        let (multiplexer, _) = film.begun(container, film.packets.len());
        assert!(multiplexer.ending() == multiplexer.finish(&film.end), "{container:?}");
    }
}

/// A file truncated at any position shows its complete groups.
#[test]
fn files_that_are_cut_off_play() {
    let film = Film::new(Config::new(96, 80, FrameRate::FPS_25).with_gop(6), 24);
    for container in BOTH {
        let (_, file) = film.begun(container, film.packets.len());
        for share in [0.5, 0.75, 1.0] {
            let cut = StreamFile::new(&file[..(share * file.len() as f64) as usize]);
            let shown = decode(&cut, &[]).len() / (96 * 80 * 3 / 2);
            assert!(shown >= 6, "{container:?}: {shown} pictures of {share} of the file");
        }
    }
}

#[test]
fn color_and_shape_are_stated() {
    let color = ColorDescription {
        primaries: ColorPrimaries::Bt470Bg,
        transfer: TransferCharacteristics::Smpte170M,
        matrix: MatrixCoefficients::Bt470Bg,
    };
    let config = Config::new(96, 80, FrameRate::FPS_25).with_color(color).with_aspect(AspectRatio::Display16x9);
    let film = Film::new(config, 3);
    let entries = "stream=width,height,sample_aspect_ratio,color_range,color_space,color_transfer,color_primaries";
    for container in BOTH {
        let told = probed(&film.file(container), entries);
        assert_eq!(told, ["96,80,40:27,tv,bt470bg,smpte170m,bt470bg"], "{container:?}");
    }
}

/// Reads the top-level boxes of an MP4 file from its first byte to its last.
#[test]
fn fragments_begin_with_an_i_picture_and_are_listed() {
    let film = Film::new(Config::new(96, 80, FrameRate::FPS_25).with_b_pictures(2).with_gop(6), 20);
    let (multiplexer, mut file) = film.begun(Container::Mp4, film.packets.len());
    file.extend(multiplexer.finish(&film.end));
    let word = |at: usize| u32::from_be_bytes(file[at..at + 4].try_into().expect("four bytes")) as usize;
    let (mut boxes, mut at) = (Vec::new(), 0);
    while at < file.len() {
        boxes.push((at, String::from_utf8_lossy(&file[at + 4..at + 8]).into_owned()));
        at += word(at);
    }
    assert_eq!(at, file.len(), "boxes must fill the file");
    let groups = film.packets.iter().filter(|packet| packet.picture_type == PictureType::I).count();
    let kinds: Vec<&str> = boxes.iter().map(|(_, kind)| kind.as_str()).collect();
    let fragments = ["moof", "mdat"].repeat(groups);
    assert_eq!(kinds, [&["ftyp", "moov"][..], &fragments, &["mfra"]].concat());

    // The last four bytes contain the size of the table, and the table contains the positions of the fragments.
    let table = file.len() - word(file.len() - 4);
    assert_eq!(Some(&(table, "mfra".into())), boxes.last());
    assert_eq!(word(table + 8 + 20), groups);
    for group in 0..groups {
        let place = word(table + 8 + 24 + 19 * group + 12);
        assert!(boxes.contains(&(place, "moof".into())), "entry {group}: {place}");
    }
    for (place, _) in boxes.iter().filter(|(_, kind)| kind == "mdat") {
        assert_eq!(file[place + 8..place + 12], [0, 0, 1, 0xb3], "a sequence header");
    }
}
