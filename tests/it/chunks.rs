//! Films in chunks: chunks rendered separately and joined equal the film rendered as a whole.

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tests::{
    Finished, Moving, Rendered, assert_fails, checkered_room, cornell, decode_ffmpeg, decode_mpeg2dec, need, program,
    render, render2mpeg, shared_scenes, sorted_names,
};

const SMALL: &str = "--size 48x48 --vpls 60 --photons 1000";

fn folder_with_room(moving: Moving) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(moving).write(&folder.path().join("room.glb"));
    folder
}

/// Starts the program in `folder` and returns the process, with its standard output in a pipe.
fn started(folder: &Path, words: &[&str]) -> Child {
    let mut command = Command::new(program());
    command.args(words).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    command.spawn().expect("render2mpeg starts")
}

/// Renders each chunk of a film separately, and returns the names of the files in order.
fn render_parts(folder: &Path, scene: &Path, frames: u32, chunk: u32, options: &str) -> Vec<String> {
    let mut names = Vec::new();
    for first in (0..frames).step_by(chunk as usize) {
        let range = format!("{first}-{}", first + chunk - 1);
        let extra = format!("--frames {frames} --chunk {chunk} --range {range} {options}");
        render(folder, &format!("part_{range}"), scene, &extra);
        names.push(format!("part_{range}.m2v"));
    }
    names
}

/// Joins `parts` into `film`, which must succeed.
fn join(folder: &Path, parts: &[String], film: &str) -> Rendered {
    let mut arguments = vec!["join", "--overwrite", "-o", film, "--quiet"];
    arguments.extend(parts.iter().map(String::as_str));
    let Finished { code, stdout, stderr } = render2mpeg(folder, &arguments);
    assert_eq!((code, stdout.as_str(), stderr.as_str()), (Some(0), "", ""), "{arguments:?}");
    let report = fs::read(folder.join(film).with_extension("report.json")).unwrap();
    Rendered { stream: fs::read(folder.join(film)).unwrap(), report: serde_json::from_slice(&report).unwrap() }
}

/// Returns the figures of all frames that do not depend on the machine.
fn without_seconds(report: &Value) -> Vec<Value> {
    let mut frames = report["frames"].as_array().expect("frames").clone();
    frames.iter_mut().for_each(|frame| frame["seconds"] = Value::Null);
    frames
}

#[test]
fn joined_parts_are_the_film_of_one_machine() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (scene, options) = (cornell(), "--size 96x96");
    let parts = render_parts(folder, &scene, 30, 10, options);
    for film in ["film.m2v", "film.mpg", "film.ts", "film.mp4", "film.mkv"] {
        let alone = render(folder, film, &scene, &format!("--frames 30 --chunk 10 {options}"));
        let joined = join(folder, &parts, &film.replace("film", "joined"));
        assert!(alone.stream == joined.stream, "{film}");

        // Except for time and memory, the report equals the whole film's.
        assert_eq!(without_seconds(&joined.report), without_seconds(&alone.report));
        assert_eq!(joined.report["plan"], alone.report["plan"]);
        assert_eq!(joined.report["settings"]["chunk"], 10);
        assert_eq!(joined.report["settings"]["range"], Value::Null);
        for figure in ["frames", "interrupted", "bits_total", "bits", "psnr_y", "cut_size_mean", "shadow_rays"] {
            assert_eq!(joined.report["summary"][figure], alone.report["summary"][figure], "{figure}");
        }
    }
}

#[test]
fn a_film_is_joined_into_standard_output() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    let parts = render_parts(folder, &folder.join("room.glb"), 4, 2, SMALL);
    let film = join(folder, &parts, "film.mpg").stream;
    let before = sorted_names(folder);
    let mut command = Command::new(program());
    command.args(["join", "-o", "-"]).args(&parts).current_dir(folder).stdin(Stdio::null());
    let output = command.output().unwrap();
    assert!(output.status.success() && output.stdout == film, "{} bytes", output.stdout.len());
    assert_eq!(sorted_names(folder), before, "there is no report");
}

