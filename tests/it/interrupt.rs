//! A run that is ended early keeps its results.

use rustix::process::{Pid, Signal, kill_process};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use tests::{cornell, decode_ffmpeg, decode_mpeg2dec, ended, program, sorted_names, tolerant_frame_count};

const SIZE: (usize, usize) = (128, 128);
/// Limit for a run that would otherwise not end.
const DEADLINE: Duration = Duration::from_secs(120);

/// A running film, killed on drop.
struct Film {
    child: Child,
    part: PathBuf,
}

impl Film {
    fn start(folder: &Path) -> Self {
        let words = "--output film.m2v --size 128x128 --frames 5000 --vpls 200 --photons 20000 --quiet";
        Self::with_options(folder, "film.m2v.part", words)
    }

    fn with_options(folder: &Path, part: &str, words: &str) -> Self {
        let child = Command::new(program())
            .arg("render")
            .arg(cornell())
            .args(words.split_whitespace())
            .args(["--threads", "2"])
            .current_dir(folder)
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .expect("render2mpeg starts");
        Self { child, part: folder.join(part) }
    }

    /// Waits until some pictures are written.
    fn wait_for_pictures(&mut self) {
        self.wait_for_bytes(6_000);
    }

    /// Waits until the film has at least this number of `bytes`.
    fn wait_for_bytes(&mut self, bytes: u64) {
        let start = Instant::now();
        while std::fs::metadata(&self.part).map_or(0, |part| part.len()) < bytes {
            assert!(start.elapsed() < DEADLINE, "no picture was written");
            assert_eq!(self.child.try_wait().expect("a child"), None, "the run ended before the signal");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(self.child.id() as i32).expect("a process");
        kill_process(pid, signal).expect("the process takes signals");
    }

    fn wait(&mut self) -> ExitStatus {
        ended(&mut self.child, DEADLINE)
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        // No effect on an ended process.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn ctrl_c_ends_the_stream_in_order() {
    for (signal, code) in [(Signal::INT, 130), (Signal::TERM, 143), (Signal::HUP, 129)] {
        let folder = tempfile::tempdir().unwrap();
        let mut film = Film::start(folder.path());
        film.wait_for_pictures();
        film.signal(signal);
        assert_eq!(film.wait().code(), Some(code));
        // The film so far, and the files to continue it.
        assert_eq!(sorted_names(folder.path()), ["film.m2v", "film.m2v.checkpoint", "film.report.json"]);
        let report = std::fs::read(folder.path().join("film.report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        assert_eq!(report["summary"]["interrupted"], true);
        let video = folder.path().join("film.m2v");
        let shown = decode_ffmpeg(&video, SIZE).len();
        println!("{signal:?} after {shown} frames");
        assert!(shown > 0);
        assert_eq!(decode_mpeg2dec(&video, SIZE).len(), shown);
        assert_eq!(report["summary"]["frames"], shown);
        assert_eq!(report["frames"].as_array().map(Vec::len), Some(shown));
        assert!(std::fs::read(&video).unwrap().ends_with(&[0, 0, 1, 0xb7]), "sequence_end_code");
    }
}

#[test]
fn a_second_signal_ends_the_film_at_once() {
    for (ending, options) in [("m2v", ""), ("mpg", ""), ("ts", ""), ("mp4", "--gop 4"), ("mkv", "--gop 4")] {
        let folder = tempfile::tempdir().unwrap();
        // Frames take about a second each, and the first signal alone would wait for them.
        let words = format!(
            "--output film.{ending} --size 128x128 --frames 5000 --vpls 5000 --photons 700000 --quiet {options}"
        );
        let mut film = Film::with_options(folder.path(), &format!("film.{ending}.part"), &words);
        film.wait_for_bytes(1_000);
        film.signal(Signal::INT);
        std::thread::sleep(Duration::from_millis(50));
        film.signal(Signal::INT);
        assert_eq!(film.wait().code(), Some(130));
        let name = format!("film.{ending}");
        let mut names = sorted_names(folder.path());
        // If the frame ends between the two signals, a checkpoint or the report may be half-written.
        names.retain(|name| !name.contains(".checkpoint") && !name.contains(".report.json"));
        assert_eq!(names, [name.as_str()], "under its name, and nothing half-written");
        let video = folder.path().join(name);
        let shown = decode_ffmpeg(&video, SIZE).len();
        assert!(shown > 0, "{ending}");
        let bytes = std::fs::read(&video).unwrap();
        match ending {
            "m2v" => assert!(bytes.ends_with(&[0, 0, 1, 0xb7])),
            "mpg" => assert!(bytes.ends_with(&[0, 0, 1, 0xb9])),
            // Group index and the last, incomplete group are present.
            "mp4" => assert!(bytes.windows(4).any(|word| word == b"mfra")),
            "mkv" => assert!(bytes.windows(4).any(|word| word == [0x1c, 0x53, 0xbb, 0x6b]), "Cues"),
            _ => assert_eq!(bytes.len() % 188, 0),
        }
    }
}

#[test]
fn killed_it_leaves_a_part_that_plays() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = Film::start(folder.path());
    film.wait_for_pictures();
    film.signal(Signal::KILL);
    assert_eq!(film.wait().signal(), Some(9));
    assert_eq!(sorted_names(folder.path()), ["film.m2v.part"], "an unfinished film does not have the final name");
    let shown = tolerant_frame_count(&film.part, SIZE);
    println!("{shown} frames play");
    assert!(shown >= 1);

    // The next run is not blocked by remains of the last one.
    let finished = tests::render(folder.path(), "film", &cornell(), "--size 64x64 --frames 2 --vpls 50 --photons 1000");
    assert_eq!(finished.report["summary"]["frames"], 2);
    assert_eq!(sorted_names(folder.path()), ["film.m2v", "film.report.json"]);
}
