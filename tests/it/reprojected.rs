//! Frames with reprojected light, compared with frames shaded at every pixel.

use render_core::image_file::read_layers;
use render_core::luminance;
use std::path::Path;
use tests::{Moving, Rendered, checkered_room, render};

const SMALL: &str = "--size 96x96 --vpls 400 --photons 40000 --exr-depth float --aov direct,indirect,shading,threshold";

/// Reads the luminance of one layer of a frame.
fn layer(folder: &Path, film: &str, index: usize, name: &str) -> Vec<f32> {
    let layers = read_layers(&folder.join(film).join(format!("frame_{index:05}.exr"))).expect("a frame");
    layers.colors(&format!("{name}.")).expect("the layer").samples().iter().map(|&rgb| luminance(rgb.into())).collect()
}

/// Renders a film shaded at every pixel, and adaptively.
fn both(folder: &Path, moving: Moving, more: &str) -> [Rendered; 2] {
    let scene = folder.join("room.glb");
    checkered_room(moving).write(&scene);
    ["full", "adaptive"]
        .map(|shading| render(folder, shading, &scene, &format!("{SMALL} {more} --shading {shading} --exr {shading}")))
}

/// Mean over all frames but the first.
fn mean(film: &Rendered, figure: &str) -> f64 {
    let all = film.figures(&[figure]);
    all[1..].iter().sum::<f64>() / (all.len() - 1) as f64
}

/// Only a box and its shadow move. Pixels they do not touch stay equal up to rounding, and no shadow is a frame late. A pixel
/// that the box has just uncovered may reuse neighboring light, within its threshold.
#[test]
fn shadows_are_never_late() {
    let folder = tempfile::tempdir().unwrap();
    let [full, adaptive] = both(folder.path(), Moving::Box, "--frames 12 --antialiasing off");
    for index in 0..12 {
        let [truth, reprojected] = ["full", "adaptive"].map(|film| layer(folder.path(), film, index, "direct"));
        let layers = read_layers(&folder.path().join(format!("adaptive/frame_{index:05}.exr"))).unwrap();
        let thresholds = layers.channel("threshold.Y").expect("the layer");
        for (pixel, ((a, b), &threshold)) in truth.iter().zip(&reprojected).zip(thresholds).enumerate() {
            let allowed = if threshold > 0.0 { threshold } else { 0.02 * a };
            assert!((a - b).abs() <= 1.5 * allowed + 1e-6, "frame {index}, pixel {pixel}: {b} instead of {a}");
        }
        let other = truth.iter().zip(&reprojected).filter(|&(a, b)| (a - b).abs() > 5e-4 * a + 1e-6).count();
        assert!(other <= truth.len() / 100, "frame {index}: {other} pixels");
    }
    // While anything moves, indirect light changes everywhere.
    assert_eq!(mean(&full, "reprojected_share"), 0.0);
    assert_eq!(mean(&adaptive, "reprojected_share"), 0.0);
    let reused = read_layers(&folder.path().join("adaptive/frame_00006.exr")).unwrap();
    let reused = reused.channel("shading.reused").expect("the layer");
    let direct = reused.iter().filter(|&&how| how == 1.0).count();
    assert!(direct > reused.len() / 3, "{direct}");
}

/// In a static room with a moving camera, most light is reprojected and the error stays small.
#[test]
fn a_moving_camera_takes_the_light_along() {
    let folder = tempfile::tempdir().unwrap();
    let [_, adaptive] = both(folder.path(), Moving::Camera, "--frames 16");
    assert!(mean(&adaptive, "reprojected_share") > 0.5, "{}", mean(&adaptive, "reprojected_share"));
    let within = mean(&adaptive, "audit_reprojected_within");
    assert!(within > 0.9, "{within}");
    for index in [5, 15] {
        for light in ["direct", "indirect"] {
            let [truth, reprojected] = ["full", "adaptive"].map(|film| layer(folder.path(), film, index, light));
            let mean = truth.iter().sum::<f32>() / truth.len() as f32;
            let squares: f32 = truth.iter().zip(&reprojected).map(|(a, b)| (a - b).powi(2)).sum();
            let rms = (squares / truth.len() as f32).sqrt() / mean;
            assert!(rms < 0.02, "frame {index}: {light} light is {rms} off");
        }
    }
}
