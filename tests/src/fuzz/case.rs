//! Test cases, each a function of the seed and its number.

use super::verdict::Verdict;
use super::{Draft, Film, Forger, mutate};
use crate::{Random, sorted_names};
use std::path::{Path, PathBuf};
use std::{fs, io};
use tempfile::TempDir;

/// Interval between cases with checkpoints.
const CHECKPOINTS: u64 = 12;

/// Options of every film.
const ALL: &str = "--output film.m2v --checkpoint off --threads 2";
/// Options of films without an explicit size.
const SMALL: &str = "--size 16x16 --vpls 20 --photons 200";

/// Additional options; the plain film is the most frequent.
const OPTIONS: [&str; 15] = [
    "--frames 2",
    "--frames 2",
    "--frames 2",
    "--frames 2",
    LAYERS,
    "--frames 2 --size 40x24 --vpls 300 --photons 4000",
    "--frames 2 --y4m film.y4m --chunk 1",
    "--frames 3 --bframes 1",
    "--frames 2 --cache off",
    "--frames 2 --samples 2",
    "--frames 2 --lighting all-lights",
    "--frames 2 --thresholds fixed:0.02 --shading full",
    "--frames 2 --importance saliency:1",
    "--frames 2 --run-everything --antialiasing off",
    "--frames 9 --fps 24 --no-motion",
];

/// Options that write every layer of a frame to files.
const LAYERS: &str = "--frames 2 --exr frames --aov direct,indirect,albedo,normal,depth,position,motion,vector,\
    crypto-object,crypto-material,cut-size,threshold,shading";

/// Test case and its result.
#[derive(Clone, Debug)]
pub struct Case {
    /// Number of the case.
    pub number: u64,
    /// Name of the scene, or `checkpoint`.
    pub subject: String,
    /// Names of the changes, in order.
    pub changes: Vec<&'static str>,
    /// Command line of the case.
    pub command: String,
    /// Result of the case.
    pub verdict: Verdict,
}

/// Case with a fault.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Folder with the case's files.
    pub folder: PathBuf,
    /// Description of the fault.
    pub fault: String,
}

/// Makes cases and runs them.
#[derive(Debug)]
pub struct Fuzzer {
    seeds: Vec<Draft>,
    seed: u64,
    work: TempDir,
    forger: Option<Forger>,
}

impl Fuzzer {
    /// Creates cases from `seeds`, which must not be empty.
    pub fn new(seeds: Vec<Draft>, seed: u64) -> io::Result<Self> {
        assert!(!seeds.is_empty(), "cases begin with a scene");
        Ok(Self { seeds, seed, work: tempfile::tempdir()?, forger: None })
    }

    /// Runs one case.
    pub fn run(&mut self, number: u64) -> io::Result<Case> {
        let mut random = random_of(self.seed, number);
        if number % CHECKPOINTS == CHECKPOINTS - 1 {
            self.run_checkpoint(number, &mut random)
        } else {
            self.run_scene(number, &mut random)
        }
    }

    /// Changes a scene, and renders it if it loads.
    fn run_scene(&self, number: u64, random: &mut Random) -> io::Result<Case> {
        // Change a random scene, and render it with random options.
        let mut draft = random.pick(&self.seeds).clone();
        let changes = mutate(&mut draft, random);
        let mut film = Film::new(&self.work.path().join("case"))?;
        let name = draft.write(&film.scene(), random)?;
        let options = *random.pick(&OPTIONS);
        let quiet = if random.one_in(4) { "" } else { "--quiet" };
        let small = if options.contains("--size") { "" } else { SMALL };
        let words = format!("render ../scene/{name} {ALL} {small} {options} {quiet}");
        film.arguments = words.split_whitespace().map(str::to_owned).collect();

        // List the outputs that the options promise, in order of their names.
        let mut outputs = vec!["film.m2v", "film.report.json"];
        outputs.extend(options.contains("--y4m").then_some("film.y4m"));
        outputs.extend((options == LAYERS).then_some("frames"));
        let before = sorted_names(&film.scene());
        let mut verdict = Verdict::of(&film, &film.run()?, &before, &outputs);
        // Render some films again, to compare numbers of threads.
        if verdict == Verdict::Rendered && random.one_in(3) {
            verdict = again_on_one_thread(&mut film)?;
        }
        Ok(Case { number, subject: draft.name, changes, command: film.command(), verdict })
    }

    /// Changes a checkpoint, and continues the film if the checkpoint is accepted.
    fn run_checkpoint(&mut self, number: u64, random: &mut Random) -> io::Result<Case> {
        let forger = match &mut self.forger {
            Some(forger) => forger,
            empty => empty.insert(Forger::new(&self.work.path().join("forged"))?),
        };
        let (changes, verdict) = forger.run(random)?;
        Ok(Case { number, subject: "checkpoint".into(), changes, command: forger.film().command(), verdict })
    }

    /// Writes the files of the last case below `folder`, with a text that describes it.
    pub fn keep(&self, case: &Case, folder: &Path) -> io::Result<Option<Finding>> {
        let Verdict::Fault(fault) = &case.verdict else { return Ok(None) };
        let folder = folder.join(format!("seed-{}-case-{}", self.seed, case.number));
        let name = if case.subject == "checkpoint" { "forged" } else { "case" };
        copy(&self.work.path().join(name), &folder)?;
        let Case { subject, changes, command, .. } = case;
        let text = format!("from: {subject}\nchanges: {}\ncommand: {command}\n{fault}\n", changes.join(", "));
        fs::write(folder.join("finding.txt"), text)?;
        Ok(Some(Finding { folder, fault: fault.clone() }))
    }
}

/// Renders the film again on one thread, which must produce the same bytes.
fn again_on_one_thread(film: &mut Film) -> io::Result<Verdict> {
    let first = fs::read(film.out().join("film.m2v"))?;
    film.clear()?;
    // Replace the number of threads in the command.
    if let Some(place) = film.arguments.iter().position(|argument| argument == "--threads") {
        film.arguments[place + 1] = "1".into();
    }
    let outcome = film.run()?;
    let second = fs::read(film.out().join("film.m2v")).unwrap_or_default();
    let fault = || format!("another film on one thread: exit code {:?}", outcome.code);
    Ok(if first == second { Verdict::Rendered } else { Verdict::Fault(fault()) })
}

/// Seeds the generator of a case; generators of consecutive cases are uncorrelated (splitmix64).
fn random_of(seed: u64, number: u64) -> Random {
    let mut bits = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ number.wrapping_mul(0xd134_2543_de82_ef95);
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    Random::new((bits ^ bits >> 31).max(1))
}

/// Copies a folder recursively.
fn copy(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}
