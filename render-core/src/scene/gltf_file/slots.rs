//! Conversion of texture references to [`TextureSlot`]s.

use crate::scene::TextureSlot;
use glam::Vec2;
use serde_json::Value;

/// Builds the slot of a texture that the crate has parsed.
pub(super) fn slot(info: gltf::texture::Info) -> TextureSlot {
    let transform = info.texture_transform();
    let own_set = transform.as_ref().and_then(|t| t.tex_coord());
    TextureSlot {
        texture: info.texture().index(),
        uv_set: own_set.unwrap_or(info.tex_coord()) as usize,
        transform: transform.map(|t| (Vec2::from(t.offset()), t.rotation(), Vec2::from(t.scale()))),
    }
}

/// Builds a slot from the JSON of a texture reference.
pub(super) fn slot_of(info: &Value) -> Option<TextureSlot> {
    let texture = usize::try_from(info.get("index")?.as_u64()?).ok()?;
    let uv_set = info.get("texCoord").and_then(Value::as_u64).unwrap_or(0);
    Some(moved_slot(texture, uv_set as usize, info.pointer("/extensions/KHR_texture_transform")))
}

/// Returns the slot of a normal texture, and its scale. The crate does not parse the transform of this slot.
pub(super) fn normal_slot(source: gltf::material::NormalTexture) -> (TextureSlot, f32) {
    let transform = source.extension_value("KHR_texture_transform");
    let slot = moved_slot(source.texture().index(), source.tex_coord() as usize, transform);
    let scale = source.scale();
    (slot, if scale.is_finite() { scale } else { 1.0 })
}

/// Builds a slot with the JSON of its transform.
fn moved_slot(texture: usize, uv_set: usize, transform: Option<&Value>) -> TextureSlot {
    // Read the transform from JSON, with the extension's defaults.
    let number = |name: &str| transform.and_then(|t| t.get(name)?.as_f64());
    let pair = |name: &str, default: f32| {
        let at = |i: usize| transform.and_then(|t| t.get(name)?.get(i)?.as_f64()).map_or(default, |x| x as f32);
        Vec2::new(at(0), at(1))
    };
    TextureSlot {
        texture,
        uv_set: number("texCoord").map_or(uv_set, |set| set as usize),
        transform: transform
            .map(|_| (pair("offset", 0.0), number("rotation").unwrap_or(0.0) as f32, pair("scale", 1.0))),
    }
}