/// Schedulers may choose ranges of any length: each is a chunk. Ranges of equal length give the same film as `--chunk`.
#[test]
fn ranges_without_chunks_are_chunks_by_themselves() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    let scene = folder.join("room.glb");
    let film = render(folder, "film", &scene, &format!("--frames 9 --chunk 3 {SMALL} --bframes 1"));
    let parts = [("a", "0-2"), ("b", "3-5"), ("c", "6-8")].map(|(name, range)| {
        render(folder, name, &scene, &format!("--frames 9 --range {range} {SMALL} --bframes 1"));
        format!("{name}.m2v")
    });
    assert!(join(folder, &parts, "joined.m2v").stream == film.stream);

    // Ranges of unequal length give another film, which is complete too.
    render(folder, "long", &scene, &format!("--frames 9 --range 0-5 {SMALL} --bframes 1"));
    let other = join(folder, &["long.m2v".into(), "c.m2v".into()], "other.m2v");
    assert!(other.stream != film.stream && other.report["summary"]["frames"] == 9);
}

/// No chunk depends on the previous one, for any state that a film has between frames.
#[test]
fn no_chunk_depends_on_another() {
    for (moving, frames, chunk, options) in [
        (Moving::Camera, 14, 5, "--bframes 2 --gop 7"),
        (Moving::Camera, 10, 4, "--bframes 3 --importance saliency:1 --aq masking"),
        (Moving::Box, 9, 3, "--stopping calibrated --cache off"),
        (Moving::Box, 9, 3, "--thresholds perceptual --mpeg1 --gop 2"),
        (Moving::Camera, 6, 2, "--thresholds perceptual --samples 2 --run-everything"),
        (Moving::Nothing, 5, 2, "--lighting all-lights"),
        (Moving::Camera, 4, 1, ""),
    ] {
        let folder = folder_with_room(moving);
        let folder = folder.path();
        let scene = folder.join("room.glb");
        let parts = render_parts(folder, &scene, frames, chunk, &format!("{SMALL} {options}"));
        let alone = render(folder, "film", &scene, &format!("--frames {frames} --chunk {chunk} {SMALL} {options}"));
        assert!(join(folder, &parts, "joined.m2v").stream == alone.stream, "{options}");

        let begins_group = alone.report["frames"][chunk as usize]["picture_type"] == "I";
        assert!(begins_group, "{options}");
    }
}

/// Parts that share the light of the film in a file are the parts that make their own.
#[test]
fn parts_may_share_the_light_of_the_film() {
    for (moving, options) in [
        (Moving::Nothing, ""),
        (Moving::Camera, "--importance saliency:1"),
        (Moving::Box, "--bframes 1"),
        (Moving::Box, "--cache off --run-everything"),
        (Moving::Camera, "--set exposure=1"),
    ] {
        let folder = folder_with_room(moving);
        let folder = folder.path();
        let film = format!("--frames 6 --chunk 2 {SMALL} {options}");
        let alone = render(folder, "film", &folder.join("room.glb"), &film);

        // The first command makes the light, and repeating it changes nothing.
        let plan = format!("plan room.glb --frames 6 --light film.light {SMALL} {options}");
        for made in ["film.light, made for", "film.light, already made for"] {
            let planned = render2mpeg(folder, &plan.split_whitespace().collect::<Vec<_>>());
            assert!(planned.code == Some(0) && planned.stdout.contains(made), "{} {}", planned.stdout, planned.stderr);
        }
        let light = fs::read(folder.join("film.light")).unwrap();
        let render_chunk = |index: u32, name: &str| {
            let more = format!("{film} --chunk-index {index} --light {name}");
            let part = format!("part_{index}.m2v");
            let _ = render(folder, &part, &folder.join("room.glb"), &more);
            part
        };
        let parts = [0, 1, 2].map(|index| render_chunk(index, "film.light"));
        assert!(join(folder, &parts, "joined.m2v").stream == alone.stream, "{options}");
        assert!(fs::read(folder.join("film.light")).unwrap() == light, "parts only read the file");

        // Without the first command, the first part makes the same light.
        let parts = [2, 0, 1].map(|index| render_chunk(index, "other.light"));
        let parts = [1, 2, 0].map(|place: usize| parts[place].clone());
        assert!(join(folder, &parts, "again.m2v").stream == alone.stream, "{options}");
        assert!(folder.join("other.light").exists());
    }
}

