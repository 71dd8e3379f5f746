//! Checkpoints whose check sums are right and whose parts are not of the film: a line and no panic.

use pipeline::Run;
use pipeline::checkpoint::{Checkpoints, path_for};
use pipeline::report::FrameReport;
use render_core::scene::{self, Scene};
use render2mpeg::job::job_of;
use render2mpeg::{Options, Render, Settings};
use renderer::plan::Plan;
use std::collections::BTreeMap;
use std::time::Duration;
use tempfile::TempDir;
use tests::{Moving, checkered_room};

/// As `pipeline/loop/src/checkpoint/file.rs` stores it: the job, the last frame that is done, the states of the parts.
type Stored = ((String, String, u32), u32, Vec<Vec<u8>>);

const CONFIG: bincode::config::Configuration = bincode::config::standard();
const HEADER: usize = 20;
/// The places of `Part::Shade` and `Part::Encode`.
const SHADE: usize = 1;
const ENCODE: usize = 3;

/// As `pipeline/loop/src/log.rs` leaves it: bytes of the film and their sum, the report, figures of frames that wait (none, where
/// each frame is coded as it comes), the encoder.
type Encoding = ((u64, u32), Vec<FrameReport>, BTreeMap<u32, ()>, Vec<u8>);

struct Film {
    _folder: TempDir,
    scene: Scene,
    settings: Settings,
    plan: Plan,
    /// Header of checkpoints: a magic number and the version.
    begin: [u8; 8],
    /// The checkpoint after the last frame but one.
    stored: Stored,
}

impl Film {
    /// Three frames, lit by `vpls` anchor lights.
    fn new(vpls: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.glb");
        checkered_room(Moving::Box).write(&path);
        let scene = scene::load(&path).unwrap();
        // A film of two frames leaves what one of three has after its second, but for its length.
        let [short, long] = [2, 3].map(|frames| {
            let options = Options {
                output: Some(folder.path().join("film.m2v")),
                frames: Some(frames),
                size: "16x16".parse().ok(),
                vpls: Some(vpls),
                photons: Some(1000),
                ..Options::default()
            };
            let settings = Settings::new(path.clone(), &scene, &options).unwrap();
            let plan = Plan::new(&scene, &settings.renderer());
            let checkpoints = Checkpoints::new(&job_of(&scene, &settings).unwrap(), Some(Duration::ZERO));
            run(&checkpoints, &scene, &settings, &plan).unwrap();
            let bytes = std::fs::read(path_for(&settings.output)).unwrap();
            let (stored, _): (Stored, _) = bincode::serde::decode_from_slice(&bytes[HEADER..], CONFIG).unwrap();
            (settings, plan, stored, *bytes.first_chunk().unwrap())
        });
        let (settings, plan, (job, ..), begin) = long;
        Self { _folder: folder, scene, settings, plan, begin, stored: (job, 1, short.2.2) }
    }

    /// Goes on from what is said to have been stored.
    fn go_on(&self, stored: &Stored) -> Result<(), String> {
        let body = bincode::serde::encode_to_vec(stored, CONFIG).unwrap();
        let mut file = self.begin.to_vec();
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(crc32fast::hash(&body).to_le_bytes());
        file.extend(body);
        std::fs::write(path_for(&self.settings.output), file).unwrap();
        let job = job_of(&self.scene, &self.settings).unwrap();
        let checkpoints = Checkpoints::resume(&job, None).map_err(|error| error.chain())?;
        run(&checkpoints, &self.scene, &self.settings, &self.plan)
    }
}

fn run(checkpoints: &Checkpoints, scene: &Scene, settings: &Settings, plan: &Plan) -> Result<(), String> {
    let film = || {
        let mut film = Render::new(scene, settings, plan, checkpoints)?;
        film.write_to(&settings.output)?;
        film.finish(Run::default())
    };
    film().map(|_| ()).map_err(|error: render2mpeg::error::Error| error.chain())
}

/// The records of a film with more lights: their cuts refer to lights that are not there.
#[test]
fn records_of_lights_that_are_not_there_are_refused() {
    let (few, many) = (Film::new(10), Film::new(300));
    let mut stored = few.stored.clone();
    few.go_on(&stored).expect("its own goes on");
    stored.2[SHADE] = many.stored.2[SHADE].clone();
    let error = few.go_on(&stored).unwrap_err();
    assert!(error.contains("makes no sense") && error.lines().count() == 1, "{error}");
}

/// States that no stage can read are refused before the film is cut to the length that it had.
#[test]
fn a_part_that_cannot_be_read_leaves_the_film_as_it_is() {
    let film = Film::new(10);
    let before = std::fs::read(&film.settings.output).unwrap();
    let whole = film.stored.clone();
    for part in 0..whole.2.len() {
        // One that is missing had the other stages wait for ever.
        for forged in [vec![255; 40], Vec::new()] {
            let mut stored = whole.clone();
            stored.2[part] = forged;
            let error = film.go_on(&stored).unwrap_err();
            assert!(error.lines().count() == 1, "{error}");
            assert!(error.contains("film.m2v.checkpoint") && error.contains("start anew"), "{error}");
            assert!(std::fs::read(&film.settings.output).unwrap() == before, "part {part}");
        }
    }
}

/// A frame whose line is missing in the report: the time of its masking was put into a line that was not there.
#[test]
fn a_report_that_leaves_a_frame_out_is_refused() {
    let film = Film::new(10);
    let mut stored = film.stored.clone();
    let (mut encoding, _): (Encoding, _) = bincode::serde::decode_from_slice(&stored.2[ENCODE], CONFIG).unwrap();
    for lines in [&[0][..], &[0, 2], &[1, 1], &[0, 1, 2]] {
        encoding.1 = lines.iter().map(|&index| FrameReport { index, ..encoding.1[0].clone() }).collect();
        stored.2[ENCODE] = bincode::serde::encode_to_vec(&encoding, CONFIG).unwrap();
        let error = film.go_on(&stored).unwrap_err();
        assert!(error.contains("makes no sense") && error.lines().count() == 1, "{error}");
    }
    encoding.1 = [1, 0].map(|index| FrameReport { index, ..encoding.1[0].clone() }).into();
    stored.2[ENCODE] = bincode::serde::encode_to_vec(&encoding, CONFIG).unwrap();
    film.go_on(&stored).expect("the order is that of coding");
}

/// Frames beyond the end of the film, up to the last that can be counted: the number after that one was computed.
#[test]
fn a_last_frame_beyond_the_film_is_refused() {
    let film = Film::new(10);
    for last in [2, 1000, u32::MAX] {
        let mut stored = film.stored.clone();
        stored.1 = last;
        let error = film.go_on(&stored).unwrap_err();
        let word = if last == 2 { "makes no sense" } else { "more --frames" };
        assert!(error.contains("film.m2v.checkpoint") && error.contains(word), "{last}: {error}");
    }
}
