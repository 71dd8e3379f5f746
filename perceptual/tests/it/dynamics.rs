//! Tests of the loop over frames as a dynamical system. Equation (5) is compared with its closed form for several kinds
//! of input. In the closed loop, a renderer uses its whole error budget.
//!
//! ```text
//! (5)  T(n) = (1 − w) e(n) + w T(n−1)        for constant e(n) = e*: T(n) − e* = wⁿ (T(0) − e*)
//! ```
//! `docs/limits.md` contains the analysis behind these tests.

use perceptual::{Feedback, MaskingModel, ObservedFrame, ToneMap, WHITE_LUMA, tolerable_error};
use plane::{Correspondence, NO_MATCH, Plane};

/// Side of the picture. A single block in a single thread is fast enough for ten thousand frames.
const SIDE: usize = 8;
const LONG: usize = 10_000;
const WEIGHTS: [f32; 6] = [0.0, 0.25, 0.5, 0.75, 0.9, 0.99];
/// Position of the observed pixel. All other pixels behave alike.
const PLACE: (usize, usize) = (5, 6);

struct Frame {
    luma: Plane<f32>,
    luminance: Plane<f32>,
}

impl Frame {
    fn observed<'a>(&'a self, known: Option<&'a Correspondence>) -> ObservedFrame<'a> {
        ObservedFrame { luma: &self.luma, luminance: &self.luminance, known }
    }
}

fn frame_of(luminance: impl Fn(usize, usize) -> f32) -> Frame {
    let luminance = Plane::from_fn(SIDE, SIDE, luminance);
    let tone_map = ToneMap::default();
    Frame { luma: luminance.map(|y| WHITE_LUMA * tone_map.encode(y)), luminance }
}

/// Returns the luminance of a detailed picture with brightness 1.
fn detail(x: usize, y: usize) -> f32 {
    0.2 + 0.1 * ((x * 7 + y * 3) % 5) as f32
}

fn lit(brightness: f32) -> Frame {
    frame_of(|x, y| brightness * detail(x, y))
}

fn feedback(weight: f32) -> Feedback {
    Feedback::new(MaskingModel::default(), ToneMap::default(), weight)
}

/// Runs a function in a separate pool of one thread.
fn alone<T: Send>(run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(run)
}

/// Returns e of a frame without a previous frame.
fn e_of(frame: &Frame, quantiser_scale: f32) -> Plane<f32> {
    tolerable_error(&frame.luma, &frame.luminance, quantiser_scale, &ToneMap::default(), &MaskingModel::default())
}

fn at(plane: &Plane<f32>) -> f64 {
    f64::from(plane.get(PLACE.0, PLACE.1))
}

/// Returns the maximum rounding error. Each frame rounds three times, and w propagates the error.
fn rounding(weight: f32) -> f64 {
    3.0 * f64::from(f32::EPSILON) / (1.0 - f64::from(weight))
}

/// Returns T of the observed pixel for a sequence of (frame, quantiser_scale), one value per frame.
fn response(weight: f32, start: f32, inputs: impl Iterator<Item = (usize, f32)> + Send, frames: &[Frame]) -> Vec<f64> {
    alone(move || {
        let (mut feedback, still) = (feedback(weight), Correspondence::still(SIDE, SIDE));
        feedback.restore(Plane::filled(SIDE, SIDE, start));
        let next = |(which, scale): (usize, f32)| at(feedback.observe(frames[which].observed(Some(&still)), scale));
        inputs.map(next).collect()
    })
}

/// After a step, the distance from the new steady state falls by the factor w per frame. It is below 1 % at the
/// predicted frame.
#[test]
fn a_step_decays_by_the_weight() {
    let frames = [lit(0.5)];
    let e = at(&e_of(&frames[0], 8.0));
    for weight in WEIGHTS {
        for start in [e as f32 * 100.0, e as f32 / 100.0] {
            let found = response(weight, start, std::iter::repeat_n((0, 8.0), 2000), &frames);
            let (w, distance) = (f64::from(weight), f64::from(start) - e);
            for (n, found) in (1..).zip(&found) {
                let exact = e + distance * w.powi(n);
                assert!(
                    (found - exact).abs() <= rounding(weight) * exact.max(e),
                    "w = {w}, frame {n}: {found} {exact}"
                );
            }
            let settled = found.iter().position(|t| (t / e - 1.0).abs() < 0.01).unwrap() + 1;
            let predicted = if w == 0.0 { 1 } else { ((0.01 * e / distance.abs()).ln() / w.ln()).ceil() as usize };
            assert!(settled.abs_diff(predicted) <= 1, "w = {w}: {settled} frames, {predicted} predicted");
        }
    }
}

