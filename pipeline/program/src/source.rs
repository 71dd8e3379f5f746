//! Source of a film: scene, option file, and scene settings from the command line.

use super::foreign;
use super::print_config::ProgramOption;
use clap::Args;
use render_core::scene::{self, Reach, Scene, SceneSettings, Setting};
use render2mpeg::error::Result;
use render2mpeg::memory;
use render2mpeg::settings::{CodedRate, MemorySize, Settings, read_tone_map};
use std::path::{Path, PathBuf};

/// Scene, and the file of additional options.
#[derive(Args)]
pub(crate) struct SceneSource {
    /// A glTF 2.0 scene, .glb or .gltf; a TOML file of the same name next to it adds settings that glTF lacks
    #[arg(required_unless_present = "config")]
    scene: Option<PathBuf>,
    /// Read options from a TOML file, by their names here: qscale = 8, cache = "off"; typed options win
    #[arg(long, value_name = "FILE.toml", help_heading = "Run", hide_short_help = true)]
    config: Option<PathBuf>,
    /// Options for reading the scene: folders, camera, animation and scene settings.
    #[command(flatten)]
    pub reading: Reading,
}

impl SceneSource {
    /// Returns the path of the scene. `config_file::parse` ends the program if the path is missing.
    pub fn path(&self) -> PathBuf {
        self.scene.clone().unwrap_or_default()
    }

    /// Returns the path of the option file, if given.
    pub fn config(&self) -> Option<&Path> {
        self.config.as_deref()
    }
}

/// Folders of the scene's files, and settings that override the scene's own.
#[derive(Clone, Debug, Args)]
pub(crate) struct Reading {
    /// Read files named by the scene from any folder, not only its own: for trusted scenes
    #[arg(long, help_heading = "Run", hide_short_help = true)]
    allow_outside: bool,
    /// Camera of the film, by name or by number from 0 [default: the first dynamic one, else the first]
    #[arg(long, value_name = "NAME|N", help_heading = "Film", hide_short_help = true)]
    camera: Option<String>,
    /// Animation to play; "all" plays all animations of different properties [default: the first]
    #[arg(long, value_name = "NAME|all", help_heading = "Film", hide_short_help = true)]
    animation: Option<String>,
    /// Material variant to show [default: the materials of the meshes]
    #[arg(long, value_name = "NAME", help_heading = "Film", hide_short_help = true)]
    variant: Option<String>,
    /// Width of points and lines in meters [default: 1/200 of the diagonal of their mesh]
    #[arg(long, value_name = "METERS", value_parser = point_size, help_heading = "Film", hide_short_help = true)]
    point_size: Option<Setting>,
    /// Override a setting of the scene's TOML file: exposure=1.5, operator=reinhard, angular_diameter=2; may be
    /// repeated. sky.intensity=2 needs a [sky] in that file; an unknown KEY lists all keys
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting, help_heading = "Film", hide_short_help = true)]
    set: Vec<Setting>,
}

impl Reading {
    /// Returns the folders in which the scene's files may be.
    pub fn reach(&self) -> Reach {
        if self.allow_outside { Reach::Anywhere } else { Reach::Folder }
    }

    /// Returns the reading options as they appear in a `--config` file.
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
    /// If the scene cannot be read or is in another program's format.
    pub fn load(&self, path: &Path) -> anyhow::Result<Scene> {
        foreign::check(path)?;
        // Pass the options as settings, which override the scene's TOML file.
        let mut set = self.set.clone();
        set.extend(self.point_size.clone());
        let names = [("camera", &self.camera), ("animation", &self.animation), ("variant", &self.variant)];
        for (table, name) in names {
            set.extend(name.as_deref().map(|name| Setting::text(table, "name", name)));
        }
        Ok(scene::load_with(path, self.reach(), &set)?)
    }
}

/// Parses a width as a setting.
fn point_size(text: &str) -> Result<Setting, String> {
    setting(&format!("point_size={text}"))
}

/// Parses a setting, and refuses values that are invalid for every scene. Errors then refer to the option, not the
/// scene's file.
fn setting(text: &str) -> Result<Setting, String> {
    let setting: Setting = text.parse().map_err(|error: scene::SettingsError| error.to_string())?;

    // Accept settings that are valid only in combination, such as a sky's. They are checked later with the scene.
    let Ok(alone) = SceneSettings::parse_with("", std::slice::from_ref(&setting)) else { return Ok(setting) };
    if let Some(table) = &alone.tone_mapping {
        read_tone_map(table)?;
    }
    if let Some(fps) = alone.video.fps {
        CodedRate::of(fps).map_err(|error| error.to_string())?;
    }
    Ok(setting)
}

/// Limit on memory.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct MemoryLimit {
    /// Refuse, before work begins, a film whose estimated memory exceeds this [default: the machine's memory]
    #[arg(long, value_name = "SIZE", help_heading = "Run", hide_short_help = true)]
    max_memory: Option<MemorySize>,
}

impl MemoryLimit {
    /// Compares the estimated memory of a film of `scene` with the limit.
    ///
    /// # Errors
    /// If the film would exceed the limit.
    pub fn check(self, scene: &Scene, settings: &Settings) -> Result<()> {
        memory::check(&settings.scene, scene, settings.render.size, self.max_memory)
    }
}
