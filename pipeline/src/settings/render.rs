//! The settings that the renderer reads: what a frame shows, and how exact its light is.

use super::{Aov, CodedRate, Importance, Lighting, PixelShading, Settings, Size, Stopping, Thresholds, TileSettings};
use perceptual::ToneMap;
use render_core::image_file::FramePlace;

/// The part of [`Settings`] that is about light and not about files or coding.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// Pictures of the film.
    pub frames: u32,
    /// The frame after the last that is made.
    pub end: u32,
    /// Frames of a chunk, with the first of which all begins anew.
    pub chunk: Option<u32>,
    /// Pictures a second.
    pub fps: f64,
    /// The frame of the scene that the film begins with.
    pub from: u32,
    /// Frames of the scene from one picture of the film to the next.
    pub every: u32,
    /// Size of the picture.
    pub size: Size,
    /// Width of a pixel as a share of its height.
    pub pixel_aspect: f32,
    /// Weights of the maps that say where people look, if they are to steer anything.
    pub importance: Option<Importance>,
    /// Factor G on thresholds: they are divided by G where importance is 1, and multiplied where it is 0.
    pub importance_gain: f32,
    /// Tiles that ranks take on demand, if they do.
    pub tiles: Option<TileSettings>,
    /// How radiance becomes what a display shows, up to its exposure: saliency is that of display values.
    pub tone_map: ToneMap,
    /// Samples of visibility and light to the pixel, at most.
    pub samples: u32,
    /// Whether pixels that outlines cross blend the surfaces of their area.
    pub antialiasing: bool,

    /// How indirect light is computed.
    pub lighting: Lighting,
    /// Whether indirect light is cached on surfaces and interpolated.
    pub cache: bool,
    /// Which pixels are lit.
    pub shading: PixelShading,
    /// Whether bias compensation restores the light that softened virtual lights lose close by.
    pub compensation: bool,
    /// Reflections of light on its way, at most; no limit when not stated.
    pub bounces: Option<u32>,
    /// Anchor lights on surfaces at rest.
    pub vpls: usize,
    /// Anchor lights on surfaces that move.
    pub moving_vpls: usize,
    /// Photons a frame.
    pub photons: u64,
    /// Seed of photons and representatives.
    pub seed: u64,

    /// Where thresholds come from.
    pub thresholds: Thresholds,
    /// Multiplier on what masking allows, for the report.
    pub kappa: f32,
    /// When cuts end.
    pub stopping: Stopping,
    /// Share of pixels that calibrated stopping keeps within their thresholds.
    pub within: f64,
    /// The quantiser_scale that the film is coded with, 1…112: it says how wrong carried light may be.
    pub qscale: u32,

    /// Whether the encoder is given motion.
    pub motion: bool,
    /// The most B pictures in a row, which need motion from both sides.
    pub bframes: u32,
    /// Leave out what the scene does not need.
    pub leave_out: bool,
    /// Further channels of a frame's OpenEXR file.
    pub aov: Vec<Aov>,
}

impl RenderSettings {
    /// Seconds from the start of the animation to frame `n` of the film.
    #[must_use]
    pub fn time(&self, n: u32) -> f32 {
        self.time_beside(n, 0)
    }

    /// Seconds from the start of the animation to the frame `after` frames later than frame `n`; negative numbers are earlier frames,
    /// and the film may end before it.
    #[must_use]
    pub(crate) fn time_beside(&self, n: u32, after: i32) -> f32 {
        let n = f64::from(n) + f64::from(after);
        ((f64::from(self.from) + n * f64::from(self.every)) / self.fps) as f32
    }

    /// Frame `n` in a film of the rate that the video has; none of a rate that no video has.
    #[must_use]
    pub fn place(&self, n: u32) -> Option<FramePlace> {
        let (frames, seconds) = CodedRate::of(self.fps).ok()?.frames();
        Some(FramePlace { number: n, frames, seconds })
    }
}

impl Settings {
    /// The settings that the renderer reads.
    #[must_use]
    pub fn renderer(&self) -> RenderSettings {
        RenderSettings {
            frames: self.frames,
            end: self.frame_range().end,
            chunk: self.chunk,
            fps: self.fps,
            from: self.from,
            every: self.every,
            size: self.size,
            pixel_aspect: self.pixel_aspect(),
            importance: self.importance,
            importance_gain: self.importance_gain.unwrap_or(1.0),
            tiles: self.tiles,
            tone_map: self.tone_map,
            samples: self.samples,
            antialiasing: self.antialiasing,
            lighting: self.lighting,
            cache: self.cache,
            shading: self.shading,
            compensation: self.compensation,
            bounces: self.bounces,
            vpls: self.vpls,
            moving_vpls: self.moving_vpls,
            photons: self.photons,
            seed: self.seed,
            thresholds: self.thresholds,
            kappa: self.kappa,
            stopping: self.stopping,
            within: self.within,
            qscale: self.qscale,
            motion: self.motion,
            bframes: self.bframes,
            leave_out: self.leave_out,
            aov: self.aov.clone(),
        }
    }
}
