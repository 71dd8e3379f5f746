#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod bounds; // box and cone of a cluster
mod build;
mod cut; // the lightcut
mod error_bound; // how wrong a cluster can be
mod exhaustive; // the sum over every light: the truth
mod gradient; // how irradiance changes with place and normal
mod light; // what is clustered
mod receiver; // where light arrives
mod store; // trees as bytes
#[cfg(test)]
mod testing; // random scenes
mod tree; // nodes and their invariants
mod update; // new intensities

pub use crate::bounds::Region;
pub use crate::build::BuildParams;
pub use crate::cut::{Cluster, Cut, Scratch, Stop};
pub use crate::exhaustive::exhaustive;
pub use crate::gradient::{IrradianceTerm, irradiance_term};
pub use crate::light::{Emission, LUMINANCE_WEIGHTS, Light, luminance};
pub use crate::receiver::{Lambert, Phong, Receiver};
pub use crate::store::StoreError;
pub use crate::tree::LightTree;
pub use crate::update::UpdateStats;
