//! Animation channels with a target other than a property of a node.

use super::{Normalized, index, objects};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Channel of `KHR_animation_pointer`, which animates a property of the document.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::scene::gltf_file) struct PointerChannel {
    /// Index of the animation.
    pub animation: usize,
    /// Index of the channel's sampler in the animation.
    pub sampler: usize,
    /// JSON pointer of the property, such as `/materials/0/emissiveFactor`.
    pub pointer: String,
}

/// Removes channels without a node (glTF 2.0, 5.5: "the target object MAY be defined by an extension"), and collects
/// their pointers.
pub(super) fn animations(root: &mut Value, unreadable: &BTreeSet<usize>, found: &mut Normalized) {
    for (animation, clip) in objects(root, "animations").enumerate() {
        // Find samplers with unreadable keys.
        let mut missing = BTreeSet::new();
        let samplers = clip.get_mut("samplers").and_then(Value::as_array_mut);
        for (place, sampler) in samplers.into_iter().flatten().enumerate() {
            let Value::Object(sampler) = sampler else { continue };
            let reads = |name: &str| sampler.get(name).and_then(index).is_some_and(|a| unreadable.contains(&a));
            if reads("input") || reads("output") {
                missing.insert(place);
            }
            let interpolation = sampler.get("interpolation").and_then(Value::as_str);
            if interpolation.is_some_and(|name| !["LINEAR", "STEP", "CUBICSPLINE"].contains(&name)) {
                sampler.remove("interpolation");
                found.note("keys with an unknown interpolation are interpolated linearly");
            }
        }

        // Keep channels that target a known property of a node.
        let Some(Value::Array(channels)) = clip.get_mut("channels") else { continue };
        channels.retain(|channel| {
            let (Some(target), Some(sampler)) = (channel.get("target"), channel.get("sampler").and_then(index)) else {
                return true;
            };
            if missing.contains(&sampler) {
                found.note("animations with unreadable keys are left out");
                return false;
            }
            // Collect pointers separately, since the crate accepts node targets only.
            if let Some(pointer) = target.pointer("/extensions/KHR_animation_pointer/pointer").and_then(Value::as_str) {
                found.pointers.push(PointerChannel { animation, sampler, pointer: pointer.into() });
                return false;
            }
            let path = target.get("path").and_then(Value::as_str);
            let known = path.is_none_or(|path| ["translation", "rotation", "scale", "weights"].contains(&path));
            if target.get("node").is_none() || !known {
                found.note("animations of unknown node properties are left out");
                return false;
            }
            true
        });
        clip.entry("samplers").or_insert_with(|| json!([]));
    }
}
