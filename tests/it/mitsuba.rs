//! The path tracer against Mitsuba 3, where that is installed.

use std::process::Command;
use tests::{cornell, need, render2mpeg};

/// No block of pixels of the textured Cornell box may differ by more than four standard errors. Seeds are fixed on both sides,
/// and so is the outcome.
///
/// Left out where python3, numpy, pillow or mitsuba is missing and none is required.
#[test]
fn a_picture_agrees_with_another_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let scene = scene.to_str().expect("a path in UTF-8");
    let ours = ["reference", scene, "-o", "ours.exr", "--size", "64x64", "--spp", "128", "--quiet"];
    let finished = render2mpeg(folder.path(), &ours);
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""));
    let mitsuba = Command::new("python3")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../bench/compare_mitsuba.py"))
        .args([scene, "ours.exr", "--block", "8", "--spp", "4"])
        .current_dir(folder.path())
        .output();
    // 77: the script has said what is missing.
    let mitsuba = mitsuba.ok().inspect(|output| println!("{}", String::from_utf8_lossy(&output.stdout)));
    let Some(mitsuba) = need("mitsuba", mitsuba.filter(|output| output.status.code() != Some(77))) else { return };
    assert!(mitsuba.status.success(), "{}", String::from_utf8_lossy(&mitsuba.stderr));
}
