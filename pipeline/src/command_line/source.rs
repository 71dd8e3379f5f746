//! Where a film comes from.

use clap::Args;
use std::path::PathBuf;

/// The scene, and the file with further options.
#[derive(Args)]
pub(crate) struct Source {
    /// A glTF 2.0 scene, .glb or .gltf; a TOML file of the same name beside it says what glTF cannot
    #[arg(required_unless_present = "config")]
    scene: Option<PathBuf>,
    /// Take options from a TOML file, by their names here: qscale = 8, cache = "off"; what is typed overrides them
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
}

impl Source {
    /// The scene's path. Without one `config_file::parse` ends the program.
    pub fn path(self) -> PathBuf {
        self.scene.unwrap_or_default()
    }
}
