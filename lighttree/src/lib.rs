#![doc = include_str!("../README.md")]
//!
//! # Figures
//!
//! The above, where pictures beside the page are not shown. A cut:
//!
#![doc = include_str!("../docs/cut.svg")]
//!
//! Bounds and errors of its clusters, errors and thresholds of pixels, and the rivals:
//!
#![doc = include_str!("../docs/bounds.svg")]
#![doc = include_str!("../docs/errors.svg")]
#![doc = include_str!("../docs/thresholds.svg")]
#![doc = include_str!("../docs/methods.svg")]
#![forbid(unsafe_code)]

mod bounds; // box and cone of a cluster
mod build;
mod calibration; // how far bounds may be exceeded
mod cut; // the lightcut
mod error_bound; // how wrong a cluster can be
mod exhaustive; // the sum over every light: the truth
mod gradient; // how irradiance changes with place and normal
mod lanes; // one number, four or eight
mod light; // what is clustered
mod node; // a cluster
mod race; // who represents a cluster
mod receiver; // where light arrives
mod sites; // where the lights of clusters are
#[cfg(feature = "serde")]
mod store; // trees as bytes
#[cfg(test)]
mod testing; // random scenes
mod tree; // nodes and their lights
mod update; // new intensities
mod validate; // checks of a whole tree

pub use crate::bounds::{DirectionCone, Region};
pub use crate::build::{BuildParams, Builder};
pub use crate::calibration::{Audits, Calibration, Learned};
pub use crate::cut::{Cluster, Cut, KeptCluster, Receivers, Scratch, ShadowRay, Stop};
pub use crate::exhaustive::exhaustive;
pub use crate::gradient::{IrradianceTerm, irradiance_term};
pub use crate::lanes::{Real, Vector3};
pub use crate::light::{Emission, LUMINANCE_WEIGHTS, Light, luminance};
pub use crate::receiver::{Bundled, Ggx, GgxBundle, Lambert, LambertBundle, Receiver, ReflectBound};
#[cfg(feature = "serde")]
pub use crate::store::StoreError;
pub use crate::tree::LightTree;
pub use crate::update::UpdateStats;
pub use crate::validate::InvalidTree;

/// Vectors stand in signatures.
pub use glam;
