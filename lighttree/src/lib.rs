// Figures as data, defined before the paths of the README: pages of rustdoc have no folder `docs`.
#![doc = include_str!("../docs/figures.md")]
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod bounds; // bounds of a cluster: box and cone
mod build;
mod calibration; // ratio of bounds to thresholds
mod cut; // the lightcut
mod draw; // random draws of lights
mod error_bound; // error bound of a cluster
mod exhaustive; // reference: the sum over all lights
mod gradient; // gradients of irradiance over position and normal
mod lanes; // one, four or eight lanes
mod light; // lights
mod node; // clusters
mod race; // draw of representatives
mod receiver; // receivers of light
mod sites; // positions of representative lights
#[cfg(feature = "serde")]
mod store; // serialization of trees
#[cfg(test)]
mod testing; // random scenes
mod tree; // nodes and their lights
mod update; // new intensities
mod validate; // checks of a whole tree

pub use crate::bounds::{DirectionCone, Region};
pub use crate::build::{BuildParams, Builder, SearchLoop};
pub use crate::calibration::{Audits, Calibration, Learned};
pub use crate::cut::{Cluster, KeptCluster, Lightcut, Receivers, Scratch, ShadowRay, Stop};
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

/// Vector types of the public API.
pub use glam;
