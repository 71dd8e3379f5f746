//! Choice of the filming camera: a camera of the file, or a position on a sphere around a target.

use super::settings_error::SettingsError;
use glam::Vec3A;
use serde::Deserialize;
use serde::de::{self, Deserializer};
use std::fmt;
use std::str::FromStr;

/// Default vertical field of view \[rad\]: 22°, a long lens of 62 mm on 36×24 mm film.
const YFOV: f32 = 0.384;
/// Default azimuth of the camera about +y, measured from +z towards +x \[°\].
const AZIMUTH: f32 = 25.0;
/// Default angle between the direction to the camera and the up axis \[°\].
const POLAR: f32 = 74.0;

/// Selection of the filming camera, or its position.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraChoice {
    /// Name of a camera or its node, or the camera's index, counted from 0. The default is the first moving camera,
    /// otherwise the first camera.
    pub name: Option<String>,
    /// Position of the camera on a sphere around the target. It replaces the file's cameras.
    pub orbit: Option<Orbit>,
    /// Point at which the camera looks \[m\]. The default is the center of the scene.
    pub target: Option<[f32; 3]>,
    /// Vertical field of view \[°\]. The default is the field of view of the file's camera, else 22.
    pub fov: Option<f32>,
    /// Direction that points up in the picture. The default is +y.
    pub up: Option<[f32; 3]>,
    /// Duration in which the camera turns once around the scene's pose at time 0 \[s\].
    pub turn: Option<f32>,
}

/// Position of a camera on a sphere around its target.
///
/// ```
/// use render_core::scene::{Orbit, OrbitDistance};
/// let orbit: Orbit = "30,75,150%".parse()?;
/// assert_eq!((orbit.azimuth, orbit.polar, orbit.distance), (30.0, 75.0, Some(OrbitDistance::Share(1.5))));
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Azimuth about the up axis \[°\]. At 0 the camera is in front, on the side of +z; at 90 on the side of +x.
    pub azimuth: f32,
    /// Angle from the up axis \[°\], 0…180: 0 for a view from above, 90 for a view at eye level.
    pub polar: f32,
    /// Distance from the target. By default, the picture shows the whole scene.
    pub distance: Option<OrbitDistance>,
}

/// Distance of a camera from its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrbitDistance {
    /// Distance \[m\].
    Meters(f32),
    /// Multiple of the distance at which the picture shows the whole scene.
    Share(f32),
}

impl FromStr for Orbit {
    type Err = String;

    /// Parses azimuth, polar angle and optional distance: `30,75`, `30,75,2.5` in meters, or `30,75,120%`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "\"{text}\" is not an orbit such as 30,75 or 30,75,2.5 or 30,75,120%: azimuth, angle from above, distance"
            )
        };
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let number = |part: &str| part.parse::<f32>().ok().filter(|number| number.is_finite()).ok_or_else(wrong);
        // Read the distance as meters or as a percentage.
        let (azimuth, polar, distance) = match parts[..] {
            [azimuth, polar] => (azimuth, polar, None),
            [azimuth, polar, distance] => (azimuth, polar, Some(distance)),
            _ => return Err(wrong()),
        };
        let distance = match distance.map(|text| (text, text.strip_suffix('%'))) {
            None => None,
            Some((_, Some(percent))) => Some(OrbitDistance::Share(number(percent)? / 100.0)),
            Some((meters, None)) => Some(OrbitDistance::Meters(number(meters)?)),
        };
        let orbit = Self { azimuth: number(azimuth)?, polar: number(polar)?, distance };
        let is_positive = match orbit.distance {
            None => true,
            Some(OrbitDistance::Meters(by) | OrbitDistance::Share(by)) => by > 0.0,
        };
        if (0.0..=180.0).contains(&orbit.polar) && is_positive { Ok(orbit) } else { Err(wrong()) }
    }
}

impl<'de> Deserialize<'de> for Orbit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;

        impl de::Visitor<'_> for Text {
            type Value = Orbit;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("text such as \"30,75\" or \"30,75,120%\"")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Orbit, E> {
                text.parse().map_err(E::custom)
            }
        }

        deserializer.deserialize_str(Text)
    }
}

impl CameraChoice {
    /// Returns whether the settings place a camera.
    pub(super) fn has_position(&self) -> bool {
        self.orbit.is_some() || self.target.is_some() || self.up.is_some() || self.turn.is_some()
    }

    /// Returns azimuth and polar angle \[°\].
    pub(super) fn angles(&self) -> (f32, f32) {
        self.orbit.map_or((AZIMUTH, POLAR), |orbit| (orbit.azimuth, orbit.polar))
    }

    /// Returns the up axis, a unit vector.
    pub(super) fn up(&self) -> Vec3A {
        self.up.and_then(|up| Vec3A::from_array(up).try_normalize()).unwrap_or(Vec3A::Y)
    }

    /// Returns the vertical field of view \[rad\].
    pub(super) fn yfov(&self) -> f32 {
        self.fov.map_or(YFOV, f32::to_radians)
    }

    /// Returns the distance from the target, given the distance at which the whole scene is visible \[m\].
    pub(super) fn distance(&self, whole: f32) -> f32 {
        match self.orbit.and_then(|orbit| orbit.distance) {
            None => whole,
            Some(OrbitDistance::Meters(distance)) => distance,
            Some(OrbitDistance::Share(share)) => whole * share,
        }
    }

    /// Checks the range of each value.
    pub(super) fn check_values(&self) -> Result<(), SettingsError> {
        let refuse = |problem: String| Err(SettingsError::value("camera", problem));
        if self.fov.is_some_and(|fov| !(0.1..=170.0).contains(&fov)) {
            return refuse("fov must lie in 0.1..=170 degrees".into());
        }
        if self.target.is_some_and(|target| target.iter().any(|x| !x.is_finite())) {
            return refuse("target must be three finite coordinates".into());
        }
        if self.up.is_some_and(|up| !(1e-6..=1e6).contains(&glam::Vec3::from(up).length())) {
            return refuse("up must be a direction such as [0,1,0]".into());
        }
        if self.turn.is_some_and(|seconds| !(0.01..=1e5).contains(&seconds)) {
            return refuse("turn must lie in 0.01..=100000 seconds".into());
        }
        Ok(())
    }
}
