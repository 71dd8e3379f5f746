//! Source of a film: scene, option file, and scene settings from the command line.

use super::foreign;
use super::print_config::ProgramOption;
use clap::Args;
use perceptual::ToneMap;
use render_core::scene::{self, Orbit, Reach, Scene, SceneSettings, Setting};
use render2mpeg::error::{Error, Result};
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
    /// Light and ground: soft, product, outdoor or off [default: soft if the scene has no lamps and no sky]
    #[arg(long, value_name = "KIND", value_parser = studio, help_heading = "View")]
    studio: Option<Typed>,
    /// Color of the background, such as white or #e0e0e0, or "transparent" for stills
    #[arg(long, value_name = "COLOR", value_parser = background, help_heading = "View")]
    background: Option<Typed>,
    /// Image of the sky that lights the scene, .hdr or .exr
    #[arg(long, value_name = "FILE", value_parser = sky, help_heading = "View", hide_short_help = true)]
    sky: Option<Typed>,
    /// Place the camera: degrees from the front to the right, degrees from above, and distance in meters or percent,
    /// such as 30,75 or 30,75,120% [default: the file's camera, else 25,74]
    #[arg(long, value_name = "A,B[,R]", value_parser = orbit, allow_hyphen_values = true, help_heading = "View")]
    orbit: Option<Typed>,
    /// Point at which the camera looks [default: the center of the scene]
    #[arg(long, value_name = "X,Y,Z", value_parser = target, allow_hyphen_values = true, help_heading = "View", hide_short_help = true)]
    target: Option<Typed>,
    /// Vertical field of view in degrees [default: the camera's own, else 22]
    #[arg(long, value_name = "DEGREES", value_parser = fov, help_heading = "View", hide_short_help = true)]
    fov: Option<Typed>,
    /// Direction that points up, such as 0,0,1
    #[arg(long, value_name = "X,Y,Z", value_parser = up, allow_hyphen_values = true, help_heading = "View", hide_short_help = true)]
    up: Option<Typed>,
    /// Turn the camera once around the scene in this time, and stop the scene's animation
    #[arg(long, alias = "seconds", value_name = "SECONDS", value_parser = turn, help_heading = "View", hide_short_help = true)]
    turn: Option<Typed>,
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
    pub fn options(&self) -> Vec<ProgramOption> {
        let views = self.views().map(|(name, typed)| ProgramOption::text(name, typed.map(|typed| typed.text.clone())));
        let mut options = vec![
            ProgramOption::text("camera", self.camera.clone()),
            ProgramOption::text("animation", self.animation.clone()),
            ProgramOption::text("variant", self.variant.clone()),
            ProgramOption::text("point-size", self.point_size.as_ref().map(Setting::value)),
            ProgramOption::list("set", self.set.iter().map(ToString::to_string)),
        ];
        options.extend(views);
        options
    }

    /// Returns the names and values of the options for light and view.
    fn views(&self) -> [(&'static str, Option<&Typed>); 8] {
        [
            ("studio", self.studio.as_ref()),
            ("background", self.background.as_ref()),
            ("sky", self.sky.as_ref()),
            ("orbit", self.orbit.as_ref()),
            ("target", self.target.as_ref()),
            ("fov", self.fov.as_ref()),
            ("up", self.up.as_ref()),
            ("turn", self.turn.as_ref()),
        ]
    }

    /// Returns whether the background has a chosen color.
    pub fn has_background(&self) -> bool {
        self.background.is_some() && !self.is_transparent()
    }

    /// Returns whether pictures have a transparent background.
    pub fn is_transparent(&self) -> bool {
        self.background.as_ref().is_some_and(|background| background.text == "transparent")
    }

    /// Turns the camera in `seconds` unless another time is given.
    pub fn turn_in(&mut self, seconds: f32) {
        self.turn.get_or_insert_with(|| turn(&seconds.to_string()).expect("the duration is in range"));
    }

    /// Loads the scene at `path`, with studio and camera as the options choose.
    ///
    /// # Errors
    /// If the scene cannot be read or is in another program's format, or if options contradict each other.
    pub fn load(&self, path: &Path) -> anyhow::Result<Scene> {
        if self.is_transparent() {
            let text = "--background transparent: only still and views write transparent pictures";
            return Err(Error::Options(text.into()).into());
        }
        let mut scene = self.load_bare(path)?;
        scene.furnish();
        Ok(scene)
    }

    /// Loads the scene at `path` without studio and camera, for a caller that calls [`Scene::furnish`].
    ///
    /// # Errors
    /// If the scene cannot be read or is in another program's format, or if options contradict each other.
    pub fn load_bare(&self, path: &Path) -> anyhow::Result<Scene> {
        foreign::check(path)?;
        let replaces_camera = [&self.orbit, &self.target, &self.up, &self.turn].into_iter().any(Option::is_some);
        if self.camera.is_some() && replaces_camera {
            let text = "--camera selects a camera of the file; --orbit, --target, --up and --turn replace it: drop one";
            return Err(Error::Options(text.into()).into());
        }
        // Pass the options as settings, which override the scene's TOML file.
        let mut set = self.set.clone();
        set.extend(self.point_size.clone());
        set.extend(self.views().into_iter().filter_map(|(_, typed)| typed?.setting.clone()));
        let names = [("camera", &self.camera), ("animation", &self.animation), ("variant", &self.variant)];
        for (table, name) in names {
            set.extend(name.as_deref().map(|name| Setting::text(table, "name", name)));
        }
        let mut scene = scene::load_with(path, self.reach(), &set)?;
        if let Some(color) = self.background.as_ref().filter(|_| self.has_background()) {
            scene.settings.studio.background = Some(shown_as(&color.text, &scene)?);
        }
        Ok(scene)
    }
}

