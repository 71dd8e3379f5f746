//! Lights: one file or folder per type, and the rays that all types share.
//!
//! ```text
//! area/  point.rs  sun.rs  sky.rs      the types: photons, direct light, bounds
//! emitters.rs                          the table of all lights
//! emission.rs  sampled.rs              the traits of a type, for photons and direct light
//! distant.rs                           common behavior of distant lights
//! photons.rs  direct.rs                photons and direct light from all lights
//! tile.rs  receiver.rs                 receivers, alone and in tiles
//! ```

mod area;
mod direct;
mod distant;
mod emission;
mod emitters;
mod photons;
mod point;
mod points;
mod receiver;
mod sampled;
mod sky;
mod sun;
mod tile;

pub(crate) use area::LightPoint;
pub use area::{AreaLight, AreaSample};
pub use direct::{DirectLights, DynamicLights};
pub(crate) use distant::DistantSample;
pub use emission::{EMISSION_DIMENSIONS, EmittedPhoton};
pub(crate) use emission::{Facing, Start};
pub use emitters::Emitters;
pub use photons::PhotonSource;
pub use point::PointLight;
pub use points::LightPoints;
pub use receiver::ShadingPoint;
pub use sampled::{Lamps, Source, Traced};
pub use sky::{DomeLight, dome_lights};
pub use sun::SunLight;
