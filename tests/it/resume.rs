//! A killed run is continued to the same bits.
//!
//! Pipes of one line, available only on Linux, make the moment of the kill depend on lines and not on time.

use rustix::pipe::{PipeFlags, fcntl_setpipe_size, pipe_with};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::{Moving, assert_fails, checkered_room, program, render, render2mpeg, sorted_names};

const SMALL: &str = "--size 48x48 --vpls 60 --photons 1000 --frames 14";

fn arguments(film: &str, more: &str) -> Vec<String> {
    let words = format!("render room.glb -o {film} --overwrite --checkpoint 0 {SMALL} {more}");
    words.split_whitespace().map(str::to_owned).collect()
}

/// Returns numbers spread evenly over 0…1, in irregular order (van der Corput).
fn chance(index: u32) -> f64 {
    f64::from(index.reverse_bits()) / 2f64.powi(32)
}

/// Creates a pipe for one write: the next write blocks until the first is read.
fn narrow_pipe() -> (BufReader<fs::File>, OwnedFd) {
    let (read, write) = pipe_with(PipeFlags::DIRECT | PipeFlags::CLOEXEC).expect("a pipe");
    // With DIRECT, each write takes its own page, and one page is the minimum size.
    fcntl_setpipe_size(&write, 1).expect("a pipe of one page");
    (BufReader::new(read.into()), write)
}

/// Runs with a line on standard error for each finished stage of a frame. Kills the run after `lines` lines, or lets it end,
/// and returns the number of lines read.
///
/// A run is at most two lines ahead of the reader, so the moment of the kill does not depend on a clock.
fn run_until(folder: &Path, arguments: &[String], lines: usize) -> usize {
    let (reader, writer) = narrow_pipe();
    let mut child = Command::new(program())
        .args(arguments)
        .arg("-vv")
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(writer)
        .spawn()
        .expect("render2mpeg starts");
    let read = reader.lines().map(Result::unwrap).take(lines).count();
    if read == lines {
        child.kill().expect("it waits for its lines to be read");
        assert_eq!(child.wait().unwrap().signal(), Some(9), "{arguments:?}: ended before line {lines}");
    } else {
        let status = child.wait().unwrap();
        assert!(status.success(), "{arguments:?}: {status}");
    }
    read
}

#[test]
fn killed_at_any_moment_it_goes_on_to_the_same_bits() {
    // The state between frames differs: a moving box with every stage; look-ahead into a transport stream; a static film with
    // more samples and uncompressed frames; no cache and fixed thresholds; importance; chunks; chunks of a range; incomplete
    // groups of pictures in MP4 and Matroska.
    let kinds = [
        (Moving::Box, "film.m2v", "--gop 7"),
        (Moving::Camera, "film.ts", "--cbr --bitrate 100k --bframes 2 --stopping calibrated"),
        (Moving::Nothing, "film.mpg", "--samples 2 --y4m film.y4m"),
        (Moving::Box, "film.m2v", "--cache off --thresholds fixed:0.02 --bframes 1 --effort fast"),
        (Moving::Camera, "film.m2v", "--importance saliency:1 --bframes 1 --aq masking"),
        (Moving::Box, "film.ts", "--chunk 5 --bframes 2 --y4m film.y4m"),
        (Moving::Camera, "film.m2v", "--frames 30 --chunk 7 --range 14-27"),
        (Moving::Camera, "film.mp4", "--bframes 2 --gop 6"),
        (Moving::Box, "film.mkv", "--gop 5"),
    ];
    for (kind, (moving, film, more)) in (0..).zip(kinds) {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        checkered_room(moving).write(&folder.join("room.glb"));
        let whole = run_until(folder, &arguments(film, more), usize::MAX);
        let names = sorted_names(folder);
        assert!(!names.iter().any(|name| name.contains("checkpoint") || name.contains("part")), "{names:?}");
        let read = |name: &str| fs::read(folder.join(name)).unwrap_or_default();
        let truth = (read(film), read("film.y4m"));
        for index in 0..4 {
            fs::remove_file(folder.join(film)).unwrap();
            // A complete film ends with the lines of the summary.
            let at = 1 + ((whole - 20) as f64 * chance(1 + 4 * kind + index)) as usize;
            run_until(folder, &arguments(film, more), at);
            // Kill it a second time after it continued, within the remaining lines.
            let resume = format!("{more} --resume");
            let left = (whole - at) as f64;
            run_until(folder, &arguments(film, &resume), 1 + (0.6 * left * chance(17 + index)) as usize);
            let last = format!("{more} --resume --threads {}", 1 + index);
            run_until(folder, &arguments(film, &last), usize::MAX);
            assert!(read(film) == truth.0, "{more}, killed after {at} of {whole} lines: another film");
            assert!(read("film.y4m") == truth.1, "{more}, killed after {at} of {whole} lines: other frames");
            assert_eq!(sorted_names(folder), names, "no other file remains");
        }
    }
}

