//! Faults during a film: a stage that panics, a folder or reader that disappears, exhausted file handles. No run hangs, an
//! error line names the fault, and the exit code is not 0.
//!
//! Full disks and devices are in `errors.rs`, signals in `interrupt.rs`.

use perceptual::YCbCr;
use pipeline::Run;
use pipeline::observe::Observer;
use pipeline::report::FrameReport;
use plane::Plane;
use render2mpeg::{Options, Settings, render};
use renderer::plan::Plan;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use tests::{Moving, checkered_room, program, sorted_names, tolerant_frame_count};

/// Limit for a run that would otherwise not end.
const DEADLINE: Duration = Duration::from_secs(120);

/// The stage in which the observer panics.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Panics {
    Display,
    Mask,
    Encode,
    EncodeReport,
    Never,
}

struct Saboteur {
    panics: Panics,
    at: u32,
}

impl Saboteur {
    fn maybe(&self, here: Panics, index: u32) {
        assert!(!(here == self.panics && index == self.at), "an injected panic");
    }
}

impl Observer for Saboteur {
    fn picture(&self, index: u32, _: &YCbCr) {
        self.maybe(Panics::Display, index);
    }

    fn thresholds(&self, index: u32, _: &Plane<f32>) {
        self.maybe(Panics::Mask, index);
    }

    fn bytes(&self, _: &[u8]) {
        self.maybe(Panics::Encode, self.at);
    }

    fn frame(&self, report: &FrameReport) {
        self.maybe(Panics::EncodeReport, report.index);
    }
}

/// Renders six frames in a separate thread, and waits for its end.
fn film_with(panics: Panics, at: u32, more: fn(&mut Options)) -> Result<(), String> {
    let (done, result) = mpsc::channel();
    std::thread::spawn(move || {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.glb");
        checkered_room(Moving::Box).write(&path);
        let scene = render_core::scene::load(&path).unwrap();
        let size = "32x32".parse().ok();
        let mut options = Options { frames: Some(6), size, vpls: Some(50), photons: Some(1000), ..Options::default() };
        options.output = Some(folder.path().join("film.m2v"));
        more(&mut options);
        let settings = Settings::new(path, &scene, &options).unwrap();
        let plan = Plan::new(&scene, &settings.render);
        let run = Run { observer: &Saboteur { panics, at }, ..Run::default() };
        let report = render(&scene, &settings, &plan, run);
        let names = sorted_names(folder.path());
        let expected: &[&str] = if report.is_ok() { &["film.m2v", "room.glb"] } else { &["room.glb"] };
        let report = report.map(|_| ()).map_err(|error| error.chain());
        done.send((report, names == expected)).unwrap();
    });
    let (report, clean) = result.recv_timeout(DEADLINE).expect("a run whose stage panics ends");
    assert!(clean, "{panics:?}: no partial file remains");
    report
}

/// Panics in each stage that calls the observer, at an early, a middle and the last frame, with and without frames queued in
/// the encoder.
#[test]
fn a_stage_that_panics_ends_the_run() {
    let kinds: [fn(&mut Options); 2] = [|_| (), |options| options.bframes = Some(2)];
    for more in kinds {
        assert_eq!(film_with(Panics::Never, 0, more), Ok(()));
        for (panics, stage) in [
            (Panics::Display, "display"),
            (Panics::Mask, "mask"),
            (Panics::Encode, "encode"),
            (Panics::EncodeReport, "encode"),
        ] {
            for at in [0, 2, 5] {
                let message = film_with(panics, at, more).expect_err("a panic is a failure");
                assert!(message.contains(stage) && message.contains("bug"), "{panics:?} at {at}: {message}");
            }
        }
    }
}

