//! glTF extensions: support by this loader, and notes for ignored extensions.

use std::collections::BTreeSet;

/// Support of an extension by this loader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// The extension is read.
    Read,
    /// The extension is read in part. A note names the ignored properties.
    Partial,
    /// The extension is ignored, with a note.
    Noted,
    /// The extension is ignored, with a note. A file that requires it is refused.
    Refused,
    /// The extension is ignored without a note, since it does not affect images.
    Silent,
}

/// glTF extension and its support by this loader.
#[derive(Clone, Copy, Debug)]
pub struct Extension {
    /// Name of the extension in files.
    pub name: &'static str,
    /// Purpose of the extension, in a few words.
    pub purpose: &'static str,
    /// Support of the extension by this loader.
    pub support: Support,
    /// Name of the extension's test.
    pub test: &'static str,
}

const fn row(name: &'static str, purpose: &'static str, support: Support, test: &'static str) -> Extension {
    Extension { name, purpose, support, test }
}

/// Returns the support of an extension that requires a feature of the build.
const fn behind(is_built: bool) -> Support {
    if is_built { Support::Read } else { Support::Refused }
}

/// Name of the test of compressed images.
const IMAGES: &str = "packed_images_have_the_reference_texels";
/// Name of the test of meshes packed by Draco.
const DRACO: &str = "meshes_packed_by_draco_have_the_reference_numbers";
/// Name of the test of buffer views packed by meshoptimizer.
const MESHOPT: &str = "views_packed_by_meshopt_have_the_reference_numbers";
/// Name of the test of lobes beyond base and coat.
const LOBES: &str = "materials_have_their_lobes";
/// Name of the test of all extensions that are ignored with a note.
const NOTED: &str = "each_extension_that_is_left_out_has_one_note";
/// Name of the test of all extensions that are refused if required.
const REFUSED: &str = "required_formats_are_refused_by_name";
/// Name of the test of all extensions that do not affect images.
const SILENT: &str = "extensions_that_change_no_picture_have_no_note";

