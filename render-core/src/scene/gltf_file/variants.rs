//! `KHR_materials_variants`: alternative materials of meshes.

use super::{LoadError, Loader};
use serde_json::Value;

impl Loader<'_> {
    /// Returns the index of the variant called `name`, if a name is set.
    pub(super) fn variant(
        &self,
        document: &gltf::Document,
        name: Option<&str>,
        notes: &mut Vec<String>,
    ) -> Result<Option<u64>, LoadError> {
        // List the names for messages.
        let list =
            document.extension_value("KHR_materials_variants").and_then(|value| value.get("variants")?.as_array());
        let mut names = Vec::new();
        for variant in list.into_iter().flatten() {
            names.push(variant.get("name").and_then(Value::as_str).unwrap_or_default());
        }
        let all = names.join("\", \"");
        // Select the variant, or note the choices.
        match name {
            None => {
                if !names.is_empty() {
                    notes.push(format!("the materials have variants \"{all}\": --variant NAME shows one"));
                }
                Ok(None)
            }
            Some(name) => match names.iter().position(|variant| *variant == name) {
                Some(place) => Ok(Some(place as u64)),
                None if names.is_empty() => {
                    self.bad(format!("there is no variant \"{name}\": the materials have none"))
                }
                None => self.bad(format!("there is no variant \"{name}\"; there are \"{all}\"")),
            },
        }
    }
}

/// Returns the material of a primitive in this variant, or `None` if the variant does not change it.
pub(super) fn material_of(primitive: &gltf::Primitive, variant: Option<u64>) -> Option<usize> {
    let mappings = primitive.extension_value("KHR_materials_variants")?.get("mappings")?.as_array()?;
    for mapping in mappings {
        let variants = mapping.get("variants").and_then(Value::as_array);
        if variants.into_iter().flatten().any(|number| number.as_u64() == variant && variant.is_some()) {
            return usize::try_from(mapping.get("material")?.as_u64()?).ok();
        }
    }
    None
}
