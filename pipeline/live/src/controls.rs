//! Changes of camera and animation, as messages of the controller contain them.

use crate::camera::Keys;
use serde::Deserialize;

/// Change of the controls by one message. Missing fields change nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Controls {
    /// Angles by which the camera turns \[rad\].
    pub turn: [f32; 2],
    /// Angles by which the camera moves around the orbit's center \[rad\].
    pub orbit: [f32; 2],
    /// Sideways movement \[multiples of the distance from the orbit's center\].
    pub pan: [f32; 2],
    /// Logarithm of the factor by which the camera approaches the orbit's center.
    pub zoom: f32,
    /// Held keys.
    pub keys: Option<Keys>,
    /// Whether the animation plays.
    pub play: Option<bool>,
    /// Returns the camera to the camera of the scene.
    pub reset: bool,
}
