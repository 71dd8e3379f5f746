//! Resolves options to settings: fills in all defaults and checks single options. No other file defines a default.

use super::aspect::PictureAspect;
use super::chunks::{checked_range, range_of_chunk};
use super::coded_rate::CodedRate;
use super::container::{check_disc, check_part, container_of, unknown_ending};
use super::emphasis::AdaptiveQuantiser;
use super::options::Options;
use super::preset::Preset;
use super::values::Switch;
use super::{CodingSettings, Effort, FileSettings, FrameRange, Settings};
use crate::error::{Error, Result};
use lighttree::Calibration;
use perceptual::ToneMap;
use render_core::scene::{Scene, SceneSettings, SettingsError};
use renderer::settings::{
    Aov, Lighting, PixelShading, RenderSettings, SampleCount, Size, Stopping, Thresholds, moving_anchors, photon_count,
};
use std::path::{Path, PathBuf};

/// Default of `--importance-gain` (ours): maximum factor by which importance lowers or raises thresholds.
const IMPORTANCE_GAIN: f32 = 2.0;
/// Number of samples of the most important pixels \[Debattista05, 4.2\].
const IMPORTANT_SAMPLES: SampleCount = SampleCount::Each(5);
/// Divisor of the number of anchor lights for drafts. With a divisor of 4, walls of the cabin scene have bright spots.
const DRAFT_SHARE: usize = 2;
/// κ of [`perceptual::Feedback::with_kappa`] (ours). Compared with lightcuts at 2 %, κ = 1 reduces the PSNR of decoded
/// luma by 0.4 dB (`cornell`, quantiser_scale 48, 512×512, 16 frames). With κ = 1/4 the loss is below 0.1 dB.
const KAPPA: f32 = 0.25;
/// κ of [`perceptual::Feedback::observe_coded`], which measures how errors change the decoded picture. On `cornell`
/// (256×256, quantisers from 8 to 48), κ = 1 costs less than 0.06 dB and 1.3 % of bits. κ = 2 costs 0.16 dB and 3.9 %
/// of bits.
const CODEC_KAPPA: f32 = 1.0;

/// Returns an [`Error::Options`] with a formatted message.
macro_rules! fail {
    ($($text:tt)*) => { return Err(Error::Options(format!($($text)*))) };
}

impl Options {
    /// Fills in every default, given `scene` loaded from `path`, and returns the settings.
    ///
    /// # Errors
    /// If an option or a scene setting is out of range or contradicts another. The message names valid values.
    pub fn fill_in(&mut self, path: PathBuf, scene: &Scene) -> Result<Settings> {
        // Apply the preset first: all other defaults fill only options that the preset does not set.
        if let Some(preset) = self.preset {
            self.fill_in_preset(preset, scene);
        }

        // Fill in length and output of the film.
        let (fps, frames) = self.fill_in_length(&path, scene)?;
        self.fill_in_chunks(frames)?;
        let output = self.fill_in_output(&path)?;
        if self.cbr && self.bitrate.is_none() {
            fail!("--cbr needs --bitrate, the constant rate in bits per second");
        }

        // Fill in thresholds and sampling.
        let (thresholds, kappa) = self.fill_in_thresholds()?;
        let (stopping, within) = self.fill_in_stopping()?;
        self.fill_in_importance(&path, scene)?;
        let samples = self.fill_in_samples()?;
        if self.bounces == Some(0) {
            fail!("--bounces 0: unreflected light shows only lamps; 1 is direct light only");
        }

        // Check the files, and fill in lights and exposure.
        self.check_files()?;
        let vpls = *self.vpls.get_or_insert_with(|| render_core::Anchors::default_count(scene));
        if !(1..=10_000_000).contains(&vpls) {
            fail!("--vpls {vpls} must be in 1..=10000000");
        }
        let lighting = self.fill_in_lighting(&path)?;
        let weighs_costs = self.importance.as_ref().is_some_and(|importance| importance.cost > 0.0);
        if weighs_costs && (self.tiles.is_some() || lighting != Lighting::Lightcuts) {
            fail!("--importance cost needs the sizes of lightcuts; drop --tiles or --lighting, or the cost map");
        }
        let (tone_map, auto_exposure) = tone_map(&path, scene)?;
        let qscale = *self.qscale.get_or_insert(8);
        // A bit rate may lead to any quantiser, so expect the default quantiser.
        let expected_qscale = if self.bitrate.is_some() { 8 } else { qscale };

        // Fill in size and shape of the pictures.
        let size = *self.size.get_or_insert_with(|| Size::of_camera(scene, 512));
        let aspect = *self.aspect.insert(PictureAspect::of(self.aspect, &output, self.range, size)?);
        check_disc(&output, self.range, fps)?;
        let frame_range = self.range.map_or(0..frames, |FrameRange { first, last }| first..last + 1);
        let [pixel_width, pixel_height] = aspect.pixel(size);
        let pixel_aspect = pixel_width as f32 / pixel_height as f32;
        if let Some(files) = self.importance.as_mut().and_then(|importance| importance.files.as_mut()) {
            files.read(frame_range.clone(), size, pixel_aspect)?;
        }

        // Collect the settings, since all options now have values.
        let render = RenderSettings {
            frames,
            end: frame_range.end,
            chunk: self.chunk,
            fps,
            rate: CodedRate::of(fps).ok().map(CodedRate::frames),
            from: self.from.unwrap_or(0),
            every: self.every.unwrap_or(1),
            size,
            pixel_aspect,
            importance: self.importance.clone(),
            importance_gain: self.importance_gain.unwrap_or(1.0),
            tiles: self.tiles,
            tone_map,
            auto_exposure,
            samples,
            antialiasing: self.antialiasing.get_or_insert(Switch::On).is_on(),
            lighting,
            cache: self.cache.get_or_insert(Switch::On).is_on(),
            shading: *self.shading.get_or_insert(PixelShading::Adaptive),
            compensation: self.compensation.get_or_insert(Switch::On).is_on(),
            bounces: self.bounces,
            vpls,
            moving_vpls: moving_anchors(scene),
            photons: *self.photons.get_or_insert(photon_count(scene, vpls, expected_qscale)),
            seed: *self.seed.get_or_insert(1),
            thresholds,
            kappa,
            stopping,
            within,
            qscale,
            motion: !self.no_motion,
            bframes: *self.bframes.get_or_insert(0),
            leave_out: !self.run_everything,
            aov: self.aov.clone(),
        };
        let (coding, files) = (self.fill_in_coding(), self.files());
        Ok(Settings { scene: path, output, range: self.range, aspect, render, coding, files })
    }