/// A light file is read only if it is complete and belongs to the film.
#[test]
fn light_of_another_film_is_refused() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    let words =
        |options: &str| format!("render room.glb -q --overwrite -o film.m2v --light film.light {SMALL} {options}");
    let run = |options: &str| render2mpeg(folder, &words(options).split_whitespace().collect::<Vec<_>>());
    assert_eq!(run("--frames 2").code, Some(0));
    let whole = fs::read(folder.join("film.light")).unwrap();

    // Coding, range and output do not change the light.
    for options in ["--frames 2 --gop 3 --bframes 1", "--frames 2 --range 1-1", "--frames 2 --png pictures"] {
        let Finished { code, stderr, .. } = run(options);
        assert_eq!(code, Some(0), "{options}: {stderr}");
    }
    for (options, named) in [
        ("--frames 3", "frames was 2 and is now 3"),
        ("--frames 2 --seed 5", "seed was 1 and is now 5"),
        ("--frames 2 --bounces 1", "bounces was null and is now 1"),
    ] {
        let refused = run(options);
        let is_named = refused.stderr.contains("film.light") && refused.stderr.contains(named);
        assert!(refused.code == Some(1) && is_named && refused.stderr.lines().count() == 1, "{}", refused.stderr);
    }

    // Damaged files, and files of other kinds.
    for (place, text) in [(whole.len() - 1, "damaged"), (30, "damaged"), (5, "version"), (0, "not a light file")] {
        let mut damaged = whole.clone();
        damaged[place] ^= 4;
        fs::write(folder.join("film.light"), damaged).unwrap();
        let refused = run("--frames 2");
        let is_named = refused.stderr.contains("film.light") && refused.stderr.contains(text);
        assert!(refused.code == Some(1) && is_named && refused.stderr.lines().count() == 1, "{}", refused.stderr);
    }
    fs::write(folder.join("film.light"), &whole[..whole.len() / 2]).unwrap();
    assert_eq!(run("--frames 2").code, Some(1));
    assert_fails(folder, &["plan", "room.glb", "--light", "room.glb"], &["room.glb", "a file of the scene"]);
}

/// Parts that start together make the light once, and each of them ends well.
#[test]
fn parts_may_start_together() {
    let folder = folder_with_room(Moving::Nothing);
    let folder = folder.path();
    let start = |index: u32| {
        let film = format!("render room.glb -q --frames 4 --chunk 2 --light film.light {SMALL}");
        let part = format!("--chunk-index {index} -o part_{index}.m2v");
        let words = film.split_whitespace().chain(part.split_whitespace());
        Command::new(program()).args(words).current_dir(folder).spawn().expect("render2mpeg starts")
    };
    for mut part in [start(0), start(1)] {
        assert_eq!(part.wait().unwrap().code(), Some(0));
    }
    let alone = render(folder, "film", &folder.join("room.glb"), &format!("--frames 4 --chunk 2 {SMALL}"));
    assert!(join(folder, &["part_0.m2v".into(), "part_1.m2v".into()], "joined.m2v").stream == alone.stream);
}

/// A film ended twice before its first checkpoint starts again with the same command and `--resume`.
#[test]
fn a_film_ended_before_its_first_checkpoint_starts_again() {
    let folder = folder_with_room(Moving::Box);
    let folder = folder.path();
    let words = format!("render room.glb -o film.mpg --frames 300 --progress openjd {SMALL}");
    let words: Vec<&str> = words.split_whitespace().collect();
    let mut child = started(folder, &words);
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.by_ref().any(|line| line.starts_with("openjd_status: 9 ")), "nine frames are made");
    let id = Pid::from_raw(child.id() as i32).unwrap();
    kill_process(id, Signal::TERM).unwrap();
    let _ = kill_process(id, Signal::INT);
    lines.for_each(drop);
    let code = child.wait().unwrap().code();
    assert!(matches!(code, Some(130 | 143)), "{code:?}");

    // An unfinished film is not replaced without permission.
    assert_fails(folder, &words, &["film.mpg", "--resume"]);
    let resumed = render2mpeg(folder, &[&words[..], &["--resume"]].concat());
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    let at_once = render(folder, "again.mpg", &folder.join("room.glb"), &format!("--frames 300 {SMALL}"));
    assert!(fs::read(folder.join("film.mpg")).unwrap() == at_once.stream);
    assert!(!folder.join("film.mpg.checkpoint").exists());
}

