//! Pages in Chromium.

use crate::need;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Page after its scripts have run.
pub struct Shown {
    /// Elements of the page as HTML.
    pub dom: String,
    /// Lines that the page wrote to the console.
    pub console: Vec<String>,
}

/// Opens a page in Chromium for one minute of its own clock, which is faster than time. Returns `None` without Chromium.
///
/// # Panics
/// If Chromium fails, or is missing although it is required.
pub fn show(page: &Path, options: &[&str]) -> Option<Shown> {
    let found = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| starts(name));
    let browser = need("chromium", found)?;
    let profile = tempfile::tempdir().expect("a temporary folder");
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--enable-logging=stderr"])
        .args(["--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--virtual-time-budget=60000", "--window-size=1280,1200", "--dump-dom"])
        .args(options)
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(url(page))
        .output()
        .expect("the browser starts");
    assert!(output.status.success(), "{output:?}");
    let log = String::from_utf8_lossy(&output.stderr);
    let console = log.lines().filter(|line| line.contains("CONSOLE")).map(str::to_owned).collect();
    Some(Shown { dom: String::from_utf8_lossy(&output.stdout).into_owned(), console })
}

fn starts(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

fn url(path: &Path) -> String {
    let path: PathBuf = path.canonicalize().expect("a page");
    format!("file://{}", path.display())
}