    /// Fills in the options of the encoder and returns its settings.
    fn fill_in_coding(&mut self) -> CodingSettings {
        CodingSettings {
            aq: *self.aq.get_or_insert(AdaptiveQuantiser::Off),
            gop: *self.gop.get_or_insert(15),
            bitrate: self.bitrate,
            cbr: self.cbr,
            effort: *self.effort.get_or_insert(Effort::Balanced),
            mpeg1: self.mpeg1,
        }
    }

    /// Returns the files of the film, except scene and video.
    fn files(&self) -> FileSettings {
        FileSettings {
            baked: self.baked.clone(),
            light: self.light.clone(),
            png: self.png.clone(),
            exr: self.exr.clone(),
            exr_depth: self.exr_depth,
            y4m: self.y4m.clone(),
            y4m_is_coded: false,
        }
    }

    /// Fills in the number of samples. Pixels have further samples of their own unless another option chooses samples.
    fn fill_in_samples(&mut self) -> Result<SampleCount> {
        let is_plain = self.tiles.is_some() || self.antialiasing == Some(Switch::Off);
        let usual = match &self.importance {
            Some(_) => IMPORTANT_SAMPLES,
            None if is_plain => SampleCount::Each(1),
            None => SampleCount::Auto,
        };
        let samples = *self.samples.get_or_insert(usual);
        if samples == SampleCount::Auto && (self.importance.is_some() || self.tiles.is_some()) {
            fail!("--samples auto needs the light of a whole frame; drop --importance and --tiles, or give a number");
        }
        Ok(samples)
    }

    /// Fills in a preset's values for options that are not set.
    fn fill_in_preset(&mut self, preset: Preset, scene: &Scene) {
        // Set only missing options, because explicit options override the preset.
        match preset {
            Preset::Draft => {
                self.size.get_or_insert_with(|| Size::of_camera(scene, 256));
                self.qscale.get_or_insert(16);
                self.effort.get_or_insert(Effort::Fast);
                if self.importance.is_none() {
                    self.samples.get_or_insert(SampleCount::Each(1));
                }
                self.vpls.get_or_insert_with(|| render_core::Anchors::default_count(scene).div_ceil(DRAFT_SHARE));
            }
            Preset::Good => {}
            Preset::Final => {
                self.size.get_or_insert_with(|| Size::of_camera(scene, 1024));
                self.qscale.get_or_insert(4);
                self.samples.get_or_insert(SampleCount::Each(4));
                self.effort.get_or_insert(Effort::Best);
            }
        }
    }

