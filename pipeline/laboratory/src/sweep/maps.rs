//! Maps of a frame as pictures: thresholds, cut sizes and errors (figures 4 and 8 of \[Herzog08\]).

use super::figures::Maps;
use crate::compare::HEAT_MAP_RANGE;
use crate::page::{CUT_SIZE, Scale, THRESHOLD};
use plane::Plane;

/// Scale of luma errors before compression.
pub const ERROR: Scale = Scale {
    name: "error",
    about: "error before compression, code values of luma",
    range: HEAT_MAP_RANGE,
    ends: ("¼", "64"),
};

/// Map as a picture.
pub struct MapPicture {
    /// Color scale of the map.
    pub scale: Scale,
    /// Map drawn in false colors.
    pub picture: Plane<[u8; 3]>,
}

/// Returns the three maps as pictures with their scales.
pub fn pictures(maps: &Maps) -> [MapPicture; 3] {
    let map = |scale: Scale, plane: &Plane<f32>| MapPicture { picture: scale.picture(plane), scale };
    [map(THRESHOLD, &maps.relative_threshold), map(CUT_SIZE, &maps.cut_size), map(ERROR, &maps.error)]
}
