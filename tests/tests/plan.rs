//! What a scene does not need is left out, and that never changes a bit.

use serde_json::Value;
use std::path::{Path, PathBuf};
use tests::{Moving, Rendered, checkered_room, render, render2mpeg};

const SMALL: &str = "--size 64x64 --frames 5 --vpls 200 --photons 20000";

fn scene(folder: &Path, moving: Moving) -> PathBuf {
    let path = folder.join("room.glb");
    checkered_room(moving).write(&path);
    path
}

/// Renders with and without leaving out; the streams must be equal.
fn both_ways(folder: &Path, moving: Moving) -> [Rendered; 2] {
    let scene = scene(folder, moving);
    let spared = render(folder, "spared", &scene, SMALL);
    let full = render(folder, "full", &scene, &format!("{SMALL} --run-everything"));
    assert!(spared.stream == full.stream, "{moving:?}: leaving out changes the film");
    [spared, full]
}

fn state<'a>(report: &'a Value, stage: &str) -> &'a str {
    let plan = report["plan"].as_array().expect("a plan");
    let step = plan.iter().find(|step| step["stage"] == stage).unwrap_or_else(|| panic!("no stage {stage}"));
    step["state"].as_str().expect("a state")
}

#[test]
fn only_the_camera_moves() {
    let folder = tempfile::tempdir().unwrap();
    let [spared, full] = both_ways(folder.path(), Moving::Camera);
    for (stage, expected) in [
        ("photons", "once"),
        ("light tree update", "once"),
        ("placing of objects", "once"),
        ("primary rays and motion", "on"),
        ("anchor lights on moving objects", "off"),
    ] {
        assert_eq!(state(&spared.report, stage), expected, "{stage}");
    }
    assert_eq!(state(&full.report, "photons"), "on");
    let spared = spared.figures(&["seconds", "photons"]);
    let full = full.figures(&["seconds", "photons"]);
    assert!(spared[0] > 0.0 && spared[1..].iter().all(|&seconds| seconds == 0.0), "{spared:?}");
    assert!(full.iter().all(|&seconds| seconds > 0.0), "{full:?}");

    // The plan is told beforehand in the words of the report.
    let table = render2mpeg(folder.path(), &["plan", "room.glb"]).stdout;
    let row = table.lines().find(|line| line.starts_with("photons ")).expect("a row for photons");
    assert!(row.split_whitespace().nth(1) == Some("once"), "{row}");
}

#[test]
fn nothing_moves() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), Moving::Nothing);
    let [spared, _] = both_ways(folder.path(), Moving::Nothing);
    assert_eq!(state(&spared.report, "primary rays and motion"), "once");
    // With fixed thresholds a still picture stays the same to the last bit. The first P picture may refine the I picture;
    // then each says "as before": a header, and for each of 4 rows a slice with its first and last macroblock.
    let still = render(folder.path(), "still", &scene, &format!("{SMALL} --thresholds fixed:0.02"));
    let bits = still.figures(&["bits"]);
    println!("bits of a still scene: {bits:?}; with perceptual thresholds {:?}", spared.figures(&["bits"]));
    assert!(bits[1] < bits[0] / 4.0, "{bits:?}");
    assert!(bits[2..].iter().all(|&skipped| skipped < 500.0), "{bits:?}");
}

#[test]
fn a_box_moves() {
    let folder = tempfile::tempdir().unwrap();
    let [spared, _] = both_ways(folder.path(), Moving::Box);
    for stage in ["photons", "light tree update", "placing of objects", "anchor lights on moving objects"] {
        assert_eq!(state(&spared.report, stage), "on", "{stage}");
    }
}