    fn fill_in_output(&mut self, path: &Path) -> Result<PathBuf> {
        // Name the film after the scene, in the current folder; add the range to the name of a part.
        if self.output.is_none() {
            let stem = path.file_stem();
            let stem = stem.ok_or_else(|| Error::Options("the scene's path has no file name".into()))?;
            let mut name = stem.to_owned();
            match self.range {
                Some(range) => name.push(format!("_{range}.m2v")),
                None => name.push(".mpg"),
            }
            self.output = Some(name.into());
        }

        // Check the ending now, so that an unknown format is reported before rendering.
        let output = self.output.clone().unwrap_or_default();
        container_of(&output, self.range).ok_or_else(|| unknown_ending(&output))?;
        check_part(self.range, &output)?;
        Ok(output)
    }

    /// Fills in frame rate and number of frames, and returns both.
    fn fill_in_length(&mut self, path: &Path, scene: &Scene) -> Result<(f64, u32)> {
        // Report an invalid rate in the scene's settings with the path of the settings file.
        let video = scene.settings.video;
        if let Some(Err(error)) = video.fps.filter(|_| self.fps.is_none()).map(CodedRate::of) {
            return Err(Error::content(&SceneSettings::path_for(path), format!(": [video] fps: {error}")));
        }
        let fps = *self.fps.get_or_insert(video.fps.unwrap_or(25.0));
        if !(fps.is_finite() && fps > 0.0) {
            fail!("--fps {fps} must be positive");
        }

        // Determine the scene's length, and the range of frames that the film shows.
        let animated = (f64::from(scene.duration()) * fps).round().clamp(0.0, 1e6) as u32;
        let all = video.frames.unwrap_or(if animated > 0 { animated } else { 100 });
        let (from, every) = (self.from.unwrap_or(0), self.every.unwrap_or(1));
        if every == 0 {
            fail!("--every 0 must be at least 1, which renders every frame");
        }
        let end = match self.to {
            Some(to) if to < from => fail!("--to {to} is before --from {from}"),
            Some(to) => to.saturating_add(1),
            None if self.frames.is_none() && from >= all => {
                fail!("--from {from} exceeds the scene: its last frame is {}; set --frames to render more", all - 1)
            }
            None => all,
        };
        // Let `--frames` override the number of frames from start, end and step.
        let shown = end.saturating_sub(from).div_ceil(every);
        let frames = *self.frames.get_or_insert(shown);
        // Clear `to`, because the number of frames now determines the film's end.
        self.to = None;
        if frames == 0 {
            fail!("--frames 0: a video has at least one frame");
        }
        Ok((fps, frames))
    }

    /// Checks the range of frames to make, if given.
    fn fill_in_chunks(&mut self, frames: u32) -> Result<()> {
        // Reject a bit rate: rate control depends on all earlier pictures.
        let option = if self.chunk.is_some() { "--chunk" } else { "--range" };
        let has_parts = self.chunk.is_some() || self.range.is_some();
        if self.bitrate.is_some() && has_parts {
            fail!(
                "{option} with --bitrate: chunks are coded independently and cannot share a bit rate; drop one of the two options"
            );
        }

        // Replace the index of a chunk by its range.
        if let Some(index) = self.chunk_index.take() {
            if self.range.is_some() {
                fail!("--chunk-index with --range: both choose the frames; drop one of the two options");
            }
            self.range = Some(range_of_chunk(self.chunk, index, frames)?);
        }
        self.range = checked_range(self.chunk, self.range, frames)?;
        Ok(())
    }

    /// Fills in the source of thresholds and their multiplier.
    fn fill_in_thresholds(&mut self) -> Result<(Thresholds, f32)> {
        let thresholds = *self.thresholds.get_or_insert(Thresholds::Codec);
        let kappa = *self.kappa.get_or_insert(if thresholds == Thresholds::Codec { CODEC_KAPPA } else { KAPPA });
        if !(0.0..=100.0).contains(&kappa) {
            fail!("--kappa {kappa} must be in 0..=100; 1 is the paper's");
        }
        Ok((thresholds, kappa))
    }

    /// Fills in the lighting method and the file of baked light.
    fn fill_in_lighting(&mut self, path: &Path) -> Result<Lighting> {
        // Reject options that the lighting method ignores.
        let lighting = *self.lighting.get_or_insert(Lighting::Lightcuts);
        if self.baked.is_some() && !lighting.is_baked() {
            fail!("--baked needs --lighting baked");
        }
        if lighting.is_baked() && self.tiles.is_some() {
            fail!("--tiles with --lighting baked: baked light needs no tiles; drop --tiles");
        }
        // Expect the baked light next to the scene.
        if lighting.is_baked() {
            self.baked.get_or_insert_with(|| path.with_extension("slf"));
        }
        Ok(lighting)
    }

