//! Tests of extensions: a note for each ignored extension, and the table of all.

use super::file::{File, notes};
use render_core::scene::{EXTENSIONS, Support, extension_table};
use serde_json::json;
use std::path::Path;

/// Builds a file that uses an extension in the square's material.
fn with_material(name: &str, extension: serde_json::Value) -> File {
    let mut file = File::square();
    file.json["extensionsUsed"] = json!([name]);
    file.json["materials"] = json!([{ "extensions": { name: extension } }]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    file
}

#[test]
fn each_extension_that_is_left_out_has_one_note() {
    for extension in EXTENSIONS {
        let mut file = File::square();
        file.json["extensionsUsed"] = json!([extension.name]);
        let scene = file.load();
        let expected = usize::from(matches!(extension.support, Support::Noted | Support::Refused));
        assert_eq!(notes(&scene, extension.name), expected, "{:?}", scene.warnings);
        assert_eq!(notes(&scene, extension.purpose), expected, "{:?}", scene.warnings);
    }
    // Test names that occur only in objects, and unknown names.
    let mut file = with_material("KHR_materials_volume_scatter", json!({ "multiscatterColor": [1.0, 1.0, 1.0] }));
    file.json.as_object_mut().unwrap().remove("extensionsUsed");
    file.json["nodes"][0]["extensions"] = json!({ "ACME_magic": {} });
    let scene = file.load();
    assert_eq!((notes(&scene, "KHR_materials_volume_scatter (milky glass)"), notes(&scene, "ACME_magic")), (1, 1));
}

/// Exporters write materials with all factors at their default of zero. Such extensions add no note.
#[test]
fn extensions_that_are_turned_off_have_no_note() {
    let name = "KHR_materials_volume_scatter";
    for off in [json!({}), json!({ "multiscatterColor": [0, 0, 0] })] {
        assert_eq!(notes(&with_material(name, off).load(), name), 0);
    }
    assert_eq!(notes(&with_material(name, json!({ "multiscatterColor": [0, 0.1, 0] })).load(), name), 1);
}

#[test]
fn extensions_that_change_no_picture_have_no_note() {
    for extension in EXTENSIONS.iter().filter(|extension| extension.support == Support::Silent) {
        let mut file = File::square();
        file.json["extensionsUsed"] = json!([extension.name]);
        file.json["extensions"] = json!({ extension.name: { "packets": [] } });
        let scene = file.load();
        assert_eq!(notes(&scene, "extension"), 0, "{:?}", scene.warnings);
    }
}

#[test]
fn required_formats_are_refused_by_name() {
    let mut names: Vec<(&str, bool)> =
        EXTENSIONS.iter().map(|extension| (extension.name, extension.support != Support::Refused)).collect();
    names.push(("ACME_mesh", false));
    for (name, loads) in names {
        let mut file = File::square();
        file.json["extensionsUsed"] = json!([name]);
        file.json["extensionsRequired"] = json!([name]);
        match file.load_with(&[]) {
            Ok(_) => assert!(loads, "{name}"),
            Err(line) => assert!(!loads && line.contains(name), "{line}"),
        }
    }
}

#[test]
fn unlit_surfaces_are_marked() {
    let scene = with_material("KHR_materials_unlit", json!({})).load();
    assert!(scene.materials[0].unlit && scene.warnings.iter().all(|note| !note.contains("unlit")));
}

/// Each row names an existing test, and the page matches the command's output.
#[test]
fn the_page_of_extensions_is_the_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let page = std::fs::read_to_string(root.join("docs/reference/gltf.md")).unwrap();
    assert!(page == extension_table(), "write docs/reference/gltf.md again by its command");
    let mut tests = String::new();
    for folder in ["render-core/tests/it/gltf", "tests/it"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                tests.push_str(&std::fs::read_to_string(path).unwrap());
            }
        }
    }
    for extension in EXTENSIONS {
        assert!(tests.contains(&format!("fn {}()", extension.test)), "{} has no test", extension.name);
    }
}
