//! The stages that a plan is about, and how often one runs.

use serde::{Serialize, Serializer};

/// Work that some scenes do not need, in the order of the printed plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Placing objects, and the top level of the ray tree.
    ObjectPlacing,
    /// Photons, and the flux of the anchor lights.
    Photons,
    /// New flux in the light tree.
    TreeUpdate,
    /// Photons whose paths no moving object can meet, traced once.
    KeptPhotons,
    /// Anchor lights on moving objects.
    DynamicAnchors,
    /// Primary rays, and motion from frame to frame.
    PrimaryRays,
    /// Rays that find the surfaces of pixels which outlines cross.
    Antialiasing,
    /// Skins and morph targets.
    Deformation,
    /// Light that surfaces reflect onto each other.
    Indirect,
    /// Light of surfaces at rest, looked up in a file.
    BakedLight,
    /// Indirect light cached on surfaces.
    Cache,
    /// Light of the frame before, carried to where it is seen now.
    CarriedLight,
    /// Bias compensation: the light that clamping of the geometry term loses.
    Compensation,
    /// Light that coats reflect.
    Gloss,
    /// Importance: where people look.
    Importance,
    /// The masking model, whose thresholds return to the renderer.
    Masking,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: [Self; 16] = [
        Self::ObjectPlacing,
        Self::Photons,
        Self::TreeUpdate,
        Self::KeptPhotons,
        Self::DynamicAnchors,
        Self::PrimaryRays,
        Self::Antialiasing,
        Self::Deformation,
        Self::Indirect,
        Self::BakedLight,
        Self::Cache,
        Self::CarriedLight,
        Self::Compensation,
        Self::Gloss,
        Self::Importance,
        Self::Masking,
    ];

    /// The name in reports and tables; it is kept stable.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ObjectPlacing => "placing of objects",
            Self::Photons => "photons",
            Self::TreeUpdate => "light tree update",
            Self::KeptPhotons => "photons that stay",
            Self::DynamicAnchors => "anchor lights on moving objects",
            Self::PrimaryRays => "primary rays and motion",
            Self::Antialiasing => "antialiasing",
            Self::Deformation => "skins and morph targets",
            Self::Indirect => "indirect light",
            Self::BakedLight => "baked light",
            Self::Cache => "irradiance cache",
            Self::CarriedLight => "carried light",
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

/// How often a stage runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Every frame.
    On,
    /// For the first frame; its result is kept.
    Once,
    /// Never.
    Off,
}

impl State {
    /// Whether the stage has work to do for frame `n`.
    #[must_use]
    pub fn runs(self, n: u32) -> bool {
        match self {
            Self::On => true,
            Self::Once => n == 0,
            Self::Off => false,
        }
    }

    /// The name in reports and tables.
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