/// Over ten thousand frames of a static scene, T does not drift. Once the rounding has converged, no two frames differ.
#[test]
fn nothing_drifts_in_ten_thousand_frames() {
    let frames = [lit(0.5)];
    let e = at(&e_of(&frames[0], 8.0));
    for weight in WEIGHTS {
        let found = response(weight, 50.0 * e as f32, std::iter::repeat_n((0, 8.0), LONG), &frames);
        assert!((found[LONG - 1] / e - 1.0).abs() <= rounding(weight), "w = {weight}: {} for {e}", found[LONG - 1]);
        assert!(found[LONG / 2..].iter().all(|t| *t == found[LONG - 1]), "w = {weight}: a cycle of roundings");
    }
}

#[test]
fn an_impulse_is_forgotten() {
    let frames = [lit(0.5), lit(50.0)];
    let [e, flash] = [0, 1].map(|k| at(&e_of(&frames[k], 8.0)));
    for weight in WEIGHTS {
        let w = f64::from(weight);
        let inputs = (0..LONG).map(|n| (usize::from(n == 10), 8.0));
        let found = response(weight, e as f32, inputs, &frames);
        for (n, found) in found.iter().enumerate().skip(10) {
            let exact = e + (1.0 - w) * (flash - e) * w.powi(n as i32 - 10);
            assert!((found - exact).abs() <= rounding(weight) * flash, "w = {w}, frame {n}: {found} {exact}");
        }
    }
}

/// Checks two alternating inputs, each constant for `held` frames: T oscillates between the limits of a geometric
/// series.
fn check_square_wave(frames: &[Frame], inputs: [(usize, f32); 2], e: [f64; 2], held: usize) {
    for weight in WEIGHTS {
        let w = f64::from(weight);
        let found = response(weight, e[0] as f32, (0..LONG).map(|n| inputs[n / held % 2]), frames);
        let tail = &found[LONG - 4 * held..];
        let swing =
            tail.iter().fold(0.0f64, |most, t| most.max(*t)) - tail.iter().fold(f64::MAX, |least, t| least.min(*t));
        // Over a half period the distance shrinks by the factor w^held. The distances at both ends are symmetric.
        let decay = w.powi(held as i32);
        let exact = (1.0 - decay) / (1.0 + decay) * (e[1] - e[0]).abs();
        let tolerance = 4.0 * rounding(weight) * e[0].max(e[1]);
        assert!((swing - exact).abs() <= tolerance, "w = {w}, {held} frames each: {swing}, {exact} by the series");
        let (low, high) = (e[0].min(e[1]), e[0].max(e[1]));
        assert!(found.iter().all(|t| (low - tolerance..=high + tolerance).contains(t)), "w = {w}: beyond both states");
    }
}

#[test]
fn a_square_wave_swings_as_its_series_says() {
    let frames = [lit(0.5), lit(3.0)];
    let e = [0, 1].map(|k| at(&e_of(&frames[k], 8.0)));
    for held in [1, 2, 7, 50] {
        check_square_wave(&frames, [(0, 8.0), (1, 8.0)], e, held);
    }
}

/// The quantiser alternates between the finest and the coarsest in every frame.
#[test]
fn jumping_quantisers_swing_as_their_series_says() {
    let frames = [lit(0.5)];
    let e = [1.0, 112.0].map(|scale| at(&e_of(&frames[0], scale)));
    assert!(e[1] > 5.0 * e[0], "{e:?}: the two tell");
    check_square_wave(&frames, [(0, 1.0), (0, 112.0)], e, 1);
}

/// The light has uniform, uncorrelated noise. The variance of T is (1 − w) / (1 + w) of the variance of e.
#[test]
fn noise_is_smoothed_as_a_filter_of_one_pole_does() {
    // Draw brightnesses from a fixed set. Only the variance of e over this set has an effect.
    let frames: Vec<Frame> = (0..64).map(|k| lit(0.5 + k as f32 / 64.0)).collect();
    let e: Vec<f64> = frames.iter().map(|frame| at(&e_of(frame, 8.0))).collect();
    let variance = |list: &[f64]| {
        let mean = list.iter().sum::<f64>() / list.len() as f64;
        list.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / list.len() as f64
    };
    let mut random = fastrand::Rng::with_seed(1);
    let drawn: Vec<(usize, f32)> = (0..3 * LONG).map(|_| (random.usize(..64), 8.0)).collect();
    for weight in [0.0, 0.25, 0.5, 0.75, 0.9] {
        let w = f64::from(weight);
        let found = response(weight, e[32] as f32, drawn.iter().copied(), &frames);
        let ratio = variance(&found[LONG..]) / variance(&e);
        let exact = (1.0 - w) / (1.0 + w);
        // Of 20 000 values, a fraction (1 − w) / (1 + w) is independent. With n independent values, the relative
        // deviation of the variance is √(2/n).
        let deviation = (2.0 / (2.0 * LONG as f64 * exact)).sqrt();
        assert!((ratio / exact - 1.0).abs() < 4.0 * deviation, "w = {w}: {ratio}, {exact} by theory");
    }
}

