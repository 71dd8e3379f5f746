//! Pictures of a scene on demand, without clock, network or threads of its own.
//!
//! [`LiveLoop`] runs the stages of a film one after the other for each picture. The caller chooses time, view and
//! quantiser. The thresholds of a picture steer the light of the next one, as in films.

mod ladder;
mod video;

pub use ladder::{COARSEST, nearest_quantiser};

use crate::error::{LiveError, LiveResult};
use mpeg2enc::{Packet, PictureType};
use perceptual::RELATIVE_FLOOR;
use pipeline::figures::Seconds;
use pipeline::stage::{
    Coding, Display as _, Displayed, LastThresholds, LuminanceThresholds, Mask, Prepare, Shade, Shaded,
};
use ranks::process_seconds;
use render_core::scene::Scene;
use render2mpeg::Settings;
use render2mpeg::stages::{Display, Masking};
use renderer::plan::{Plan, Stage};
use renderer::settings::{RenderSettings, SampleCount};
use renderer::{Moment, Preparation, Shading, exposure_of_lit_frames};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use video::LiveVideo;

/// Maximum permitted error of newly visible pixels, relative to luminance.
const LARGEST_SHARE: f32 = 0.3;

/// Stages for pictures in motion and for static views.
#[derive(Clone, Debug)]
pub struct LivePlans {
    /// Stages of pictures with one sample per pixel.
    plain: Plan,
    /// Stages of pictures with smooth outlines and further samples.
    fine: Plan,
}

impl LivePlans {
    /// Plans `scene` with `settings`, for a camera that may move at any time.
    #[must_use]
    pub fn new(scene: &Scene, settings: &Settings) -> Self {
        let fine = Plan::with_free_camera(scene, &settings.render);
        let render = RenderSettings { samples: SampleCount::Each(1), antialiasing: false, ..settings.render.clone() };
        Self { plain: Plan::with_free_camera(scene, &render), fine }
    }
}

/// Number of samples of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// One sample per pixel.
    #[default]
    Plain,
    /// Smooth outlines, and further samples where light changes within a pixel.
    Fine,
}

/// Request for a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureRequest {
    /// Time and camera.
    pub moment: Moment,
    /// quantiser_scale of MPEG-2, 1…112.
    pub quantiser_scale: u32,
    /// Number of samples.
    pub detail: Detail,
    /// Whether the picture must be an I picture, such as for a new viewer.
    pub is_intra: bool,
    /// Whether all light is computed again, within the thresholds in force. The view is the view of the last picture.
    pub is_fresh: bool,
    /// Maximum fraction of the pixels for which each layer of light is computed; `None` for all that need it.
    pub budget: Option<f32>,
    /// Maximum size of the coded picture \[bits\]; `None` for any. A larger picture is coded again with a coarser
    /// quantiser, unless it has the coarsest.
    pub most_bits: Option<u64>,
}

impl PictureRequest {
    /// Returns a request for a plain picture of `moment`.
    #[must_use]
    pub fn new(moment: Moment, quantiser_scale: u32) -> Self {
        let detail = Detail::Plain;
        Self { moment, quantiser_scale, detail, is_intra: false, is_fresh: false, budget: None, most_bits: None }
    }
}

/// Coded picture and its figures.
#[derive(Clone, Debug)]
pub struct LivePicture {
    /// Picture of the elementary stream, with its reconstruction. The display index counts all pictures of the loop.
    pub packet: Packet,
    /// CPU seconds of the stages.
    pub seconds: Seconds,
    /// Fraction of the lit pixels for which some light was computed.
    pub shaded_share: f64,
    /// Fraction of the pixels that the budget left with larger errors than permitted. Pixels count once per layer.
    pub open_share: f64,
    /// Mean ratio of threshold to luminance.
    pub threshold_mean_relative: f64,
}

impl LivePicture {
    /// Returns whether a decoder may start with this picture.
    #[must_use]
    pub fn is_intra(&self) -> bool {
        self.packet.picture_type == PictureType::I
    }
}

/// The loop of renderer, display, encoder and masking model for pictures on demand.
pub struct LiveLoop<'a> {
    /// Time of the film's first frame \[s\].
    begin: f32,
    plans: &'a LivePlans,
    prepare: Preparation<'a>,
    shade: Shading<'a>,
    display: Display,
    mask: Option<Masking>,
    video: LiveVideo,
    /// Thresholds of the last picture.
    thresholds: Option<LuminanceThresholds>,
    /// Mean ratio of threshold to luminance in the last picture, or the permitted ratio of the first one.
    threshold_mean_relative: f64,
    /// Number of the next picture, from 0.
    index: u32,
    /// Moment of the last picture; `None` before the first.
    shown: Option<Moment>,
}

impl<'a> LiveLoop<'a> {
    /// Creates a loop for `scene`. The first picture computes the light of the scene for all views.
    ///
    /// # Errors
    /// If no encoder supports the settings.
    pub fn new(scene: &'a Scene, settings: &Settings, plans: &'a LivePlans) -> LiveResult<Self> {
        // Use the exposure of a film, which its first frame determines unless that is dark or lamps move.
        let of_lit_frames = settings.render.auto_exposure.then(|| exposure_of_lit_frames(scene, &settings.render));
        let display = match of_lit_frames.flatten() {
            Some(exposure) => Display::new(settings.render.tone_map.with_exposure(exposure)),
            None => Display::of(settings)?,
        };
        let masks = plans.plain.is_on(Stage::Masking);
        Ok(Self {
            begin: settings.render.time(0),
            plans,
            prepare: Preparation::new(scene, &settings.render, &plans.plain).everywhere(),
            shade: Shading::new(&settings.render, &plans.plain),
            display,
            mask: masks.then(|| Masking::new(settings)).transpose()?,
            video: LiveVideo::new(settings)?,
            thresholds: None,
            threshold_mean_relative: 0.0,
            index: 0,
            shown: None,
        })
    }

