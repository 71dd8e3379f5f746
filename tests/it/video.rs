//! Options of the encoder on the command line.

use std::path::Path;
use tests::{Rendered, cornell, decode_ffmpeg, decode_mpeg2dec, render, tolerant_frame_count};

const SIZE: (usize, usize) = (64, 64);
const SMALL: &str = "--size 64x64 --vpls 200 --photons 20000";

fn film(folder: &Path, name: &str, more: &str) -> Rendered {
    render(folder, name, &cornell(), &format!("{SMALL} {more}"))
}

fn picture_types(film: &Rendered) -> String {
    let frames = film.report["frames"].as_array().expect("a report has frames");
    frames.iter().map(|frame| frame["picture_type"].as_str().expect("a type")).collect()
}

#[test]
fn the_ending_says_what_the_pictures_are_wrapped_into() {
    let folder = tempfile::tempdir().unwrap();
    let films = ["plain.m2v", "program.mpg", "transport.ts"].map(|name| film(folder.path(), name, "--frames 5"));
    let starts: [&[u8]; 3] = [&[0, 0, 1, 0xb3], &[0, 0, 1, 0xba], &[0x47]];
    for (film, start) in films.iter().zip(starts) {
        assert!(film.stream.starts_with(start));
        assert_eq!(film.figures(&["bits"]), films[0].figures(&["bits"]), "wrapping changes no picture");
    }
    let shown = |name: &str| decode_ffmpeg(&folder.path().join(name), SIZE);
    let plain = shown("plain.m2v");
    assert_eq!(plain.len(), 5);
    assert!(shown("program.mpg") == plain && shown("transport.ts") == plain, "all three show the same");
}

#[test]
fn mpeg_1_has_no_extensions() {
    let folder = tempfile::tempdir().unwrap();
    let film = film(folder.path(), "one", "--frames 5 --mpeg1");
    assert!(!film.stream.windows(4).any(|bytes| bytes == [0, 0, 1, 0xb5]), "extension_start_code");
    let video = folder.path().join("one.m2v");
    // At its strictest, ffmpeg warns that the stream has no duration.
    assert_eq!(tolerant_frame_count(&video, SIZE), 5);
    assert_eq!(decode_mpeg2dec(&video, SIZE).len(), 5);
}

#[test]
fn a_constant_rate_is_kept_and_steers_the_thresholds() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str, rate: u32, more: &str| {
        film(folder.path(), name, &format!("--frames 50 --gop 10 --cbr --bitrate {rate}k {more}"))
    };
    let (low, high) = (at("low", 50, "--bframes 2"), at("high", 200, ""));
    for (film, rate) in [(&low, 50e3), (&high, 200e3)] {
        // 50 frames take two seconds.
        let bits = film.report["summary"]["bits_total"].as_f64().unwrap();
        assert!((bits / (2.0 * rate) - 1.0).abs() < 0.05, "{bits} bits for two seconds of {rate} a second");
    }
    assert!(picture_types(&low).contains('B') && !picture_types(&high).contains('B'), "{}", picture_types(&low));
    assert_eq!(
        low.figures(&["index"]),
        (0..50).map(f64::from).collect::<Vec<f64>>(),
        "the report is in order of display"
    );
    // Coarser coding allows coarser rendering, also at the start, before any picture is coded.
    for frames in [3..8, 45..50] {
        let mean =
            |film: &Rendered| film.figures(&["threshold_mean_relative"])[frames.clone()].iter().sum::<f64>() / 5.0;
        println!("thresholds of {frames:?}: {:.4} at 50 kbit/s, {:.4} at 200", mean(&low), mean(&high));
        assert!(mean(&low) - 0.02 > 2.0 * (mean(&high) - 0.02), "beyond the 2 % that all have");
    }
    for name in ["low.m2v", "high.m2v"] {
        let video = folder.path().join(name);
        assert_eq!(tolerant_frame_count(&video, SIZE), 50);
        assert_eq!(decode_mpeg2dec(&video, SIZE).len(), 50);
    }
    let again = at("again", 50, "--bframes 2 --threads 1");
    assert!(again.stream == low.stream, "the number of threads changes a bit");
}

#[test]
fn a_bound_is_not_exceeded() {
    let folder = tempfile::tempdir().unwrap();
    let [free, bound] = ["", "--bitrate 20k"].map(|rate| {
        let name = if rate.is_empty() { "free" } else { "bound" };
        film(folder.path(), name, &format!("--frames 25 --effort fast {rate}"))
    });
    let seconds = |film: &Rendered| film.report["summary"]["bits_total"].as_f64().unwrap() / 20e3;
    println!("{:.2} s of the rate without a bound, {:.2} s with it", seconds(&free), seconds(&bound));
    // One second of film, and the smallest buffer: 16384 bits.
    assert!(seconds(&free) > 1.82 && seconds(&bound) <= 1.82);
    assert!(bound.figures(&["qscale"]).into_iter().all(|scale| scale >= 8.0), "never finer than requested");
}
