//! Changes scenes and checkpoints by their structure, and reports rules that the program breaks:
//!
//! ```sh
//! cargo run -p tests --example fuzz_scenes -- --minutes 10
//! cargo run -p tests --example fuzz_scenes -- --seed 7 --case 123       # one case again, and keep its files
//! ```
//!
//! `tests/fuzz/README.md` lists the rules. With findings, the exit code is 1.

mod arguments;

use arguments::Arguments;
use std::io;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};
use tests::fuzz::{Case, Fuzzer, Verdict, own_seeds, seeds_below};
use tests::shared_scenes;

/// Interval between summaries.
const SUMMARY: Duration = Duration::from_secs(30);

/// Cases of each kind so far.
#[derive(Default)]
struct Counts {
    cases: u64,
    refused: u64,
    rendered: u64,
    findings: u64,
}

impl Counts {
    /// Counts a case.
    fn add(&mut self, case: &Case) {
        self.cases += 1;
        match case.verdict {
            Verdict::Rendered => self.rendered += 1,
            Verdict::Refused => self.refused += 1,
            Verdict::Fault(_) => self.findings += 1,
        }
    }

    /// Prints the counts in one line.
    fn say(&self, begin: Instant) {
        let Self { cases, refused, rendered, findings } = self;
        let seconds = begin.elapsed().as_secs();
        println!("{seconds} s: {cases} cases, {refused} refused, {rendered} rendered, {findings} findings");
    }
}

fn main() -> ExitCode {
    let arguments = match Arguments::parse(std::env::args().skip(1)) {
        Ok(arguments) => arguments,
        Err(problem) => {
            eprintln!("fuzz_scenes: {problem}\nusage: fuzz_scenes [--minutes M] [--seed N] [--keep DIR] [--case K]");
            return ExitCode::from(2);
        }
    };
    match fuzz(&arguments) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("fuzz_scenes: {error}");
            ExitCode::from(2)
        }
    }
}

/// Runs cases until the time is over, or the requested case. Returns the number of findings.
fn fuzz(arguments: &Arguments) -> io::Result<u64> {
    build_program()?;
    // Seeds: the tests' scenes, the shipped ones, test data, and third-party scenes.
    let mut seeds = own_seeds();
    seeds.extend(seeds_below(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes").as_ref()));
    seeds.extend(seeds_below(concat!(env!("CARGO_MANIFEST_DIR"), "/../render-core/tests/data").as_ref()));
    seeds.extend(shared_scenes().iter().flat_map(|folder| seeds_below(folder)));
    let names: Vec<&str> = seeds.iter().map(|seed| seed.name.as_str()).collect();
    println!("seed {}, {} scenes to begin with: {}", arguments.seed, seeds.len(), names.join(", "));
    let mut fuzzer = Fuzzer::new(seeds, arguments.seed)?;

    // Cases run one after the other, as each has several threads.
    let (begin, mut said, mut counts) = (Instant::now(), Instant::now(), Counts::default());
    let (first, most) = arguments.case.map_or((0, u64::MAX), |case| (case, 1));
    for number in (first..).take(usize::try_from(most).unwrap_or(usize::MAX)) {
        let case = fuzzer.run(number)?;
        counts.add(&case);
        if let Some(finding) = fuzzer.keep(&case, &arguments.keep)? {
            println!("case {number}, {}: {}", finding.folder.display(), finding.fault.trim_end());
        }
        if arguments.case.is_some() {
            println!("{} by {:?}: {:?}", case.subject, case.changes, case.verdict);
        }
        if said.elapsed() >= SUMMARY {
            said = Instant::now();
            counts.say(begin);
        }
        if begin.elapsed() >= arguments.time {
            break;
        }
    }
    counts.say(begin);
    Ok(counts.findings)
}

/// Builds the tests' program with the profile of this one, if Cargo runs this one.
fn build_program() -> io::Result<()> {
    let Some(cargo) = std::env::var_os("CARGO") else { return Ok(()) };
    let mut build = Command::new(cargo);
    build.args(["build", "--quiet", "-p", "tests", "--bins"]);
    if !cfg!(debug_assertions) {
        build.arg("--release");
    }
    if build.status()?.success() { Ok(()) } else { Err(io::Error::other("the program of the tests cannot be built")) }
}
