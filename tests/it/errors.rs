//! Errors are reported in one line and leave no partial files.

use serde_json::json;
use std::path::Path;
use std::process::{Command, Stdio};
use tests::{Moving, assert_fails, checkered_room, program, sorted_names};

/// Checks that the run fails with one line and leaves the folder unchanged.
fn fails_cleanly(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = sorted_names(folder);
    assert_fails(folder, arguments, words);
    assert_eq!(sorted_names(folder), before, "{arguments:?} leaves something behind");
}

fn folder_with_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    folder
}

const SMALL: [&str; 10] =
    ["render", "room.glb", "--size", "32x32", "--frames", "3", "--vpls", "50", "--photons", "1000"];

#[test]
fn scenes() {
    let folder = folder_with_room();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let room = checkered_room(Moving::Camera);
    let whole = room.to_bytes();
    // Truncated files, other formats, a missing buffer, and an unsupported extension.
    write("cut.glb", &whole[..whole.len() * 2 / 3]);
    write("header.glb", &whole[..10]);
    write("empty.glb", b"");
    write("text.gltf", b"this is not JSON");
    write("half.gltf", b"{ \"asset\": {");
    let mut missing = room.clone();
    missing.json["buffers"] = json!([{ "uri": "gone.bin", "byteLength": room.bin.len() }]);
    write("missing.gltf", missing.json.to_string().as_bytes());
    let mut required = room.clone();
    required.json["extensionsUsed"] = json!(["KHR_gaussian_splatting"]);
    required.json["extensionsRequired"] = json!(["KHR_gaussian_splatting"]);
    required.write(&folder.path().join("splats.glb"));

    // Each gives a message that contains these words.
    for (name, words) in [
        ("nowhere.glb", &["nowhere.glb"][..]),
        ("cut.glb", &["cut.glb", "again"]),
        ("header.glb", &["header.glb"]),
        ("empty.glb", &["empty.glb"]),
        ("text.gltf", &["text.gltf: this is not a glTF file"]),
        ("half.gltf", &["half.gltf: not a complete glTF file"]),
        ("missing.gltf", &["missing.gltf", "gone.bin"]),
        ("splats.glb", &["splats.glb", "KHR_gaussian_splatting"]),
        (".", &["."]),
    ] {
        fails_cleanly(folder.path(), &["render", name], words);
        fails_cleanly(folder.path(), &["plan", name], words);
    }
}

#[test]
fn settings() {
    let folder = folder_with_room();
    // Values out of range, with words of the message.
    for (option, value, words) in [
        ("--size", "0x0", &["0x0"][..]),
        ("--size", "99999x10", &["99999x10", "16383"]),
        ("--qscale", "0", &["0", "1 and 2"]),
        ("--qscale", "9", &["9", "8 and 10"]),
        ("--qscale", "113", &["113", "112"]),
        ("--fps", "26", &["26", "25"]),
        ("--fps", "nan", &["fps"]),
        ("--gop", "0", &["0", "132"]),
        ("--gop", "133", &["133", "132"]),
        ("--bitrate", "2", &["1500k"]),
        ("--bitrate", "900M", &["900000000", "High"]),
        ("--bframes", "8", &["8", "0 to 7"]),
        ("--frames", "0", &["--frames 0"]),
        ("--frames", "-1", &["-1"]),
        ("--vpls", "0", &["--vpls 0"]),
        ("--thresholds", "fixed:2", &["fixed:2"]),
        ("--lighting", "candles", &["candles"]),
    ] {
        fails_cleanly(folder.path(), &["render", "room.glb", option, value], words);
        fails_cleanly(folder.path(), &["plan", "room.glb", option, value], words);
    }
    fails_cleanly(folder.path(), &["render", "room.glb", "--threads", "0"], &["0"]);

    // Unsupported file names.
    for name in ["film.avi", "film.m2", "film", "film.", ".mpg", "./-", "a.mp4/film"] {
        let words = [name, ".mpg", ".mp4", ".mkv", ".ts", ".vob", ".m2v"];
        fails_cleanly(folder.path(), &["render", "room.glb", "--output", name], &words);
        fails_cleanly(folder.path(), &["plan", "room.glb", "--output", name], &words);
    }

    // Options that require or exclude each other.
    fails_cleanly(folder.path(), &["render", "room.glb", "--cbr"], &["--bitrate"]);
    fails_cleanly(folder.path(), &["render", "room.glb", "--mpeg1", "--qscale", "7"], &["MPEG-1", "even"]);
}

