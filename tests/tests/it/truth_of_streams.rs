//! Numbers that streams state hold for what is in them, by a parser of the tests' own (`tests::truth`).
//!
//! `tests::render` checks each film of the test suite in the same way. Here are clips and options that strain one number each.

use glam::Vec3;
use mpeg2enc::{Config, Container, FrameRate, KnownMotion, Level, Multiplexer, Picture, Plane, Rate, Standard};
use std::path::Path;
use std::process::{Command, Stdio};
use tests::truth::{Elementary, assert_true};
use tests::{Glb, render};

/// Containers that have clocks or none.
const CONTAINERS: [Container; 4] = [Container::Elementary, Container::Program, Container::Disc, Container::Transport];

/// Noise of half range, another one in each frame: nothing predicts it.
fn noise(width: usize, height: usize, seed: u64) -> Picture {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut plane = |width: usize, height: usize| {
        Plane::from_fn(width, height, |_, _| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            64 + (state >> 33) as u8 / 2
        })
    };
    let chroma = (width.div_ceil(2), height.div_ceil(2));
    Picture::new(plane(width, height), plane(chroma.0, chroma.1), plane(chroma.0, chroma.1)).unwrap()
}

/// A pattern that moves a pixel a frame.
fn waves(width: usize, height: usize, time: usize) -> Picture {
    let wave = |x: usize, y: usize| (128.0 + 70.0 * ((x + time) as f64 * 0.3).sin() * (y as f64 * 0.2).cos()) as u8;
    let chroma = Plane::filled(width.div_ceil(2), height.div_ceil(2), 120);
    Picture::new(Plane::from_fn(width, height, wave), chroma.clone(), chroma).unwrap()
}

/// A film of these frames; each number that it states holds.
fn film(container: Container, config: &Config, frames: impl Iterator<Item = Picture>) -> (Vec<u8>, Elementary) {
    let mut multiplexer = Multiplexer::new(container, config);
    let mut encoder = config.clone().encoder().unwrap();
    let mut film = Vec::new();
    for frame in frames {
        for packet in encoder.push(&frame, KnownMotion::default()) {
            film.extend(multiplexer.push(packet));
        }
    }
    let finish = encoder.finish();
    for packet in finish.packets {
        film.extend(multiplexer.push(packet));
    }
    film.extend(multiplexer.finish(&finish.end));
    let video = assert_true(&film, &format!("{container:?}, {:?}", config.level())).expect("a known container");
    (film, video)
}

/// The level's four bits of profile_and_level_indication.
fn level(video: &Elementary) -> u64 {
    video.sequences[0].profile_and_level & 15
}

#[test]
fn sides_of_a_multiple_of_4096_are_coded_longer_and_displayed_as_they_are() {
    for (size, coded) in [((4096, 32), (4097, 32)), ((32, 4096), (32, 4097)), ((8192, 16), (8193, 16))] {
        let config = Config::new(size.0, size.1, FrameRate::FPS_25).with_lookahead(2);
        let frames = (0..3).map(|time| waves(size.0, size.1, time));
        let (_, video) = film(Container::Elementary, &config, frames);
        let display = (size.0 as u64, size.1 as u64);
        assert_eq!((video.sequences[0].size, video.sequences[0].display), (coded, Some(display)));
    }
}

/// Noise that no level of its size holds: a higher level is stated, whose rate and buffer hold the pictures.
#[test]
fn noise_at_fine_quantisers_states_a_level_that_holds_it() {
    for (width, height, quantiser, frames, indication) in
        [(352, 288, 1, 12, 6), (720, 576, 2, 8, 4), (176, 144, 1, 12, 8)]
    {
        for (lookahead, b_pictures) in [(0, 0), (4, 2)] {
            for standard in [Standard::Mpeg2, Standard::Mpeg1] {
                let quantiser = if standard == Standard::Mpeg1 { 2 } else { quantiser };
                let config = Config::new(width, height, FrameRate::FPS_25)
                    .with_quantiser_scale(quantiser)
                    .with_standard(standard)
                    .with_lookahead(lookahead)
                    .with_b_pictures(b_pictures);
                for container in CONTAINERS {
                    let (_, video) = film(container, &config, (0..frames).map(|seed| noise(width, height, seed)));
                    let largest = video.pictures.iter().map(|picture| picture.bits()).max().unwrap();
                    let stated = &video.sequences[0];
                    println!(
                        "{width}x{height} {standard:?} {container:?}: {largest} bits in {}, level {}",
                        stated.buffer,
                        level(&video)
                    );
                    assert!(standard == Standard::Mpeg1 || level(&video) == indication, "{}", level(&video));
                }
            }
        }
    }
}

/// A quiet beginning states the lowest level. Noise that follows is coded coarser, so that the level holds it.
#[test]
fn noise_after_a_quiet_beginning_is_coded_coarser() {
    for lookahead in [0, 4] {
        for (quiet, gop) in [(1, 15), (5, 15), (3, 1)] {
            let config = Config::new(352, 288, FrameRate::FPS_25)
                .with_quantiser_scale(1)
                .with_gop(gop)
                .with_lookahead(lookahead);
            let frames = (0..quiet).map(|_| Picture::black(352, 288)).chain((0..15).map(|seed| noise(352, 288, seed)));
            let (_, video) = film(Container::Transport, &config, frames);
            assert_eq!(level(&video), 10, "Low Level");
        }
    }
}

/// A requested level is kept.
#[test]
fn a_requested_level_holds_noise_too() {
    let config = Config::new(352, 288, FrameRate::FPS_25).with_quantiser_scale(2).with_level(Level::Main);
    let (_, video) = film(Container::Program, &config, (0..10).map(|seed| noise(352, 288, seed)));
    assert_eq!(level(&video), 8);
}

/// Rates, B pictures, group lengths and standards in all containers.
#[test]
fn a_table_of_options_states_the_truth() {
    let constant = Rate::Constant { bits_per_second: 1_500_000, buffer_bits: 750_000 };
    let capped = Rate::Capped { bits_per_second: 1_000_000, buffer_bits: 500_000 };
    for fps in [23.976, 24.0, 25.0, 29.97, 30.0, 50.0, 59.94, 60.0] {
        for (rate, b_pictures) in
            [(Rate::ConstantQuantiser, 0), (Rate::ConstantQuantiser, 2), (constant, 2), (capped, 1), (constant, 0)]
        {
            for standard in [Standard::Mpeg2, Standard::Mpeg1] {
                let lookahead = if rate == Rate::ConstantQuantiser { b_pictures } else { 10 };
                let config = Config::new(160, 112, FrameRate::from_fps(fps).unwrap())
                    .with_standard(standard)
                    .with_lookahead(lookahead)
                    .with_b_pictures(b_pictures)
                    .with_rate(rate)
                    .with_gop(12);
                for container in CONTAINERS {
                    film(container, &config, (0..40).map(|time| waves(160, 112, time)));
                }
            }
        }
    }
}

/// Pixels of the first frame of a file as ffmpeg shows them, R′G′B′.
fn shown_by_ffmpeg(file: &Path) -> Vec<u8> {
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-i"]).arg(file);
    command.args(["-frames:v", "1", "-sws_flags", "accurate_rnd+full_chroma_int"]);
    command.args(["-pix_fmt", "rgb24", "-f", "rawvideo", "-"]);
    let output = command.stdin(Stdio::null()).output().expect("ffmpeg can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Eight bars that glow, side by side in front of a camera, which sees 1.2 m of them in each direction.
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

/// MPEG-1 and YUV4MPEG2 state no matrix, and readers assume BT.601.
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
