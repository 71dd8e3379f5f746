//! Films of the program, and the values in their headers.

use super::level;
use glam::Vec3;
use std::path::Path;
use std::process::{Command, Stdio};
use tests::truth::{Elementary, assert_true, clock_accuracy, clock_interval};
use tests::{Glb, Moving, assert_fails, checkered_room, need, render, render2mpeg};

/// Returns the first frame's pixels as R′G′B′, decoded by ffmpeg.
fn shown_by_ffmpeg(file: &Path) -> Vec<u8> {
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-i"]).arg(file);
    command.args(["-frames:v", "1", "-sws_flags", "accurate_rnd+full_chroma_int"]);
    command.args(["-pix_fmt", "rgb24", "-f", "rawvideo", "-"]);
    let output = command.stdin(Stdio::null()).output().expect("ffmpeg can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Builds eight emissive vertical bars in front of a camera that sees 1.2 m in each direction.
fn bars() -> Glb {
    let mut glb = Glb::default();
    for bar in 0..8u8 {
        let color = Vec3::new(f32::from(bar & 1), f32::from(bar >> 1 & 1), f32::from(bar >> 2)) * 0.7 + 0.02;
        let corner = Vec3::new(0.3 * f32::from(bar) - 1.2, -1.2, 0.0);
        glb.add(&[[corner, Vec3::X * 0.3, Vec3::Y * 2.4]], Vec3::ZERO, color);
    }
    glb.add_camera(Vec3::new(0.0, 0.0, 1.2 / 0.45f32.tan()));
    glb
}

/// MPEG-1 and YUV4MPEG2 have no matrix coefficients, and decoders assume BT.601.
#[test]
fn colors_are_those_of_the_png_in_every_format() {
    const SIDE: usize = 128;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    bars().write(&folder.join("bars.glb"));
    std::fs::write(folder.join("bars.toml"), "[tone_mapping]\nexposure = 1\n").unwrap();
    let common = "--size 128x128 --frames 2 --qscale 2 --bounces 1 --photons 1000";
    for (name, more) in [
        ("two.m2v", ""),
        ("one.m1v", "--mpeg1"),
        ("one.mpg", "--mpeg1"),
        ("one.ts", "--mpeg1 --bframes 1"),
        ("one.mp4", "--mpeg1"),
        ("one.mkv", "--mpeg1"),
    ] {
        let files = "--y4m film.y4m --png frames";
        render(folder, name, &folder.join("bars.glb"), &format!("{common} {files} {more}"));
        let truth = shown_by_ffmpeg(&folder.join("frames/frame_00000.png"));
        // Compare the center of each bar with the PNG.
        for file in [name, "film.y4m"] {
            let shown = shown_by_ffmpeg(&folder.join(file));
            assert_eq!(shown.len(), 3 * SIDE * SIDE);
            for bar in 0..8 {
                let at = 3 * (SIDE / 2 * SIDE + SIDE / 16 * (2 * bar + 1));
                let [shown, truth] = [&shown, &truth].map(|pixels| &pixels[at..at + 3]);
                let off = shown.iter().zip(truth).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                println!("{file} {more} bar {bar}: {shown:?}, {truth:?} in the PNG, {off} off");
                assert!(off <= 8, "{file} {more}, bar {bar}: {shown:?}, not {truth:?}");
            }
        }
    }
}

/// Renders a film of a small room.
fn room(folder: &Path, name: &str, more: &str) -> (Vec<u8>, Elementary) {
    checkered_room(Moving::Camera).write(&folder.join("room.glb"));
    let film = render(folder, name, &folder.join("room.glb"), &format!("--vpls 60 --photons 1000 {more}")).stream;
    let video = assert_true(&film, name).expect("a known container");
    (film, video)
}

/// Checks that dvdauthor accepts the film without a warning.
fn author(folder: &Path, film: &str) {
    let words = ["-o", "disc", "-t", film];
    let mut command = Command::new("dvdauthor");
    let installed =
        command.args(words).current_dir(folder).env("VIDEO_FORMAT", "PAL").stdin(Stdio::null()).output().ok();
    let Some(output) = need("dvdauthor", installed) else { return };
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let warns = told.lines().any(|line| line.contains("WARN") || line.contains("ERR"));
    assert!(output.status.success() && !warns, "{film}: {told}");
    std::fs::remove_dir_all(folder.join("disc")).unwrap();
}

/// Discs have pictures of 4:3 or 16:9, and 23.976 pictures per second in frames at 29.97.
#[test]
fn films_for_discs_are_those_of_dvd_video() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Aspect ratio, frame rate and repeated fields.
    for (name, more, aspect, rate) in [
        ("pal.vob", "--size 720x576 --frames 4", 2, (25, 1)),
        ("wide.vob", "--size 720x576 --frames 4 --aspect 16:9 --bframes 2", 3, (25, 1)),
        ("film.vob", "--size 720x480 --frames 9 --fps 24000/1001", 2, (30_000, 1001)),
        ("b.vob", "--size 352x240 --frames 40 --fps 23.976 --bframes 2 --aspect 16:9", 3, (30_000, 1001)),
        ("cbr.vob", "--size 352x240 --frames 40 --fps 23.98 --cbr --bitrate 1M --bframes 1", 2, (30_000, 1001)),
        ("small.vob", "--size 50x33 --frames 40 --fps 23.976", 2, (30_000, 1001)),
        ("half.vob", "--size 352x288 --frames 4 --fps 12.5", 2, (25, 1)),
    ] {
        let (_, video) = room(folder, name, more);
        let stated = &video.sequences[0];
        assert_eq!((stated.aspect, stated.frame_rate), (aspect, rate), "{name}");
        let repeated = video.pictures.iter().filter(|picture| picture.repeat_first_field).count();
        let expected = if rate.0 == 30_000 { video.pictures.len() / 2 } else { 0 };
        assert!(repeated.abs_diff(expected) <= 1 && stated.progressive == (rate.0 != 30_000), "{name}: {repeated}");
        if name != "small.vob" {
            author(folder, name);
        }
    }

    // Requests beyond DVD-Video.
    for (words, told) in [
        ("--fps 24 -o a.vob", "29.97"),
        ("--fps 60 -o a.vob", "29.97"),
        ("--aspect square -o a.vob", "4:3"),
        ("--aspect 2:1 -o a.mpg", "16:9"),
        ("--mpeg1 --fps 23.976 -o a.vob", "pulldown"),
    ] {
        let words = format!("render room.glb {words}");
        assert_fails(folder, &words.split(' ').collect::<Vec<_>>(), &[told]);
    }
}

/// On the display, a square in the middle of the picture is as wide as high.
#[test]
fn pixels_have_the_stated_shape() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut glb = Glb::default();
    glb.add(&[[Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y]], Vec3::ZERO, Vec3::splat(0.7));
    glb.add_camera(Vec3::new(0.0, 0.0, 3.0));
    glb.write(&folder.join("square.glb"));
    std::fs::write(folder.join("square.toml"), "[tone_mapping]\nexposure = 1\n").unwrap();
    for (name, more, pixel) in [
        ("square.mpg", "", 1.0),
        ("narrow.vob", "", 16.0 / 15.0),
        ("wide.vob", "--aspect 16:9", 64.0 / 45.0),
        ("wide.mkv", "--aspect 16:9", 64.0 / 45.0),
        ("wide.m1v", "--aspect 16:9 --mpeg1", 64.0 / 45.0),
    ] {
        let options = "--size 720x576 --frames 1 --bounces 1 --photons 1000 --png frames";
        render(folder, name, &folder.join("square.glb"), &format!("{options} {more}"));
        let shown = shown_by_ffmpeg(&folder.join("frames/frame_00000.png"));
        let is_lit = |x: usize, y: usize| shown[3 * (y * 720 + x)] > 100;
        let width = (0..720).filter(|&x| is_lit(x, 288)).count() as f64;
        let height = (0..576).filter(|&y| is_lit(360, y)).count() as f64;
        println!("{name} {more}: {width} by {height} pixels");
        assert!((width * pixel / height - 1.0).abs() < 2.5 / width, "{name}: {width} by {height}");
    }
}

