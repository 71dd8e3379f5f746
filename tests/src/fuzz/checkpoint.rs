//! Checkpoints of a film that was killed, changed so that their check sums are right or not.

use super::verdict::{Verdict, told};
use super::{Film, Outcome};
use crate::{Moving, Random, checkered_room};
use pipeline::Run;
use pipeline::checkpoint::{Checkpoints, path_for};
use render_core::scene;
use render2mpeg::job::job_of;
use render2mpeg::{Options, Render, Settings};
use renderer::plan::Plan;
use std::path::Path;
use std::time::Duration;
use std::{fs, io};

/// As `pipeline/loop/src/checkpoint/file.rs` stores it: the job, the last frame that is done, the states of the parts.
type Stored = ((String, String, u32), u32, Vec<Vec<u8>>);

const CONFIG: bincode::config::Configuration = bincode::config::standard();
const HEADER: usize = 20;
/// The place of `Part::Prepare`, the light tree: it has a header with a check sum of its own.
const TREE: usize = 0;

/// What continues the film.
const COMMAND: &str = "--frames 3 --size 8x8 --vpls 5 --photons 50 --bframes 1 --cache on --resume --quiet --threads 2";

/// A film of three frames that was killed after its second.
#[derive(Debug)]
pub struct Forger {
    film: Film,
    /// Header of checkpoints: a magic number and the version.
    begin: [u8; 8],
    stored: Stored,
    /// The film as it was left.
    part: Vec<u8>,
    /// The film that it has to become.
    truth: Vec<u8>,
}

/// A changed checkpoint.
struct Forged {
    name: &'static str,
    file: Vec<u8>,
    part: Vec<u8>,
    /// Whether the program can tell: the sums are wrong, or it is of another film.
    is_noticed: bool,
}

impl Forger {
    /// Makes the film in `folder`.
    ///
    /// # Panics
    /// If it cannot be made, or does not go on to the same bits before anything is changed.
    pub fn new(folder: &Path) -> io::Result<Self> {
        let mut film = Film::new(folder)?;
        let path = film.scene().join("scene.glb");
        checkered_room(Moving::Box).write(&path);
        let output = film.out().join("film.m2v");
        let words = format!("render {} --output {} {COMMAND}", path.display(), output.display());
        film.arguments = words.split_whitespace().map(str::to_owned).collect();

        // A film of two frames leaves what one of three has after its second, but for its length.
        let scene = scene::load(&path).expect("a scene");
        let [short, long] = [2, 3].map(|frames| {
            let options = Options {
                output: Some(output.clone()),
                frames: Some(frames),
                size: "8x8".parse().ok(),
                vpls: Some(5),
                photons: Some(50),
                bframes: Some(1),
                ..Options::default()
            };
            let settings = Settings::new(path.clone(), &scene, &options).expect("settings");
            let plan = Plan::new(&scene, &settings.renderer());
            let job = job_of(&scene, &settings).expect("a job");
            let checkpoints = Checkpoints::new(&job, Some(Duration::ZERO));
            let mut film = Render::new(&scene, &settings, &plan, &checkpoints).expect("a film");
            film.write_to(&output).and_then(|()| film.finish(Run::default())).expect("a film");
            let bytes = fs::read(path_for(&output)).expect("a checkpoint");
            let (stored, _) = bincode::serde::decode_from_slice::<Stored, _>(&bytes[HEADER..], CONFIG).expect("a body");
            (stored, fs::read(&output).expect("a film"), *bytes.first_chunk().expect("a header"))
        });
        let ((job, ..), truth, begin) = long;
        let forger = Self { film, begin, stored: (job, 1, short.0.2), part: short.1, truth };

        // What nobody changed goes on.
        let file = forger.file(&forger.stored);
        let whole = Forged { name: "nothing", file, part: forger.part.clone(), is_noticed: true };
        let verdict = forger.continue_from(&whole)?;
        assert_eq!(verdict, Verdict::Rendered, "the film itself goes on");
        Ok(forger)
    }

    /// The film.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Changes the checkpoint, and continues from it.
    pub fn run(&self, random: &mut Random) -> io::Result<(Vec<&'static str>, Verdict)> {
        let forged = self.forged(random);
        Ok((vec![forged.name], self.continue_from(&forged)?))
    }

