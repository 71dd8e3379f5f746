//! Runs `render2mpeg` as a separate process.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Returns the path of this package's `render2mpeg` binary. Cargo builds it before the tests, two folders above them.
///
/// # Panics
/// If the binary was not built: examples need `cargo build -p tests --bins` first.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let own = std::env::current_exe().expect("the path of the test program");
        let folder = own.ancestors().nth(2).expect("tests are in a folder of the profile's");
        let program = folder.join(format!("render2mpeg-under-test{}", std::env::consts::EXE_SUFFIX));
        assert!(program.is_file(), "{} is missing: cargo build -p tests --bins makes it", program.display());
        program
    })
}

/// Exit code and output of a process.
#[derive(Debug)]
pub struct Finished {
    /// Exit code; none if a signal ended the process.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

/// Runs `render2mpeg` with `arguments` in `folder` and waits.
pub fn render2mpeg(folder: &Path, arguments: &[&str]) -> Finished {
    let output = Command::new(program()).args(arguments).current_dir(folder).stdin(Stdio::null()).output();
    let output = output.expect("render2mpeg starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Finished { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
}

/// Starts `render2mpeg`, and returns when the checkpoint of `film` exists.
///
/// # Panics
/// If no checkpoint is written within two minutes.
pub fn start_until_checkpoint(folder: &Path, arguments: &[&str], film: &str) -> Child {
    let mut command = Command::new(program());
    let child = command.args(arguments).current_dir(folder).stdin(Stdio::null()).spawn().expect("render2mpeg starts");
    let (begin, checkpoint) = (Instant::now(), folder.join(format!("{film}.checkpoint")));
    // Poll at short intervals, to stop before the film is finished.
    while !checkpoint.exists() {
        assert!(begin.elapsed() < Duration::from_secs(120), "no checkpoint is made");
        std::thread::sleep(Duration::from_millis(1));
    }
    child
}

/// Waits for the end of a process, and returns its status.
///
/// # Panics
/// If the process does not end within `deadline`.
pub fn ended(child: &mut Child, deadline: Duration) -> ExitStatus {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child") {
            return status;
        }
        assert!(begin.elapsed() < deadline, "it does not end");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Finished film.
pub struct Rendered {
    /// Content of the video file.
    pub stream: Vec<u8>,
    /// Content of the report.
    pub report: Value,
}

impl Rendered {
    /// Returns a number of each frame, such as `["seconds", "photons"]`; null counts as infinite (the PSNR of equal
    /// pictures).
    pub fn figures(&self, path: &[&str]) -> Vec<f64> {
        let frames = self.report["frames"].as_array().expect("a report has frames");
        let figure = |frame: &Value| path.iter().fold(frame, |value, key| &value[key]).as_f64();
        frames.iter().map(|frame| figure(frame).unwrap_or(f64::INFINITY)).collect()
    }
}

/// Renders `scene` into `folder/NAME.m2v`, or `folder/NAME` if the name has an extension. Splits the `extra` arguments at
/// spaces.
///
/// # Panics
/// If the run fails, writes to standard error, or produces a video with wrong header values.
pub fn render(folder: &Path, name: &str, scene: &Path, extra: &str) -> Rendered {
    let (stem, ending) = name.split_once('.').unwrap_or((name, "m2v"));
    let (video, report) = (format!("{stem}.{ending}"), format!("{stem}.report.json"));
    let scene = scene.to_str().expect("a path in UTF-8");
    let mut arguments = vec!["render", scene, "--output", &video, "--quiet", "--overwrite"];
    arguments.extend(extra.split_whitespace());
    let finished = render2mpeg(folder, &arguments);
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "render2mpeg {arguments:?}");
    let stream = std::fs::read(folder.join(video)).expect("the video is there");
    let report = std::fs::read(folder.join(report)).expect("the report is there");
    // Compare header values of every rendered film with the stream.
    crate::truth::assert_true(&stream, name);
    Rendered { stream, report: serde_json::from_slice(&report).expect("the report is JSON") }
}

/// Checks that `render2mpeg` fails correctly: with a defined exit code, one line that contains all `words`, and no panic.
pub fn assert_fails(folder: &Path, arguments: &[&str], words: &[&str]) {
    let Finished { code, stderr, .. } = render2mpeg(folder, arguments);
    let context = format!("render2mpeg {arguments:?}: exit code {code:?}, {stderr}");
    match code {
        // For invalid arguments, clap adds usage and a hint.
        Some(2) if stderr.starts_with("error: ") => {}
        Some(1 | 2) => {
            assert_eq!(stderr.trim_end().lines().count(), 1, "not one line: {context}");
            assert!(stderr.starts_with("render2mpeg: "), "no name of the program: {context}");
        }
        _ => panic!("neither 1 nor 2: {context}"),
    }
    assert!(!stderr.contains("panicked"), "{context}");
    for word in words {
        assert!(stderr.contains(word), "\"{word}\" is missing: {context}");
    }
}

/// Returns the path of the Cornell box, which ships with the project.
pub fn cornell() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell/cornell.glb"))
}

/// Returns the folder of scenes outside the workspace, if present. Their licenses exclude them from the repository.
pub fn shared_scenes() -> Option<PathBuf> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"));
    let present = folder.is_dir();
    if !present {
        println!("no folder shared/scenes next to the workspace: checks with its scenes are skipped");
    }
    present.then_some(folder)
}

/// Returns the sorted names of all entries of `folder`.
pub fn sorted_names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into()).collect();
    names.sort();
    names
}
