//! Scales of maps: numbers to colors, and legends.

use crate::false_color::{false_color, log_share};
use plane::Plane;

/// A kind of map: its name, and the numbers at the dark and at the bright end; between them it goes by ratio.
#[derive(Clone, Debug)]
pub struct Scale {
    /// In files and on the page.
    pub name: &'static str,
    /// Description for readers.
    pub about: &'static str,
    /// Dark and bright end.
    pub range: (f32, f32),
    /// The same as they are written beside the colors.
    pub ends: (&'static str, &'static str),
}

/// Thresholds by luminance: from 1 % to all of it.
pub const THRESHOLD: Scale =
    Scale { name: "threshold", about: "threshold by luminance", range: (0.01, 1.0), ends: ("1 %", "100 %") };
/// Cut sizes, up to the largest that a cut may have.
pub const CUT_SIZE: Scale =
    Scale { name: "cuts", about: "clusters of the cut", range: (1.0, 1000.0), ends: ("1", "1000") };

impl Scale {
    /// `plane` in false colors.
    pub fn picture(&self, plane: &Plane<f32>) -> Plane<[u8; 3]> {
        plane.map(|value| false_color(log_share(value, self.range.0, self.range.1)))
    }
}

/// A color of a map as CSS.
pub(super) fn css_color([r, g, b]: [u8; 3]) -> String {
    format!("rgb({r},{g},{b})")
}

/// The colors from dark to bright, as CSS.
pub fn gradient() -> String {
    let stops: Vec<String> = (0..=10).map(|i| css_color(false_color(i as f32 / 10.0))).collect();
    format!("linear-gradient(to right, {})", stops.join(", "))
}
