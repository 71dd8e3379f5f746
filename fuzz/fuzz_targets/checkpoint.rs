//! A checkpoint: what is not of this film is refused, and what is of it but damaged ends the film with a message.
//!
//! The first byte says what the rest is: the whole file, its body under a right checksum, all that one stage left, or changes
//! to what it left: two bytes of place, one of value each.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pipeline::checkpoint::{Checkpoints, path_for};
use pipeline::settings::Switch;
use pipeline::{Plan, Settings, Wishes, render_from};
use render_core::scene::{self, Scene};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// As `pipeline/src/checkpoint/file.rs` stores it.
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
    stored: Stored,
    video: Vec<u8>,
}

const CONFIG: bincode::config::Configuration = bincode::config::standard();
const HEADER: usize = 20;

impl Film {
    /// A film of two frames with a checkpoint after each, killed when it was done.
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.glb");
        tests::checkered_room(tests::Moving::Box).write(&path);
        let scene = scene::load(&path).expect("a scene");
        let wishes = Wishes {
            output: Some(folder.path().join("film.m2v")),
            frames: Some(3),
            size: "16x16".parse().ok(),
            vpls: Some(20),
            photons: Some(200),
            bframes: Some(1),
            cache: Some(Switch::On),
            ..Wishes::default()
        };
        let settings = Settings::new(path, &scene, wishes).expect("settings");
        let plan = Plan::new(&scene, &settings);
        let checkpoints = Checkpoints::new(&settings, &plan, Some(Duration::ZERO)).expect("a place");
        let output = checkpoints.output(&settings).expect("a place");
        let stop = AtomicBool::new(false);
        render_from(&checkpoints, &scene, &settings, &plan, output, &stop, &()).expect("a film");
        let bytes = std::fs::read(path_for(&settings.output)).expect("a checkpoint");
        let (stored, _) = bincode::serde::decode_from_slice(&bytes[HEADER..], CONFIG).expect("a checkpoint");
        let video = std::fs::read(&settings.output).expect("a video");
        Self { _folder: folder, scene, settings, stored, video }
    }

    fn file(body: &[u8]) -> Vec<u8> {
        let mut file = b"R2MC\x01\0\0\0".to_vec();
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(crc32fast::hash(body).to_le_bytes());
        file.extend(body);
        file
    }
}

fuzz_target!(|data: &[u8]| {
    static FILM: OnceLock<Film> = OnceLock::new();
    let film = FILM.get_or_init(Film::new);
    let Some((&kind, rest)) = data.split_first() else { return };
    let file = match kind % 14 {
        0 => rest.to_vec(),
        1 => Film::file(rest),
        kind => {
            let mut stored = film.stored.clone();
            // The last frame would leave nothing to be done.
            stored.frame = 1;
            let part = &mut stored.parts[usize::from(kind - 2) % 6];
            if kind < 8 {
                *part = rest.to_vec();
            } else if !part.is_empty() {
                for change in rest.chunks_exact(3) {
                    let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % part.len();
                    part[place] = change[2];
                }
            }
            Film::file(&bincode::serde::encode_to_vec(&stored, CONFIG).expect("bytes"))
        }
    };
    let Film { scene, settings, .. } = film;
    std::fs::write(path_for(&settings.output), file).expect("a file");
    std::fs::write(&settings.output, &film.video).expect("a file");
    let plan = Plan::new(scene, settings);
    let Ok(checkpoints) = Checkpoints::resume(settings, &plan, None) else { return };
    let Ok(output) = checkpoints.output(settings) else { return };
    let _ = render_from(&checkpoints, scene, settings, &plan, output, &AtomicBool::new(false), &());
});