#[test]
fn baked_light_is_in_chunks_too() {
    let folder = folder_with_room(Moving::Box);
    let folder = folder.path();
    let baked =
        render2mpeg(folder, &["bake", "room.glb", "--texels", "2000", "--vpls", "60", "--photons", "2000", "-q"]);
    assert_eq!(baked.code, Some(0), "{}", baked.stderr);
    let (scene, options) = (folder.join("room.glb"), format!("--lighting baked {SMALL}"));
    let parts = render_parts(folder, &scene, 6, 3, &options);
    let alone = render(folder, "film", &scene, &format!("--frames 6 --chunk 3 {options}"));
    assert!(join(folder, &parts, "joined.m2v").stream == alone.stream);
    let parts = render_parts(folder, &scene, 6, 3, &format!("{options} --light film.light"));
    assert!(join(folder, &parts, "joined.m2v").stream == alone.stream);
}

#[test]
fn a_scene_from_elsewhere_without_exposure() {
    let Some(scenes) = shared_scenes() else { return };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = scenes.join("sponza-dabrovic/sponza.glb");
    let options = "--size 64x64 --photons 40000";
    let parts = render_parts(folder, &scene, 8, 4, options);
    let alone = render(folder, "film", &scene, &format!("--frames 8 --chunk 4 {options}"));
    assert!(join(folder, &parts, "joined.m2v").stream == alone.stream);
}

#[test]
fn joined_films_play_with_times_at_even_distances() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    for (options, fps) in [("--bframes 2", 25), ("--fps 30", 30)] {
        let parts = render_parts(folder, &folder.join("room.glb"), 14, 5, &format!("{SMALL} {options}"));
        for film in ["joined.m2v", "joined.mpg", "joined.ts", "joined.mp4", "joined.mkv"] {
            join(folder, &parts, film);
            let film = folder.join(film);
            let decoded = decode_ffmpeg(&film, (48, 48));
            assert_eq!(decoded.len(), 14, "{film:?}");
            if film.extension().is_some_and(|ending| ending == "m2v") {
                assert_eq!(decode_mpeg2dec(&film, (48, 48)).len(), 14, "{film:?}");
                continue;
            }
            let mut times = times_of(&film);
            times.sort_unstable();
            // Matroska counts milliseconds, 90 units each.
            let tolerance = if film.extension().is_some_and(|ending| ending == "mkv") { 90 } else { 0 };
            for pair in times.windows(2) {
                let off = (pair[1] - pair[0] - 90_000 / fps).abs();
                assert!(off <= tolerance, "{film:?}: {pair:?}");
            }
        }
    }
}

/// Returns the presentation times of all pictures \[1/90 000 s\], in the order of the file.
fn times_of(film: &Path) -> Vec<i64> {
    let arguments = ["-v", "warning", "-show_entries", "packet=pts_time", "-of", "csv=p=0"];
    let output = Command::new("ffprobe").args(arguments).arg(film).stdin(Stdio::null()).output().expect("ffprobe runs");
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines = text.lines().map(|line| line.trim_end_matches(',')).filter(|line| !line.is_empty());
    lines.map(|line| (90_000.0 * line.parse::<f64>().expect("a time")).round() as i64).collect()
}

