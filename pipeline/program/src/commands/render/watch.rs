//! `render --watch`: renders the film again whenever a file of the scene changes.

use anyhow::{Context, Result};
use render_core::scene::{Scene, SceneSettings};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode};
use std::time::{Duration, SystemTime};

/// Interval between two checks of the files.
const LOOK_EVERY: Duration = Duration::from_millis(300);

/// Modification time, and size of a file \[bytes\]; `None` if the file does not exist.
type Stamp = Option<(SystemTime, u64)>;

/// Runs the same command without `--watch`, and runs it again after each change of a file that `load` reads. Does not
/// return until the process ends.
///
/// # Errors
/// If the program cannot be started again.
pub fn run(path: &Path, load: impl Fn() -> Result<Scene>) -> Result<ExitCode> {
    let program = std::env::current_exe().context("cannot find the program's own executable")?;
    // Repeat the command without --watch, so that each film has a new process.
    let words: Vec<OsString> = std::env::args_os().skip(1).filter(|word| word != "--watch").collect();
    loop {
        // List the files again each time, because an edit may change the list.
        let files = files_of(path, load().ok());
        let stamps = stamps(&files);
        let mut film =
            Command::new(&program).args(&words).arg("--overwrite").spawn().context("cannot start the renderer")?;
        wait_for_change(&mut film, &files, &stamps)?;
    }
}

/// Returns all files that the film depends on, including missing and unreadable ones.
fn files_of(path: &Path, scene: Option<Scene>) -> Vec<PathBuf> {
    let mut files = vec![path.to_owned(), SceneSettings::path_for(path)];
    files.extend(scene.into_iter().flat_map(|scene| scene.origin.files));
    files
}

fn stamps(files: &[PathBuf]) -> Vec<Stamp> {
    let stamp = |path: &PathBuf| {
        let metadata = std::fs::metadata(path).ok()?;
        Some((metadata.modified().ok()?, metadata.len()))
    };
    files.iter().map(stamp).collect()
}

/// Waits until a file has changed and is no longer being written, then stops the renderer if it still runs.
fn wait_for_change(film: &mut Child, files: &[PathBuf], before: &[Stamp]) -> Result<()> {
    let mut is_told = false;
    let mut last = before.to_vec();
    loop {
        std::thread::sleep(LOOK_EVERY);
        let now = stamps(files);
        if now != before && now == last {
            // Stop the renderer only when the changed files have been written completely.
            let _ = film.kill();
            film.wait().context("cannot stop the renderer")?;
            return Ok(());
        }
        last = now;
        // Print the hint once, when the film is finished.
        if !is_told && film.try_wait().context("cannot watch the renderer")?.is_some() {
            tell!("waiting for changes; Ctrl-C quits");
            is_told = true;
        }
    }
}