/// Ratified and common extensions, mostly sorted by name.
pub static EXTENSIONS: &[Extension] = &[
    row("ADOBE_materials_clearcoat_specular", "varnish reflectance", Support::Noted, NOTED),
    row("ADOBE_materials_thin_transparency", "thin glass", Support::Noted, NOTED),
    row("AGI_articulations", "named joints", Support::Silent, SILENT),
    row("AGI_stk_metadata", "satellite data", Support::Silent, SILENT),
    row("CESIUM_primitive_outline", "edge lines", Support::Noted, NOTED),
    row("CESIUM_RTC", "far origin", Support::Noted, NOTED),
    row("EXT_implicit_ellipsoid_region", "ellipsoid shapes", Support::Noted, NOTED),
    row("EXT_instance_features", "instance numbers", Support::Silent, SILENT),
    row("EXT_lights_ies", "measured lamp shapes", Support::Noted, NOTED),
    row("EXT_lights_image_based", "surrounding light image", Support::Noted, NOTED),
    row("EXT_mesh_features", "feature numbers", Support::Silent, SILENT),
    row("EXT_mesh_manifold", "closed shapes", Support::Silent, SILENT),
    row("EXT_meshopt_compression", "compressed meshes", behind(cfg!(feature = "meshopt")), MESHOPT),
    row("EXT_structural_metadata", "data of features", Support::Silent, SILENT),
    row("EXT_texture_avif", "AVIF images", Support::Refused, REFUSED),
    row("EXT_texture_webp", "WebP images", behind(cfg!(feature = "webp")), IMAGES),
    row("FB_geometry_metadata", "mesh statistics", Support::Silent, SILENT),
    row("GODOT_single_root", "one root node", Support::Silent, SILENT),
    row("KHR_accessor_float64", "double-precision numbers", Support::Refused, REFUSED),
    row("KHR_audio_emitter", "sound sources", Support::Silent, SILENT),
    row("KHR_draco_mesh_compression", "compressed meshes", behind(cfg!(feature = "draco")), DRACO),
    row("KHR_gaussian_splatting", "clouds of splats", Support::Refused, REFUSED),
    row("KHR_implicit_shapes", "shapes for physics", Support::Silent, SILENT),
    row("KHR_interactivity", "interactive behavior", Support::Silent, SILENT),
    row("KHR_lights_punctual", "points, spots, suns", Support::Read, "lamps_of_blender_fit_its_emission"),
    row("KHR_materials_anisotropy", "brushed metal", Support::Read, LOBES),
    row("KHR_materials_clearcoat", "layer of varnish", Support::Read, LOBES),
    row("KHR_materials_diffuse_transmission", "light through leaves", Support::Read, LOBES),
    row("KHR_materials_dispersion", "prism colors", Support::Read, LOBES),
    row(
        "KHR_materials_emissive_strength",
        "strong glow",
        Support::Read,
        "a_sky_is_added_where_nothing_was_made_to_shine",
    ),
    row("KHR_materials_ior", "index of refraction", Support::Read, "materials_mean_what_the_specification_says"),
    row("KHR_materials_iridescence", "thin film colors", Support::Read, LOBES),
    row(
        "KHR_materials_pbrSpecularGlossiness",
        "older material model",
        Support::Partial,
        "the_older_material_model_is_converted",
    ),
    row("KHR_materials_sheen", "velvet rim", Support::Read, LOBES),
    row("KHR_materials_specular", "reflectance factors", Support::Read, LOBES),
    row("KHR_materials_transmission", "light through glass", Support::Read, LOBES),
    row("KHR_materials_unlit", "color without light", Support::Read, "unlit_surfaces_are_marked"),
    row("KHR_materials_variants", "alternative materials", Support::Read, "variants_replace_materials"),
    row("KHR_materials_volume", "thickness of glass", Support::Read, LOBES),
    row("KHR_materials_volume_scatter", "milky glass", Support::Noted, NOTED),
    row("KHR_mesh_quantization", "small integers", Support::Read, "quantised_meshes_have_the_numbers_they_stand_for"),
    row("KHR_meshopt_compression", "compressed meshes", behind(cfg!(feature = "meshopt")), MESHOPT),
    row("KHR_node_hoverability", "pointer targets", Support::Silent, SILENT),
    row("KHR_node_selectability", "selectable nodes", Support::Silent, SILENT),
    row("KHR_node_visibility", "hidden nodes", Support::Read, "hidden_nodes_and_all_below_them_are_not_shown"),
    row("KHR_physics_rigid_bodies", "bodies for physics", Support::Silent, SILENT),
    row("KHR_techniques_webgl", "own shaders", Support::Noted, NOTED),
    row("KHR_texture_basisu", "KTX2 images", behind(cfg!(feature = "basis")), IMAGES),
    row("KHR_texture_transform", "moved textures", Support::Read, "textures_are_held_for_what_they_are_used_as"),
    row("KHR_xmp", "authorship data", Support::Silent, SILENT),
    row("KHR_xmp_json_ld", "authorship data", Support::Silent, SILENT),
    row("KHR_animation_pointer", "animated properties", Support::Partial, "pointers_animate_nodes_and_lenses"),
    row("EXT_mesh_gpu_instancing", "many copies", Support::Read, "copies_of_a_mesh_have_their_own_places"),
    row("EXT_texture_procedurals", "computed textures", Support::Noted, NOTED),
    row("MSFT_lod", "levels of detail", Support::Read, "the_finest_level_of_detail_is_shown"),
    row("MSFT_packing_normalRoughnessMetallic", "packed textures", Support::Silent, SILENT),
    row("MSFT_packing_occlusionRoughnessMetallic", "packed textures", Support::Silent, SILENT),
    row("MSFT_texture_dds", "DDS images", Support::Refused, REFUSED),
    row("NV_materials_mdl", "own material language", Support::Noted, NOTED),
    row("VRM", "avatar data", Support::Silent, SILENT),
    row("VRMC_materials_mtoon", "cartoon shading", Support::Noted, NOTED),
    row("VRMC_node_constraint", "dependent nodes", Support::Noted, NOTED),
    row("VRMC_springBone", "swinging hair", Support::Noted, NOTED),
    row("VRMC_vrm", "avatar data", Support::Silent, SILENT),
];

