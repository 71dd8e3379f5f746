//! Ranks as processes, if `mpirun` is installed.

use rustix::process::{Pid, Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tests::{cornell, decode_ffmpeg, need, program, render, sorted_names, tolerant_frame_count};

const SIZE: (usize, usize) = (64, 64);
/// Limit for a run that would otherwise not end.
const DEADLINE: Duration = Duration::from_secs(60);

/// Returns an `mpirun` command with groups of ranks, each a count and a command line; none if `mpirun` is missing.
fn mpirun(folder: &Path, groups: &[(usize, Vec<String>)]) -> Option<Command> {
    let version = Command::new("mpirun").arg("--version").stdout(Stdio::null()).status();
    need("mpirun", version.ok().filter(|status| status.success()))?;
    let mut command = Command::new("mpirun");
    command.args(["--allow-run-as-root", "--oversubscribe"]).current_dir(folder).stdin(Stdio::null());
    for (place, (count, words)) in groups.iter().enumerate() {
        if place > 0 {
            command.arg(":");
        }
        command.args(["-n", &count.to_string()]).args(words);
    }
    Some(command)
}

/// Returns the command line for a film of the shipped Cornell box.
fn words(program: &Path, more: &str) -> Vec<String> {
    let path = |path: &Path| path.to_str().expect("a path in UTF-8").to_owned();
    let own = format!("--output film.m2v --size 64x64 --vpls 200 --photons 40000 --threads 1 --quiet {more}");
    let mut words = vec![path(program), "render".into(), path(&cornell())];
    words.extend(own.split_whitespace().map(str::to_owned));
    words
}

/// Returns the error lines of this program, without the launcher's.
fn said(output: &Output) -> Vec<String> {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!text.contains("panicked"), "{text}");
    text.lines().filter(|line| line.starts_with("render2mpeg")).map(str::to_owned).collect()
}

#[test]
fn two_processes_make_the_film_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let alone = render(folder.path(), "alone", &cornell(), "--size 64x64 --vpls 200 --photons 40000 --frames 5").stream;
    let words = words(program(), "--frames 5");
    let Some(mut command) = mpirun(folder.path(), &[(2, words)]) else { return };
    let output = command.output().expect("mpirun starts");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    assert!(std::fs::read(folder.path().join("film.m2v")).unwrap() == alone, "two ranks make another film");
    assert_eq!(sorted_names(folder.path()), ["alone.m2v", "alone.report.json", "film.m2v", "film.report.json"]);
}

/// Ranks take tiles on demand, with each kind of record exchange.
#[test]
fn processes_take_tiles_on_demand() {
    let folder = tempfile::tempdir().unwrap();
    for tiles in ["rays,none", "rays,central:2", "time,each:2"] {
        let words = words(program(), &format!("--frames 4 --samples 2 --overwrite --tiles {tiles}"));
        let Some(mut command) = mpirun(folder.path(), &[(3, words)]) else { return };
        let output = command.output().expect("mpirun starts");
        assert!(output.status.success() && output.stderr.is_empty(), "{tiles}: {output:?}");
        assert_eq!(decode_ffmpeg(&folder.path().join("film.m2v"), SIZE).len(), 4, "{tiles}");
    }
}

#[test]
fn ranks_of_different_films_end_with_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let group = |more: &str| (1, words(program(), more));
    for (second, words) in [
        ("--frames 5 --seed 2", "rank 1 has another scene, other settings"),
        ("--frames 5 --baked no.slf", "rank 1: --baked needs --lighting baked"),
    ] {
        let Some(mut command) = mpirun(folder.path(), &[group("--frames 5"), group(second)]) else { return };
        let output = command.output().expect("mpirun starts");
        let said = said(&output);
        assert!(!output.status.success() && said.len() == 1 && said[0].contains(words), "{said:?}");
        assert!(sorted_names(folder.path()).is_empty(), "nothing is written");
    }
}

