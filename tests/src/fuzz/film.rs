//! One run of the program, within bounds.

use crate::program;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Addresses that a run may take \[KiB\].
const MEMORY: u32 = 2_000_000;
/// Processor time that it may take \[s\].
const PROCESSOR: u32 = 20;
/// Largest file that it may write \[blocks of 512 bytes\].
const FILE: u32 = 200_000;
/// A run that waits for ever takes no processor time.
const LONGEST: Duration = Duration::from_secs(120);

/// Folders of one case: a scene, an output, and one for files that are not to last.
#[derive(Debug)]
pub struct Film {
    /// The folder around the others.
    pub folder: PathBuf,
    /// Arguments of the program; it runs in the folder of the output.
    pub arguments: Vec<String>,
}

/// How a run ended.
#[derive(Debug)]
pub struct Outcome {
    /// Exit code; none when a signal ended it.
    pub code: Option<i32>,
    /// The signal, if there was one.
    pub signal: Option<i32>,
    /// Whether it had to be ended, for it did not end by itself.
    pub endless: bool,
    /// All of standard error, as bytes.
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

    /// Where the scene lies.
    pub fn scene(&self) -> PathBuf {
        self.folder.join("scene")
    }

    /// Where the film goes.
    pub fn out(&self) -> PathBuf {
        self.folder.join("out")
    }

    /// Whether the program is to say nothing but errors.
    pub fn is_quiet(&self) -> bool {
        self.arguments.iter().any(|argument| argument == "--quiet")
    }

    /// Removes what the run before has written.
    pub fn clear(&self) -> io::Result<()> {
        fs::remove_dir_all(self.out())?;
        fs::create_dir(self.out())
    }

    /// The command as it is typed in the folder of the output.
    pub fn command(&self) -> String {
        format!("ulimit -v {MEMORY}; ulimit -t {PROCESSOR}; render2mpeg {}", self.arguments.join(" "))
    }

    /// Runs the program, and waits.
    pub fn run(&self) -> io::Result<Outcome> {
        // Standard error goes to a file, so that nobody has to read it meanwhile.
        let told = self.folder.join("stderr");
        let script =
            format!("ulimit -c 0; ulimit -v {MEMORY}; ulimit -t {PROCESSOR}; ulimit -f {FILE}; exec \"$0\" \"$@\"");
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]).arg(program()).args(&self.arguments).current_dir(self.out());
        shell.env("TMPDIR", self.folder.join("tmp")).env_remove("RUST_BACKTRACE");
        shell.stdin(Stdio::null()).stdout(Stdio::null()).stderr(File::create(&told)?);
        let mut child = shell.spawn()?;

        // Short waits at first: most runs take some hundredths of a second.
        let begin = Instant::now();
        let mut status: Option<ExitStatus> = child.try_wait()?;
        while status.is_none() && begin.elapsed() < LONGEST {
            std::thread::sleep(Duration::from_millis(if begin.elapsed().as_millis() < 200 { 2 } else { 20 }));
            status = child.try_wait()?;
        }
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

/// The signal that ended a process; there are none on other systems.
#[cfg(unix)]
fn signal_of(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal_of(_: ExitStatus) -> Option<i32> {
    None
}
