//! Light of one sample of each pixel.

use glam::Vec3;
use plane::Plane;

/// Light of all pixels at one sample position each, before outlines are blended \[W·m⁻²·sr⁻¹\].
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct Sample {
    /// Emitted light, and light reflected directly from its source.
    pub direct: Plane<Vec3>,
    /// All light except emitted light and light reflected directly from its source.
    pub indirect: Plane<Vec3>,
}

impl Sample {
    /// Returns the sum of direct and indirect light.
    pub fn whole(&self) -> Plane<Vec3> {
        let Self { direct, indirect } = self;
        Plane::from_fn(direct.width(), direct.height(), |x, y| direct.get(x, y) + indirect.get(x, y))
    }
}
