//! Properties that `KHR_animation_pointer` animates.

use crate::scene::{CameraProperty, LightProperty, MaterialProperty, SlotName};
use gltf::animation::Property;

/// Property of the document that a pointer refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Transform or weights of a node.
    Node(usize, Property),
    /// Lens of a camera.
    Camera(usize, CameraProperty),
    /// Property of a punctual light.
    Light(usize, LightProperty),
    /// Visibility of a node and its descendants.
    Visible(usize),
    /// Property of a material.
    Material(usize, MaterialProperty),
    /// Hint without effect on rendered images.
    Hint,
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Node(index, _) => write!(f, "animation of node {index}"),
            Self::Camera(index, _) => write!(f, "animation of camera {index}"),
            Self::Light(index, _) => write!(f, "animation of light {index}"),
            Self::Visible(index) => write!(f, "animation of the visibility of node {index}"),
            Self::Material(index, _) => write!(f, "animation of material {index}"),
            Self::Hint => f.write_str("animation of a hint"),
        }
    }
}

/// Returns the property of a JSON pointer, or `None` if the property is not supported.
pub(super) fn target(pointer: &str) -> Option<Target> {
    // Shorten pointers to lights, so that all pointers have three components.
    let short = pointer.strip_prefix("/extensions/KHR_lights_punctual/").map(|rest| format!("/{rest}"));
    let pointer = short.as_deref().unwrap_or(pointer);
    let mut parts = pointer.strip_prefix('/')?.splitn(3, '/');
    let (list, index, path) = (parts.next()?, parts.next()?.parse().ok()?, parts.next()?);
    Some(match (list, path) {
        ("nodes", "translation") => Target::Node(index, Property::Translation),
        ("nodes", "rotation") => Target::Node(index, Property::Rotation),
        ("nodes", "scale") => Target::Node(index, Property::Scale),
        ("nodes", "weights") => Target::Node(index, Property::MorphTargetWeights),
        ("nodes", "extensions/KHR_node_visibility/visible") => Target::Visible(index),
        ("lights", "color") if short.is_some() => Target::Light(index, LightProperty::Color),
        ("lights", "intensity") if short.is_some() => Target::Light(index, LightProperty::Intensity),
        ("lights", "spot/innerConeAngle") if short.is_some() => Target::Light(index, LightProperty::InnerCone),
        ("lights", "spot/outerConeAngle") if short.is_some() => Target::Light(index, LightProperty::OuterCone),
        // "range" is "a hint defining a distance cutoff", but in this renderer light has no cutoff.
        ("lights", "range") if short.is_some() => Target::Hint,
        ("materials", path) => Target::Material(index, of_material(path)?),
        ("cameras", "perspective/yfov") => Target::Camera(index, CameraProperty::FieldOfView),
        ("cameras", "perspective/aspectRatio") => Target::Camera(index, CameraProperty::Aspect),
        ("cameras", "orthographic/ymag") => Target::Camera(index, CameraProperty::HalfHeight),
        ("cameras", "orthographic/xmag") => Target::Camera(index, CameraProperty::HalfWidth),
        ("cameras", "perspective/znear" | "orthographic/znear") => Target::Camera(index, CameraProperty::Near),
        ("cameras", "perspective/zfar" | "orthographic/zfar") => Target::Camera(index, CameraProperty::Far),
        _ => return None,
    })
}

/// Returns the property of a material at the end of a JSON pointer.
fn of_material(path: &str) -> Option<MaterialProperty> {
    // Handle texture transforms first, because every slot may have one.
    if let Some((texture, part)) = path.split_once("/extensions/KHR_texture_transform/") {
        let slot = match texture {
            "pbrMetallicRoughness/baseColorTexture" => SlotName::BaseColor,
            "pbrMetallicRoughness/metallicRoughnessTexture" => SlotName::MetallicRoughness,
            "normalTexture" => SlotName::Normal,
            "emissiveTexture" => SlotName::Emission,
            _ => return None,
        };
        return match part {
            "offset" => Some(MaterialProperty::Offset(slot)),
            "rotation" => Some(MaterialProperty::Rotation(slot)),
            "scale" => Some(MaterialProperty::Scale(slot)),
            _ => None,
        };
    }
    Some(match path {
        "pbrMetallicRoughness/baseColorFactor" => MaterialProperty::BaseColor,
        "pbrMetallicRoughness/metallicFactor" => MaterialProperty::Metallic,
        "pbrMetallicRoughness/roughnessFactor" => MaterialProperty::Roughness,
        "emissiveFactor" => MaterialProperty::Emission,
        "normalTexture/scale" => MaterialProperty::NormalScale,
        "alphaCutoff" => MaterialProperty::AlphaCutoff,
        "extensions/KHR_materials_emissive_strength/emissiveStrength" => MaterialProperty::EmissionStrength,
        "extensions/KHR_materials_ior/ior" => MaterialProperty::Ior,
        "extensions/KHR_materials_specular/specularFactor" => MaterialProperty::Specular,
        "extensions/KHR_materials_specular/specularColorFactor" => MaterialProperty::SpecularColor,
        _ => return None,
    })
}

/// Returns a note with the first pointer to an unsupported property, and the number of further ones.
pub(super) fn note<'p>(pointers: impl Iterator<Item = &'p str>) -> Option<String> {
    let mut left_out: Vec<&str> = pointers.filter(|pointer| target(pointer).is_none()).collect();
    left_out.sort_unstable();
    left_out.dedup();
    let first = left_out.first()?;
    let others = match left_out.len() {
        1 => String::new(),
        count => format!(" and {} more", count - 1),
    };
    Some(format!("the animated property {first}{others} is left out: it keeps the value of the file"))
}
