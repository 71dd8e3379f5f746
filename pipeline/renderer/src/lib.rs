//! Renders scenes to linear frames, with errors within per-pixel thresholds.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

#[cfg(feature = "bake")]
pub mod bake;
#[cfg(feature = "bake")]
pub mod baked_light;
#[cfg(feature = "bake")]
pub mod coat_fields;
mod exposure;
pub mod frame;
#[cfg(feature = "bake")]
pub mod normal_texels;
pub mod plan;
mod prepare;
pub mod reference;
mod renderer;
pub mod settings;
mod shade;
#[cfg(feature = "bake")]
pub mod texels;

pub use exposure::{exposure_of_first_frame, exposure_of_lit_frames};
pub use frame::{Frame, Moment, PreparedFrame};
pub use plan::Plan;
pub use prepare::Preparation;
pub use renderer::Renderer;
pub use shade::{
    Audits, Crew, FootprintPixel, Layer, LightcutCounts, Lit, RecordCounts, RegionLayer, RegionSample, Shading,
    SimulatedFrame, SimulatedRanks, Tolerance, Visible,
};
#[cfg(feature = "bake")]
pub(crate) use shade::{GATHER_RAYS, KnownScene, TexelCoat, Visibility, arriving_light};

/// Minimum perceptual roughness of baked coats. Reflections in smoother coats contain details finer than texels.
pub(crate) const BAKED_ROUGHNESS: f32 = 0.35;
