//! The settings that the renderer reads.

use super::{CodedRate, Settings};
use renderer::settings::RenderSettings;

impl Settings {
    /// The settings that the renderer reads.
    #[must_use]
    pub fn renderer(&self) -> RenderSettings {
        RenderSettings {
            frames: self.frames,
            end: self.frame_range().end,
            chunk: self.chunk,
            fps: self.fps,
            rate: CodedRate::of(self.fps).ok().map(CodedRate::frames),
            from: self.from,
            every: self.every,
            size: self.size,
            pixel_aspect: self.pixel_aspect(),
            importance: self.importance,
            importance_gain: self.importance_gain.unwrap_or(1.0),
            tiles: self.tiles,
            tone_map: self.tone_map,
            auto_exposure: self.auto_exposure,
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