#[test]
fn ended_by_ctrl_c_it_goes_on_after_its_last_frame() {
    // Checkpoints are a minute apart, so only the checkpoint at the end counts.
    let kinds = [
        (Moving::Box, "film.m2v", "--frames 60 --y4m film.y4m"),
        // The renderer is 31 frames ahead of the reported ones.
        (Moving::Camera, "film.ts", "--frames 120 --cbr --bitrate 100k --bframes 2 --stopping calibrated"),
        (Moving::Nothing, "film.mpg", "--frames 200 --thresholds fixed:0.02"),
    ];
    for (kind, (moving, film, more)) in (0..).zip(kinds) {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        checkered_room(moving).write(&folder.join("room.glb"));
        let words = format!(
            "render room.glb -o {film} --size 48x48 --vpls 60 --photons 1000 --progress json --overwrite {more}"
        );
        let words: Vec<&str> = words.split_whitespace().collect();
        let whole = render2mpeg(folder, &words);
        assert_eq!(whole.code, Some(0), "{}", whole.stderr);
        let read = |name: &str| fs::read(folder.join(name)).unwrap_or_default();
        let truth = (read(film), read("film.y4m"), sorted_names(folder));
        let resumed = [&words[..], &["--resume"]].concat();
        for index in 0..2 {
            fs::remove_file(folder.join(film)).unwrap();
            // Number of frames before the interruption: in the first run, and in the continued run.
            let after = [1 + (20.0 * chance(3 * kind + index)) as usize, 5];
            let first = end_after(folder, &words, after[0]);
            let second = end_after(folder, &resumed, after[1]);
            assert!(second > first, "{first} {second}");
            let last = render2mpeg(folder, &resumed);
            assert_eq!(last.code, Some(0), "{}", last.stderr);
            let begin: Value = serde_json::from_str(last.stdout.lines().next().unwrap()).unwrap();
            assert_eq!(begin["first_frame"], second, "{more}: not a frame is made again");
            assert!(
                read(film) == truth.0 && read("film.y4m") == truth.1,
                "{more}, ended after {after:?}: another film"
            );
            assert_eq!(sorted_names(folder), truth.2, "no other file remains");
        }
    }
}

/// Interrupts a run after `after` reported frames, and returns the number of frames in the film.
///
/// The run blocks at its next frame until the interrupt has arrived.
fn end_after(folder: &Path, arguments: &[&str], after: usize) -> u64 {
    let (reader, writer) = narrow_pipe();
    let mut child = Command::new(program())
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(writer)
        .stderr(Stdio::null())
        .spawn()
        .expect("render2mpeg starts");
    let mut lines = reader.lines().map(Result::unwrap);
    lines.by_ref().filter(|line| line.contains("\"event\":\"frame\"")).take(after).for_each(drop);
    let before = times_asleep(child.id());
    kill_process(Pid::from_raw(child.id() as i32).unwrap(), Signal::INT).unwrap();
    while times_asleep(child.id()) == before {
        assert_eq!(child.try_wait().unwrap(), None, "{arguments:?}: ended too early");
        std::thread::sleep(Duration::from_millis(1));
    }
    let last = lines.last().expect("a line at the end");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{arguments:?}: {last}");
    let end: Value = serde_json::from_str(&last).unwrap();
    end["summary"]["frames"].as_u64().expect("frames are counted")
}

/// Counts how often the interrupt thread went to sleep, which increases after each handled interrupt.
fn times_asleep(process: u32) -> u64 {
    let threads = fs::read_dir(format!("/proc/{process}/task")).expect("threads of the process");
    let status = threads
        .filter_map(|thread| fs::read_to_string(thread.ok()?.path().join("status")).ok())
        .find(|status| status.starts_with("Name:\tctrl-c\n"))
        .expect("a thread that waits for interrupts");
    let count = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
    count.expect("a count").trim().parse().expect("a number")
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
    // The unfinished video with a byte changed at its start or in its last known range, and a truncated one.
    let begun = fs::read(folder.join("film.m2v.part")).unwrap();
    for place in [0, 1000] {
        let mut changed = begun.clone();
        changed[place] ^= 1;
        fs::write(folder.join("film.m2v.part"), &changed).unwrap();
        fails(&[], &["film.m2v.part", "differs", "--resume"]);
        assert!(fs::read(folder.join("film.m2v.part")).unwrap() == changed, "it is left as it is");
    }
    fs::write(folder.join("film.m2v.part"), b"").unwrap();
    fails(&[], &["film.m2v.part", "shorter"]);

    // A new start removes the old checkpoint and a half-written one. Without a checkpoint, --resume starts at the first
    // frame.
    fs::write(folder.join("film.m2v.checkpoint.part"), &bytes[..bytes.len() / 2]).unwrap();
    let film = render(folder, "film", &folder.join("room.glb"), "--size 48x48 --vpls 60 --photons 1000 --frames 3");
    assert_eq!(sorted_names(folder), ["film.m2v", "film.report.json", "room.glb"]);
    let again = ["render", "room.glb", "-o", "film.m2v", "--size", "48x48", "--vpls", "60", "--photons", "1000"];
    let finished = render2mpeg(folder, &[&again[..], &["--frames", "3", "--resume", "--quiet"]].concat());
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""));
    assert!(fs::read(folder.join("film.m2v")).unwrap() == film.stream);
}
