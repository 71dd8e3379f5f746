//! Header values of streams are true, by an independent parser (`tests::truth`).
//!
//! `tests::render` checks every film of the test suite in this way. The clips and options here strain one value each.

mod films;

use mpeg2enc::{Config, Container, FrameRate, Level, Multiplexer, Picture, Plane, Rate, Standard, SuppliedMotion};
use tests::truth::{Elementary, assert_true};

/// Containers with and without clocks.
const CONTAINERS: [Container; 4] = [Container::Elementary, Container::Program, Container::Disc, Container::Transport];

/// Returns noise of half range, different in each frame, which cannot be predicted.
fn noise(width: usize, height: usize, seed: u64) -> Picture {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut plane = |width: usize, height: usize| Plane::from_fn(width, height, |_, _| random.u8(64..192));
    let chroma = (width.div_ceil(2), height.div_ceil(2));
    Picture::new(plane(width, height), plane(chroma.0, chroma.1), plane(chroma.0, chroma.1)).unwrap()
}

/// Returns a pattern that moves by one pixel per frame.
fn waves(width: usize, height: usize, time: usize) -> Picture {
    let wave = |x: usize, y: usize| (128.0 + 70.0 * ((x + time) as f64 * 0.3).sin() * (y as f64 * 0.2).cos()) as u8;
    let chroma = Plane::filled(width.div_ceil(2), height.div_ceil(2), 120);
    Picture::new(Plane::from_fn(width, height, wave), chroma.clone(), chroma).unwrap()
}

/// Encodes a film of these frames, and checks all of its header values.
fn film(container: Container, config: &Config, frames: impl Iterator<Item = Picture>) -> (Vec<u8>, Elementary) {
    let mut multiplexer = Multiplexer::new(container, config);
    let mut encoder = config.clone().encoder().unwrap();
    let mut film = Vec::new();
    for frame in frames {
        for packet in encoder.push(&frame, SuppliedMotion::default()) {
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

/// Returns the level's four bits of profile_and_level_indication.
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

/// Noise beyond the level of its size: the header states a higher level, and the pictures obey its limits.
#[test]
fn noise_at_fine_quantisers_states_a_level_that_holds_it() {
    for (width, height, quantiser, frames, indication) in
        [(352, 288, 1, 12, 6), (720, 576, 2, 8, 4), (176, 144, 1, 12, 8)]
    {
        for (lookahead, b_pictures) in [(0, 0), (4, 2)] {
            // MPEG-1 has no level to check.
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

/// A quiet start states the lowest level. The noise after it is coded coarser, within that level.
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
