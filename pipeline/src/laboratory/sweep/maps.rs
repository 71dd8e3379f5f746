//! Maps of a frame, as pictures: thresholds, cut sizes, errors (figures 4 and 8 of \[Herzog08\]).

use super::figures::Maps;
use crate::laboratory::compare::HEAT_MAP_RANGE;
use crate::laboratory::compare::false_color::{false_color, log_share};
use plane::Plane;

/// A kind of map: its name, and the numbers at the dark and at the bright end; between them it goes by ratio.
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
/// Error before compression.
pub const ERROR: Scale = Scale {
    name: "error",
    about: "error before compression, code values of luma",
    range: HEAT_MAP_RANGE,
    ends: ("¼", "64"),
};

impl Scale {
    /// `plane` in false colors.
    pub fn picture(&self, plane: &Plane<f32>) -> Plane<[u8; 3]> {
        plane.map(|value| false_color(log_share(value, self.range.0, self.range.1)))
    }
}

/// A map as a picture.
pub struct MapPicture {
    /// Legend of the colors.
    pub scale: Scale,
    /// In false colors.
    pub picture: Plane<[u8; 3]>,
}

/// The three maps as pictures, with their scales.
pub fn pictures(maps: &Maps) -> [MapPicture; 3] {
    let map = |scale: Scale, plane: &Plane<f32>| MapPicture { picture: scale.picture(plane), scale };
    [map(THRESHOLD, &maps.relative_threshold), map(CUT_SIZE, &maps.cut_size), map(ERROR, &maps.error)]
}

/// The colors from dark to bright, as CSS.
pub fn gradient() -> String {
    let stops = (0..=10).map(|i| {
        let [r, g, b] = false_color(i as f32 / 10.0);
        format!("rgb({r},{g},{b})")
    });
    format!("linear-gradient(to right, {})", stops.collect::<Vec<String>>().join(", "))
}
