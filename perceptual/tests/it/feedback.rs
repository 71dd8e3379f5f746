//! Tests of the loop over frames: steady state, no drift, shot changes, flashes, invalid frames, threads.

use perceptual::{
    DEFAULT_WEIGHT, Feedback, MaskingModel, ObservedFrame, ToneMap, YCbCr, luminance_plane, tolerable_error,
};
use plane::{Correspondence, NO_MATCH, Plane};

const WIDTH: usize = 19;
const HEIGHT: usize = 10;

struct Frame {
    luma: Plane<f32>,
    luminance: Plane<f32>,
}

impl Frame {
    fn observed<'a>(&'a self, known: Option<&'a Correspondence>) -> ObservedFrame<'a> {
        ObservedFrame { luma: &self.luma, luminance: &self.luminance, known }
    }
}

fn tone_map() -> ToneMap {
    ToneMap::default()
}

fn frame_of(radiance: &Plane<[f32; 3]>) -> Frame {
    Frame { luma: YCbCr::from_radiance(radiance, &tone_map()).luma, luminance: luminance_plane(radiance) }
}

fn frame(brightness: f32) -> Frame {
    frame_of(&Plane::from_fn(WIDTH, HEIGHT, |x, y| [brightness * (0.2 + 0.1 * ((x * 7 + y * 3) % 5) as f32); 3]))
}

fn feedback(weight: f32) -> Feedback {
    Feedback::new(MaskingModel::default(), tone_map(), weight)
}

fn alone(frame: &Frame, quantiser_scale: f32) -> Plane<f32> {
    tolerable_error(&frame.luma, &frame.luminance, quantiser_scale, &tone_map(), &MaskingModel::default())
}

fn largest_ratio(a: &Plane<f32>, b: &Plane<f32>) -> f32 {
    a.samples().iter().zip(b.samples()).map(|(a, b)| (a / b).max(b / a)).fold(0.0, f32::max)
}

#[test]
fn ten_thousand_still_frames_settle_and_stay() {
    let (still, bright, dim) = (Correspondence::still(WIDTH, HEIGHT), frame(3.0), frame(0.5));
    let e = alone(&dim, 8.0);
    for weight in [0.0, 0.3, DEFAULT_WEIGHT, 0.9] {
        let mut feedback = feedback(weight);
        feedback.observe(bright.observed(None), 112.0);
        let mut settled = None;
        for t in 1..=10_000 {
            let thresholds = feedback.observe(dim.observed(Some(&still)), 8.0);
            if t == 500 {
                settled = Some(thresholds.clone());
            }
        }
        assert_eq!(Some(&**feedback.thresholds()), settled.as_ref(), "no drift at w = {weight}");
        let ratio = largest_ratio(feedback.thresholds(), &e);
        assert!(ratio < 1.0 + 1e-5, "w = {weight}: {ratio}");
    }
}

#[test]
fn the_past_fades_by_its_weight() {
    let (still, bright, dim) = (Correspondence::still(WIDTH, HEIGHT), frame(3.0), frame(0.5));
    let mut feedback = feedback(0.5);
    let first = feedback.observe(bright.observed(None), 8.0).get(4, 4);
    let now = alone(&dim, 8.0).get(4, 4);
    for t in 1..6 {
        let threshold = feedback.observe(dim.observed(Some(&still)), 8.0).get(4, 4);
        let wanted = now + (first - now) * 0.5f32.powi(t);
        assert!((threshold / wanted - 1.0).abs() < 1e-5, "frame {t}: {threshold} {wanted}");
    }
}

#[test]
fn a_cut_forgets() {
    let (bright, dim) = (frame(3.0), frame(0.5));
    let mut feedback = feedback(0.5);
    feedback.observe(bright.observed(None), 8.0);
    assert_eq!(feedback.observe(dim.observed(None), 8.0), &alone(&dim, 8.0));
    let nothing_matches = Correspondence::from_matches(Plane::filled(WIDTH, HEIGHT, NO_MATCH));
    feedback.observe(bright.observed(None), 8.0);
    assert_eq!(feedback.observe(dim.observed(Some(&nothing_matches)), 8.0), &alone(&dim, 8.0));
    let map = feedback.thresholds_for_next(&nothing_matches);
    assert!((0..WIDTH).all(|x| map.get(x, 3).is_none()));
    // A picture of a different size resets the state.
    let small = frame_of(&Plane::filled(8, 8, [0.5; 3]));
    assert_eq!(feedback.observe(small.observed(Some(&Correspondence::still(8, 8))), 8.0), &alone(&small, 8.0));
}

