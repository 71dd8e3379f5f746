//! Scene files of other programs, which must be exported as glTF first.

use anyhow::{Result, bail};
use std::path::Path;

/// Scene formats: file endings, name, and way to convert files to glTF.
const FORMATS: [(&[&str], &str, &str); 8] = [
    (
        &["blend"],
        "a Blender file",
        "in Blender: File > Export > glTF 2.0, with cameras, punctual lights and animations",
    ),
    (&["usd", "usda", "usdc", "usdz"], "a USD file", "import it in Blender, then File > Export > glTF 2.0"),
    (&["fbx"], "an FBX file", "import it in Blender, then File > Export > glTF 2.0; or FBX2glTF -b -i SCENE.fbx"),
    (&["obj", "ply", "stl"], "a mesh without a scene", "import it in Blender, then File > Export > glTF 2.0"),
    (
        &["dae", "3ds", "abc", "x3d", "wrl"],
        "a scene in another format",
        "import it in Blender, then File > Export > glTF 2.0",
    ),
    (&["ma", "mb", "max", "c4d", "hip", "hiplc"], "a modeling program's file", "export it there as glTF 2.0 or USD"),
    (&["pbrt", "xml"], "a research renderer's scene", "import it in Blender, then File > Export > glTF 2.0"),
    (&["vrm"], "a VRM avatar", "it is glTF 2.0: name it .glb"),
];

/// Refuses a file in a known format that this program cannot read.
///
/// # Errors
/// If the file ending is in `FORMATS`. The message names a remedy.
pub fn check(path: &Path) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    if let Some((_, what, remedy)) = FORMATS.iter().find(|(endings, ..)| endings.contains(&ending.as_str())) {
        bail!("{}: {what}; scenes are glTF 2.0, .glb or .gltf: {remedy}", path.display());
    }
    Ok(())
}

/// Returns whether a word looks like the path of a scene, for command lines without a command.
pub fn is_scene(word: &str) -> bool {
    let ending =
        Path::new(word).extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let is_foreign = FORMATS.iter().any(|(endings, ..)| endings.contains(&ending.as_str()));
    ["glb", "gltf"].contains(&ending.as_str()) || is_foreign
}
