//! One run of the program with limited resources.

use crate::program;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Maximum address space of a run \[KiB\].
const MEMORY: u32 = 2_000_000;
/// Maximum CPU time of a run \[s\].
const PROCESSOR: u32 = 20;
/// Maximum size of a written file \[blocks of 512 bytes\].
const FILE: u32 = 200_000;
/// Maximum wall-clock time of a run: one that waits forever uses no CPU time.
const LONGEST: Duration = Duration::from_secs(120);

/// Folders of one case: scene, output and temporary files.
#[derive(Debug)]
pub struct Film {
    /// Folder that contains the other three.
    pub folder: PathBuf,
    /// Arguments of the program, which runs in the output folder.
    pub arguments: Vec<String>,
}

/// End of a run.
#[derive(Debug)]
pub struct Outcome {
    /// Exit code; none if a signal ended the run.
    pub code: Option<i32>,
    /// Signal that ended the run, if any.
    pub signal: Option<i32>,
    /// Whether the run exceeded its time and was killed.
    pub endless: bool,
    /// Standard error, as bytes.
    pub stderr: Vec<u8>,
}

impl Film {
    /// Empties the folders of a case.
    pub fn new(folder: &Path) -> io::Result<Self> {
        if folder.exists() {
            fs::remove_dir_all(folder)?;
        }
        for name in ["scene", "out", "tmp"] {
            fs::create_dir_all(folder.join(name))?;
        }
        Ok(Self { folder: folder.to_owned(), arguments: Vec::new() })
    }

    /// Returns the folder of the scene.
    pub fn scene(&self) -> PathBuf {
        self.folder.join("scene")
    }

    /// Returns the folder of the film.
    pub fn out(&self) -> PathBuf {
        self.folder.join("out")
    }

    /// Returns whether the program runs with `--quiet`.
    pub fn is_quiet(&self) -> bool {
        self.arguments.iter().any(|argument| argument == "--quiet")
    }

    /// Removes the output of the previous run.
    pub fn clear(&self) -> io::Result<()> {
        fs::remove_dir_all(self.out())?;
        fs::create_dir(self.out())
    }

    /// Returns the command line, to be run in the output folder.
    pub fn command(&self) -> String {
        format!("ulimit -v {MEMORY}; ulimit -t {PROCESSOR}; render2mpeg {}", self.arguments.join(" "))
    }

    /// Runs the program, and waits for its end.
    pub fn run(&self) -> io::Result<Outcome> {
        // Redirect standard error to a file, so that no thread has to read it during the run.
        let told = self.folder.join("stderr");
        let script =
            format!("ulimit -c 0; ulimit -v {MEMORY}; ulimit -t {PROCESSOR}; ulimit -f {FILE}; exec \"$0\" \"$@\"");
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]).arg(program()).args(&self.arguments).current_dir(self.out());
        shell.env("TMPDIR", self.folder.join("tmp")).env_remove("RUST_BACKTRACE");
        shell.stdin(Stdio::null()).stdout(Stdio::null()).stderr(File::create(&told)?);
        let mut child = shell.spawn()?;

        // Poll at short intervals first, because most runs take a few hundredths of a second.
        let begin = Instant::now();
        let mut status: Option<ExitStatus> = child.try_wait()?;
        while status.is_none() && begin.elapsed() < LONGEST {
            std::thread::sleep(Duration::from_millis(if begin.elapsed().as_millis() < 200 { 2 } else { 20 }));
            status = child.try_wait()?;
        }
        // Kill a run that exceeds its time.
        let endless = status.is_none();
        if endless {
            child.kill()?;
        }
        let status = child.wait()?;
        let stderr = fs::read(&told)?;
        fs::remove_file(&told)?;
        Ok(Outcome { code: status.code(), signal: signal_of(status), endless, stderr })
    }
}

/// Returns the signal that ended a process; other systems have none.
#[cfg(unix)]
fn signal_of(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal_of(_: ExitStatus) -> Option<i32> {
    None
}
