//! The feedback from the encoder's quantiser to the lightcuts of the next frame.

use perceptual::{ToneMap, YCbCr, luminance_plane};
use pipeline::stage::{Coding, Displayed, LastThresholds, LuminanceThresholds, Mask, Prepare, Shade};
use plane::Plane;
use render_core::scene::Scene;
use render2mpeg::settings::Switch;
use render2mpeg::stages::Masking;
use render2mpeg::{Options, Settings};
use renderer::plan::Plan;
use renderer::{Preparation, Shading};
use std::sync::Arc;
use tests::{Moving, Rendered, checkered_room, cornell, load, render};

const SIDE: usize = 48;

#[test]
fn thresholds_open_after_the_first_frame_and_cuts_shrink() {
    let folder = tempfile::tempdir().unwrap();
    let film = |name: &str, more: &str| {
        let arguments =
            format!("--size 64x64 --frames 5 --vpls 1000 --photons 50000 --cache off --compensation off {more}");
        render(folder.path(), name, &cornell(), &arguments)
    };
    let fixed = film("fixed", "--thresholds fixed:0.02");
    let [fine, middle, coarse] =
        [2, 8, 48].map(|q| film(&format!("q{q}"), &format!("--thresholds perceptual --qscale {q}")));
    let cuts = |film: &Rendered| film.figures(&["cut_size_mean"]);
    let shares = |film: &Rendered| film.figures(&["threshold_mean_relative"]);
    for (name, film) in [("fixed", &fixed), ("q2", &fine), ("q8", &middle), ("q48", &coarse)] {
        println!("{name}: cuts {:.1?}, thresholds {:.3?} of luminance", cuts(film), shares(film));
        // No coding is known before the first frame, so all films start equal.
        assert_eq!(cuts(film)[0], cuts(&fixed)[0], "{name}");
        assert!((shares(film)[0] - 0.02).abs() < 1e-6, "{name}");
    }
    // Coarser quantisers allow larger thresholds and smaller cuts.
    for frame in 1..5 {
        assert!((shares(&fixed)[frame] - 0.02).abs() < 1e-6);
        assert!(shares(&middle)[frame] > 0.02, "frame {frame}: {:?}", shares(&middle));
        assert!(cuts(&middle)[frame] < cuts(&fixed)[frame], "frame {frame}: {:?}", cuts(&middle));
        assert!(shares(&coarse)[frame] > shares(&fine)[frame], "frame {frame}: a coarser quantiser hides more");
        assert!(cuts(&coarse)[frame] <= cuts(&fine)[frame], "frame {frame}: and needs smaller cuts");
    }
}

/// Options for one lightcut per pixel and frame, so that a threshold has an immediate effect.
fn per_pixel() -> Options {
    Options { cache: Some(Switch::Off), compensation: Some(Switch::Off), ..Options::default() }
}

fn small_film(frames: u32) -> (Scene, Settings) {
    let size = format!("{SIDE}x{SIDE}").parse().ok();
    let options = Options { frames: Some(frames), size, vpls: Some(300), photons: Some(10_000), ..per_pixel() };
    load(&cornell(), options)
}

fn thresholds_of(frame: u32, delta: f32) -> LuminanceThresholds {
    LuminanceThresholds {
        of: frame,
        delta: Arc::new(Plane::filled(SIDE, SIDE, delta)),
        luminance: Arc::new(Plane::filled(SIDE, SIDE, 1.0)),
    }
}

/// Returns the cut sizes of frames 0 and 1; frame 1 gets `delta` as the thresholds of frame 0.
fn cuts_with(delta: f32) -> [f64; 2] {
    let (scene, settings) = small_film(2);
    let plan = Plan::new(&scene, &settings.render);
    let (mut preparation, mut shading) =
        (Preparation::new(&scene, &settings.render, &plan), Shading::new(&settings.render, &plan));
    let first = shading.step(&preparation.step(0).unwrap(), LastThresholds::none());
    let (prepared, thresholds) = (preparation.step(1).unwrap(), thresholds_of(0, delta));
    let last = LastThresholds::new(1, Some(&thresholds), prepared.correspondence.as_deref());
    let second = shading.step(&prepared, last);
    assert!(preparation.step(2).is_none(), "the film has two frames");
    [first, second].map(|shaded| shaded.figures.cut_size_mean)
}

