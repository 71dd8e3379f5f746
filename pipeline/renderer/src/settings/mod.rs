//! The settings that the renderer reads: what a frame shows, and how exact its light is.

mod importance;
mod tiles;
mod values;

pub use importance::Importance;
pub(crate) use tiles::TILES_PER_RANK;
pub use tiles::{RecordSharing, TileCost, TileSettings};
pub use values::{Aov, Lighting, PixelShading, Size, Stopping, Thresholds, parsed};

use perceptual::ToneMap;
use render_core::image_file::FramePlace;

/// Photons for each anchor light: where quantiser_scale is below 4, below 16, and from there on.
///
/// Noise of photons is seen where the encoder keeps it. A film of `atrium` (192×192, 9000 anchors) loses 0.66 dB at
/// quantiser_scale 2 with half of its photons, 0.09 dB at 8, and nothing at 48 even with a quarter of them. Table 1 of
/// \[Herzog08\] has 150, on fewer anchors.
const PHOTONS_PER_ANCHOR: [u64; 3] = [36, 18, 9];
/// Anchor lights on moving things, each evaluated at every record. With 24, two or three to a side of a block, `cornell`
/// is 1.6·10⁻³ off the path tracer's in relative MSE; with 96 it is 4.5·10⁻⁴, for 2 % more shadow rays.
pub const MOVING_ANCHORS: usize = 96;

/// The choices of a film that are about light, and not about files or coding.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// Pictures of the film.
    pub frames: u32,
    /// The frame after the last that is made.
    pub end: u32,
    /// Frames of a chunk, with the first of which all begins anew.
    pub chunk: Option<u32>,
    /// Frames a second.
    pub fps: f64,
    /// The same as a fraction, such as (30000, 1001), for headers of files; none of rates that no video has.
    pub rate: Option<(u32, u32)>,
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
    /// Whether the film sets the exposure of its tone curve.
    pub auto_exposure: bool,
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

/// Photons for each anchor light of a film that is coded with `qscale`, a quantiser_scale of 1…112.
#[must_use]
pub fn photons_per_anchor(qscale: u32) -> u64 {
    let [fine, medium, coarse] = PHOTONS_PER_ANCHOR;
    match qscale {
        ..4 => fine,
        4..16 => medium,
        16.. => coarse,
    }
}

impl Default for RenderSettings {
    /// The defaults of films, for one still frame of a small scene: 512×512 pixels and 4000 anchor lights.
    fn default() -> Self {
        let vpls = 4000;
        Self {
            frames: 1,
            end: 1,
            chunk: None,
            fps: 25.0,
            rate: Some((25, 1)),
            from: 0,
            every: 1,
            size: Size { width: 512, height: 512 },
            pixel_aspect: 1.0,
            importance: None,
            importance_gain: 1.0,
            tiles: None,
            tone_map: ToneMap::default(),
            auto_exposure: true,
            samples: 1,
            antialiasing: true,
            lighting: Lighting::Lightcuts,
            cache: true,
            shading: PixelShading::Adaptive,
            compensation: true,
            bounces: None,
            vpls,
            moving_vpls: MOVING_ANCHORS,
            photons: photons_per_anchor(8) * vpls as u64,
            seed: 1,
            thresholds: Thresholds::Codec,
            kappa: 1.0,
            stopping: Stopping::Bound,
            within: lighttree::Calibration::DEFAULT_SHARE,
            qscale: 8,
            motion: true,
            bframes: 0,
            leave_out: true,
            aov: Vec::new(),
        }
    }
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
        let (frames, seconds) = self.rate?;
        Some(FramePlace { number: n, frames, seconds })
    }
}
