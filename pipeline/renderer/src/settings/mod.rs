//! Settings of the renderer: frames, resolution, lighting and permitted error.

mod importance;
mod importance_files;
mod samples;
mod tiles;
mod values;

pub use importance::Importance;
pub use importance_files::ImportanceFiles;
pub use samples::SampleCount;
pub(crate) use tiles::TILES_PER_RANK;
pub use tiles::{RecordSharing, TileCost, TileSettings};
pub use values::{Aov, Lighting, PixelShading, Size, Stopping, Thresholds, parsed};

use perceptual::ToneMap;
use render_core::image_file::FramePlace;
use render_core::scene::Scene;

/// Number of photons per anchor light, for quantiser_scale below 4, below 16, and from 16 on.
///
/// Photon noise is visible only at fine quantisers. With half the photons, a film of `atrium` (192×192, 9000 anchors)
/// loses 0.66 dB at quantiser_scale 2 and 0.09 dB at 8. At 48, it loses nothing even with a quarter. Table 1 of
/// \[Herzog08\] uses 150 photons per anchor, with fewer anchors.
const PHOTONS_PER_ANCHOR: [u64; 3] = [36, 18, 9];
/// Number of anchor lights on dynamic geometry, each evaluated at every record. In `cornell`, the relative MSE against
/// the path tracer is 1.6·10⁻³ with 24 anchors, two or three per side of a block. It is 4.5·10⁻⁴ with 96 anchors, which
/// need 2 % more shadow rays.
const MOVING_ANCHORS: usize = 96;
/// Number of anchor lights on dynamic geometry in a studio. With few anchors, one near the ground lights a spot: next to
/// the feet of Khronos' CesiumMan, the RMSE is 8.2 codes with 96 anchors and 4.7 with 256, in the same time.
const STUDIO_MOVING_ANCHORS: usize = 256;

/// Settings that affect the light of a film, but not its output files or coding.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// Number of frames in the film.
    pub frames: u32,
    /// Index of the first frame after the rendered range.
    pub end: u32,
    /// Number of frames per chunk, with all state reset at the start of each; `None` without chunks.
    pub chunk: Option<u32>,
    /// Frame rate \[frames/s\].
    pub fps: f64,
    /// Frame rate as (frames, seconds), such as (30000, 1001), for file headers; `None` if the video format has no such rate.
    pub rate: Option<(u32, u32)>,
    /// Scene frame with which the film starts.
    pub from: u32,
    /// Number of scene frames from one film frame to the next.
    pub every: u32,
    /// Frame size \[pixels\].
    pub size: Size,
    /// Ratio of pixel width to pixel height.
    pub pixel_aspect: f32,
    /// Weights of the importance maps; `None` disables importance.
    pub importance: Option<Importance>,
    /// Gain G of importance: thresholds are divided by G at importance 1 and multiplied by G at 0.
    pub importance_gain: f32,
    /// Tiles that ranks request on demand; `None` splits the work without tiles.
    pub tiles: Option<TileSettings>,
    /// Tone curve before exposure is set. Saliency is computed from the curve's display values.
    pub tone_map: ToneMap,
    /// Whether the film sets the exposure of its tone curve automatically.
    pub auto_exposure: bool,
    /// Number of visibility and light samples per pixel.
    pub samples: SampleCount,
    /// Whether pixels that outlines cross blend all surfaces in their area.
    pub antialiasing: bool,

    /// Method for indirect light.
    pub lighting: Lighting,
    /// Whether indirect light is cached on surfaces and interpolated.
    pub cache: bool,
    /// Pixels that are shaded in each frame.
    pub shading: PixelShading,
    /// Whether bias compensation restores the light lost by clamping nearby virtual lights.
    pub compensation: bool,
    /// Maximum number of reflections of light; `None` without a limit.
    pub bounces: Option<u32>,
    /// Number of anchor lights on static geometry.
    pub vpls: usize,
    /// Number of anchor lights on dynamic geometry.
    pub moving_vpls: usize,
    /// Number of photons per frame.
    pub photons: u64,
    /// Random seed of photons and of representative lights.
    pub seed: u64,

    /// Source of the thresholds.
    pub thresholds: Thresholds,
    /// Multiplier κ of the masking thresholds, applied in the masking stage.
    pub kappa: f32,
    /// Stopping criterion of lightcuts.
    pub stopping: Stopping,
    /// Fraction of pixels that calibrated stopping keeps within their thresholds.
    pub within: f64,
    /// quantiser_scale of the film, 1…112; it determines the permitted error of reprojected light.
    pub qscale: u32,

    /// Whether the encoder receives motion vectors.
    pub motion: bool,
    /// Maximum number of consecutive B pictures. B pictures need motion from both sides.
    pub bframes: u32,
    /// Whether to skip stages that the scene does not need.
    pub leave_out: bool,
    /// Additional channels of each frame's OpenEXR file.
    pub aov: Vec<Aov>,
}

/// Minimum number of photons in a studio, whose ground takes most of them. With 20 000, single anchors next to the
/// ground are up to twice too bright. With 100 000, stills of DamagedHelmet and CesiumMilkTruck have 3 and 5 % less RMSE
/// against path tracing, for up to 0.2 CPU s.
const STUDIO_PHOTONS: u64 = 100_000;

/// Returns the number of anchor lights on the dynamic geometry of a scene.
#[must_use]
pub fn moving_anchors(scene: &Scene) -> usize {
    if scene.ground.is_some() { STUDIO_MOVING_ANCHORS } else { MOVING_ANCHORS }
}

/// Returns the number of photons for a film of a scene with `vpls` anchor lights, coded with quantiser_scale `qscale`.
#[must_use]
pub fn photon_count(scene: &Scene, vpls: usize, qscale: u32) -> u64 {
    let count = photons_per_anchor(qscale) * vpls as u64;
    if scene.ground.is_some() { count.max(STUDIO_PHOTONS) } else { count }
}

/// Returns the number of photons per anchor light for a film coded with quantiser_scale `qscale`, 1…112.
#[must_use]
fn photons_per_anchor(qscale: u32) -> u64 {
    let [fine, medium, coarse] = PHOTONS_PER_ANCHOR;
    match qscale {
        ..4 => fine,
        4..16 => medium,
        16.. => coarse,
    }
}

impl Default for RenderSettings {
    /// Returns the defaults of a film for one still frame of a small scene: 512×512 pixels and 4000 anchor lights.
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
            samples: SampleCount::Auto,
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
    /// Returns the animation time of film frame `n` \[s\].
    #[must_use]
    pub fn time(&self, n: u32) -> f32 {
        self.time_beside(n, 0)
    }

    /// Returns the animation time \[s\] of film frame `n + after`. `after` may be negative, and that frame may be after
    /// the film's end.
    #[must_use]
    pub(crate) fn time_beside(&self, n: u32, after: i32) -> f32 {
        let n = f64::from(n) + f64::from(after);
        ((f64::from(self.from) + n * f64::from(self.every)) / self.fps) as f32
    }

    /// Returns the position of frame `n` in the video; `None` if the video format lacks the frame rate.
    #[must_use]
    pub fn place(&self, n: u32) -> Option<FramePlace> {
        let (frames, seconds) = self.rate?;
        Some(FramePlace { number: n, frames, seconds })
    }
}