#[test]
fn a_frame_keeps_to_the_thresholds_of_the_one_before() {
    let (strict, lax) = (cuts_with(1e-9), cuts_with(1e6));
    println!("cuts of frames 0 and 1: threshold 10⁻⁹ {strict:.1?}, threshold 10⁶ {lax:.1?}");
    assert_eq!(strict[0], lax[0], "frame 0 has no thresholds");
    // Disoccluded pixels keep 2 %; all others stop at the root.
    assert!(lax[1] < 0.2 * lax[0], "{lax:?}");
    assert!(strict[1] > 2.0 * strict[0], "{strict:?}");
}

#[test]
#[should_panic(expected = "out of step")]
fn thresholds_of_another_frame_are_refused() {
    let thresholds = thresholds_of(1, 1.0);
    let _ = LastThresholds::new(1, Some(&thresholds), None);
}

#[test]
fn masking_allows_two_percent_at_least() {
    let (_, settings) = small_film(3);
    let mut masking = Masking::new(&settings).unwrap();
    let tone_map = ToneMap::default();
    for index in 0..3 {
        let level = 0.1 + 0.2 * index as f32;
        let radiance = Plane::from_fn(SIDE, SIDE, |x, y| [level * (1.0 + 0.5 * ((x / 5 + y / 3) % 2) as f32); 3]);
        let luminance = Arc::new(luminance_plane(&radiance));
        let picture = Arc::new(YCbCr::from_radiance(&radiance, &tone_map));
        let displayed =
            Displayed { index, picture, luminance, tone_map, importance: None, correspondence: None, forward: None };
        let delta = masking.step(&displayed, &Coding::of_quantiser(8.0));
        // Without a match in the previous frame, this is e of eq. (4), at least 2 % of the luminance.
        let least = delta.samples().iter().zip(displayed.luminance.samples()).map(|(delta, y)| delta / y);
        assert!(least.fold(f32::INFINITY, f32::min) >= 0.02 * 0.999);
    }
}

/// Thresholds follow the quantiser of a bit rate one frame later, even during the encoder's look-ahead. They are close to a
/// film's at that quantiser, not at the quantiser in the settings.
#[test]
fn thresholds_follow_a_bit_rate_from_the_first_frame_on() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = folder.join("room.glb");
    checkered_room(Moving::Camera).write(&scene);
    let film = |name: &str, options: &str| {
        let options = format!("--size 64x64 --vpls 60 --photons 1000 --frames 31 --bframes 1 {options}");
        render(folder, name, &scene, &options)
    };
    let rated = film("rated", "--bitrate 40k");
    let quantisers = rated.figures(&["qscale"]);
    let mean = quantisers.iter().sum::<f64>() / quantisers.len() as f64;
    let like_it = film("like_it", &format!("--qscale {}", 2 * (mean / 2.0) as u32));
    let fine = film("fine", "--qscale 8");

    // The first frame has thresholds of 2 %; no picture is coded before the last frame is shaded.
    let thresholds = |film: &Rendered| {
        let figures = film.figures(&["threshold_mean_relative"]);
        figures[1..].iter().sum::<f64>() / (figures.len() - 1) as f64
    };
    let [rated, like_it, fine] = [&rated, &like_it, &fine].map(thresholds);
    println!("quantiser {mean:.1}: {rated:.4}, at that quantiser {like_it:.4}, at 8 {fine:.4}");
    assert!(like_it > 1.5 * fine, "the quantisers are too close for this test: {like_it} {fine}");
    assert!((0.6..1.6).contains(&(rated / like_it)), "{rated} is far from {like_it}");
}
