//! The loop from the encoder's quantiser back to the renderer's cuts, one frame later.

use crossbeam_channel::{Receiver, Sender, bounded, unbounded};
use perceptual::{ToneMap, YCbCr, luminance_plane};
use pipeline::message::{LuminanceThresholds, Prepared, Shaded, ToMask};
use pipeline::settings::Switch;
use pipeline::{Plan, Settings, Wishes, stage};
use plane::Plane;
use render_core::scene::Scene;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tests::{assert_fails, cornell, load, render};

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
    let cuts = |film: &tests::Rendered| film.figures(&["cut_size_mean"]);
    let shares = |film: &tests::Rendered| film.figures(&["threshold_mean_relative"]);
    for (name, film) in [("fixed", &fixed), ("q2", &fine), ("q8", &middle), ("q48", &coarse)] {
        println!("{name}: cuts {:.1?}, thresholds {:.3?} of luminance", cuts(film), shares(film));
        // Nothing is known before the first frame, so all begin alike.
        assert_eq!(cuts(film)[0], cuts(&fixed)[0], "{name}");
        assert!((shares(film)[0] - 0.02).abs() < 1e-6, "{name}");
    }
    for frame in 1..5 {
        assert!((shares(&fixed)[frame] - 0.02).abs() < 1e-6);
        assert!(shares(&middle)[frame] > 0.02, "frame {frame}: {:?}", shares(&middle));
        assert!(cuts(&middle)[frame] < cuts(&fixed)[frame], "frame {frame}: {:?}", cuts(&middle));
        assert!(shares(&coarse)[frame] > shares(&fine)[frame], "frame {frame}: a coarser quantiser hides more");
        assert!(cuts(&coarse)[frame] <= cuts(&fine)[frame], "frame {frame}: and asks for less");
    }
}

/// Masking from the decoded picture (the paper's first strategy) and from the one that was coded differ by what was lost.
#[test]
fn both_strategies_agree_where_little_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let film = |kind: &str, qscale: u32| {
        let arguments = format!(
            "--size 64x64 --frames 3 --vpls 300 --photons 20000 --cache off --kappa 1 --qscale {qscale} --thresholds {kind}"
        );
        let film = render(folder.path(), &format!("{kind}{qscale}"), &cornell(), &arguments);
        film.figures(&["threshold_mean_relative"])[2]
    };
    let ratio = |qscale| film("quantised", qscale) / film("perceptual", qscale);
    let (little, much) = (ratio(1), ratio(62));
    println!("thresholds from decoded pictures by those from their sources: {little:.3} at 1, {much:.3} at 62");
    assert!((little - 1.0).abs() < 0.05, "{little}");
    assert!((much - 1.0).abs() > (little - 1.0).abs(), "{much}, {little}");
    let scene = cornell();
    let waiting = ["render", scene.to_str().unwrap(), "--thresholds", "quantised", "--bframes", "2"];
    assert_fails(folder.path(), &waiting, &["--thresholds quantised", "--thresholds codec"]);
}

/// A cut for each pixel and frame: what a threshold asks for shows at once.
fn per_pixel() -> Wishes {
    Wishes { cache: Some(Switch::Off), compensation: Some(Switch::Off), ..Wishes::default() }
}

fn small_film(frames: u32) -> (Scene, Settings) {
    let size = format!("{SIDE}x{SIDE}").parse().ok();
    let wishes = Wishes { frames: Some(frames), size, vpls: Some(300), photons: Some(10_000), ..per_pixel() };
    load(&cornell(), wishes)
}

/// Runs the shading stage between channels that the test holds.
fn with_shading(test: impl FnOnce(&Receiver<Shaded>, &Sender<LuminanceThresholds>)) -> std::thread::Result<()> {
    let (scene, settings) = small_film(2);
    let plan = Plan::new(&scene, &settings);
    let (prepared_out, prepared_in) = bounded::<Prepared>(2);
    let (thresholds_out, thresholds_in) = bounded(1);
    let (shaded_out, shaded_in) = bounded(2);
    stage::prepare::run(&scene, &settings, &plan, &AtomicBool::new(false), &prepared_out);
    drop(prepared_out);
    std::thread::scope(|scope| {
        let shading = scope.spawn(|| {
            // Owned here, so that the test sees the channels close when the stage ends.
            let (prepared_in, thresholds_in, shaded_out) = (prepared_in, thresholds_in, shaded_out);
            stage::shade::run(&settings, &plan, &prepared_in, &thresholds_in, &shaded_out);
        });
        test(&shaded_in, &thresholds_out);
        drop((shaded_in, thresholds_out));
        shading.join()
    })
}

