//! A film killed after its second frame, and its checkpoint, for tests that damage it.

use pipeline::Run;
use pipeline::checkpoint::{Checkpoints, path_for};
use render_core::scene::{self, Scene};
use render2mpeg::error::Error;
use render2mpeg::job::job_of;
use render2mpeg::{Options, Render, Settings};
use renderer::plan::Plan;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Body of a checkpoint, as `pipeline/loop/src/checkpoint/file.rs` stores it: the job (program, settings, checksum of the
/// inputs), the last finished frame, the state sections.
pub type Stored = ((String, String, u32), Option<u32>, Vec<Vec<u8>>);

/// Encoding of checkpoints and their state sections.
pub const CONFIG: bincode::config::Configuration = bincode::config::standard();
/// Length of the header \[bytes\]: magic number, version, length, checksum. Light trees have the same header.
pub const HEADER: usize = 20;
/// Index of the state section `Part::Prepare`, the light tree, which has a header and a checksum of its own.
pub const TREE: usize = 0;

/// Film of three frames, killed after the second frame.
#[derive(Debug)]
pub struct KilledFilm {
    /// Scene of the film.
    pub scene: Scene,
    /// Settings of all three frames.
    pub settings: Settings,
    /// Plan of the film.
    pub plan: Plan,
    /// Body of the checkpoint.
    pub stored: Stored,
    /// Unfinished video.
    pub part: Vec<u8>,
    /// Complete video of three frames.
    pub truth: Vec<u8>,
    /// Magic number and version of checkpoints.
    begin: [u8; 8],
}

impl KilledFilm {
    /// Renders a film of the scene with `options`; their number of frames is ignored.
    ///
    /// # Panics
    ///
    /// If the film cannot be rendered.
    #[must_use]
    pub fn new(scene_path: &Path, options: &Options) -> Self {
        let scene = scene::load(scene_path).expect("a scene");
        // A film of two frames ends in the state of one of three frames after its second, except for its length.
        let [short, long] = [2, 3].map(|frames| {
            let options = Options { frames: Some(frames), ..options.clone() };
            let settings = Settings::new(scene_path.into(), &scene, &options).expect("settings");
            let plan = Plan::new(&scene, &settings.render);
            let checkpoints = Checkpoints::new(&job_of(&scene, &settings).expect("a job"), Some(Duration::ZERO));
            finish(&scene, &settings, &plan, &checkpoints).expect("a film");
            let bytes = fs::read(path_for(&settings.output)).expect("a checkpoint");
            let (stored, _) = bincode::serde::decode_from_slice::<Stored, _>(&bytes[HEADER..], CONFIG).expect("a body");
            let video = fs::read(&settings.output).expect("a video");
            (settings, plan, stored, video, *bytes.first_chunk().expect("a header"))
        });
        // Combine the job of the long film with the state of the short film.
        let (settings, plan, (job, ..), truth, begin) = long;
        Self { scene, settings, plan, stored: (job, Some(1), short.2.2), part: short.3, truth, begin }
    }

    /// Returns the file of a checkpoint with this body and a valid checksum.
    #[must_use]
    pub fn sealed(&self, body: &[u8]) -> Vec<u8> {
        let mut file = self.begin.to_vec();
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(crc32fast::hash(body).to_le_bytes());
        file.extend(body);
        file
    }

    /// Encodes a checkpoint with a valid checksum.
    ///
    /// # Panics
    ///
    /// If memory runs out.
    #[must_use]
    pub fn file(&self, stored: &Stored) -> Vec<u8> {
        self.sealed(&bincode::serde::encode_to_vec(stored, CONFIG).expect("bytes"))
    }

    /// Reads `file` as the checkpoint of the film.
    ///
    /// # Errors
    ///
    /// If the checkpoint is rejected.
    ///
    /// # Panics
    ///
    /// If the file cannot be written.
    pub fn checkpoints(&self, file: &[u8]) -> Result<Checkpoints, Error> {
        fs::write(path_for(&self.settings.output), file).expect("a file");
        Ok(Checkpoints::resume(&job_of(&self.scene, &self.settings)?, None)?)
    }

    /// Continues the film from the checkpoint `file` to its end.
    ///
    /// # Errors
    ///
    /// If the checkpoint is rejected or a stage fails.
    ///
    /// # Panics
    ///
    /// If the file cannot be written.
    pub fn go_on(&self, file: &[u8]) -> Result<(), Error> {
        finish(&self.scene, &self.settings, &self.plan, &self.checkpoints(file)?)
    }
}

fn finish(scene: &Scene, settings: &Settings, plan: &Plan, checkpoints: &Checkpoints) -> Result<(), Error> {
    let mut film = Render::new(scene, settings, plan, checkpoints)?;
    film.write_to(&settings.output)?;
    film.finish(Run::default()).map(|_| ())
}

/// Writes the right length and checksum into the header of a light tree.
pub fn seal_tree(tree: &mut [u8]) {
    if let Some((header, body)) = tree.split_at_mut_checked(HEADER) {
        header[8..16].copy_from_slice(&(body.len() as u64).to_le_bytes());
        header[16..].copy_from_slice(&crc32fast::hash(body).to_le_bytes());
    }
}
