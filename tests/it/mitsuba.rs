//! The path tracer compared with Mitsuba 3, if installed.

use glam::{Vec3, vec3};
use serde_json::json;
use std::path::Path;
use std::process::Command;
use tests::{Ball, Glb, cornell, need, render2mpeg};

/// Compares a picture of `scene` with Mitsuba's. No block of pixels may differ by more than four standard errors. Both
/// seeds are fixed, so the result is reproducible.
///
/// The comparison is skipped if python3, numpy, pillow or mitsuba is missing and not required.
fn compare(folder: &Path, scene: &Path, paths: [&str; 2]) {
    let scene = scene.to_str().expect("a path in UTF-8");
    let ours = ["reference", scene, "-o", "ours.exr", "--size", "64x64", "--spp", paths[0], "--quiet"];
    let finished = render2mpeg(folder, &ours);
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""));
    let mitsuba = Command::new("python3")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../bench/compare_mitsuba.py"))
        .args([scene, "ours.exr", "--block", "8", "--spp", paths[1]])
        .current_dir(folder)
        .output();
    // Exit code 77: the script has printed the missing packages.
    let mitsuba = mitsuba.ok().inspect(|output| println!("{}", String::from_utf8_lossy(&output.stdout)));
    let Some(mitsuba) = need("mitsuba", mitsuba.filter(|output| output.status.code() != Some(77))) else { return };
    assert!(mitsuba.status.success(), "{}", String::from_utf8_lossy(&mitsuba.stderr));
}

#[test]
fn a_picture_agrees_with_another_renderer() {
    compare(tempfile::tempdir().unwrap().path(), &cornell(), ["128", "4"]);
}

/// A ball of tinted glass in a lit room, with its caustic.
#[test]
fn a_picture_of_glass_agrees_with_another_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let mut glb = Glb::default();
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    let corner = vec3(-1.0, 0.0, -1.0);
    let walls = [[corner, z, x], [corner + y, x, z], [corner, x, y], [corner + x, z, y], [corner, y, z]];
    glb.add(&walls, Vec3::splat(0.5), Vec3::ZERO);
    glb.add(&[[vec3(-0.5, 1.98, -0.5), Vec3::X, Vec3::Z]], Vec3::ZERO, Vec3::splat(5.0));
    let ball = Ball { center: vec3(0.2, 0.6, 0.1), radius: 0.5, columns: 32, rows: 16, half: false, inward: false };
    glb.add_ball(ball, vec3(0.9, 1.0, 0.8), Vec3::ZERO);
    glb.add_camera(vec3(0.0, 1.0, 3.2));
    // Mitsuba's surfaces are matte or smooth glass.
    for material in glb.json["materials"].as_array_mut().unwrap() {
        material["pbrMetallicRoughness"]["roughnessFactor"] = json!(1.0);
    }
    let glass = glb.json["materials"].as_array_mut().unwrap().last_mut().unwrap();
    glass["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.0);
    glass["extensions"] = json!({
        "KHR_materials_transmission": { "transmissionFactor": 1.0 },
        "KHR_materials_volume": { "thicknessFactor": 1.0 },
    });
    let scene = folder.path().join("scene.glb");
    glb.write(&scene);
    compare(folder.path(), &scene, ["512", "16"]);
}