#[test]
fn parts_that_make_no_film_are_named_in_one_line() {
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    let scene = folder.join("room.glb");
    let parts = render_parts(folder, &scene, 6, 2, SMALL);
    // Chunks of other films, ranges and lengths.
    let more = |name: &str, options: &str| {
        render(folder, name, &scene, &format!("{SMALL} {options}"));
    };
    more("coarse", "--frames 6 --chunk 2 --range 2-3 --qscale 16");
    more("twice", "--frames 6 --chunk 2 --range 0-3");
    more("longer", "--frames 8 --chunk 2 --range 2-3");
    more("other", "--frames 6 --chunk 3 --range 3-5");
    more("whole", "--frames 6 --chunk 2");
    let [first, second, third] = [0, 1, 2].map(|part| parts[part].as_str());

    // A stream without its last bytes or its report, the report of another stream, and an invalid report.
    let bytes = fs::read(folder.join(second)).unwrap();
    let report = fs::read_to_string(folder.join("part_2-3.report.json")).unwrap();
    let mut of_another_scene: Value = serde_json::from_str(&report).unwrap();
    of_another_scene["inputs"] = 1.into();
    for (name, stream, report) in [
        ("cut", &bytes[..bytes.len() - 4], report.clone()),
        ("short", &bytes[..bytes.len() / 2], report.clone()),
        ("doubled", &[&bytes[..], &bytes].concat(), report.clone()),
        ("wrong", &bytes, fs::read_to_string(folder.join("part_4-5.report.json")).unwrap()),
        ("early", &bytes, report.replace("\"interrupted\": false", "\"interrupted\": true")),
        ("scene", &bytes, of_another_scene.to_string()),
        ("json", &bytes, report[..report.len() / 2].into()),
        ("size", &bytes, report.replace("\"width\": 48", "\"width\": 64")),
        ("text", b"no video", report.clone()),
        ("empty", b"", report),
    ] {
        fs::write(folder.join(format!("{name}.m2v")), stream).unwrap();
        fs::write(folder.join(format!("{name}.report.json")), report).unwrap();
    }
    fs::write(folder.join("alone.m2v"), &bytes).unwrap();

    // Each command names the faulty file, and leaves the folder unchanged.
    let before = sorted_names(folder);
    for (named, words) in [
        (vec![first, third, second], [third, "out of order", second]),
        (vec![second, first, third], [second, "out of order", first]),
        (vec![first, third], [third, "begins with frame 2", "missing"]),
        (vec![second, third], [second, "begins with frame 0", "missing"]),
        (vec![first, second], [second, "begins with frame 4", "missing"]),
        (vec![first, first, second, third], [first, "overlaps", first]),
        (vec!["twice.m2v", second, third], ["twice.m2v", "overlaps", second]),
        (vec![first, "coarse.m2v", third], ["coarse.m2v", "qscale is 16, but 8 in", first]),
        (vec![first, "longer.m2v", third], ["longer.m2v", "frames is 8, but 6 in", first]),
        (vec!["other.m2v", first], [first, "chunk is 2, but 3 in", "other.m2v"]),
        (vec![first, "size.m2v", third], ["size.m2v", "size is", first]),
        (vec![first, "scene.m2v", third], ["scene.m2v", "another scene", first]),
        (vec![first, "cut.m2v", third], ["cut.m2v", "truncated", "--resume"]),
        (vec![first, "short.m2v", third], ["short.m2v", "truncated", "--resume"]),
        (vec![first, "doubled.m2v", third], ["doubled.m2v", "after its end", "byte"]),
        (vec![first, "wrong.m2v", third], ["wrong.m2v", "does not match", "wrong.report.json"]),
        (vec![first, "early.m2v", third], ["early.m2v", "ended early", "--resume"]),
        (vec![first, "json.m2v", third], ["json.report.json", "not a report", "line"]),
        (vec![first, "alone.m2v", third], ["alone.report.json", "needs its report", "alone.m2v"]),
        (vec![first, "text.m2v", third], ["text.m2v", "no sequence header", "elementary"]),
        (vec![first, "empty.m2v", third], ["empty.m2v", "no sequence header", "elementary"]),
        (vec![first, "none.m2v", third], ["none.m2v", "cannot be read", "--range"]),
        (vec!["whole.m2v"], ["whole.m2v", "not a part", "--range"]),
    ] {
        assert_fails(folder, &[&["join", "--overwrite", "-o", "film.m2v"][..], &named].concat(), &words);
        assert_eq!(sorted_names(folder), before, "{named:?}: no partial file remains");
    }

    // Invalid outputs.
    assert_fails(folder, &["join", first, second, third, "-o", first], &[first, "a file of a part"]);
    assert_fails(folder, &["join", first, second, third, "-o", "film.avi"], &["film.avi", ".mpg"]);
    assert_fails(folder, &["join", first, second, third, "-o", "film"], &["film", "ending", ".mkv"]);
    assert_eq!(sorted_names(folder), before);
    let _ = join(folder, &parts, "film.m2v");
}

