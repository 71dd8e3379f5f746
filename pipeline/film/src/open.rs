//! Films in one call: from a scene, options that differ from the defaults, and an output path.

use crate::error::{Error, Result};
use crate::report::Report;
use crate::settings::{Options, Settings};
use pipeline::Run;
use render_core::scene::{self, Scene};
use renderer::plan::Plan;
use std::path::{Path, PathBuf};

/// Scene, and options of the film to render.
///
/// ```no_run
/// use render2mpeg::{Film, Options};
///
/// let options = Options { frames: Some(25), qscale: Some(4), ..Options::default() };
/// let report = Film::open("scene.glb")?.with_options(options).render_to("film.mpg")?;
/// println!("{} frames, {} bits", report.summary.frames, report.summary.bits_total);
/// # Ok::<(), render2mpeg::Error>(())
/// ```
#[derive(Debug)]
pub struct Film {
    path: PathBuf,
    scene: Scene,
    options: Options,
}

impl Film {
    /// Loads a glTF 2.0 scene, `.glb` or `.gltf`, with the TOML file of the same name next to it, if one exists.
    ///
    /// # Errors
    /// [`Error::Scene`]: the scene cannot be read, or requires an unsupported feature.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let mut scene = scene::load(&path)?;
        scene.furnish();
        Ok(Self { path, scene, options: Options::default() })
    }

    /// Replaces the options. Without this call, all options have their defaults.
    #[must_use]
    pub fn with_options(self, options: Options) -> Self {
        Self { options, ..self }
    }

    /// Returns the scene of the film.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the options with every default filled in.
    ///
    /// # Errors
    /// [`Error::Options`], [`Error::Loop`] or [`Error::Encoder`]: an option or a scene setting is out of range.
    pub fn settings(&self) -> Result<Settings> {
        let settings = Settings::new(self.path.clone(), &self.scene, &self.options)?;
        let _ = settings.encoder_config()?;
        Ok(settings)
    }

    /// Renders into a file, `.mpg`, `.mp4`, `.mkv`, `.ts`, `.vob` or `.m2v`, and returns the report. Blocks until the
    /// film is finished.
    ///
    /// # Errors
    /// Returns the errors of [`Film::settings`] and [`render`](crate::render), and an [`Error::Loop`] if the film cannot
    /// be written.
    pub fn render_to(&self, output: impl AsRef<Path>) -> Result<Report> {
        self.render_with(output, Run::default())
    }

    /// Renders like [`Film::render_to`], with an observer and a flag that ends the film early. Once the flag is true,
    /// no further frame starts, and the video remains playable.
    ///
    /// # Errors
    /// Returns the errors of [`Film::render_to`].
    pub fn render_with(&self, output: impl AsRef<Path>, run: Run<'_>) -> Result<Report> {
        let options = Options { output: Some(output.as_ref().to_owned()), ..self.options.clone() };
        let settings = Settings::new(self.path.clone(), &self.scene, &options)?;
        let _ = settings.encoder_config()?;
        // Create the folders of single frames now, so that a failure is reported before rendering.
        for folder in settings.files.exr.iter().chain(&settings.files.png) {
            std::fs::create_dir_all(folder).map_err(Error::file(folder, "cannot be created"))?;
        }
        let plan = Plan::new(&self.scene, &settings.render);
        crate::render(&self.scene, &settings, &plan, run)
    }
}
