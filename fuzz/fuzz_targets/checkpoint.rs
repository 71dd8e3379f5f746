//! A checkpoint: what is not of this film is refused, and what is of it but damaged ends the film with a message.
//!
//! The first byte says what the rest is: the whole file, its body under a right checksum, all that one stage left, or changes
//! to what it left: two bytes of place, one of value each. Checksums are made right, that of the light tree too, so that what
//! comes after them is met. Most inputs are only read, for that is quick; from 14 on the film is continued as well.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pipeline::Run;
use render2mpeg::job::job_of;
use pipeline::checkpoint::{Checkpoints, path_for};
use render2mpeg::settings::Switch;
use renderer::plan::Plan;
use render2mpeg::{Options, Render, Settings};
use render_core::scene::{self, Scene};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;
use std::time::Duration;

/// As `pipeline/loop/src/checkpoint/file.rs` stores it.
#[derive(Clone, Serialize, Deserialize)]
struct Stored {
    program: String,
    settings: String,
    scene: u32,
    frame: u32,
    parts: Vec<Vec<u8>>,
}

struct Film {
    _folder: tempfile::TempDir,
    scene: Scene,
    settings: Settings,
    plan: Plan,
    /// First bytes of checkpoints: a magic number and the version.
    begin: [u8; 8],
    stored: Stored,
    video: Vec<u8>,
}

const CONFIG: bincode::config::Configuration = bincode::config::standard();
const HEADER: usize = 20;

impl Film {
    /// A film of three frames, killed after the second.
    fn new() -> Self {
        // A stage that panics ends the film with a message: that is no finding. A panic in who called it is.
        std::panic::set_hook(Box::new(|_| ()));
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.glb");
        tests::checkered_room(tests::Moving::Box).write(&path);
        let scene = scene::load(&path).expect("a scene");
        // A film of two frames leaves what one of three has after its second, but for its length.
        let [short, long] = [2, 3].map(|frames| {
            let options = Options {
                output: Some(folder.path().join("film.m2v")),
                frames: Some(frames),
                size: "8x8".parse().ok(),
                vpls: Some(5),
                photons: Some(50),
                bframes: Some(1),
                cache: Some(Switch::On),
                ..Options::default()
            };
            let settings = Settings::new(path.clone(), &scene, &options).expect("settings");
            let plan = Plan::new(&scene, &settings.renderer());
            let job = job_of(&scene, &settings).expect("a scene");
            let checkpoints = Checkpoints::new(&job, Some(Duration::ZERO));
            let mut film = Render::new(&scene, &settings, &plan, &checkpoints).expect("a film");
            film.write_to(&settings.output).expect("a place");
            film.finish(Run::default()).expect("a film");
            let bytes = std::fs::read(path_for(&settings.output)).expect("a checkpoint");
            let (stored, _) =
                bincode::serde::decode_from_slice::<Stored, _>(&bytes[HEADER..], CONFIG).expect("a checkpoint");
            let video = std::fs::read(&settings.output).expect("a video");
            (settings, plan, stored, video, *bytes.first_chunk().expect("a header"))
        });
        let (settings, plan, stored, _, begin) = long;
        let stored = Stored { frame: 1, parts: short.2.parts, ..stored };
        Self { _folder: folder, scene, settings, plan, begin, stored, video: short.3 }
    }

    fn file(&self, body: &[u8]) -> Vec<u8> {
        let mut file = self.begin.to_vec();
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(crc32fast::hash(body).to_le_bytes());
        file.extend(body);
        file
    }
}

/// The light tree's place among the parts.
const TREE: usize = 0;

/// Puts the right length and checksum into the header of a light tree.
fn seal(tree: &mut [u8]) {
    if let Some((header, body)) = tree.split_at_mut_checked(HEADER) {
        header[8..16].copy_from_slice(&(body.len() as u64).to_le_bytes());
        header[16..].copy_from_slice(&crc32fast::hash(body).to_le_bytes());
    }
}

/// Changes bytes of what a stage left.
fn change(part: &mut [u8], changes: &[u8]) {
    if part.is_empty() {
        return;
    }
    for change in changes.chunks_exact(3) {
        let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % part.len();
        part[place] = change[2];
    }
}

fn changed(film: &Film, kind: u8, rest: &[u8]) -> Vec<u8> {
    let mut stored = film.stored.clone();
    let place = usize::from(kind - 2) % stored.parts.len();
    let part = &mut stored.parts[place];
    let edit = |bytes: &mut Vec<u8>| if kind < 8 { *bytes = rest.to_vec() } else { change(bytes, rest) };
    edit(part);
    if place == TREE {
        seal(part);
    }
    film.file(&bincode::serde::encode_to_vec(&stored, CONFIG).expect("bytes"))
}

fuzz_target!(|data: &[u8]| {
    static FILM: OnceLock<Film> = OnceLock::new();
    let film = FILM.get_or_init(Film::new);
    let Some((&kind, rest)) = data.split_first() else { return };
    let file = match kind % 14 {
        0 => rest.to_vec(),
        1 => film.file(rest),
        kind => changed(film, kind, rest),
    };
    let Film { scene, settings, plan, .. } = film;
    std::fs::write(path_for(&settings.output), file).expect("a file");
    let job = job_of(scene, settings).expect("a scene");
    let Ok(checkpoints) = Checkpoints::resume(&job, None) else { return };
    let Ok(mut continued) = Render::new(scene, settings, plan, &checkpoints) else { return };
    if kind % 28 < 14 {
        return;
    }
    std::fs::write(&settings.output, &film.video).expect("a file");
    let _ = continued.write_to(&settings.output).and_then(|()| continued.finish(Run::default()));
});
