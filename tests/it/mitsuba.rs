//! The path tracer compared with Mitsuba 3, if installed.

use std::process::Command;
use tests::{cornell, need, render2mpeg};

/// No block of pixels of the textured Cornell box may differ by more than four standard errors. Both seeds are fixed, so the
/// result is reproducible.
///
/// The test is skipped if python3, numpy, pillow or mitsuba is missing and not required.
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
    // Exit code 77: the script has printed the missing packages.
    let mitsuba = mitsuba.ok().inspect(|output| println!("{}", String::from_utf8_lossy(&output.stdout)));
    let Some(mitsuba) = need("mitsuba", mitsuba.filter(|output| output.status.code() != Some(77))) else { return };
    assert!(mitsuba.status.success(), "{}", String::from_utf8_lossy(&mitsuba.stderr));
}