/// Starts the program on a long film.
fn start(folder: &Path, output: &str, stdout: Stdio) -> Child {
    Command::new(program())
        .args(["render", "room.glb", "-o", output, "--size", "48x48", "--frames", "100000", "--quiet"])
        .args(["--vpls", "50", "--photons", "1000", "--threads", "2", "--report", "report.json", "--checkpoint", "0"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(stdout)
        .stderr(Stdio::piped())
        .spawn()
        .expect("render2mpeg starts")
}

fn wait(child: &mut Child) -> (ExitStatus, String) {
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child") {
            break status;
        }
        if begin.elapsed() > DEADLINE {
            let _ = child.kill();
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let mut message = String::new();
    child.stderr.take().expect("it is piped").read_to_string(&mut message).expect("text");
    (status, message)
}

fn wait_until(what: &str, mut so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !so() {
        assert!(begin.elapsed() < DEADLINE, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The folder is removed during the film. The run fails at the next checkpoint, or at the latest at its end.
#[test]
fn an_output_that_vanishes() {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    let place = folder.path().join("there");
    std::fs::create_dir(&place).unwrap();
    let mut child = start(folder.path(), "there/film.m2v", Stdio::null());
    wait_until("pictures are written", || {
        std::fs::metadata(place.join("film.m2v.part")).is_ok_and(|part| part.len() > 5000)
    });
    std::fs::remove_dir_all(&place).or_else(|_| std::fs::remove_dir_all(&place)).unwrap();
    let (status, message) = wait(&mut child);
    assert_eq!(status.code(), Some(1), "{message}");
    // Failed checkpoints print warnings and do not end the film.
    let mut lines = message.lines().skip_while(|line| line.starts_with("warning: there/film.m2v.checkpoint"));
    let error = lines.next().unwrap_or_default();
    assert!(error.starts_with("render2mpeg: ") && error.contains("film.m2v"), "{message}");
    assert_eq!(lines.next(), None, "{message}");
}

/// A pipe is closed by its reader; the bytes it has read are playable.
#[test]
fn a_reader_that_goes_away() {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    let mut child = start(folder.path(), "/dev/stdout", Stdio::piped());
    let mut read = vec![0; 20_000];
    child.stdout.take().expect("it is piped").read_exact(&mut read).expect("a stream comes");
    // The reader is dropped here.
    let (status, message) = wait(&mut child);
    assert_eq!(status.code(), Some(1), "{status}: {message}");
    assert!(message.contains("standard output") && message.lines().count() == 1, "{message}");
    let prefix = folder.path().join("prefix.mpg");
    std::fs::write(&prefix, &read).unwrap();
    assert!(tolerant_frame_count(&prefix, (48, 48)) > 3, "the bytes read are playable");
}

/// Printed output may be read partially: `render2mpeg plan scene.glb | head -1`.
#[test]
fn readers_of_texts_may_go_away() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("room.glb");
    checkered_room(Moving::Camera).write(&scene);
    std::fs::write(
        folder.path().join("a.y4m"),
        [&b"YUV4MPEG2 W16 H16 F25:1 C420mpeg2\n"[..], &film_of_gray(3)].concat(),
    )
    .unwrap();
    for arguments in
        [&["plan", "room.glb"][..], &["render", "room.glb", "--print-config"], &["compare", "a.y4m", "a.y4m"]]
    {
        let mut child = Command::new(program())
            .args(arguments)
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("render2mpeg starts");
        drop(child.stdout.take());
        let (status, message) = wait(&mut child);
        assert!(status.success() && message.is_empty(), "{arguments:?}: {status} {message}");
    }
}

fn film_of_gray(frames: usize) -> Vec<u8> {
    [&b"FRAME\n"[..], &[128; 16 * 16 * 3 / 2]].concat().repeat(frames)
}

/// With at most a few file handles, an error names the file that cannot be opened, and the program neither panics nor hangs.
#[test]
fn out_of_file_handles() {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    let before = sorted_names(folder.path());
    let mut failed = 0;
    // Run with each limit, from the three standard streams upwards.
    for handles in 3..14 {
        let mut shell = Command::new("sh");
        shell
            .args(["-c", &format!("ulimit -n {handles}; exec \"$0\" \"$@\"")])
            .arg(program())
            .args(["render", "room.glb", "-o", "film.m2v", "--size", "32x32", "--frames", "2", "--quiet"])
            .args(["--vpls", "50", "--photons", "1000", "--y4m", "film.y4m", "--exr", "frames", "--checkpoint", "0"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let (status, message) = wait(&mut shell.spawn().expect("sh starts"));
        println!("{handles} handles: {status} {message}");
        assert!(!message.contains("panicked"), "{handles} handles: {message}");
        if !status.success() {
            failed += 1;
            // The dynamic linker prints its own message if it cannot open a library.
            let ours = message.starts_with("render2mpeg: ");
            assert!(
                !ours || (status.code() == Some(1) && message.lines().count() == 1),
                "{handles} handles: {message}"
            );
            let stays: Vec<String> = sorted_names(folder.path())
                .into_iter()
                .filter(|name| !before.contains(name) && name != "frames")
                .collect();
            // With a checkpoint, the unfinished files remain for another run.
            let is_resumable = stays.iter().any(|name| name.ends_with(".checkpoint"));
            let has_parts = stays.iter().any(|name| name.ends_with(".part"));
            assert!(is_resumable || !has_parts, "{handles} handles leave {stays:?}");
        }
        // Remove the files of this run.
        for name in sorted_names(folder.path()).iter().filter(|name| !before.contains(name)) {
            let path = folder.path().join(name);
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        }
    }
    assert!(failed >= 2, "a few handles are too few: {failed} runs failed");
}