/// Returns the radiance that the tone curve of `scene` shows as the color `text`.
fn shown_as(text: &str, scene: &Scene) -> anyhow::Result<[f32; 3]> {
    let color = color(text).map_err(Error::Options)?;
    let table = scene.settings.tone_mapping.as_ref();
    let tone_map = table.map_or(Ok(ToneMap::default()), read_tone_map).map_err(Error::Options)?;
    // Studios have exposure 1 by default; other scenes have automatic exposure, which follows from the picture.
    if scene.studio_kind().is_none() && !table.is_some_and(|table| table.contains_key("exposure")) {
        let text = format!("--background {text} needs a fixed exposure without a studio: add --set exposure=1");
        return Err(Error::Options(text).into());
    }
    Ok(color.map(|display| tone_map.decode(display)))
}

/// Parses a width as a setting.
fn point_size(text: &str) -> Result<Setting, String> {
    setting(&format!("point_size={text}"))
}

fn studio(text: &str) -> Result<Typed, String> {
    Ok(Typed::of(text, setting(&format!("studio.kind=\"{text}\""))?))
}

/// Option as typed, with the setting that it overrides; `None` for a color, which depends on the scene's tone curve.
#[derive(Clone, Debug)]
struct Typed {
    text: String,
    setting: Option<Setting>,
}

impl Typed {
    fn of(text: &str, setting: Setting) -> Self {
        Self { text: text.into(), setting: Some(setting) }
    }
}

/// Parses a background: a color as it appears in the picture, or "transparent".
fn background(text: &str) -> Result<Typed, String> {
    if text != "transparent" {
        let _ = color(text)?;
    }
    Ok(Typed { text: text.into(), setting: None })
}

fn turn(text: &str) -> Result<Typed, String> {
    let seconds: f32 = text.parse().map_err(|_| format!("\"{text}\" is not a duration in seconds"))?;
    Ok(Typed::of(text, setting(&format!("turn={seconds:?}"))?))
}

/// Parses `#rgb`, `#rrggbb`, or the name of a gray: components 0…1 of sRGB.
fn color(text: &str) -> Result<[f32; 3], String> {
    let wrong = || format!("\"{text}\" is not a color such as white, black, gray or #e0e0e0");
    let hex = match text {
        "white" => "ffffff",
        "black" => "000000",
        "gray" => "808080",
        _ => text.strip_prefix('#').ok_or_else(wrong)?,
    };
    let digits: Vec<u32> = hex.chars().map(|c| c.to_digit(16)).collect::<Option<_>>().ok_or_else(wrong)?;
    match digits[..] {
        [r, g, b] => Ok([r, g, b].map(|digit| digit as f32 / 15.0)),
        [r, q, g, h, b, c] => Ok([16 * r + q, 16 * g + h, 16 * b + c].map(|code| code as f32 / 255.0)),
        _ => Err(wrong()),
    }
}

/// Parses the path of a sky, relative to the current folder.
fn sky(text: &str) -> Result<Typed, String> {
    let path = std::path::absolute(text).map_err(|error| format!("{text}: {error}"))?;
    Ok(Typed::of(text, Setting::text("sky", "image", &path.to_string_lossy())))
}

fn orbit(text: &str) -> Result<Typed, String> {
    let _: Orbit = text.parse()?;
    Ok(Typed::of(text, Setting::text("camera", "orbit", text)))
}

fn target(text: &str) -> Result<Typed, String> {
    Ok(Typed::of(text, setting(&format!("target=[{}]", floats(text)?))?))
}

fn up(text: &str) -> Result<Typed, String> {
    Ok(Typed::of(text, setting(&format!("camera.up=[{}]", floats(text)?))?))
}

fn fov(text: &str) -> Result<Typed, String> {
    let degrees: f32 = text.parse().map_err(|_| format!("\"{text}\" is not an angle in degrees"))?;
    Ok(Typed::of(text, setting(&format!("fov={degrees:?}"))?))
}

/// Returns three numbers as the elements of a TOML array.
fn floats(text: &str) -> Result<String, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([x, y, z]) => Ok(format!("{x:?},{y:?},{z:?}")),
        _ => Err(format!("\"{text}\" is not three numbers such as 0,1.5,0")),
    }
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
