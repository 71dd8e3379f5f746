//! Checkpoints of a killed run, changed with and without valid checksums.

use super::verdict::{Verdict, told};
use super::{Film, Outcome};
use crate::killed::{HEADER, KilledFilm, TREE, seal_tree};
use crate::{Moving, Random, checkered_room};
use render2mpeg::Options;
use std::path::Path;
use std::{fs, io};

/// Options that continue the film.
const COMMAND: &str = "--frames 3 --size 8x8 --vpls 5 --photons 50 --bframes 1 --cache on --resume --quiet --threads 2";

/// Files of a killed run, and the program that continues it.
#[derive(Debug)]
pub struct Forger {
    film: Film,
    killed: KilledFilm,
}

/// Changed checkpoint.
struct Forged {
    name: &'static str,
    file: Vec<u8>,
    part: Vec<u8>,
    /// Whether the program can detect the change: the checksums are wrong, or the checkpoint belongs to another film.
    is_noticed: bool,
}

impl Forger {
    /// Renders the film in `folder`.
    ///
    /// # Panics
    /// If the film cannot be rendered, or the unchanged checkpoint does not lead to the same bits.
    pub fn new(folder: &Path) -> io::Result<Self> {
        // Write the scene, and the command that continues its film.
        let mut film = Film::new(folder)?;
        let path = film.scene().join("scene.glb");
        checkered_room(Moving::Box).write(&path);
        let output = film.out().join("film.m2v");
        let words = format!("render {} --output {} {COMMAND}", path.display(), output.display());
        film.arguments = words.split_whitespace().map(str::to_owned).collect();

        // Render a film with the same settings, and keep its checkpoint.
        let options = Options {
            output: Some(output),
            size: "8x8".parse().ok(),
            vpls: Some(5),
            photons: Some(50),
            bframes: Some(1),
            ..Options::default()
        };
        let forger = Self { film, killed: KilledFilm::new(&path, &options) };

        // Check that the unchanged checkpoint continues the film.
        let KilledFilm { stored, part, .. } = &forger.killed;
        let file = forger.killed.file(stored);
        let whole = Forged { name: "nothing", file, part: part.clone(), is_noticed: true };
        let verdict = forger.continue_from(&whole)?;
        assert_eq!(verdict, Verdict::Rendered, "the unchanged film is continued");
        Ok(forger)
    }

    /// Returns the film.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Changes the checkpoint, and continues from it.
    pub fn run(&self, random: &mut Random) -> io::Result<(Vec<&'static str>, Verdict)> {
        let forged = self.forged(random);
        Ok((vec![forged.name], self.continue_from(&forged)?))
    }

    /// Returns a changed checkpoint, or a changed film with the original checkpoint.
    fn forged(&self, random: &mut Random) -> Forged {
        let killed = &self.killed;
        let (mut stored, mut part) = (killed.stored.clone(), killed.part.clone());
        let whole = killed.file(&stored);
        let (name, file, is_noticed) = match random.below(12) {
            // Change the file.
            0 => ("bytes", changed(&whole, random), true),
            1 => ("cut", whole[..random.below(whole.len())].to_vec(), true),
            2 => {
                let mut file = whole;
                file[random.below(HEADER)] ^= 1 << random.below(8);
                ("header", file, true)
            }
            // Change the content, with a valid checksum.
            3 => ("body", killed.sealed(&changed(&whole[HEADER..], random)), false),
            4 => {
                // Change the job: program, settings or inputs.
                let (program, settings, inputs) = &mut stored.0;
                match random.below(3) {
                    0 => program.push(' '),
                    1 => *settings = settings.replacen(['1', '2', '5', '8'], "3", 1),
                    _ => *inputs ^= 1 << random.below(32),
                }
                ("job", killed.file(&stored), true)
            }
            5 => {
                stored.1 = *random.pick(&[None, Some(0), Some(2), Some(3), Some(1000), Some(u32::MAX)]);
                ("frame", killed.file(&stored), false)
            }
            6 => {
                let places = [random.below(stored.2.len()), random.below(stored.2.len())];
                stored.2.swap(places[0], places[1]);
                ("states change places", killed.file(&stored), false)
            }
            7 => {
                // Truncate the film or flip one of its bits: the checkpoint has a checksum of it.
                let place = random.below(part.len() / 2);
                if random.one_in(2) {
                    part.truncate(place)
                } else {
                    part[place] ^= 1 << random.below(8)
                }
                ("film", whole, true)
            }
            // Change the state of a stage, with valid checksums.
            _ => {
                let place = random.below(stored.2.len());
                let state = &mut stored.2[place];
                change_state(state, random);
                if place == TREE {
                    seal_tree(state);
                }
                ("state", killed.file(&stored), false)
            }
        };
        Forged { name, file, part, is_noticed }
    }

    /// Writes the checkpoint and the unfinished film, runs the program, and judges the run.
    fn continue_from(&self, forged: &Forged) -> io::Result<Verdict> {
        let out = self.film.out();
        self.film.clear()?;
        fs::write(out.join("film.m2v.part"), &forged.part)?;
        fs::write(out.join("film.m2v.checkpoint"), &forged.file)?;
        let outcome = self.film.run()?;
        Ok(self.judged(&outcome, forged.is_noticed).unwrap_or_else(Verdict::Fault))
    }

    fn judged(&self, outcome: &Outcome, is_noticed: bool) -> Result<Verdict, String> {
        let film = fs::read(self.film.out().join("film.m2v"));
        match (told(outcome, true)?, film) {
            // If the states differ and every checksum is valid, no program can detect the change.
            (true, Ok(film)) if film == self.killed.truth || (!is_noticed && !film.is_empty()) => Ok(Verdict::Rendered),
            (true, Ok(_)) => Err("another film at exit code 0".into()),
            (true, Err(error)) => Err(format!("no film: {error}")),
            (false, Ok(_)) => Err("a film in spite of an error".into()),
            (false, Err(_)) => Ok(Verdict::Refused),
        }
    }
}

/// Changes one to four bytes.
fn changed(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let place = random.below(bytes.len());
        bytes[place] ^= 1 + random.below(255) as u8;
    }
    bytes
}

/// Changes the state of a stage.
fn change_state(state: &mut Vec<u8>, random: &mut Random) {
    match random.below(8) {
        0 => state.clear(),
        1 => state.truncate(random.below(state.len() + 1)),
        2 => state.extend((0..=random.below(40)).map(|_| 0)),
        3 => state.fill(255),
        4 => {
            // Write NaN, infinite or large floats, which are also large lengths and indices.
            let bytes = random.pick(&[f32::NAN, f32::INFINITY, 1e30, -1.0]).to_le_bytes();
            let place = random.below(state.len().max(4)).min(state.len().saturating_sub(4));
            for (old, new) in state.iter_mut().skip(place).zip(bytes) {
                *old = new;
            }
        }
        _ if state.is_empty() => state.push(1),
        _ => *state = changed(state, random),
    }
}