const LONG: Duration = Duration::from_secs(60);

/// Cut sizes of frame 0 and of frame 1, which is given `delta` as the thresholds of frame 0.
fn cuts_with(delta: f32) -> [f64; 2] {
    let mut cuts = [0.0; 2];
    let result = with_shading(|shaded, thresholds| {
        cuts[0] = shaded.recv_timeout(LONG).unwrap().figures.cut_size_mean;
        // Frame 1 has all it needs but the thresholds.
        let early = shaded.recv_timeout(Duration::from_millis(300));
        assert!(early.is_err(), "frame 1 does not wait for the thresholds of frame 0");
        thresholds
            .send(LuminanceThresholds {
                of: 0,
                delta: Plane::filled(SIDE, SIDE, delta),
                luminance: Plane::filled(SIDE, SIDE, 1.0),
            })
            .unwrap();
        let second = shaded.recv_timeout(LONG).unwrap();
        assert_eq!(second.frame, 1);
        cuts[1] = second.figures.cut_size_mean;
    });
    result.expect("shading ends in order");
    cuts
}

#[test]
fn a_frame_waits_for_the_thresholds_of_the_one_before_and_keeps_to_them() {
    let (strict, lax) = (cuts_with(1e-9), cuts_with(1e6));
    println!("cuts of frames 0 and 1: threshold 10⁻⁹ {strict:.1?}, threshold 10⁶ {lax:.1?}");
    assert_eq!(strict[0], lax[0], "frame 0 knows of no thresholds");
    // What was not seen before keeps 2 % even now: the rest stops at the root.
    assert!(lax[1] < 0.2 * lax[0], "{lax:?}");
    assert!(strict[1] > 2.0 * strict[0], "{strict:?}");
}

#[test]
fn thresholds_of_another_frame_are_refused() {
    let result = with_shading(|shaded, thresholds| {
        shaded.recv_timeout(LONG).unwrap();
        thresholds
            .send(LuminanceThresholds {
                of: 1,
                delta: Plane::filled(SIDE, SIDE, 1.0),
                luminance: Plane::filled(SIDE, SIDE, 1.0),
            })
            .unwrap();
        assert!(shaded.recv_timeout(LONG).is_err(), "no frame is lit by thresholds out of step");
    });
    let message = result.expect_err("the stage stops").downcast::<String>().expect("a message");
    assert!(message.contains("out of step"), "{message}");
}

#[test]
fn masking_stamps_each_map_with_its_frame() {
    let (_, settings) = small_film(3);
    let (to_mask, frames) = bounded(1);
    let (out, thresholds) = bounded(1);
    let (times_out, times) = unbounded();
    std::thread::scope(|scope| {
        let masking = scope.spawn(|| {
            let (frames, out, times_out) = (frames, out, times_out);
            stage::mask::run(&settings, &frames, &out, &times_out)
        });
        let tone_map = ToneMap::default();
        for frame in 0..3 {
            let level = 0.1 + 0.2 * frame as f32;
            let radiance = Plane::from_fn(SIDE, SIDE, |x, y| [level * (1.0 + 0.5 * ((x / 5 + y / 3) % 2) as f32); 3]);
            let luminance = luminance_plane(&radiance);
            let picture = Arc::new(YCbCr::from_radiance(&radiance, &tone_map));
            let message = ToMask {
                frame,
                checkpoint: false,
                picture,
                luminance: luminance.clone(),
                tone_map,
                correspondence: None,
            };
            to_mask.send(message).unwrap();
            if frame == 2 {
                break;
            }
            let map = thresholds.recv_timeout(LONG).unwrap();
            assert_eq!(map.of, frame);
            // Without a match at the frame before, this is e of eq. (4), never below 2 % of what is seen.
            let least = map.delta.samples().iter().zip(luminance.samples()).map(|(delta, y)| delta / y);
            assert!(least.fold(f32::INFINITY, f32::min) >= 0.02 * 0.999);
        }
        // The renderer takes no thresholds after its last frame; that is no failure, and masking still ends.
        drop((thresholds, to_mask));
        masking.join().expect("masking ends in order").expect("and without an error");
    });
    assert_eq!(times.iter().map(|time| time.of).collect::<Vec<_>>(), [0, 1, 2]);
}