/// Ignored material extensions, with the factor of each that disables the extension at its default of zero.
const FACTORS: [(&str, &str); 1] = [("KHR_materials_volume_scatter", "multiscatterColor")];

/// Extensions that require a feature of the build, with the name of the feature.
const FEATURES: [(&str, &str); 5] = [
    ("EXT_meshopt_compression", "meshopt"),
    ("EXT_texture_webp", "webp"),
    ("KHR_draco_mesh_compression", "draco"),
    ("KHR_meshopt_compression", "meshopt"),
    ("KHR_texture_basisu", "basis"),
];

/// Returns the feature that reads an extension, if this build lacks the feature.
pub(super) fn missing_feature(name: &str) -> Option<&'static str> {
    let (_, feature) = FEATURES.into_iter().find(|(extension, _)| *extension == name)?;
    (!may_be_required(name)).then_some(feature)
}

/// Returns the extension called `name`.
fn named(name: &str) -> Option<&'static Extension> {
    EXTENSIONS.iter().find(|extension| extension.name == name)
}

/// Returns whether a file may require the extension. Without such an extension, images show the same shapes.
pub(super) fn may_be_required(name: &str) -> bool {
    named(name).is_some_and(|extension| extension.support != Support::Refused)
}

/// Returns a note for each ignored extension in `names`, unless all materials disable the extension.
pub(super) fn notes(names: &BTreeSet<String>, materials: &[serde_json::Value]) -> Vec<String> {
    let mut notes = Vec::new();
    for name in names {
        // Skip supported extensions, and extensions without effect in all materials.
        let purpose = match named(name) {
            Some(Extension { support: Support::Read | Support::Partial | Support::Silent, .. }) => continue,
            Some(_) if is_off(name, materials) => continue,
            Some(extension) => format!(" ({})", extension.purpose),
            None => String::new(),
        };
        // Name the feature that would read the extension.
        let remedy =
            missing_feature(name).map_or(String::new(), |f| format!("; a build with the feature {f} reads it"));
        notes.push(format!("the glTF extension {name}{purpose} is left out{remedy}"));
    }
    notes
}

/// Returns whether some materials have the extension, all with a factor of zero.
fn is_off(name: &str, materials: &[serde_json::Value]) -> bool {
    let Some((_, factor)) = FACTORS.into_iter().find(|(extension, _)| *extension == name) else { return false };
    let mut used = materials.iter().filter_map(|material| material.get("extensions")?.get(name)).peekable();
    used.peek().is_some()
        && used.all(|extension| match extension.get(factor) {
            None => true,
            Some(serde_json::Value::Array(list)) => list.iter().all(|x| x.as_f64() == Some(0.0)),
            Some(value) => value.as_f64() == Some(0.0),
        })
}

/// Returns the documentation page with the table of glTF extensions.
#[must_use]
pub fn extension_table() -> String {
    let mut page = String::from(
        "# Extensions of glTF

`cargo run -p render2mpeg-render-core --example gltf_table > docs/reference/gltf.md` writes this page; a test compares it.

- *read*: the extension has its effect.
- *in part*: some properties have an effect; a note names the others.
- *noted*: it has no effect, and a note names it. Material extensions with a factor of zero have no note.
- *refused*: as noted, but a file that *requires* it is refused; the error names it.
- *silent*: it changes no picture.

Other extensions are noted; a file that requires one is refused.

| Extension | Purpose | Effect | Test |
|---|---|---|---|
",
    );
    // Sort by name, because the list itself is only mostly sorted.
    let mut rows: Vec<&Extension> = EXTENSIONS.iter().collect();
    rows.sort_by_key(|extension| extension.name);
    for Extension { name, purpose, support, test } in rows {
        let effect = match support {
            Support::Read => "read",
            Support::Partial => "in part",
            Support::Noted => "noted",
            Support::Refused => "refused",
            Support::Silent => "silent",
        };
        page.push_str(&format!("| `{name}` | {purpose} | {effect} | `{test}` |\n"));
    }
    page
}
