//! Checkpoints whose check sums are right and whose parts are not of the film: a line and no panic.

use pipeline::checkpoint::{Checkpoints, path_for};
use pipeline::{Plan, Settings, Wishes, render_from};
use render_core::scene::{self, Scene};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tempfile::TempDir;
use tests::{Moving, checkered_room};

/// As `pipeline/src/checkpoint/file.rs` stores it: the job, the last frame that is done, what the stages left.
type Stored = ((String, String, u32), u32, Vec<Vec<u8>>);

const CONFIG: bincode::config::Configuration = bincode::config::standard();
const HEADER: usize = 20;
/// The place of `Part::Shade`.
const SHADE: usize = 1;

struct Film {
    _folder: TempDir,
    scene: Scene,
    settings: Settings,
    plan: Plan,
}

impl Film {
    /// Three frames, lit by so many anchor lights, with a checkpoint after each.
    fn new(vpls: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.glb");
        checkered_room(Moving::Box).write(&path);
        let scene = scene::load(&path).unwrap();
        let wishes = Wishes {
            output: Some(folder.path().join("film.m2v")),
            frames: Some(3),
            size: "16x16".parse().ok(),
            vpls: Some(vpls),
            photons: Some(1000),
            ..Wishes::default()
        };
        let settings = Settings::new(path, &scene, wishes).unwrap();
        let plan = Plan::new(&scene, &settings);
        let film = Self { _folder: folder, scene, settings, plan };
        film.run(&Checkpoints::new(&film.settings, &film.plan, Some(Duration::ZERO)).unwrap()).unwrap();
        film
    }

    fn run(&self, checkpoints: &Checkpoints) -> Result<(), String> {
        let Self { scene, settings, plan, .. } = self;
        let film = || {
            let output = checkpoints.output(settings)?;
            render_from(checkpoints, scene, settings, plan, output, &AtomicBool::new(false), &())
        };
        film().map(|_| ()).map_err(|error| format!("{error:#}"))
    }

    /// The checkpoint behind the last frame but one.
    fn stored(&self) -> Stored {
        let bytes = std::fs::read(path_for(&self.settings.output)).unwrap();
        let (mut stored, _): (Stored, _) = bincode::serde::decode_from_slice(&bytes[HEADER..], CONFIG).unwrap();
        stored.1 = 1;
        stored
    }

    /// Goes on from what is said to have been stored.
    fn go_on(&self, stored: &Stored) -> Result<(), String> {
        let body = bincode::serde::encode_to_vec(stored, CONFIG).unwrap();
        let mut file = b"R2MC\x01\0\0\0".to_vec();
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(crc32fast::hash(&body).to_le_bytes());
        file.extend(body);
        std::fs::write(path_for(&self.settings.output), file).unwrap();
        let checkpoints =
            Checkpoints::resume(&self.settings, &self.plan, None).map_err(|error| format!("{error:#}"))?;
        self.run(&checkpoints)
    }
}

/// The records of a film with more lights: their cuts were looked up among lights that are not there.
#[test]
fn records_of_lights_that_are_not_there_are_refused() {
    let (few, many) = (Film::new(10), Film::new(300));
    let mut stored = few.stored();
    few.go_on(&stored).expect("its own goes on");
    stored.2[SHADE] = many.stored().2[SHADE].clone();
    let error = few.go_on(&stored).unwrap_err();
    assert!(error.contains("makes no sense") && error.lines().count() == 1, "{error}");
}

/// What no stage can read is refused before the film is cut to the length that it had.
#[test]
fn a_part_that_cannot_be_read_leaves_the_film_as_it_is() {
    let film = Film::new(10);
    let before = std::fs::read(&film.settings.output).unwrap();
    let whole = film.stored();
    for part in 0..whole.2.len() {
        // One that is missing had the other stages wait for ever.
        for forged in [vec![255; 40], Vec::new()] {
            let mut stored = whole.clone();
            stored.2[part] = forged;
            let error = film.go_on(&stored).unwrap_err();
            assert!(error.lines().count() == 1, "{error}");
            assert!(std::fs::read(&film.settings.output).unwrap() == before, "part {part}");
        }
    }
}