/// Clock references of transport streams, at every bit rate.
#[test]
fn clock_references_come_often_and_at_a_constant_rate_exactly() {
    let folder = tempfile::tempdir().unwrap();
    for fps in ["23.976", "24", "25", "30", "12"] {
        for (rate, is_constant) in
            [("", false), ("--bitrate 300k", false), ("--cbr --bitrate 300k", true), ("--cbr --bitrate 6M", true)]
        {
            let more = format!("--size 64x48 --frames 30 --fps {fps} {rate}");
            let (film, _) = room(folder.path(), "film.ts", &more);
            let (interval, accuracy) = (clock_interval(&film), clock_accuracy(&film));
            println!(
                "{more}: {:.2} ms between references, {:.3} µs off a constant rate",
                1e3 * interval,
                1e6 * accuracy
            );
            assert!(interval <= 0.040 + 1e-7, "{more}");
            assert!(!is_constant || accuracy <= 0.5e-6, "{more}");
        }
    }
}

/// Frame rates without an MPEG code repeat frames, at the lowest multiple.
#[test]
fn frames_are_repeated_at_rates_that_have_no_code() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (fps, pictures, rate) in [
        ("12", 2, (24, 1)),
        ("10", 3, (30, 1)),
        ("12.5", 2, (25, 1)),
        ("15", 2, (30, 1)),
        ("20", 3, (60, 1)),
        ("15000/1001", 2, (30_000, 1001)),
        ("1", 24, (24, 1)),
        ("24000/1001", 1, (24_000, 1001)),
        ("30000/1001", 1, (30_000, 1001)),
        ("23.98", 1, (24_000, 1001)),
        ("59.94", 1, (60_000, 1001)),
    ] {
        for (name, more) in [
            ("film.m2v", ""),
            ("film.mpg", "--mpeg1"),
            ("film.ts", "--bframes 2 --bitrate 400k"),
            ("chunks.mpg", "--chunk 3 --aq masking"),
        ] {
            // All options at some rates, one at the others.
            if !["12", "10"].contains(&fps) && name != "film.m2v" {
                continue;
            }
            let frames = if fps == "1" { 3 } else { 7 };
            let size = "--size 64x48 --gop 4";
            let (film, video) = room(folder, name, &format!("{size} --frames {frames} --fps {fps} {more}"));
            assert_eq!(video.sequences[0].frame_rate, rate, "{fps} {name}");
            assert_eq!(video.pictures.len(), frames * pictures, "{fps} {name}");

            // Repeated pictures are skipped as far as the standard allows: 144 bits of headers, and 56 for each row with two
            // empty macroblocks.
            if name == "film.m2v" {
                for (number, picture) in video.pictures.iter().enumerate().filter(|(number, _)| number % pictures > 0) {
                    assert!(
                        picture.kind == 2 && picture.bits() <= 144 + 3 * 56,
                        "{fps}, picture {number}: {} bits",
                        picture.bits()
                    );
                }
            }
            let report = std::fs::read(folder.join(name).with_extension("report.json")).unwrap();
            let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
            assert_eq!(report["frames"].as_array().unwrap().len(), frames, "{fps} {name}");
            let bits: u64 = video.pictures.iter().map(|picture| picture.bits()).sum();
            let told = report["summary"]["bits_total"].as_u64().unwrap();
            assert_eq!(told, bits, "{fps} {name}: {} bytes", film.len());
        }
    }
    for (fps, word) in [("16", "23.976"), ("0.5", "23.976"), ("fast", "24000/1001"), ("24000/0", "fps"), ("-12", "fps")]
    {
        let finished = render2mpeg(folder, &["render", "room.glb", &format!("--fps={fps}"), "-o", "a.mpg"]);
        assert!(finished.code == Some(2) && finished.stderr.contains(word), "{fps}: {}", finished.stderr);
    }
    std::fs::write(folder.join("room.toml"), "[video]\nfps = \"12000/1001\"\n").unwrap();
    let (_, video) = room(folder, "toml.m2v", "--size 64x48 --frames 2");
    assert_eq!(video.sequences[0].frame_rate, (24_000, 1001));
}

