//! Where a film comes from.

use crate::error::Result;
use crate::memory;
use crate::settings::{MemorySize, Settings};
use clap::Args;
use render_core::scene::{self, LoadError, Reach, Scene};
use std::path::{Path, PathBuf};

/// The scene, and the file with further options.
#[derive(Args)]
pub(crate) struct Source {
    /// A glTF 2.0 scene, .glb or .gltf; a TOML file of the same name beside it says what glTF cannot
    #[arg(required_unless_present = "config")]
    scene: Option<PathBuf>,
    /// Take options from a TOML file, by their names here: qscale = 8, cache = "off"; what is typed overrides them
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Folders of the scene's files.
    #[command(flatten)]
    pub access: Access,
}

impl Source {
    /// The scene's path. Without one `config_file::parse` ends the program.
    pub fn path(&self) -> PathBuf {
        self.scene.clone().unwrap_or_default()
    }

    /// The file that options were taken from.
    pub fn config(&self) -> Option<&Path> {
        self.config.as_deref()
    }
}

/// Folders from which files are read that a scene names.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Access {
    /// Read files that the scene names from anywhere, and not from its own folder alone: for scenes that are trusted
    #[arg(long)]
    allow_outside: bool,
}

impl Access {
    pub fn reach(self) -> Reach {
        if self.allow_outside { Reach::Anywhere } else { Reach::Folder }
    }

    /// Loads the scene at `path`.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn load(self, path: &Path) -> Result<Scene, LoadError> {
        scene::load_within(path, self.reach())
    }
}

/// Bound on memory.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct MemoryLimit {
    /// Refuse, before work begins, what takes more memory than this by an estimate [default: what the machine has]
    #[arg(long, value_name = "SIZE")]
    max_memory: Option<MemorySize>,
}

impl MemoryLimit {
    /// Holds a film of `scene` against the bound.
    ///
    /// # Errors
    /// It would take more.
    pub fn check(self, scene: &Scene, settings: &Settings) -> Result<()> {
        memory::check(&settings.scene, scene, settings.size, self.max_memory)
    }
}