#[test]
fn a_flashing_light_keeps_thresholds_between_its_two_states() {
    let (still, on, off) = (Correspondence::still(WIDTH, HEIGHT), frame(3.0), frame(0.01));
    let (high, low) = (alone(&on, 8.0), alone(&off, 8.0));
    let mut feedback = feedback(0.5);
    for t in 0..1000 {
        let frame = if t % 2 == 0 { &on } else { &off };
        let thresholds = feedback.observe(frame.observed(Some(&still)), 8.0);
        for i in 0..WIDTH * HEIGHT {
            let (a, b) = (high.samples()[i], low.samples()[i]);
            let here = thresholds.samples()[i];
            assert!(here >= a.min(b) * 0.9999 && here <= a.max(b) * 1.0001, "frame {t}: {here}");
        }
    }
}

#[test]
fn a_broken_frame_passes() {
    let (still, good) = (Correspondence::still(WIDTH, HEIGHT), frame(1.0));
    let mut broken = frame(1.0);
    broken.luma.set(3, 3, f32::NAN);
    broken.luminance.set(4, 3, f32::INFINITY);
    let mut feedback = feedback(0.5);
    feedback.observe(broken.observed(Some(&still)), 8.0);
    assert_eq!(feedback.non_finite(), 2);
    for _ in 0..200 {
        feedback.observe(good.observed(Some(&still)), 8.0);
    }
    assert_eq!(feedback.non_finite(), 0);
    assert!(largest_ratio(feedback.thresholds(), &alone(&good, 8.0)) < 1.0 + 1e-5);
}

#[test]
fn thresholds_travel_with_the_picture() {
    let first = frame(1.0);
    let mut feedback = feedback(0.5);
    feedback.observe(first.observed(None), 8.0);
    // Everything moves two pixels to the right. The left columns are disoccluded.
    let two_to_the_left = |x: usize, y: usize| if x < 2 { NO_MATCH } else { (y * WIDTH + x - 2) as u32 };
    let moved = Correspondence::from_matches(Plane::from_fn(WIDTH, HEIGHT, two_to_the_left));
    let map = feedback.thresholds_for_next(&moved);
    assert_eq!(map.get(1, 5), None);
    assert_eq!(map.get(9, 5), Some(feedback.thresholds().get(7, 5)));
}

#[test]
fn a_film_can_be_continued() {
    let (still, first, second) = (Correspondence::still(WIDTH, HEIGHT), frame(1.0), frame(2.0));
    let (mut whole, mut continued) = (feedback(0.5), feedback(0.5));
    let saved = whole.observe(first.observed(None), 8.0).clone();
    continued.restore(saved);
    let wanted = whole.observe(second.observed(Some(&still)), 8.0);
    assert_eq!(continued.observe(second.observed(Some(&still)), 8.0), wanted);
    whole.reset();
    assert_eq!(whole.thresholds_for_next(&still).get(0, 0), None);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let radiance = Plane::from_fn(203, 151, |x, y| [0.1 + 0.001 * ((x * 31 + y * 17) % 611) as f32, 0.2, 0.3]);
            let frame = frame_of(&radiance);
            let mut feedback = feedback(0.5);
            feedback.observe(frame.observed(None), 5.0);
            feedback.observe(frame.observed(Some(&Correspondence::still(203, 151))), 9.0).clone()
        })
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(run(threads), one);
    }
}

#[test]
fn kappa_scales_what_masking_allows_down_to_the_floor() {
    let tone_map = ToneMap::default();
    let radiance = Plane::from_fn(32, 32, |x, y| [0.1 + 0.05 * ((x * 5 + y * 3) % 7) as f32; 3]);
    let picture = YCbCr::from_radiance(&radiance, &tone_map);
    let luminance = luminance_plane(&radiance);
    let observe = |kappa| {
        let mut feedback = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT).with_kappa(kappa);
        feedback.observe(ObservedFrame { luma: &picture.luma, luminance: &luminance, known: None }, 16.0).clone()
    };
    let (paper, half, none) = (observe(1.0), observe(0.5), observe(0.0));
    let mut scaled = 0;
    for ((&e, &h), &floor) in paper.samples().iter().zip(half.samples()).zip(none.samples()) {
        assert!((h - (0.5 * e).max(floor)).abs() <= 1e-6 * e);
        scaled += usize::from(h > floor);
    }
    assert!(scaled > 500, "masking is at work in {scaled} pixels");
    for (&floor, &y) in none.samples().iter().zip(luminance.samples()) {
        assert!((floor - 0.02 * y).abs() <= 1e-6, "without masking 2 % stay");
    }
    assert_eq!(observe(f32::NAN), none);
}
