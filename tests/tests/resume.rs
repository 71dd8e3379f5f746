//! A film that was killed is continued to the same bits.
#![cfg(unix)]

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::{Moving, assert_fails, checkered_room, program, render, render2mpeg, sorted_names};

const SMALL: &str = "--size 48x48 --vpls 60 --photons 1000 --frames 14";

fn arguments(film: &str, more: &str) -> Vec<String> {
    let words = format!("render room.glb -o {film} --quiet --checkpoint 0 {SMALL} {more}");
    words.split_whitespace().map(str::to_owned).collect()
}

/// Numbers that are spread evenly over 0…1 and come in no order (van der Corput).
fn chance(index: u32) -> f64 {
    f64::from(index.reverse_bits()) / 2f64.powi(32)
}

/// Runs until it ends, or kills it after `patience`; whether it ended.
fn run_for(folder: &Path, arguments: &[String], patience: Duration) -> bool {
    let mut child = Command::new(program())
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .spawn()
        .expect("render2mpeg starts");
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child") {
            assert!(status.success(), "{arguments:?}: {status}");
            return true;
        }
        if begin.elapsed() >= patience {
            // SIGKILL; it may have ended just now.
            let _ = child.kill();
            let _ = child.wait();
            return false;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn killed_at_any_moment_it_goes_on_to_the_same_bits() {
    // What is carried differs: a moving box with everything; an encoder that looks ahead, into a transport stream; a still
    // picture, more samples, uncompressed frames; no cache, fixed thresholds.
    let kinds = [
        (Moving::Box, "film.m2v", "--gop 7"),
        (Moving::Camera, "film.ts", "--cbr --bitrate 100k --bframes 2 --stopping calibrated"),
        (Moving::Nothing, "film.mpg", "--samples 2 --y4m film.y4m"),
        (Moving::Box, "film.m2v", "--cache off --thresholds fixed:0.02 --bframes 1 --effort fast"),
    ];
    let mut killed = 0;
    for (kind, (moving, film, more)) in (0..).zip(kinds) {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        checkered_room(moving).write(&folder.join("room.glb"));
        let begin = Instant::now();
        assert!(run_for(folder, &arguments(film, more), Duration::from_secs(600)));
        let whole = begin.elapsed();
        let names = sorted_names(folder);
        assert!(!names.iter().any(|name| name.contains("checkpoint") || name.contains("part")), "{names:?}");
        let read = |name: &str| fs::read(folder.join(name)).unwrap_or_default();
        let truth = (read(film), read("film.y4m"));
        for index in 0..4 {
            fs::remove_file(folder.join(film)).unwrap();
            let at = whole.mul_f64(chance(1 + 4 * kind + index));
            killed += u32::from(!run_for(folder, &arguments(film, more), at));
            // A second time where it goes on.
            let resume = format!("{more} --resume");
            killed += u32::from(!run_for(folder, &arguments(film, &resume), whole.mul_f64(0.6 * chance(17 + index))));
            let last = format!("{more} --resume --threads {}", 1 + index);
            assert!(run_for(folder, &arguments(film, &last), Duration::from_secs(600)));
            assert!(read(film) == truth.0, "{more}, killed after {at:?} of {whole:?}: another film");
            assert!(read("film.y4m") == truth.1, "{more}, killed after {at:?} of {whole:?}: other frames");
            assert_eq!(sorted_names(folder), names, "nothing else stays");
        }
    }
    println!("killed {killed} times");
    assert!(killed >= 20, "most runs ended before they were killed: {killed}");
}

#[test]
fn ended_by_ctrl_c_it_goes_on_behind_its_last_frame() {
    // Checkpoints of a minute: the one that counts is made at the end.
    let kinds = [
        (Moving::Box, "film.m2v", "--frames 60 --y4m film.y4m"),
        (Moving::Camera, "film.ts", "--frames 60 --cbr --bitrate 100k --bframes 2 --stopping calibrated"),
        (Moving::Nothing, "film.mpg", "--frames 200 --thresholds fixed:0.02"),
    ];
    let mut ended = 0;
    for (kind, (moving, film, more)) in (0..).zip(kinds) {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        checkered_room(moving).write(&folder.join("room.glb"));
        let words = format!("render room.glb -o {film} --size 48x48 --vpls 60 --photons 1000 --json-progress {more}");
        let words: Vec<&str> = words.split_whitespace().collect();
        let whole = render2mpeg(folder, &words);
        assert_eq!(whole.code, Some(0), "{}", whole.stderr);
        let read = |name: &str| fs::read(folder.join(name)).unwrap_or_default();
        let truth = (read(film), read("film.y4m"), sorted_names(folder));
        let resumed = [&words[..], &["--resume"]].concat();
        for index in 0..2 {
            fs::remove_file(folder.join(film)).unwrap();
            // After so many frames of its own, the run is asked to end; once from the beginning, once where it goes on.
            let after = [1 + (20.0 * chance(3 * kind + index)) as usize, 5];
            let first = end_after(folder, &words, after[0]);
            let second = first.and_then(|_| end_after(folder, &resumed, after[1]));
            assert!(second.is_none_or(|second| Some(second) > first), "{first:?} {second:?}");
            ended += u32::from(first.is_some()) + u32::from(second.is_some());
            let last = render2mpeg(folder, &resumed);
            assert_eq!(last.code, Some(0), "{}", last.stderr);
            let begin: Value = serde_json::from_str(last.stdout.lines().next().unwrap()).unwrap();
            if let Some(done) = second.or(first) {
                assert_eq!(begin["first_frame"], done, "{more}: not a frame is made again");
            }
            assert!(
                read(film) == truth.0 && read("film.y4m") == truth.1,
                "{more}, ended after {after:?}: another film"
            );
            assert_eq!(sorted_names(folder), truth.2, "nothing else stays");
        }
    }
    println!("ended {ended} times");
    assert!(ended >= 6, "most runs came to their end first: {ended}");
}

/// Runs, and sends an interrupt when `after` frames were told of; how many frames the film has then, or none if it was whole
/// before.
fn end_after(folder: &Path, arguments: &[&str], after: usize) -> Option<u64> {
    let mut child = Command::new(program())
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("render2mpeg starts");
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    lines.by_ref().filter(|line| line.contains("\"event\":\"frame\"")).take(after).for_each(drop);
    // Until it is waited for, a process can be sent signals even when it has ended.
    kill_process(Pid::from_raw(child.id() as i32).unwrap(), Signal::INT).unwrap();
    let last = lines.last();
    let code = child.wait().unwrap().code();
    assert!(matches!(code, Some(0 | 130)), "{arguments:?}: {code:?}");
    let end: Value = serde_json::from_str(&last?).unwrap();
    (code == Some(130)).then(|| end["summary"]["frames"].as_u64().expect("frames are counted"))
}

#[test]
fn only_the_same_film_is_continued() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    checkered_room(Moving::Camera).write(&folder.join("room.glb"));
    let long = arguments("film.m2v", "").into_iter().map(|word| if word == "14" { "100000".into() } else { word });
    let long: Vec<String> = long.collect();
    let checkpoint = folder.join("film.m2v.checkpoint");
    let mut child = Command::new(program())
        .args(&long)
        .current_dir(folder)
        .stdin(Stdio::null())
        .spawn()
        .expect("render2mpeg starts");
    let begin = Instant::now();
    let part = folder.join("film.m2v.part");
    while fs::metadata(&part).map_or(0, |part| part.len()) < 20_000 || !checkpoint.exists() {
        assert!(begin.elapsed() < Duration::from_secs(120), "no checkpoint is made");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let resumed = |more: &[&'static str]| -> Vec<String> {
        long.iter().cloned().chain(["--resume".to_owned()]).chain(more.iter().map(|word| (*word).to_owned())).collect()
    };
    let fails = |more: &[&'static str], words: &[&str]| {
        let arguments = resumed(more);
        assert_fails(folder, &arguments.iter().map(String::as_str).collect::<Vec<_>>(), words);
    };
    let bytes = fs::read(&checkpoint).unwrap();
    fails(&["--qscale", "10"], &["film.m2v.checkpoint", "qscale was 8 and is now 10"]);
    fs::write(&checkpoint, &bytes[..bytes.len() / 2]).unwrap();
    fails(&[], &["film.m2v.checkpoint", "damaged", "--resume"]);
    fs::write(&checkpoint, &bytes).unwrap();
    checkered_room(Moving::Box).write(&folder.join("room.glb"));
    fails(&[], &["film.m2v.checkpoint", "scene has changed"]);
    checkered_room(Moving::Camera).write(&folder.join("room.glb"));
    fs::write(folder.join("film.m2v.part"), b"").unwrap();
    fails(&[], &["film.m2v.part", "shorter"]);

    // Begun anew, the old checkpoint is gone, and so is one that was being written; and where there is none, --resume begins at the beginning.
    fs::write(folder.join("film.m2v.checkpoint.part"), &bytes[..bytes.len() / 2]).unwrap();
    let film = render(folder, "film", &folder.join("room.glb"), "--size 48x48 --vpls 60 --photons 1000 --frames 3");
    assert_eq!(sorted_names(folder), ["film.m2v", "film.report.json", "room.glb"]);
    let again = ["render", "room.glb", "-o", "film.m2v", "--size", "48x48", "--vpls", "60", "--photons", "1000"];
    let finished = render2mpeg(folder, &[&again[..], &["--frames", "3", "--resume", "--quiet"]].concat());
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""));
    assert!(fs::read(folder.join("film.m2v")).unwrap() == film.stream);
}
