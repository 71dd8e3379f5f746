//! Color scales and legends of maps.

use crate::false_color::{false_color, log_share};
use plane::Plane;

/// Color scale of a map: name and range of values. Values map to colors logarithmically.
#[derive(Clone, Debug)]
pub struct Scale {
    /// Name of the map, in files and on the page.
    pub name: &'static str,
    /// Description of the map for readers.
    pub about: &'static str,
    /// Values at the dark end and at the bright end.
    pub range: (f32, f32),
    /// Labels of the two ends.
    pub ends: (&'static str, &'static str),
}

/// Ratio of threshold to luminance, from 1 % to 100 %.
pub const THRESHOLD: Scale =
    Scale { name: "threshold", about: "threshold / luminance", range: (0.01, 1.0), ends: ("1 %", "100 %") };
/// Cut sizes, up to the maximum size of a lightcut \[clusters\].
pub const CUT_SIZE: Scale =
    Scale { name: "cuts", about: "clusters per cut", range: (1.0, 1000.0), ends: ("1", "1000") };

impl Scale {
    /// Returns `plane` in false colors.
    pub fn picture(&self, plane: &Plane<f32>) -> Plane<[u8; 3]> {
        plane.map(|value| false_color(log_share(value, self.range.0, self.range.1)))
    }
}

/// Returns a color of a map as CSS.
pub(super) fn css_color([r, g, b]: [u8; 3]) -> String {
    format!("rgb({r},{g},{b})")
}

/// Returns the colors from dark to bright as a CSS gradient.
pub fn gradient() -> String {
    let stops: Vec<String> = (0..=10).map(|i| css_color(false_color(i as f32 / 10.0))).collect();
    format!("linear-gradient(to right, {})", stops.join(", "))
}
