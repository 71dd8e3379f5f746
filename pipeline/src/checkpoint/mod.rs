//! Long films survive: what stages carry from frame to frame is written down now and then, and another process goes on
//! from there, to the same bits.
//!
//! A checkpoint is a cut through the pipeline behind one frame. `prepare` marks the frame, and each stage that is done with
//! it leaves its [`Part`] here; when the last part is there, the file is written, whole or not at all. Stages do not wait for
//! each other: every part is of the same frame, though not of the same time.
//!
//! A run that is ended early (Ctrl-C) leaves the same behind its last frame, when the stages come to their ends.
//!
//! What follows from scene and settings is not written but made again: the ray tree, photons, direct lights and the picture of
//! the last frame, for which that one frame is prepared once more.

mod file;

use crate::error::{Context, Error, Result};
use crate::output::{Output, part_of};
use crate::plan::{Plan, Stage};
use crate::settings::Settings;
use file::Stored;
pub(crate) use file::{decode, encode};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Whose part of a checkpoint it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The light tree.
    Prepare,
    /// The irradiance cache, or the light of a film in which nothing moves.
    Shade,
    /// The exposure; how much of the uncompressed film there is.
    Display,
    /// ΔY.
    Mask,
    /// The encoder with the frames that wait in it; the report up to here.
    Encode,
    /// How much of the film there is.
    Film,
}

const PARTS: usize = 6;

/// What is said of parts that no stage left.
pub(crate) const NONSENSE: &str = "the checkpoint makes no sense: start anew, without --resume";

/// Parts of one frame that are there already.
type Parts = [Option<Vec<u8>>; PARTS];

/// Where checkpoints go, and the one that a run begins with.
pub struct Checkpoints {
    /// None: nothing is written.
    place: Option<Place>,
    from: Option<Stored>,
}

struct Place {
    path: PathBuf,
    every: Duration,
    /// Which parts there will be.
    wanted: [bool; PARTS],
    job: file::Job,
    state: Mutex<Progress>,
}

struct Progress {
    /// When a frame was last marked.
    last: Instant,
    /// The last frame of a run that ends before its film does.
    ends_behind: Option<u32>,
    waiting: BTreeMap<u32, Parts>,
}

impl Checkpoints {
    /// None are written, and the film begins at its beginning.
    pub fn off() -> Self {
        Self { place: None, from: None }
    }

    /// For a film that begins at its beginning: a checkpoint beside it every so often, and after each frame if that is zero.
    /// What another run has left there is taken away.
    ///
    /// # Errors
    /// An old checkpoint cannot be taken away, or the scene cannot be read.
    pub fn new(settings: &Settings, plan: &Plan, every: Option<Duration>) -> Result<Self> {
        let path = path_for(&settings.output);
        take_away(&path)?;
        // A device cannot be cut to a length later.
        let is_file = std::fs::metadata(&settings.output).map_or(true, |metadata| metadata.is_file());
        let place = every.filter(|_| is_file).map(|every| Place::new(path, settings, plan, every)).transpose()?;
        Ok(Self { place, from: None })
    }

    /// Goes on from the checkpoint beside the film; from the beginning if there is none.
    ///
    /// # Errors
    /// The checkpoint is damaged, or of another scene, other settings, or another version of the program, or a stage cannot
    /// read what it left.
    pub fn resume(settings: &Settings, plan: &Plan, every: Option<Duration>) -> Result<Self> {
        let path = path_for(&settings.output);
        if !path.exists() {
            return Self::new(settings, plan, every);
        }
        let job = file::Job::new(settings)?;
        let stored = Stored::read(&path)?;
        if let Some(difference) = stored.job.difference(&job) {
            let path = path.display();
            let problem = format!("{path} cannot be continued: {difference}; start anew without --resume");
            return Err(Error::Checkpoint(problem));
        }
        // A stage that does not find what it left would begin anew, and the others wait for it for ever.
        if stored.parts.iter().zip(wanted(plan)).any(|(part, wanted)| wanted && part.is_empty()) {
            return Err(Error::Checkpoint(format!("{}: {NONSENSE}", path.display())));
        }
        let place = every.map(|every| Place::new(path, settings, plan, every)).transpose()?;
        let resumed = Self { place, from: Some(stored) };
        // Before anything is cut to the length that it had.
        crate::stage::check(settings, &resumed)?;
        Ok(resumed)
    }