/// With a different scene in every frame, no threshold depends on the previous frame.
#[test]
fn cuts_in_every_frame_leave_no_memory() {
    let frames = [lit(0.5), lit(3.0), lit(1e-6), lit(1e6)];
    let e: Vec<Plane<f32>> = frames.iter().map(|frame| e_of(frame, 8.0)).collect();
    let nothing = Correspondence::from_matches(Plane::filled(SIDE, SIDE, NO_MATCH));
    alone(|| {
        for weight in WEIGHTS {
            let mut feedback = feedback(weight);
            for n in 0..LONG {
                let (frame, e) = (&frames[n * 7 % 4], &e[n * 7 % 4]);
                let known = (n % 2 == 0).then_some(&nothing);
                assert!(feedback.observe(frame.observed(known), 8.0) == e, "w = {weight}, frame {n}");
            }
        }
    });
}

/// Error behavior of a renderer within its threshold.
#[derive(Clone, Copy, Debug)]
enum Renderer {
    /// Error equal to the threshold, with alternating sign: the worst case.
    Flickers,
    /// Error equal to the threshold, with a random sign per pixel and frame.
    Noise,
    /// Rounds to values two thresholds apart, like a lightcut with few possible values. Equal thresholds give equal
    /// pictures.
    Coarse,
}

fn rendered(kind: Renderer, truth: f32, threshold: f32, pixel: usize, n: usize) -> f32 {
    let off = match kind {
        Renderer::Flickers => threshold * (1.0 - 2.0 * (n % 2) as f32),
        Renderer::Noise => {
            let mixed = ((pixel * 0x9e37 + n * 0x85eb) as u32).wrapping_mul(0x2c1b_3c6d);
            threshold * ((mixed >> 8) as f32 / (1 << 23) as f32 - 1.0)
        }
        Renderer::Coarse => 2.0 * threshold * (truth / (2.0 * threshold)).round() - truth,
    };
    (truth + off).max(0.0)
}

/// Runs the closed loop over `frames` frames, from a uniform threshold `start`. Returns the lowest, mean and highest
/// threshold of the last thousand frames.
fn band(kind: Renderer, (weight, kappa, scale): (f32, f32, f32), start: f32, frames: usize) -> [f64; 3] {
    let still = Correspondence::still(SIDE, SIDE);
    let mut feedback = feedback(weight).with_kappa(kappa);
    feedback.restore(Plane::filled(SIDE, SIDE, start));
    let (mut low, mut sum, mut high) = (f64::MAX, 0.0, 0.0f64);
    for n in 0..frames {
        let thresholds = feedback.thresholds_for_next(&still);
        let frame = frame_of(|x, y| {
            let truth = detail(x, y);
            rendered(kind, truth, thresholds.resolve(x, y, truth), y * SIDE + x, n)
        });
        let after = feedback.observe(frame.observed(Some(&still)), scale).samples();
        if n + 1000 >= frames {
            low = after.iter().fold(low, |low, t| low.min(f64::from(*t)));
            high = after.iter().fold(high, |high, t| high.max(f64::from(*t)));
            sum += after.iter().map(|t| f64::from(*t)).sum::<f64>() / after.len() as f64;
        }
    }
    [low, sum / 1000.0, high]
}

/// The loop from thresholds to a picture and back runs for thousands of frames. No closed form exists, but T is
/// bounded: it is a mean of values of e, which is bounded for any picture.
///
/// With the default weight, thresholds that start at 10⁻⁴ and at 10⁴ converge to the same band. Without any past the
/// loop is chaotic. With a weight near 1, a thousand frames are few. In these two cases, only the order of magnitude of
/// the means must agree.
#[test]
fn the_closed_loop_stays_in_a_band_wherever_it_starts() {
    let largest = f64::from(ToneMap::default().saturation());
    for kind in [Renderer::Flickers, Renderer::Noise, Renderer::Coarse] {
        for settings in [(0.0, 1.0, 48.0), (0.5, 1.0, 8.0), (0.5, 0.25, 48.0), (0.5, 1.0, 112.0), (0.99, 1.0, 48.0)] {
            let weight = settings.0;
            let frames = if weight > 0.9 { 5000 } else { 2000 };
            let bands = alone(|| [1e-4, 1e4].map(|start| band(kind, settings, start, frames)));
            let truth = frame_of(detail);
            let e = e_of(&truth, settings.2);
            let open = e.samples().iter().zip(truth.luminance.samples());
            let open = open.map(|(e, y)| f64::from((settings.1 * e).max(0.02 * y))).sum::<f64>() / (SIDE * SIDE) as f64;
            println!("{kind:?}, (w, κ, quantiser) = {settings:?}: open {open:.4}, closed {bands:.4?}");
            // e cannot exceed the saturating luminance, unless the picture is brighter than this luminance.
            for [low, mean, high] in bands {
                assert!(low > 0.0 && high <= largest && low <= mean && mean <= high, "{kind:?}: {bands:?}");
            }
            let ratio = bands[0][1] / bands[1][1];
            let allowed = if weight == 0.5 { 0.02 } else { 0.25 };
            assert!((ratio - 1.0).abs() < allowed, "{kind:?}, {settings:?}: where it starts decides: {bands:?}");
        }
    }
}