    /// Computes the light of the scene for all views, before the first picture.
    pub fn make_ready(&mut self) {
        self.prepare.make_ready();
    }

    /// Permits an error of light in the first picture, relative to luminance. No earlier picture has thresholds for it.
    pub fn permit_first_error(&mut self, relative: f64) {
        self.threshold_mean_relative = relative;
    }

    /// Returns the number of pictures in the stream so far.
    #[must_use]
    pub fn pictures(&self) -> u64 {
        self.video.pictures()
    }

    /// Continues the stream of another loop after its `pictures`, with an I picture.
    ///
    /// # Errors
    /// If no encoder supports the settings.
    pub fn continue_after(&mut self, pictures: u64) -> LiveResult<()> {
        self.video.begin_at(pictures)
    }

    /// Renders and codes the next picture.
    ///
    /// # Errors
    /// If the standard does not have the quantiser.
    pub fn picture(&mut self, request: PictureRequest) -> LiveResult<LivePicture> {
        let never = Arc::new(AtomicBool::new(false));
        Ok(self.picture_unless(request, &never)?.expect("it is not stopped"))
    }

    /// Renders and codes the next picture. Further samples end as soon as the flag `stop` is true. A picture of the same
    /// moment as the last one is then discarded: the result is `None`, and the next picture follows the last one.
    ///
    /// # Errors
    /// If the standard does not have the quantiser.
    pub fn picture_unless(
        &mut self,
        request: PictureRequest,
        stop: &Arc<AtomicBool>,
    ) -> LiveResult<Option<LivePicture>> {
        let PictureRequest { moment, quantiser_scale, detail, is_intra, is_fresh, budget, most_bits } = request;
        // Frame 0 has the lights of the film's first frame, so begin with frame 1 at any other time.
        let is_first = self.index == 0;
        if is_first && moment.time != self.begin {
            self.index = 1;
        }
        let index = self.index;
        self.shade.set_stop(stop.clone());

        // Light the frame within the thresholds of the previous picture.
        let prepared = self.prepare.frame_at(index, moment);
        self.shade.set_plan(match detail {
            Detail::Plain => &self.plans.plain,
            Detail::Fine => &self.plans.fine,
        });
        let is_static = self.shown == Some(moment);
        if is_static {
            self.shade.set_aside();
        }
        if is_fresh {
            self.shade.forget();
        }
        self.shade.set_quantiser_scale(quantiser_scale);
        self.shade.set_budget(budget);
        // Newly visible pixels have no threshold; permit the mean error of the last picture.
        let share = (self.threshold_mean_relative as f32).clamp(RELATIVE_FLOOR, LARGEST_SHARE);
        self.shade.set_share_elsewhere(share);
        let known = prepared.correspondence.clone();
        let last = LastThresholds::new(index, self.thresholds.as_ref(), known.as_deref());
        let shaded = self.shade.step(&prepared, last);
        if stop.load(Ordering::Relaxed) && self.shade.take_back() {
            return self.discarded(index).map(|()| None);
        }
        self.shade.keep();
        self.shown = Some(moment);

        // Show and code it, with the exact motion from the previous picture.
        let Shaded { figures, .. } = &shaded;
        let mut seconds = figures.seconds.clone();
        let (shaded_share, threshold_mean_relative) = (figures.shaded_share, figures.threshold_mean_relative);
        self.threshold_mean_relative = threshold_mean_relative;
        let begin = process_seconds();
        let shown = self.display.show(if is_first { 0 } else { index }, &shaded);
        let is_shown = process_seconds();
        let displayed = Displayed { index, correspondence: known, ..shown };
        let coded = self.video.code(&displayed, quantiser_scale, is_intra, most_bits)?;
        let is_coded = process_seconds();

        // Derive the thresholds of the next picture from the coding of this one.
        self.thresholds = self.masked(displayed, &coded.coding);
        (seconds.tone_map, seconds.encode) = (is_shown - begin, is_coded - is_shown);
        seconds.thresholds = process_seconds() - is_coded;
        self.index = index.checked_add(1).ok_or(LiveError::TooManyPictures)?;
        seconds.add_up();
        let open_share = self.shade.open_share();
        Ok(Some(LivePicture { packet: coded.packet, seconds, shaded_share, open_share, threshold_mean_relative }))
    }

    /// Goes on after the picture `index`, which was discarded and has the view of the last shown picture.
    fn discarded(&mut self, index: u32) -> LiveResult<()> {
        if let Some(thresholds) = &mut self.thresholds {
            thresholds.of = index;
        }
        self.index = index.checked_add(1).ok_or(LiveError::TooManyPictures)?;
        Ok(())
    }

    /// Returns the thresholds that follow from the coding of a picture; `None` without masking.
    fn masked(&mut self, displayed: Displayed, coding: &Coding) -> Option<LuminanceThresholds> {
        let delta = self.mask.as_mut()?.step(&displayed, coding);
        Some(LuminanceThresholds { of: displayed.index, delta, luminance: Arc::clone(&displayed.luminance) })
    }

    /// Returns the configuration of the encoder.
    pub fn encoder_config(&self) -> &mpeg2enc::Config {
        self.video.config()
    }
}

impl std::fmt::Debug for LiveLoop<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LiveLoop").field("index", &self.index).finish_non_exhaustive()
    }
}