    /// The first frame that is still to be made.
    pub fn first_frame(&self) -> u32 {
        self.from.as_ref().map_or(0, |stored| stored.frame + 1)
    }

    /// What a stage left when it was done with the frame before [`Checkpoints::first_frame`]; none at the beginning.
    ///
    /// # Errors
    /// It was left by another version of the program.
    pub fn part<T: DeserializeOwned>(&self, part: Part) -> Result<Option<T>> {
        // A stage that did not run left nothing.
        let bytes = self.from.as_ref().map(|stored| &stored.parts[part as usize]).filter(|bytes| !bytes.is_empty());
        bytes.map(|bytes| decode(bytes).context(NONSENSE)).transpose()
    }

    /// The film: what there is of it, or a new one.
    ///
    /// # Errors
    /// It cannot be written, or there is less of it than when the checkpoint was made.
    pub fn output(&self, settings: &Settings) -> Result<Output> {
        match self.part(Part::Film)? {
            Some(length) => Output::resume(&settings.output, length),
            None => Output::create(&settings.output),
        }
    }

    /// Whether a checkpoint is to be made behind the frame that is prepared now; asked once for each.
    pub fn is_due(&self) -> bool {
        let Some(place) = &self.place else { return false };
        let mut state = place.lock();
        let due = state.last.elapsed() >= place.every;
        if due {
            state.last = Instant::now();
        }
        due
    }

    /// Says that the run ends early, and `frame` is the last one; told before the first stage hands over nothing more.
    pub fn end_behind(&self, frame: u32) {
        if let Some(place) = &self.place {
            place.lock().ends_behind = Some(frame);
        }
    }

    /// Whether a stage that has come to its end, with `frame` as its last, is to leave what it carries: the run was ended
    /// early, and can go on from here.
    pub fn ends_behind(&self, frame: u32) -> bool {
        self.place.as_ref().is_some_and(|place| place.lock().ends_behind == Some(frame))
    }

    /// Whether any are written.
    pub fn are_on(&self) -> bool {
        self.place.is_some()
    }

    /// Leaves what a stage carries on behind `frame`, and writes the checkpoint if this was the last part of it.
    ///
    /// # Errors
    /// The checkpoint cannot be written.
    pub fn leave(&self, frame: u32, part: Part, carried: &impl Serialize) -> Result<()> {
        let Some(place) = &self.place else { return Ok(()) };
        let bytes = encode(carried);
        let mut state = place.lock();
        let parts = state.waiting.entry(frame).or_default();
        parts[part as usize] = Some(bytes);
        let whole = parts.iter().zip(place.wanted).all(|(part, wanted)| part.is_some() || !wanted);
        let Some(parts) = whole.then(|| state.waiting.remove(&frame)).flatten() else { return Ok(()) };
        // Written under the lock: a later checkpoint never comes before an earlier one.
        let stored = Stored { job: place.job.clone(), frame, parts: parts.map(Option::unwrap_or_default).to_vec() };
        stored.write(&place.path)?;
        tracing::info!("checkpoint after frame {frame}");
        Ok(())
    }

    /// The film is whole: there is nothing to be continued any more.
    pub fn remove(self, settings: &Settings) {
        let _ = take_away(&path_for(&settings.output));
    }
}

impl Place {
    fn new(path: PathBuf, settings: &Settings, plan: &Plan, every: Duration) -> Result<Self> {
        let state = Progress { last: Instant::now(), ends_behind: None, waiting: BTreeMap::new() };
        let job = file::Job::new(settings)?;
        Ok(Self { path, every, wanted: wanted(plan), job, state: Mutex::new(state) })
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Progress> {
        // A stage that panicked has left nothing half-done here.
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// Which parts there are of a film.
fn wanted(plan: &Plan) -> [bool; PARTS] {
    let masking = plan.is_on(Stage::Masking);
    [true, true, true, masking, true, true]
}

/// Removes a checkpoint, and one that a killed run had begun to write.
fn take_away(path: &Path) -> Result<()> {
    for path in [path, &part_of(path)] {
        match std::fs::remove_file(path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::file(path, "cannot be removed")(error));
            }
            _ => {}
        }
    }
    Ok(())
}

/// `film.m2v` → `film.m2v.checkpoint`.
pub fn path_for(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".checkpoint");
    output.with_file_name(name)
}
