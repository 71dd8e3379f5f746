//! The path tracer against Mitsuba 3, where that is installed.

use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{cornell, render2mpeg, shared_scenes};

/// No block of pixels may differ by more than four standard errors. Seeds are fixed on both sides: the outcome is, too.
///
/// Left out, with a reason printed, where python3, numpy or mitsuba is missing.
#[test]
fn pictures_agree_with_another_renderer() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/compare_mitsuba.py");
    let textured = cornell();
    let plain = shared_scenes().map(|folder| folder.join("cornell-mcguire/CornellBox-Original.glb"));
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("ours.exr");
    for scene in std::iter::once(textured).chain(plain.filter(|scene| Path::is_file(scene))) {
        let [scene, output] = [&scene, &picture].map(|path: &PathBuf| path.to_str().expect("a path in UTF-8"));
        let finished = render2mpeg(
            folder.path(),
            &["reference", scene, "-o", output, "--size", "64x64", "--spp", "128", "--quiet"],
        );
        assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "{scene}");
        let mitsuba = Command::new("python3")
            .args([script, scene, output, "--block", "8", "--spp", "4", "--seeds", "64"])
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .output();
        let mitsuba = match mitsuba {
            Ok(output) => output,
            Err(error) => return println!("left out: python3 cannot be run: {error}"),
        };
        let said = String::from_utf8_lossy(&mitsuba.stdout);
        println!("{scene}: {said}");
        // 77: the script has said what is missing.
        if mitsuba.status.code() == Some(77) {
            return;
        }
        assert!(mitsuba.status.success(), "{scene}: {said}{}", String::from_utf8_lossy(&mitsuba.stderr));
    }
}