#[test]
fn files_beside_the_scene() {
    let folder = folder_with_room();
    for (text, words) in [
        ("[tone_mapping", &["room.toml"][..]),
        ("[tone_mapping]\noperator = \"sepia\"", &["room.toml", "sepia"]),
        (
            "[tone_mapping]\noperator = \"gamma\"\nexposure = -1.0",
            &["room.toml: [tone_mapping] exposure is -1; it must be above 0 (1e-20 to 1e20)"],
        ),
        ("[tone_mapping]\nwhite = \"much\"", &["room.toml", "white", "expected a number"]),
        ("[video]\nfps = \"fast\"", &["room.toml", "expected a number"]),
        ("[video]\nframes = 0", &["room.toml", "frames"]),
        ("[video]\nlength = 5", &["room.toml", "length"]),
        // As an option, the same value is an error of the command line.
        ("[video]\nfps = 0.5", &["room.toml", "[video] fps", "0.5", "23.976"]),
        ("[sky]\nzenith = [-1, 0, 0]\nhorizon = [0, 0, 0]", &["room.toml", "sky"]),
    ] {
        std::fs::write(folder.path().join("room.toml"), text).unwrap();
        fails_cleanly(folder.path(), &["render", "room.glb"], words);
    }
}

#[test]
fn places_that_cannot_be_written() {
    let folder = folder_with_room();
    std::fs::write(folder.path().join("file"), "").unwrap();
    for (options, word) in [
        (&["--output", "no/such/folder/film.m2v"][..], "no/such/folder/film.m2v"),
        (&["--output", "file/film.m2v"], "file/film.m2v"),
        (&["--output", "."], "."),
        (&["--output", "film.m2v", "--report", "no/report.json"], "no/report.json"),
        (&["--output", "film.m2v", "--exr", "file"], "file is a file, not a folder"),
        (&["--output", "film.m2v", "--png", "file"], "file is a file, not a folder"),
        (&["--output", "film.m2v", "--exr", "file/frames"], "file/frames cannot be created"),
        (&["--output", "film.m2v", "--y4m", "no/film.y4m"], "no/film.y4m"),
        (&["--output", "film.m2v", "--also", "no/film.mp4"], "no/film.mp4"),
    ] {
        fails_cleanly(folder.path(), &[&SMALL[..], options].concat(), &[word]);
    }
}

/// /dev/full accepts no bytes, like a disk that is full from the start.
#[test]
#[cfg(target_os = "linux")]
fn a_full_device() {
    let folder = folder_with_room();
    for options in [
        &["--output", "/dev/full"][..],
        &["--output", "/dev/null", "--report", "/dev/full"],
        &["--output", "film.m2v", "--y4m", "/dev/full"],
    ] {
        fails_cleanly(folder.path(), &[&SMALL[..], &["--quiet"], options].concat(), &["/dev/full"]);
    }
}

/// A file-size limit stops a regular file midway, like a disk that fills up.
#[test]
#[cfg(unix)]
fn a_disk_that_fills_up() {
    let folder = folder_with_room();
    let before = sorted_names(folder.path());
    // Two blocks of 512 bytes are less than the first picture. The signal that would end the program is ignored.
    let script = "trap '' XFSZ; ulimit -f 2; exec \"$0\" \"$@\"";
    // The report alone exceeds the limit. It goes to /dev/null, so that another file fails first.
    for (options, word) in [
        (&["--output", "film.m2v", "--report", "/dev/null"][..], "film.m2v"),
        (&["--output", "/dev/null", "--report", "/dev/null", "--y4m", "film.y4m"], "film.y4m"),
        (&["--output", "/dev/null", "--report", "film.json"], "film.json"),
    ] {
        let mut shell = Command::new("sh");
        shell.args(["-c", script]).arg(program()).args(SMALL).arg("--quiet").args(options);
        let output = shell.current_dir(folder.path()).stdin(Stdio::null()).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{options:?}: {message}");
        assert!(message.starts_with("render2mpeg: ") && message.contains(word), "{options:?}: {message}");
        assert_eq!(message.lines().count(), 1, "{options:?}: {message}");
        assert_eq!(sorted_names(folder.path()), before, "{options:?}: no partial file remains");
    }
}