    /// The file of a checkpoint, with right sums.
    fn file(&self, stored: &Stored) -> Vec<u8> {
        self.sealed(&bincode::serde::encode_to_vec(stored, CONFIG).expect("bytes"))
    }

    /// The file with this body.
    fn sealed(&self, body: &[u8]) -> Vec<u8> {
        let mut file = self.begin.to_vec();
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(crc32fast::hash(body).to_le_bytes());
        file.extend(body);
        file
    }

    /// A changed checkpoint, or a changed film beside it.
    fn forged(&self, random: &mut Random) -> Forged {
        let (mut stored, mut part) = (self.stored.clone(), self.part.clone());
        let whole = self.file(&stored);
        let (name, file, is_noticed) = match random.below(12) {
            0 => ("bytes", changed(&whole, random), true),
            1 => ("cut", whole[..random.below(whole.len())].to_vec(), true),
            2 => {
                let mut file = whole;
                file[random.below(HEADER)] ^= 1 << random.below(8);
                ("header", file, true)
            }
            3 => ("body", self.sealed(&changed(&whole[HEADER..], random)), false),
            4 => {
                let (program, settings, inputs) = &mut stored.0;
                match random.below(3) {
                    0 => program.push(' '),
                    1 => *settings = settings.replacen(['1', '2', '5', '8'], "3", 1),
                    _ => *inputs ^= 1 << random.below(32),
                }
                ("job", self.file(&stored), true)
            }
            5 => {
                stored.1 = *random.pick(&[0, 2, 3, 1000, u32::MAX]);
                ("frame", self.file(&stored), false)
            }
            6 => {
                let places = [random.below(stored.2.len()), random.below(stored.2.len())];
                stored.2.swap(places[0], places[1]);
                ("states change places", self.file(&stored), false)
            }
            7 => {
                // The film was cut or has other bytes: what stands in it was summed up.
                let place = random.below(part.len() / 2);
                if random.one_in(2) {
                    part.truncate(place)
                } else {
                    part[place] ^= 1 << random.below(8)
                }
                ("film", whole, true)
            }
            _ => {
                let place = random.below(stored.2.len());
                let state = &mut stored.2[place];
                change_state(state, random);
                if place == TREE {
                    seal(state);
                }
                ("state", self.file(&stored), false)
            }
        };
        Forged { name, file, part, is_noticed }
    }

    /// Puts the checkpoint beside what there was of the film, runs, and judges.
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
            // Where states are others and all sums are right, no program can know the true film.
            (true, Ok(film)) if film == self.truth || (!is_noticed && !film.is_empty()) => Ok(Verdict::Rendered),
            (true, Ok(_)) => Err("another film at exit code 0".into()),
            (true, Err(error)) => Err(format!("no film: {error}")),
            (false, Ok(_)) => Err("a film in spite of an error".into()),
            (false, Err(_)) => Ok(Verdict::Refused),
        }
    }
}

/// Other bytes at one to four places.
fn changed(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let place = random.below(bytes.len());
        bytes[place] ^= 1 + random.below(255) as u8;
    }
    bytes
}

/// Changes what a stage left.
fn change_state(state: &mut Vec<u8>, random: &mut Random) {
    match random.below(8) {
        0 => state.clear(),
        1 => state.truncate(random.below(state.len() + 1)),
        2 => state.extend((0..=random.below(40)).map(|_| 0)),
        3 => state.fill(255),
        4 => {
            // Floats that are no numbers, or large; lengths and indices that are.
            let bytes = random.pick(&[f32::NAN, f32::INFINITY, 1e30, -1.0]).to_le_bytes();
            let place = random.below(state.len().max(4)).min(state.len().saturating_sub(4));
            state.iter_mut().skip(place).zip(bytes).for_each(|(old, new)| *old = new);
        }
        _ if state.is_empty() => state.push(1),
        _ => *state = changed(state, random),
    }
}

/// Puts the right length and check sum into the header of a light tree.
fn seal(tree: &mut [u8]) {
    if let Some((header, body)) = tree.split_at_mut_checked(HEADER) {
        header[8..16].copy_from_slice(&(body.len() as u64).to_le_bytes());
        header[16..].copy_from_slice(&crc32fast::hash(body).to_le_bytes());
    }
}
