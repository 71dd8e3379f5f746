//! Films in every container: the same pictures at the same times, also on standard output and in modern formats.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tests::{Moving, assert_fails, checkered_room, decode_ffmpeg, need, program, render, render2mpeg, sorted_names};

const SIZE: (usize, usize) = (48, 48);
const SMALL: &str = "--size 48x48 --vpls 60 --photons 1000";
const ENDINGS: [&str; 5] = ["mpg", "ts", "vob", "mp4", "mkv"];

fn folder_with_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    folder
}

/// Runs a program in `folder`; `words` are its arguments, separated by spaces.
fn run(folder: &Path, name: &Path, words: &str) -> Output {
    let mut command = Command::new(name);
    command.args(words.split_whitespace()).current_dir(folder).stdin(Stdio::null());
    command.output().unwrap_or_else(|error| panic!("{} cannot be run: {error}", name.display()))
}

/// Returns ffprobe's output for a film, one value per line.
fn probed(folder: &Path, film: &str, entries: &str) -> Vec<String> {
    let words =
        format!("-v error -select_streams v -count_packets -show_entries {entries} -of default=nw=1:nk=1 {film}");
    let output = run(folder, Path::new("ffprobe"), &words);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

/// Returns the raw pictures of a film; `begin` is empty or `-ss SECONDS`.
fn pictures_from(folder: &Path, film: &str, begin: &str) -> Vec<u8> {
    let words = format!("-v error {begin} -i {film} -fps_mode passthrough -f rawvideo -pix_fmt yuv420p -");
    let output = run(folder, Path::new("ffmpeg"), &words);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

#[test]
fn every_container_has_the_pictures_and_their_times() {
    let folder = folder_with_room();
    let folder = folder.path();
    for (options, fps, rate) in
        [("--fps 25", 25.0, "25/1"), ("--fps 29.97 --bframes 2", 30000.0 / 1001.0, "30000/1001")]
    {
        let options = format!("{SMALL} --frames 40 {options}");
        // The elementary stream as the reference.
        render(folder, "film", &folder.join("room.glb"), &options);
        let truth = decode_ffmpeg(&folder.join("film.m2v"), SIZE);
        let all = pictures_from(folder, "film.m2v", "");
        for ending in ENDINGS {
            let film = format!("film.{ending}");
            render(folder, &film, &folder.join("room.glb"), &options);
            // Number of pictures, frame rate and duration, then the pictures.
            assert_eq!(probed(folder, &film, "stream=nb_read_packets").first(), Some(&"40".into()), "{film}");
            assert_eq!(probed(folder, &film, "stream=avg_frame_rate").first(), Some(&rate.into()), "{film}");
            let seconds: f64 = probed(folder, &film, "format=duration")[0].parse().unwrap();
            assert!((seconds - 40.0 / fps).abs() < 1.5 / fps, "{film}: {seconds} s");
            if ending != "vob" {
                assert!(decode_ffmpeg(&folder.join(&film), SIZE) == truth, "{film} {options}");
            }

            // Seeking to the middle is exact if the file has an index.
            if ["mp4", "mkv"].contains(&ending) {
                let rest = pictures_from(folder, &film, &format!("-ss {:.6}", 19.5 / fps));
                assert!(rest == all[all.len() / 2..], "{film} {options}: {} bytes", rest.len());
            }
        }
    }
}

#[test]
fn a_film_without_a_name_is_a_program_stream() {
    let folder = folder_with_room();
    let folder = folder.path();
    let made = run(folder, program(), &format!("render room.glb -q --frames 2 {SMALL}"));
    assert!(made.status.success() && made.stdout.is_empty());
    assert_eq!(sorted_names(folder), ["room.glb", "room.mpg", "room.report.json"]);
    assert_eq!(decode_ffmpeg(&folder.join("room.mpg"), SIZE).len(), 2);
}

#[test]
fn standard_output_takes_the_bytes_of_the_file() {
    let folder = folder_with_room();
    let folder = folder.path();
    let options = format!("--frames 5 {SMALL}");
    let film = render(folder, "film.mpg", &folder.join("room.glb"), &options).stream;
    let names = sorted_names(folder);
    // Both names of standard output give the file's bytes.
    for name in ["-", "/dev/stdout"] {
        let made = run(folder, program(), &format!("render room.glb -o {name} {options}"));
        assert!(made.status.success() && made.stdout == film, "{name}: {} bytes", made.stdout.len());
        let told = String::from_utf8(made.stderr).unwrap();
        assert!(told.contains("5 frames") && !told.contains("report"), "{told}");
        assert_eq!(sorted_names(folder), names, "{name} leaves nothing behind");
    }
    let made = run(folder, program(), &format!("render room.glb -o - --report told.json {options} -q"));
    assert!(made.status.success() && made.stdout == film && folder.join("told.json").exists());

    // A chunk is an elementary stream on standard output too.
    let part = format!("--frames 6 --range 0-2 {SMALL}");
    let truth = render(folder, "part", &folder.join("room.glb"), &part).stream;
    let made = run(folder, program(), &format!("render room.glb -o - -q {part}"));
    assert!(made.stdout == truth);

    // Conflicting uses of standard output.
    for (options, word) in [
        ("--progress json", "progress"),
        ("--progress openjd", "progress"),
        ("--report -", "--report"),
        ("--y4m /dev/stdout", "--y4m"),
        ("--also film.mp4", "--also"),
    ] {
        let words = format!("render room.glb -o - -q {options} {SMALL}");
        assert_fails(folder, &words.split(' ').collect::<Vec<_>>(), &["-o", word]);
        assert_eq!(run(folder, program(), &words).status.code(), Some(2), "{options}");
    }
}

/// Additional encodings of the film, if ffmpeg has the encoders.
#[test]
fn films_are_made_for_players_of_today_too() {
    let folder = folder_with_room();
    let folder = folder.path();
    let known = String::from_utf8(run(folder, Path::new("ffmpeg"), "-v error -encoders").stdout).unwrap();
    for (ending, size, encoder, codec) in [
        ("mp4", "49x47", "libx264", "h264"),
        ("webm", "64x64", "libsvtav1", "av1"),
        ("webm", "33x31", "libvpx-vp9", "vp9"),
    ] {
        // Skip missing encoders.
        if need(encoder, known.contains(encoder).then_some(())).is_none() {
            continue;
        }
        let also = format!("also.{ending}");
        let words = format!(
            "render room.glb -o film.mkv --overwrite --also {also} --vpls 60 --photons 1000 --frames 6 --size {size}"
        );
        let words: Vec<&str> = words.split(' ').collect();
        let made = render2mpeg(folder, &words);
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        assert!(made.stderr.contains(&format!("{also}, by {encoder}")), "{}", made.stderr);

        // The encoding has the codec, the color space and all pictures.
        let entries = "stream=codec_name,color_space,nb_read_packets";
        let told = probed(folder, &also, entries);
        assert!(told.starts_with(&[codec.into(), "bt709".into()]) && told.contains(&"6".into()), "{told:?}");
        assert_eq!(sorted_names(folder), [&also, "film.mkv", "film.report.json", "room.glb"]);
        fs::remove_file(folder.join(also)).unwrap();
    }
}

/// Loops and editing formats have the film's colors, its number of pictures and its duration.
#[test]
fn films_are_made_for_pages_and_editors_too() {
    let folder = folder_with_room();
    let folder = folder.path();
    let known = String::from_utf8(run(folder, Path::new("ffmpeg"), "-v error -encoders").stdout).unwrap();
    for (ending, encoder, options) in [
        ("mov", "prores_ks", "--fps 25 --size 49x47"),
        ("webp", "libwebp_anim", "--fps 25 --size 49x47"),
        ("gif", "gif", "--fps 25 --size 49x47"),
        // Without a matrix in the stream, and above the fastest rate of GIF.
        ("webp", "libwebp_anim", "--fps 25 --size 48x48 --mpeg1"),
        ("gif", "gif", "--fps 60 --size 48x48 --mpeg1"),
    ] {
        if need(encoder, known.contains(encoder).then_some(())).is_none() {
            continue;
        }
        let also = format!("also.{ending}");
        let words = format!(
            "render room.glb -o film.mpg -q --overwrite --also {also} --vpls 60 --photons 1000 --frames 12 {options}"
        );
        let made = render2mpeg(folder, &words.split(' ').collect::<Vec<_>>());
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        let colors = mean_color(&decoded(folder, "film.mpg"));
        let seconds = if options.contains("60") { 0.2 } else { 0.48 };
        if ending == "webp" {
            // This ffmpeg cannot decode animated WebP.
            let file = std::io::BufReader::new(fs::File::open(folder.join(&also)).unwrap());
            let loops = image::codecs::webp::WebPDecoder::new(file).unwrap();
            let frames = image::AnimationDecoder::into_frames(loops).collect_frames().unwrap();
            let of_frame = |frame: &image::Frame| std::time::Duration::from(frame.delay()).as_secs_f64();
            let total: f64 = frames.iter().map(of_frame).sum();
            assert!((total - seconds).abs() < 0.005 && frames.len() > 6, "{total} s, {} frames", frames.len());
            let first = image::DynamicImage::from(frames[0].buffer().clone()).into_rgb8().into_raw();
            assert_near(mean_color(&first), mean_color(&decoded(folder, "film.mpg")[..first.len()]), ending);
        } else {
            let found: f64 = probed(folder, &also, "format=duration")[0].parse().unwrap();
            assert!((found - seconds).abs() < 0.015, "{also}: {found} s");
            assert_near(mean_color(&decoded(folder, &also)), colors, ending);
        }
        fs::remove_file(folder.join(also)).unwrap();
    }
}

/// Returns the samples of a film's pictures, as RGB with even sides.
fn decoded(folder: &Path, film: &str) -> Vec<u8> {
    let words = format!("-v error -i {film} -fps_mode passthrough -f rawvideo -pix_fmt rgb24 -");
    let output = run(folder, Path::new("ffmpeg"), &words);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn mean_color(samples: &[u8]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for rgb in samples.as_chunks::<3>().0 {
        for (sum, &code) in sum.iter_mut().zip(rgb) {
            *sum += f64::from(code) / (samples.len() / 3) as f64;
        }
    }
    sum
}

fn assert_near(found: [f64; 3], expected: [f64; 3], name: &str) {
    let apart = found.into_iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 2.5, "{name}: {found:?} for {expected:?}");
}

#[test]
fn what_cannot_be_made_also_is_said_before_work_begins() {
    let folder = folder_with_room();
    let folder = folder.path();
    let before = sorted_names(folder);
    // Formats that `--also` does not support, and the scene's path.
    let words = |also: &str| format!("render room.glb -o film.mpg -q --also {also} {SMALL}");
    for also in ["film.avi", "film", "film.mkv"] {
        let words = words(also);
        assert_fails(folder, &words.split(' ').collect::<Vec<_>>(), &["--also", also, ".mp4", ".webm", ".gif"]);
        assert_eq!(run(folder, program(), &words).status.code(), Some(2), "{also}");
    }
    assert_fails(folder, &words("room.glb").split(' ').collect::<Vec<_>>(), &["--also", "room.glb", "the scene"]);

    // No ffmpeg on the path, and one without encoders.
    let bare = tempfile::tempdir().unwrap();
    for (ffmpeg, word) in [(None, "not installed"), (Some("#!/bin/sh\n"), "libx264")] {
        if let Some(script) = ffmpeg {
            let path = bare.path().join("ffmpeg");
            fs::write(&path, script).unwrap();
            fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
        }
        let mut command = Command::new(program());
        command.args(words("film.mp4").split(' ')).env("PATH", bare.path()).current_dir(folder);
        let output = command.stdin(Stdio::null()).output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && told.contains(word) && told.contains("film.mp4"), "{told}");
        assert_eq!(told.lines().count(), 1, "{told}");
    }
    assert_eq!(sorted_names(folder), before, "nothing was begun");
}
