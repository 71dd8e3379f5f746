//! Full disks, and concurrent runs on one file: no film is lost or silently wrong.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tests::{
    Moving, assert_fails, checkered_room, ended, program, render, render2mpeg, sorted_names, start_until_checkpoint,
};

const SMALL: &str = "--size 48x48 --vpls 60 --photons 1000";

fn folder_with_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Box).write(&folder.path().join("room.glb"));
    folder
}

/// Runs the program with a file-size limit of `blocks` blocks of 512 bytes, like a disk that fills up.
fn with_blocks(folder: &Path, blocks: usize, arguments: &[&str]) -> Output {
    // Ignore the signal that would end the program, so that writing fails.
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).arg(program()).args(arguments);
    shell.current_dir(folder).stdin(Stdio::null()).output().expect("sh starts")
}

#[test]
fn a_disk_that_fills_up_loses_nothing_that_a_checkpoint_knows() {
    let folder = folder_with_room();
    let folder = folder.path();
    let options =
        format!("--frames 40 --samples 1 --cache off --thresholds fixed:0.02 --shading full --y4m film.y4m {SMALL}");
    let truth = render(folder, "film", &folder.join("room.glb"), &options);
    let frames = fs::read(folder.join("film.y4m")).unwrap();
    let names = sorted_names(folder);
    let words = format!("render room.glb -o film.m2v -q --overwrite --checkpoint 0 {options}");
    let words: Vec<&str> = words.split_whitespace().collect();
    let resumed = [&words[..], &["--resume"]].concat();

    // The uncompressed frames are the largest file. Checkpoints exceed only the smallest limits.
    let most = frames.len() / 512;
    let mut kept = 0;
    for part in 0..10 {
        fs::remove_file(folder.join("film.m2v")).unwrap();
        fs::remove_file(folder.join("film.y4m")).unwrap();
        let blocks = 40 + part * (most - 41) / 10;
        let output = with_blocks(folder, blocks, &words);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{blocks} blocks: {message}");
        let last = message.lines().last().unwrap_or_default();
        assert!(last.starts_with("render2mpeg: film."), "{blocks} blocks: {message}");

        // The film is absent; its unfinished files exist only with a checkpoint.
        let left = sorted_names(folder);
        assert!(!left.contains(&"film.m2v".into()) && !left.contains(&"film.y4m".into()), "{left:?}");
        let is_resumable = left.contains(&"film.m2v.checkpoint".into());
        for name in ["film.m2v.part", "film.y4m.part"] {
            assert_eq!(left.contains(&name.into()), is_resumable, "{blocks} blocks: {left:?}");
        }
        kept += u32::from(is_resumable);

        // Without the limit, the film is continued to the same bits.
        let finished = render2mpeg(folder, &resumed);
        assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "{blocks} blocks");
        assert!(fs::read(folder.join("film.m2v")).unwrap() == truth.stream, "{blocks} blocks: another film");
        assert!(fs::read(folder.join("film.y4m")).unwrap() == frames, "{blocks} blocks: other frames");
        assert_eq!(sorted_names(folder), names);
    }
    assert!(kept >= 5, "{kept} of 10 left something to go on from");
}

#[test]
fn a_checkpoint_that_cannot_be_written_ends_no_film() {
    let folder = folder_with_room();
    let folder = folder.path();
    let truth = render(folder, "film", &folder.join("room.glb"), &format!("--frames 6 {SMALL}"));
    // A folder occupies the checkpoint's path.
    fs::create_dir_all(folder.join("film.m2v.checkpoint.part/in the way")).unwrap();
    let words = format!("render room.glb -o film.m2v -q --overwrite --checkpoint 0 --frames 6 {SMALL}");
    let words: Vec<&str> = words.split_whitespace().collect();
    let refused = render2mpeg(folder, &words);
    assert_eq!(refused.code, Some(1), "a folder at the checkpoint's path is an error: {}", refused.stderr);
    fs::remove_dir_all(folder.join("film.m2v.checkpoint.part")).unwrap();

    // Four blocks are enough for the film, but not for a checkpoint.
    let options = [&words[..], &["--report", "/dev/null"]].concat();
    let output = with_blocks(folder, truth.stream.len().div_ceil(512), &options);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{message}");
    for line in message.lines() {
        assert!(line.starts_with("warning: film.m2v.checkpoint ") && line.contains("continues"), "{message}");
    }
    assert!(message.lines().count() > 0, "a warning");
    assert!(fs::read(folder.join("film.m2v")).unwrap() == truth.stream);
}

#[test]
fn two_runs_do_not_write_to_one_file() {
    let folder = folder_with_room();
    let folder = folder.path();
    let truth = render(folder, "truth", &folder.join("room.glb"), &format!("--frames 150 {SMALL}"));
    let words = format!("render room.glb -o film.m2v -q --overwrite --checkpoint 0 --frames 150 {SMALL}");
    let words: Vec<&str> = words.split_whitespace().collect();
    let mut first = start_until_checkpoint(folder, &words, "film.m2v");
    for more in [&[][..], &["--resume"], &["--frames", "3"], &["--y4m", "film.m2v"]] {
        let expected = if more.contains(&"--y4m") { "film.m2v" } else { "another run" };
        assert_fails(folder, &[&words[..], more].concat(), &["film.m2v", expected]);
        assert_eq!(first.try_wait().unwrap(), None, "{more:?}: the first run was over too early");
    }
    assert!(ended(&mut first, Duration::from_secs(120)).success());
    assert!(fs::read(folder.join("film.m2v")).unwrap() == truth.stream);
}
