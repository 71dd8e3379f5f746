//! Stages of the plan, and the frames for which they run.

use serde::{Serialize, Serializer};

/// A stage that some scenes do not need; variants are in the order of the printed plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Placement of anchor lights on surfaces, with their surfels and the photon guide.
    Anchors,
    /// Placement of objects, and construction of the ray tree's top level.
    ObjectPlacing,
    /// Photon tracing and the flux of the anchor lights.
    Photons,
    /// Update of the flux in the light tree.
    TreeUpdate,
    /// Reuse of photon paths that no moving object can cross.
    KeptPhotons,
    /// Anchor lights on moving objects.
    DynamicAnchors,
    /// Primary rays and motion between frames.
    PrimaryRays,
    /// Rays to all surfaces in pixels that outlines cross.
    Antialiasing,
    /// Further samples of pixels in which light changes.
    FineSamples,
    /// Deformation by skins and morph targets.
    Deformation,
    /// Indirect light of surfaces.
    Indirect,
    /// Baked light of static surfaces, read from a file.
    BakedLight,
    /// Irradiance cache for indirect light.
    Cache,
    /// Reprojection of the previous frame's light.
    ReprojectedLight,
    /// Bias compensation: restores light lost by clamping the geometry term.
    Compensation,
    /// Light reflected by coats.
    Gloss,
    /// Importance map, which determines samples, thresholds and bits.
    Importance,
    /// Masking model, which returns permitted errors to the renderer.
    Masking,
}

impl Stage {
    /// All stages, in the order of the plan.
    pub const ALL: [Self; 18] = [
        Self::Anchors,
        Self::ObjectPlacing,
        Self::Photons,
        Self::TreeUpdate,
        Self::KeptPhotons,
        Self::DynamicAnchors,
        Self::PrimaryRays,
        Self::Antialiasing,
        Self::FineSamples,
        Self::Deformation,
        Self::Indirect,
        Self::BakedLight,
        Self::Cache,
        Self::ReprojectedLight,
        Self::Compensation,
        Self::Gloss,
        Self::Importance,
        Self::Masking,
    ];

    /// Returns the stable name of the stage in reports and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Anchors => "anchor lights",
            Self::ObjectPlacing => "object placement",
            Self::Photons => "photons",
            Self::TreeUpdate => "light tree update",
            Self::KeptPhotons => "kept photon paths",
            Self::DynamicAnchors => "anchor lights on moving objects",
            Self::PrimaryRays => "primary rays and motion",
            Self::Antialiasing => "antialiasing",
            Self::FineSamples => "fine samples",
            Self::Deformation => "skins and morph targets",
            Self::Indirect => "indirect light",
            Self::BakedLight => "baked light",
            Self::Cache => "irradiance cache",
            Self::ReprojectedLight => "reprojected light",
            Self::Compensation => "compensation",
            Self::Gloss => "glossy surfaces",
            Self::Importance => "importance",
            Self::Masking => "masking thresholds",
        }
    }
}

impl Serialize for Stage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// State of a stage: how often it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Runs for every frame.
    On,
    /// Runs for the first frame; its result is kept.
    Once,
    /// Never runs.
    Off,
}

impl State {
    /// Returns whether the stage runs for frame `n`.
    #[must_use]
    pub fn runs(self, n: u32) -> bool {
        match self {
            Self::On => true,
            Self::Once => n == 0,
            Self::Off => false,
        }
    }

    /// Returns the name of the state in reports and tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::On => "on",
            Self::Once => "once",
            Self::Off => "off",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_indexed_by_their_order() {
        for (index, stage) in Stage::ALL.into_iter().enumerate() {
            assert_eq!(stage as usize, index, "{stage:?}");
        }
    }
}