/// Starts a long film, ends rank 1 by `end` after the first pictures are written, and returns the output.
fn film_without_rank_1(folder: &Path, second: Vec<String>, end: impl FnOnce()) -> Option<Output> {
    let first = words(program(), "--frames 5000");
    let child = mpirun(folder, &[(1, first), (1, second)])?.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let child = child.expect("mpirun starts");
    let (begin, part) = (Instant::now(), folder.join("film.m2v.part"));
    while std::fs::metadata(&part).map_or(0, |part| part.len()) < 6_000 && !folder.join("film.m2v").exists() {
        assert!(begin.elapsed() < DEADLINE, "no picture is written");
        std::thread::sleep(Duration::from_millis(10));
    }
    end();
    let begin = Instant::now();
    let output = child.wait_with_output().expect("mpirun ends");
    println!("all ranks ended {:?} later", begin.elapsed());
    Some(output)
}

/// Counts the frames of the first rank's film: complete under its name, or a playable prefix.
fn frames_of_film(folder: &Path) -> usize {
    let (film, part) = (folder.join("film.m2v"), folder.join("film.m2v.part"));
    if film.exists() { decode_ffmpeg(&film, SIZE).len() } else { tolerant_frame_count(&part, SIZE) }
}

#[test]
fn a_rank_that_is_killed_ends_the_film_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let pid_file = folder.path().join("pid");
    let mut second = vec!["sh".to_owned(), "-c".into(), "echo $$ > pid; exec \"$@\"".into(), "sh".into()];
    second.extend(words(program(), "--frames 5000"));
    let kill = || {
        let pid = std::fs::read_to_string(&pid_file).expect("its number").trim().parse().expect("a number");
        kill_process(Pid::from_raw(pid).expect("a process"), Signal::KILL).expect("it can be killed");
    };
    let Some(output) = film_without_rank_1(folder.path(), second, kill) else { return };
    assert!(!output.status.success());
    assert!(frames_of_film(folder.path()) > 0);
}

/// A panic of rank 1 prints one line, ends all ranks, and leaves a playable film.
#[test]
fn a_rank_that_panics_ends_all() {
    let folder = tempfile::tempdir().unwrap();
    let failing: PathBuf = program().with_file_name("failing-rank-under-test");
    let Some(output) = film_without_rank_1(folder.path(), words(&failing, "--frames 5000"), || ()) else { return };
    let said = said(&output);
    let own: Vec<&String> = said.iter().filter(|line| line.starts_with("render2mpeg: ")).collect();
    assert!(!output.status.success() && own.len() == 1, "{said:?}");
    assert!(own[0].contains("rank 1 failed") && own[0].contains("on purpose"), "{said:?}");
    assert!(frames_of_film(folder.path()) > 0);
}

/// Returns the output of three processes that exchange messages.
fn mail(how: &str) -> Option<Output> {
    let folder = tempfile::tempdir().unwrap();
    let program = program().with_file_name("mail-under-test");
    let words = vec![program.to_str().expect("a path in UTF-8").to_owned(), how.to_owned()];
    Some(mpirun(folder.path(), &[(3, words)])?.output().expect("mpirun starts"))
}

/// All processes exchange messages at the same time, including messages longer than one MPI operation transfers.
#[test]
fn messages_of_processes_arrive_in_the_order_of_their_sender() {
    let Some(output) = mail("exchange") else { return };
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    let mut lines: Vec<&str> = text.lines().collect();
    lines.sort_unstable();
    assert_eq!(lines, ["rank 0 has all messages", "rank 1 has all messages", "rank 2 has all messages"]);
}

/// A rank that waits after the others have ended fails with one line, after it has received their messages.
#[test]
fn who_waits_for_processes_that_are_gone_fails() {
    let Some(output) = mail("alone") else { return };
    let said = said(&output);
    let own: Vec<&String> = said.iter().filter(|line| line.starts_with("render2mpeg: ")).collect();
    assert!(!output.status.success() && own.len() == 1, "{said:?}");
    assert!(own[0].contains("rank 0 failed") && own[0].contains("another rank has ended"), "{said:?}");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "rank 0 has a message of rank 1 and one of rank 2\n");
}
