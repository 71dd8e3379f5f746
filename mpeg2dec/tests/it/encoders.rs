//! Streams of several encoders, compared with libavcodec.

use crate::common::{check, encoded, ffmpeg, raw, run_if_installed, temporary};
use mpeg2enc::{CoefficientTable, Config, FrameRate, Packet, Picture, Plane, Standard, SuppliedMotion};
use std::{collections::BTreeMap, fs, sync::Arc};

/// Features of ffmpeg's encoder: name, size and options.
const FFMPEG: [(&str, &str, &str); 17] = [
    ("MPEG-1, I, P and B", "192x128", "-c:v mpeg1video -bf 2 -q:v 4"),
    ("MPEG-1, odd size", "175x97", "-c:v mpeg1video -bf 2 -q:v 2"),
    ("I pictures", "192x128", "-c:v mpeg2video -g 1 -q:v 2"),
    ("P pictures", "192x128", "-c:v mpeg2video -bf 0 -q:v 3"),
    ("B pictures", "192x128", "-c:v mpeg2video -bf 2 -q:v 3"),
    ("closed groups", "192x128", "-c:v mpeg2video -bf 2 -q:v 3 -g 6 -flags +cgop -sc_threshold 1000000000"),
    ("low delay", "192x128", "-c:v mpeg2video -bf 0 -q:v 3 -flags +low_delay"),
    ("interlaced", "192x128", "-c:v mpeg2video -bf 2 -q:v 3 -flags +ildct+ilme -top 1"),
    ("alternate scan", "192x128", "-c:v mpeg2video -bf 2 -q:v 3 -flags +ildct+ilme -alternate_scan 1"),
    ("intra_vlc_format", "192x128", "-c:v mpeg2video -bf 2 -q:v 2 -intra_vlc 1"),
    ("non-linear scale", "192x128", "-c:v mpeg2video -bf 2 -q:v 12 -qmax 28 -non_linear_quant 1"),
    ("DC of 9 bits", "192x128", "-c:v mpeg2video -bf 2 -q:v 2 -dc 9"),
    ("DC of 11 bits", "192x128", "-c:v mpeg2video -bf 2 -q:v 2 -dc 11"),
    ("4:2:2", "192x128", "-c:v mpeg2video -pix_fmt yuv422p -bf 2 -q:v 3"),
    ("4:2:2, interlaced", "192x128", "-c:v mpeg2video -pix_fmt yuv422p -bf 2 -q:v 3 -flags +ildct+ilme -intra_vlc 1"),
    ("odd size", "175x97", "-c:v mpeg2video -bf 2 -q:v 3"),
    ("several slices per row", "192x128", "-c:v mpeg2video -bf 2 -q:v 3 -ps 200"),
];

#[test]
fn streams_of_ffmpeg() {
    for (feature, size, options) in FFMPEG {
        let format = if options.contains("mpeg1") { "-f mpeg1video" } else { "-f mpeg2video" };
        let options = format!("{} {format}", options.replace("-c:v mpeg1video", "-c:v mpeg1video -pix_fmt yuv420p"));
        let options = if options.contains("-pix_fmt") { options } else { format!("-pix_fmt yuv420p {options}") };
        let found = check(feature, "ffmpeg", &encoded(size, "m2v", &options), "mpegvideo");
        assert_eq!(found.pictures.len(), 15, "{feature}");
    }
}

#[test]
fn custom_matrices() {
    let list = |f: &dyn Fn(usize) -> usize| {
        let weights: Vec<String> = (0..64).map(|i| f(i).to_string()).collect();
        weights.join(",")
    };
    let intra = list(&|i| if i == 0 { 8 } else { 9 + i });
    let inter = list(&|i| 12 + i / 3);
    let options = format!(
        "-pix_fmt yuv420p -c:v mpeg2video -bf 1 -q:v 3 -intra_matrix {intra} -inter_matrix {inter} -f mpeg2video"
    );
    check("custom matrices", "ffmpeg", &encoded("192x128", "m2v", &options), "mpegvideo");
}

/// Stream of the encoder of this project, and its reconstructed pictures in display order.
struct OwnStream {
    bytes: Vec<u8>,
    pictures: BTreeMap<u64, Arc<Picture>>,
}

impl OwnStream {
    fn add(&mut self, packets: Vec<Packet>) {
        for packet in packets {
            self.bytes.extend(packet.data);
            self.pictures.insert(packet.display_index, packet.reconstruction);
        }
    }
}