    /// Fills in the stopping rule of lightcuts, and the fraction of pixels that calibrated stopping keeps within
    /// their thresholds.
    fn fill_in_stopping(&mut self) -> Result<(Stopping, f64)> {
        // Let `--within` imply calibrated stopping.
        let implied = if self.within.is_some() { Stopping::Calibrated } else { Stopping::Bound };
        let stopping = *self.stopping.get_or_insert(implied);
        let within = self.within.unwrap_or(Calibration::DEFAULT_SHARE);
        if !(0.5..=0.999).contains(&within) {
            fail!("--within {within} must be in 0.5..=0.999; with 0.95 one pixel in twenty may exceed its threshold");
        }
        // Reject a fraction that the bound would ignore, and store the default for reports.
        match stopping {
            Stopping::Bound if self.within.is_some() => {
                fail!("--within needs calibrated stopping; drop --stopping bound");
            }
            Stopping::Bound => {}
            Stopping::Calibrated => self.within = Some(within),
        }
        Ok((stopping, within))
    }

    /// Fills in the gain of importance, and checks that the scene has the nodes of a task map.
    fn fill_in_importance(&mut self, path: &Path, scene: &Scene) -> Result<()> {
        // Reject options without effect if there is no importance map.
        let Some(weights) = &self.importance else {
            if self.importance_gain.is_some() {
                fail!("--importance-gain needs --importance, such as --importance saliency:1");
            }
            if self.aov.contains(&Aov::Importance) {
                fail!("--aov importance needs --importance, such as --importance saliency:1");
            }
            return Ok(());
        };
        let gain = *self.importance_gain.get_or_insert(IMPORTANCE_GAIN);
        if !(1.0..=8.0).contains(&gain) {
            fail!("--importance-gain {gain} must be in 1..=8; 1 leaves thresholds unchanged");
        }

        // Refuse an empty task map, which is a mistake.
        if weights.task > 0.0 {
            let (file, nodes) = (SceneSettings::path_for(path), &scene.settings.importance.nodes);
            if nodes.is_empty() {
                let text = ": --importance task needs node names: add [importance] with nodes = [\"NAME\"]";
                return Err(Error::content(&file, text));
            }
            for name in nodes {
                if !scene.instances_under(name).contains(&true) {
                    let text = format!(": [importance] nodes: the scene has no visible node \"{name}\"");
                    return Err(Error::content(&file, text));
                }
            }
        }
        Ok(())
    }

    fn check_files(&mut self) -> Result<()> {
        // Reject files that this build cannot write, before rendering.
        if self.exr.is_some() && !cfg!(feature = "exr") {
            fail!("--exr: this build writes no OpenEXR; build it with the feature exr");
        }
        if self.png.is_some() && !cfg!(feature = "still") {
            fail!("--png: this build writes no pictures; build it with the feature still");
        }
        // Reject options of OpenEXR files without such files.
        if !self.aov.is_empty() && self.exr.is_none() {
            fail!("--aov needs --exr DIR, the folder of its files");
        }
        match (&self.exr, self.exr_depth) {
            (None, Some(_)) => fail!("--exr-depth needs --exr DIR, the folder of its files"),
            (None, None) => {}
            (Some(_), depth) => self.exr_depth = Some(depth.unwrap_or_default()),
        }
        Ok(())
    }
}

/// Returns the tone curve of a scene, and whether the first frame sets the exposure.
fn tone_map(path: &Path, scene: &Scene) -> Result<(ToneMap, bool)> {
    let Some(table) = &scene.settings.tone_mapping else { return Ok((ToneMap::default(), true)) };
    let file = SceneSettings::path_for(path);
    // Let a constant exposure in the table disable automatic exposure.
    let read = read_tone_map(table).map_err(|error| Error::content(&file, format!(": [tone_mapping] {error}")))?;
    Ok((read, !table.contains_key("exposure")))
}

/// Returns the tone curve of a `[tone_mapping]` table.
///
/// # Errors
/// If a key or value does not exist or a number is out of range. The message names valid values.
pub fn read_tone_map(table: &toml::Table) -> Result<ToneMap, String> {
    let read: Result<ToneMap, toml::de::Error> = table.clone().try_into();
    let tone_map = read.map_err(|error| SettingsError::of_toml(&error.to_string()).to_string())?;
    tone_map.check().map_err(|error| error.to_string())?;
    Ok(tone_map)
}
