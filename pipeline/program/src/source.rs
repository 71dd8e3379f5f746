//! Where a film comes from.

use super::foreign;
use super::print_config::ProgramOption;
use clap::Args;
use render_core::scene::{self, Reach, Scene, SceneSettings, Setting};
use render2mpeg::error::Result;
use render2mpeg::memory;
use render2mpeg::settings::{CodedRate, MemorySize, Settings, read_tone_map};
use std::path::{Path, PathBuf};

/// The scene, and the file with further options.
#[derive(Args)]
pub(crate) struct SceneSource {
    /// A glTF 2.0 scene, .glb or .gltf; a TOML file of the same name beside it says what glTF cannot
    #[arg(required_unless_present = "config")]
    scene: Option<PathBuf>,
    /// Take options from a TOML file, by their names here: qscale = 8, cache = "off"; what is typed overrides them
    #[arg(long, value_name = "FILE.toml", help_heading = "Run", hide_short_help = true)]
    config: Option<PathBuf>,
    /// Reading of the scene: folders, camera, animation, settings.
    #[command(flatten)]
    pub reading: Reading,
}

impl SceneSource {
    /// The scene's path. Without one `config_file::parse` ends the program.
    pub fn path(&self) -> PathBuf {
        self.scene.clone().unwrap_or_default()
    }

    /// The file that options were taken from.
    pub fn config(&self) -> Option<&Path> {
        self.config.as_deref()
    }
}

/// Folders of the scene's files, and settings in place of its own.
#[derive(Clone, Debug, Args)]
pub(crate) struct Reading {
    /// Read files that the scene names from anywhere, and not from its own folder alone: for scenes that are trusted
    #[arg(long, help_heading = "Run", hide_short_help = true)]
    allow_outside: bool,
    /// The camera that films, by its name or its number from 0 [default: the first that moves, else the first]
    #[arg(long, value_name = "NAME|N", help_heading = "Film", hide_short_help = true)]
    camera: Option<String>,
    /// The animation that plays, or "all": those that move different properties [default: the first]
    #[arg(long, value_name = "NAME|all", help_heading = "Film", hide_short_help = true)]
    animation: Option<String>,
    /// The variant of the materials that is shown [default: the materials of the meshes]
    #[arg(long, value_name = "NAME", help_heading = "Film", hide_short_help = true)]
    variant: Option<String>,
    /// Width of points and lines, in meters [default: 1/200 of the diagonal of their mesh]
    #[arg(long, value_name = "METERS", value_parser = point_size, help_heading = "Film", hide_short_help = true)]
    point_size: Option<Setting>,
    /// A setting in place of one in the scene's TOML file: exposure=1.5, operator=reinhard, angular_diameter=2; may be repeated.
    /// sky.intensity=2 needs a [sky] in that file; a wrong KEY lists all
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting, help_heading = "Film", hide_short_help = true)]
    set: Vec<Setting>,
}

impl Reading {
    /// Folders that files may lie in.
    pub fn reach(&self) -> Reach {
        if self.allow_outside { Reach::Anywhere } else { Reach::Folder }
    }

    /// As a file for `--config` has them.
    pub fn options(&self) -> [ProgramOption; 5] {
        [
            ProgramOption::text("camera", self.camera.clone()),
            ProgramOption::text("animation", self.animation.clone()),
            ProgramOption::text("variant", self.variant.clone()),
            ProgramOption::text("point-size", self.point_size.as_ref().map(Setting::value)),
            ProgramOption::list("set", self.set.iter().map(ToString::to_string)),
        ]
    }

    /// Loads the scene at `path`.
    ///
    /// # Errors
    /// It cannot be read, or it is in another program's format.
    pub fn load(&self, path: &Path) -> anyhow::Result<Scene> {
        foreign::check(path)?;
        let mut set = self.set.clone();
        set.extend(self.point_size.clone());
        let names = [("camera", &self.camera), ("animation", &self.animation), ("variant", &self.variant)];
        for (table, name) in names {
            set.extend(name.as_deref().map(|name| Setting::text(table, "name", name)));
        }
        Ok(scene::load_with(path, self.reach(), &set)?)
    }
}

/// Reads a width as a setting.
fn point_size(text: &str) -> Result<Setting, String> {
    setting(&format!("point_size={text}"))
}

/// Reads a setting, and refuses what no scene can have: the file beside the scene is not to blame for it.
fn setting(text: &str) -> Result<Setting, String> {
    let setting: Setting = text.parse().map_err(|error: scene::SettingsError| error.to_string())?;

    // Settings that mean something only together, as those of a sky, are held against the scene later.
    let Ok(alone) = SceneSettings::parse_with("", std::slice::from_ref(&setting)) else { return Ok(setting) };
    if let Some(table) = &alone.tone_mapping {
        read_tone_map(table)?;
    }
    if let Some(fps) = alone.video.fps {
        CodedRate::of(fps).map_err(|error| error.to_string())?;
    }
    Ok(setting)
}

/// Bound on memory.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct MemoryLimit {
    /// Refuse, before work begins, what takes more memory than this by an estimate [default: what the machine has]
    #[arg(long, value_name = "SIZE", help_heading = "Run", hide_short_help = true)]
    max_memory: Option<MemorySize>,
}

impl MemoryLimit {
    /// Holds a film of `scene` against the bound.
    ///
    /// # Errors
    /// It would take more.
    pub fn check(self, scene: &Scene, settings: &Settings) -> Result<()> {
        memory::check(&settings.scene, scene, settings.render.size, self.max_memory)
    }
}
