//! Test that compares a file of Blender's exporter with the file's rendering in Blender's Cycles.

use render_core::scene::{self, Reach};
use render_core::{PathOptions, Still, path_traced};
use std::path::Path;

/// Radiance of the floor around some points, rendered with Cycles of Blender 5.0.1: 4096 samples, direct light only,
/// means over 4×4 pixels. `tests/data/blender_lamps.py` writes the file and prints these values.
const CYCLES: [(&str, f32, f32); 4] =
    [("panel", -7.0, 0.13973), ("point", -3.0, 0.30916), ("spot", 3.0, 0.31555), ("sun", 13.0, 0.00859)];

/// Light is within 2 % of Cycles for a file exported with default options. The file has a panel of emission 10, a point
/// and a spot of 100 W, and a sun of 0.05 W/m².
#[test]
fn lamps_of_blender_are_as_bright_as_in_cycles() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/blender_lamps.glb");
    let radiance = |settings: &[scene::Setting]| {
        let scene = scene::load_with(&path, Reach::Folder, settings).unwrap();
        let options = PathOptions { samples: 256, max_bounces: Some(1), ..PathOptions::default() };
        let picture = path_traced(&scene, Still { time: 0.0, width: 128, height: 32 }, &options, |_, _| ()).mean;
        CYCLES.map(|(_, x, _)| {
            let column = ((x / 32.0 + 0.5) * 128.0).round() as usize;
            let block = (14..18).flat_map(|y| (column - 2..column + 2).map(move |x| (x, y)));
            block.map(|(x, y)| picture.get(x, y)[0]).sum::<f32>() / 16.0
        })
    };
    for ((name, _, expected), found) in CYCLES.into_iter().zip(radiance(&[])) {
        println!("{name}: {found} for {expected}");
        assert!((found / expected - 1.0).abs() < 0.02, "{name}: {found}, not {expected}");
    }
    // With the file's own values, lamps are 683 times as bright and outshine the panel.
    let [_, point, ..] = radiance(&["lamps=1".parse().unwrap()]);
    assert!((point / (683.0 * 0.30916) - 1.0).abs() < 0.02, "{point}");
}
