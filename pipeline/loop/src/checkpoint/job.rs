//! The identity of a film: only a run of the same program, settings and inputs continues it.

use super::file::Identity;
use std::path::{Path, PathBuf};

/// A film, and everything that its bits depend on.
#[derive(Clone, Debug)]
pub struct FilmJob {
    film: PathBuf,
    identity: Identity,
    /// The frame after the last; none where that is not known.
    end: Option<u32>,
}

impl FilmJob {
    /// A film at `film` that `program` makes: `settings` is a JSON object with all that its bits depend on, `inputs` a check
    /// sum of the files that are read.
    #[must_use]
    pub fn new(film: &Path, program: &str, settings: &str, inputs: u32) -> Self {
        Self {
            film: film.into(),
            identity: Identity { program: program.into(), settings: settings.into(), inputs },
            end: None,
        }
    }

    /// The path of the film.
    #[must_use]
    pub fn film(&self) -> &Path {
        &self.film
    }

    /// The same film, of which `end` is the frame after the last.
    #[must_use]
    pub fn with_end(self, end: Option<u32>) -> Self {
        Self { end, ..self }
    }

    /// A sum of all that ranks of this film have to have in common: they may read its files and write the film at other places.
    #[must_use]
    pub fn sum(&self) -> u32 {
        let Identity { program, settings, inputs } = &self.identity;
        crc32fast::hash(format!("{program} {settings} {inputs} {:?}", self.end).as_bytes())
    }

    /// Whether both are the same film, as far as both go.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.identity.difference(&other.identity).is_none()
    }

    /// The frame after the last, if it is known.
    #[must_use]
    pub fn end(&self) -> Option<u32> {
        self.end
    }

    pub(super) fn identity(&self) -> &Identity {
        &self.identity
    }
}