/// The job template for schedulers, run by the reference implementation of Open Job Description.
#[test]
fn the_job_template_makes_the_film_of_one_machine() {
    let found = Command::new("openjd").arg("--version").output().ok();
    if need("openjd", found).is_none() {
        return;
    }
    let folder = folder_with_room(Moving::Camera);
    let folder = folder.path();
    let farm = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("packaging");
    let template = farm.join("render2mpeg.openjd.yaml").display().to_string();
    let output = Command::new("openjd")
        .args(["run", &template, "--step", "Join", "--run-dependencies", "-p", "Scene=room.glb", "-p", "LastFrame=8"])
        .args(["-p", "ChunkSize=3", "-p", "Film=the film.ts", "-p", &format!("Program={}", program().display())])
        .args(["-p", &format!("Options={SMALL} --bframes 1")])
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("openjd starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(String::from_utf8_lossy(&output.stdout).contains("openjd_status: 3 of 3 frames"));
    let scene = folder.join("room.glb");
    let alone = render(folder, "alone.ts", &scene, &format!("--frames 9 --chunk 3 {SMALL} --bframes 1"));
    assert!(fs::read(folder.join("the film.ts")).unwrap() == alone.stream);
}

/// Invalid arguments have an exit code of their own, after which schedulers do not retry.
#[test]
fn wrong_arguments_end_with_two() {
    let folder = folder_with_room(Moving::Nothing);
    for (options, words) in [
        ("--chunk 5 --bitrate 1M", ["--chunk", "--bitrate"]),
        ("--range 0-4 --bitrate 1M", ["--range", "--bitrate"]),
        ("--range 15-20 --frames 20", ["--range 15-20", "19"]),
        ("--chunk 5 --range 3-7 --frames 20", ["--range 3-7", "0-9"]),
        ("--chunk 5 --range 20-24 --frames 20", ["--range 20-24", "19"]),
        ("--chunk 5 --range 0-4 -o part.mpg --frames 20", ["part.mpg", "join"]),
        ("--chunk 0", ["--chunk 0", "at least"]),
        ("--range five", ["five", "10-19"]),
        ("--qscale 9", ["9", "8 and 10"]),
    ] {
        let arguments: Vec<&str> = ["render", "room.glb", "-q"].into_iter().chain(options.split(' ')).collect();
        let Finished { code, stderr, .. } = render2mpeg(folder.path(), &arguments);
        assert_eq!(code, Some(2), "{options}: {stderr}");
        assert!(words.iter().all(|word| stderr.contains(word)), "{options}: {stderr}");
    }
    // The same arguments may succeed on another machine, or later.
    let absent = render2mpeg(folder.path(), &["render", "absent.glb", "-q"]);
    assert_eq!(absent.code, Some(1), "{}", absent.stderr);
}

#[test]
fn a_terminated_part_plays_and_goes_on_to_the_same_bits() {
    let folder = folder_with_room(Moving::Box);
    let folder = folder.path();
    let words =
        format!("render room.glb -o part.m2v --frames 400 --chunk 200 --range 200-399 --progress openjd {SMALL}");
    let words: Vec<&str> = words.split_whitespace().collect();
    // Interrupt the chunk halfway with a signal.
    let mut child = started(folder, &words);
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert_eq!(lines.next().as_deref(), Some("openjd_progress: 0.0"));
    assert_eq!(lines.next().as_deref(), Some("openjd_status: 0 of 200 frames"));
    assert_eq!(lines.next().as_deref(), Some("openjd_progress: 0.5"));
    kill_process(Pid::from_raw(child.id() as i32).unwrap(), Signal::TERM).unwrap();
    lines.for_each(drop);
    assert_eq!(child.wait().unwrap().code(), Some(143));

    // The unfinished chunk is playable, but cannot be joined yet.
    let shown = decode_ffmpeg(&folder.join("part.m2v"), (48, 48)).len();
    assert!((1..200).contains(&shown), "{shown} frames");
    assert_fails(folder, &["join", "part.m2v", "-o", "film.m2v"], &["part.m2v", "ended early", "--resume"]);

    // The resumed chunk has the bits of an uninterrupted one.
    let resumed = render2mpeg(folder, &[&words[..], &["--resume"]].concat());
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    let first = resumed.stdout.lines().nth(1).unwrap();
    assert_eq!(first, format!("openjd_status: {shown} of 200 frames"));
    assert_eq!(resumed.stdout.lines().last().unwrap(), "openjd_status: 200 of 200 frames");
    let options = format!("--frames 400 --chunk 200 --range 200-399 {SMALL}");
    let at_once = render(folder, "again", &folder.join("room.glb"), &options);
    assert!(fs::read(folder.join("part.m2v")).unwrap() == at_once.stream);
}
