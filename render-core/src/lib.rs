//! Scenes, rays, photons and direct light: visible surfaces of a frame, and their reprojection to the previous frame.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod scene;

mod accel;
mod anchor;
#[cfg(feature = "bake")]
mod atlas;
mod bsdf;
pub mod cache;
mod clear;
mod environment;
mod gather;
mod gbuffer;
mod light;
mod media;
mod path;
mod photon;
mod polygon;
mod posed_scene;
mod reconstruct;
mod reprojected;
mod steps;
mod surface;
mod swept;

pub mod image_file;
pub mod sampling;

pub use accel::{Accelerator, Geometry, Hit, Layered, PACKET, Shaft, SheetHit};
pub use anchor::{Anchor, AnchorSpread, Anchors, DynamicAnchor, Moved, ZoneSearch, Zones};
#[cfg(feature = "bake")]
pub use atlas::{
    Atlas, AtlasError, AtlasPoint, FinePoint, FineTexels, SeamPoint, SeamSide, TexelBlend, TexelEstimate, TexelSite,
};
pub use bsdf::{Bsdf, BsdfSample, GlassLobe, SurfaceLobes};
pub use environment::{Environment, SkySample};
pub use gather::{FinalGather, GatherDirections, Gathered};
pub use gbuffer::{
    Coverage, GBuffer, InstanceShare, InstanceShares, LayeredPixel, MACROBLOCK, MixedPixel, NOTHING, PixelSample,
    PixelSurface, SurfaceFragment,
};
pub use light::{
    AreaLight, AreaSample, DirectLights, DomeLight, DynamicLights, EMISSION_DIMENSIONS, EmittedPhoton, Emitters, Lamps,
    LightPoints, PhotonSource, PointLight, ShadingPoint, Source, SunLight, Traced, dome_lights,
};
pub use media::Media;
pub use path::{PathEstimate, PathOptions, PathTracer, PixelSampling, Still, path_traced};
pub use photon::{AnchorFlux, Guide, GuideSearch, Photons};
pub use posed_scene::PosedScene;
pub use ranks::{self, Busy, Timed, process_seconds};
pub use reconstruct::{reconstruct, reconstruct_counted, sample_offsets};
pub use reprojected::{
    AuditCounts, CoatView, CoatsInView, Completed, Destination, LobeLight, ReflectedLight, Reprojected,
    ReprojectedCoats, ReprojectedLight, Reuse, Unseen, spread,
};
pub use surface::{Paint, Surface, Surfaces};
pub use swept::SweptVolume;

/// Crate of the vectors and matrices that occur in signatures.
pub use glam;
pub use plane::{Correspondence, NO_MATCH, Plane};

use glam::{Vec3, Vec3A};

/// Returns [`plane::luminance`] of a linear RGB quantity, in the quantity's unit.
#[inline]
#[must_use]
pub fn luminance(rgb: Vec3) -> f32 {
    plane::luminance(rgb.to_array())
}

/// Size of a scene, and the distance that is negligible in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Center of the scene's bounding box \[m\].
    pub center: Vec3A,
    /// Radius of a bounding sphere of the scene \[m\]; never 0.
    pub radius: f32,
    /// Distance of ray origins from their surface \[m\], some hundred times the rounding error of a coordinate.
    pub epsilon: f32,
}

impl Units {
    /// Measures `scene` over its whole animation, so that moving objects stay inside the sphere.
    #[must_use]
    pub fn of(scene: &scene::Scene) -> Self {
        // Sample the bounds at 33 times over the animation; a static scene needs one.
        let steps = if scene.channels.is_empty() { 1 } else { 33 };
        let mut corners = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for step in 0..steps {
            let pose = scene.pose(scene.duration() * step as f32 / 32.0);
            if let Some((min, max)) = scene.bounds(&pose) {
                corners = (corners.0.min(min), corners.1.max(max));
            }
        }
        // Replace the bounds of an empty scene by a box of 2 m, so that the radius is not 0.
        if !corners.0.cmple(corners.1).all() {
            corners = (Vec3A::splat(-1.0), Vec3A::ONE);
        }
        let center = (corners.0 + corners.1) / 2.0;
        let radius = ((corners.1 - corners.0).length() / 2.0).max(1e-6);
        let largest = corners.0.abs().max(corners.1.abs()).max_element();
        Self { center, radius, epsilon: 2e-5 * largest.max(radius) }
    }
}