/// Builds a screen of noise and a camera that moves by half a texel per picture.
fn screen_of_noise() -> Glb {
    let mut state = 1u32;
    let mut code = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let codes: Vec<u8> = (0..512 * 512).map(|_| code()).collect();
    let mut glb = Glb::default();
    glb.add_screen([Vec3::new(-1.5, -1.5, 0.0), Vec3::X * 3.0, Vec3::Y * 3.0], 1.0, (512, &codes), false);
    let camera = glb.add_camera(Vec3::new(0.0, 0.0, 1.6));
    glb.animate(camera, Vec3::new(-0.2, 0.0, 1.6), Vec3::new(0.2, 0.1, 1.6));
    glb
}

/// Noise at fine quantisers exceeds the lowest level of its size.
#[test]
fn films_of_noise_state_a_level_that_holds_them() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    screen_of_noise().write(&folder.join("noise.glb"));
    std::fs::write(folder.join("noise.toml"), "[tone_mapping]\nexposure = 1\n").unwrap();
    for (name, more, lowest) in [
        ("low.m2v", "--size 352x288 --qscale 1", 10),
        ("main.mpg", "--size 720x576 --qscale 2", 8),
        ("low.ts", "--size 352x288 --qscale 1 --bframes 2", 10),
        ("one.mpg", "--size 352x288 --qscale 2 --mpeg1", 0),
        ("chunks.m2v", "--size 352x288 --qscale 1 --chunk 4", 10),
        // Discs require Main Level: pictures are coded coarser.
        ("disc.vob", "--size 352x288 --qscale 1", 10),
    ] {
        let options = format!("--frames 8 --bounces 1 --photons 1000 {more}");
        let film = render(folder, name, &folder.join("noise.glb"), &options).stream;
        let video = assert_true(&film, name).expect("a known container");
        let bits = video.pictures.iter().map(|picture| picture.bits()).sum::<u64>() / 8 * 25;
        println!("{name} {more}: {bits} bit/s, level {}", level(&video));
        assert!(lowest == 0 || level(&video) < lowest, "{name}: level {}", level(&video));
    }
}

/// Sides that headers cannot represent, and sizes beyond every level, which a note reports.
#[test]
fn sides_of_a_multiple_of_4096_are_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, size, coded) in
        [("wide.mpg", "4096x16", (4097, 16)), ("high.ts", "16x4096", (16, 4097)), ("wide.m2v", "8192x16", (8193, 16))]
    {
        let (_, video) = room(folder, name, &format!("--frames 2 --size {size} --aq masking"));
        assert_eq!(video.sequences[0].size, coded, "{name}");
        let (width, height) = size.split_once('x').unwrap();
        assert_eq!(video.sequences[0].display, Some((width.parse().unwrap(), height.parse().unwrap())), "{name}");
    }
    let words = "render room.glb -o note.mpg --size 4096x16 --frames 1 --vpls 60 --photons 1000";
    let finished = render2mpeg(folder, &words.split(' ').collect::<Vec<_>>());
    assert!(finished.code == Some(0) && finished.stderr.contains("High Level"), "{}", finished.stderr);
    assert_fails(folder, &["render", "room.glb", "-o", "a.mpg", "--size", "4096x16", "--mpeg1"], &["4095"]);
}
