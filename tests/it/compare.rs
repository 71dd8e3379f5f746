//! `render2mpeg compare`: pictures, folders and videos, checked with ffmpeg.

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tests::{Moving, assert_fails, checkered_room, render, render2mpeg};

fn compare(folder: &Path, arguments: &str) -> Value {
    let arguments = format!("compare {arguments} --json");
    let finished = render2mpeg(folder, &arguments.split_whitespace().collect::<Vec<&str>>());
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "{arguments}");
    serde_json::from_str(&finished.stdout).expect("JSON")
}

/// Luma PSNR of each frame \[dB\], by ffmpeg's filter.
fn psnr_by_ffmpeg(folder: &Path, a: &str, b: &str) -> Vec<f64> {
    let arguments =
        ["-nostdin", "-v", "error", "-i", a, "-i", b, "-lavfi", "psnr=stats_file=psnr.log", "-f", "null", "-"];
    let status = Command::new("ffmpeg").args(arguments).current_dir(folder).status().expect("ffmpeg starts");
    assert!(status.success());
    let log = std::fs::read_to_string(folder.join("psnr.log")).expect("ffmpeg writes its figures");
    let figure = |line: &str| line.split_whitespace().find_map(|word| word.strip_prefix("psnr_y:")?.parse().ok());
    log.lines().map(|line| figure(line).expect("a figure in each line")).collect()
}

#[test]
fn videos_folders_and_pictures_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("room.glb"), checkered_room(Moving::Camera).to_bytes()).unwrap();
    let options = "--size 64x48 --frames 3 --vpls 100 --qscale 16 --y4m room.y4m --exr frames";
    let rendered = render(folder.path(), "film", &path("room.glb"), options);

    let found = compare(folder.path(), "film.m2v room.y4m --heatmap where.png");
    let psnr = |frame: &Value| frame["psnr_y"].as_f64().expect("a PSNR");
    let ours: Vec<f64> = found["frames"].as_array().unwrap().iter().map(psnr).collect();
    let theirs = psnr_by_ffmpeg(folder.path(), "film.m2v", "room.y4m");
    assert_eq!(ours.len(), 3);
    // ffmpeg's log has two decimals, and its inverse transform may round differently.
    assert!(ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 0.05), "{ours:?} {theirs:?}");
    // The encoder reports the PSNR of its own reconstruction, in BT.709; the frames of `room.y4m` are in BT.601.
    assert!(ours.iter().zip(rendered.figures(&["psnr_y"])).all(|(a, b)| (a - b).abs() < 0.05), "{ours:?}");
    assert!((psnr(&found["mean"]) - ours.iter().sum::<f64>() / 3.0).abs() < 1e-9);
    let score = found["mean"]["ssimulacra2"].as_f64().unwrap();
    assert!(score < 95.0 && found["mean"]["ssim"].as_f64().unwrap() < 0.999, "{found}");
    let map = laboratory::compare::png_file::read(&path("where.png")).unwrap();
    assert_eq!((map.width(), map.height()), (64, 48));
    assert!(map.samples().iter().any(|pixel| pixel[0] > 100), "somewhere they differ");

    let same = compare(folder.path(), "frames frames");
    assert_eq!((same["frames"].as_array().unwrap().len(), &same["mean"]["psnr_y"]), (3, &Value::Null));
    assert_eq!(same["mean"]["rmse"], 0.0);
    let text = render2mpeg(folder.path(), &["compare", "room.y4m", "room.y4m"]).stdout;
    assert!(text.contains("frame     2") && text.contains("mean of 3 pictures"), "{text}");

    // Two grays in closed form: by the sRGB curve, codes 128 and 118 are 0.2159 and 0.1812 of white.
    let gray = |name: &str, code: u8| {
        std::fs::write(path(name), laboratory::compare::png_file::encode(&plane::Plane::filled(16, 16, [code; 3])))
            .unwrap();
    };
    gray("a.png", 128);
    gray("b.png", 118);
    let rmse = compare(folder.path(), "a.png b.png")["rmse"].as_f64().unwrap();
    let linear = |code: f64| ((code / 255.0 + 0.055) / 1.055).powf(2.4);
    assert!((rmse - (linear(128.0) - linear(118.0))).abs() < 1e-6, "{rmse}");

    std::fs::create_dir(path("empty")).unwrap();
    for (name, count) in [("one", 1), ("two", 2)] {
        std::fs::create_dir(path(name)).unwrap();
        for frame in (0..count).map(|index| format!("frame_{index:05}.exr")) {
            std::fs::copy(path("frames").join(&frame), path(name).join(&frame)).unwrap();
        }
    }
    std::fs::write(path("short.m2v"), &rendered.stream[..8]).unwrap();
    std::fs::write(path("broken.y4m"), b"YUV4MPEG2 W64").unwrap();
    for (arguments, words) in [
        ("compare a.png frames/frame_00000.exr", &["a.png", "linear light", "of one kind"][..]),
        ("compare a.png room.y4m", &["a.png", "16x16", "64x48"]),
        ("compare empty empty", &["empty", ".exr", ".png"]),
        ("compare room.glb a.png", &["room.glb", ".y4m", ".mpg", ".mp4", ".mkv"]),
        (
            "compare frames/frame_00000.exr frames",
            &["frame_00000.exr is a single picture, but frames is longer; compare sequences of the same length"],
        ),
        ("compare frames two", &["two ends after 2 pictures, but frames is longer"]),
        ("compare one frames", &["one ends after 1 picture, but frames is longer"]),
        ("compare film.m2v frames/frame_00000.exr", &["film.m2v", "linear light"]),
        ("compare short.m2v room.y4m", &["short.m2v", "no video in this file", "name a film"]),
        ("compare broken.y4m room.y4m", &["broken.y4m", "YUV4MPEG2"]),
        ("compare a.png b.png --heatmap nowhere/c.png", &["nowhere/c.png"]),
    ] {
        assert_fails(folder.path(), &arguments.split_whitespace().collect::<Vec<&str>>(), words);
    }
}
