//! Job of making a film: only a run with the same program, settings and inputs continues it.

use super::file::Identity;
use std::path::{Path, PathBuf};

/// Film, with all data that determines its bits.
#[derive(Clone, Debug)]
pub struct FilmJob {
    film: PathBuf,
    identity: Identity,
    /// Index of the first frame after the film or range; `None` if unknown.
    end: Option<u32>,
    /// Whether this process reads the light of the film from a file.
    reads_light: bool,
}

impl FilmJob {
    /// Returns the job of making the film at path `film` with `program`. `settings` is a JSON object with every setting
    /// that affects the bits. `inputs` is a checksum of the input files.
    #[must_use]
    pub fn new(film: &Path, program: &str, settings: &str, inputs: u32) -> Self {
        Self {
            film: film.into(),
            identity: Identity { program: program.into(), settings: settings.into(), inputs },
            end: None,
            reads_light: false,
        }
    }

    /// Returns the path of the film.
    #[must_use]
    pub fn film(&self) -> &Path {
        &self.film
    }

    /// Returns the job with `end` as the index of the first frame after the film or range.
    #[must_use]
    pub fn with_end(self, end: Option<u32>) -> Self {
        Self { end, ..self }
    }

    /// Returns the job, with whether this process reads the light of the film from a file. The ranks share the work of
    /// making light, so that all or none must read it.
    #[must_use]
    pub fn reading_light(self, reads_light: bool) -> Self {
        Self { reads_light, ..self }
    }

    /// Returns the checksum of the data that all ranks of a film must have in common. Paths are excluded: ranks may
    /// read and write at different paths.
    #[must_use]
    pub fn sum(&self) -> u32 {
        let Identity { program, settings, inputs } = &self.identity;
        crc32fast::hash(format!("{program} {settings} {inputs} {:?} {}", self.end, self.reads_light).as_bytes())
    }

    /// Returns whether both jobs make the same film, apart from its length.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.identity.difference(&other.identity).is_none()
    }

    /// Returns the index of the first frame after the film or range; `None` if unknown.
    #[must_use]
    pub fn end(&self) -> Option<u32> {
        self.end
    }

    /// Returns program, settings and inputs of the film.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }
}