/// Encodes a moving pattern with the encoder of this project.
fn own_stream(standard: Standard, adapt: impl Fn(Config) -> Config) -> OwnStream {
    let (width, height) = (90, 70);
    let config = Config::new(width, height, FrameRate::FPS_25).with_gop(8).with_quantiser_scale(6);
    let mut encoder = adapt(config.with_standard(standard)).encoder().expect("a valid configuration");
    let mut stream = OwnStream { bytes: Vec::new(), pictures: BTreeMap::new() };
    for time in 0..12 {
        let wave = |x: usize, y: usize| {
            let (x, y) = ((x + 2 * time) as f32, (y + time) as f32);
            (128.0 + 60.0 * (x * 0.4).sin() + 50.0 * (y * 0.3 + x * 0.05).cos()) as u8
        };
        let chroma = Plane::from_fn(width / 2, height / 2, |x, y| wave(2 * x, 2 * y) / 2 + 60);
        let picture = Picture::new(Plane::from_fn(width, height, wave), chroma.clone(), chroma).expect("planes");
        stream.add(encoder.push(&picture, SuppliedMotion::default()));
    }
    let finish = encoder.finish();
    stream.add(finish.packets);
    stream.bytes.extend(finish.end);
    stream
}

/// Checks a stream of this project, and that its pictures equal the encoder's reconstruction.
fn check_own(feature: &str, stream: &OwnStream) {
    let found = check(feature, "mpeg2enc", &stream.bytes, "mpegvideo");
    assert_eq!(found.pictures.len(), stream.pictures.len());
    for (picture, expected) in found.pictures.iter().zip(stream.pictures.values()) {
        let planes = [expected.luma(), expected.cb(), expected.cr()];
        let expected: Vec<u8> = planes.iter().flat_map(|plane| plane.samples()).copied().collect();
        assert!(raw(picture) == expected, "{feature}: the decoder differs from the encoder");
    }
}

#[test]
fn streams_of_this_project() {
    for standard in [Standard::Mpeg2, Standard::Mpeg1] {
        check_own(&format!("{standard:?}"), &own_stream(standard, |config| config));
    }
    let ahead = own_stream(Standard::Mpeg2, |config| config.with_lookahead(4).with_b_pictures(2));
    check_own("look-ahead and B pictures", &ahead);
    let fine = |config: Config| config.with_quantiser_scale(1).with_intra_dc_precision(11);
    check_own("fine scale, DC of 11 bits", &own_stream(Standard::Mpeg2, fine));
    let other = |config: Config| config.with_alternate_scan(true).with_intra_table(CoefficientTable::Zero);
    check_own("alternate scan, Table B.14", &own_stream(Standard::Mpeg2, other));
}

/// Options of the encoder of mjpegtools.
const MJPEGTOOLS: [(&str, &str); 6] = [
    ("MPEG-1", "-f 1 -b 1150"),
    ("progressive, B pictures", "-f 3 -I 0 -b 3000 -R 2 -q 5"),
    ("progressive, closed groups", "-f 3 -I 0 -b 3000 -R 2 -q 5 -c"),
    ("interlaced, B pictures", "-f 3 -I 1 -b 2500 -R 2 -q 6"),
    ("interlaced, P pictures, DC of 10 bits", "-f 3 -I 1 -b 2500 -R 0 -q 6 -D 10"),
    ("dual prime in frame pictures", "-f 3 -I 1 -b 2500 -R 0 -q 6 --dualprime-mpeg2"),
];

#[test]
fn streams_of_mjpegtools() {
    let (source, stream) = (temporary("y4m"), temporary("m2v"));
    let pattern = "testsrc2=s=352x288:r=50:d=0.4,noise=alls=10:allf=t,tinterlace=interleave_top";
    let name = |path: &std::path::PathBuf| path.to_str().expect("a path in UTF-8").to_owned();
    let format = ["-pix_fmt", "yuv420p", "-f", "yuv4mpegpipe"];
    ffmpeg(&[&["-f", "lavfi", "-i", pattern], &format[..], &[&name(&source)]].concat());
    for (feature, options) in MJPEGTOOLS {
        let options = format!("{options} -v 0 -o {}", name(&stream));
        let options: Vec<&str> = options.split_whitespace().collect();
        if run_if_installed("mpeg2enc", &options, &source).is_none() {
            break;
        }
        check(feature, "mjpegtools", &fs::read(&stream).expect("a stream"), "mpegvideo");
    }
    let _ = (fs::remove_file(source), fs::remove_file(stream));
}
