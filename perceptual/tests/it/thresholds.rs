//! Tests of equations (4) and (5), which are compared with a transcription in `f64`, and of guarantees of thresholds.

use perceptual::{
    DEFAULT_WEIGHT, Feedback, MaskingModel, ObservedFrame, Operator, ThresholdMap, ToneMap, YCbCr, blend,
    luminance_plane, reproject, thresholds_of_srgb, tolerable_error, tolerable_error_counted,
};
use plane::{Correspondence, NO_MATCH, Plane};
use proptest::prelude::*;

fn radiance(width: usize, height: usize, seed: u32) -> Plane<[f32; 3]> {
    let mut state = seed;
    Plane::from_fn(width, height, |x, y| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 8) as f32 / (1 << 24) as f32;
        let level = 0.25 + 0.15 * (x as f32 * 0.3).sin() * (y as f32 * 0.2).cos() + 0.1 * noise;
        [level, 0.8 * level, 0.6 * level]
    })
}

fn thresholds(radiance: &Plane<[f32; 3]>, quantiser_scale: f32, tone_map: &ToneMap) -> Plane<f32> {
    let picture = YCbCr::from_radiance(radiance, tone_map);
    tolerable_error(&picture.luma, &luminance_plane(radiance), quantiser_scale, tone_map, &MaskingModel::default())
}

fn mean(plane: &Plane<f32>) -> f64 {
    plane.samples().iter().map(|&v| f64::from(v)).sum::<f64>() / plane.samples().len() as f64
}

proptest! {
    #[test]
    fn errors_follow_equation_4(
        seed in any::<u32>(), quantiser_scale in 1u8..=112, operator in prop::sample::select(Operator::ALL.to_vec()),
        exposure in 0.3f32..2.0,
    ) {
        let (tone_map, model) = (ToneMap::of(operator).with_exposure(exposure), MaskingModel::default());
        let radiance = radiance(20, 13, seed);
        let picture = YCbCr::from_radiance(&radiance, &tone_map);
        let luminance = luminance_plane(&radiance);
        let e = tolerable_error(&picture.luma, &luminance, f32::from(quantiser_scale), &tone_map, &model);
        let distorted = model.worst_case_luma(&picture.luma, f32::from(quantiser_scale));
        let gray = |luma: f32| f64::from(tone_map.decode(luma / 219.0));
        for i in 0..e.samples().len() {
            let luminance = f64::from(luminance.samples()[i]);
            let (before, after) = (gray(picture.luma.samples()[i]), gray(distorted.samples()[i]));
            let f = (luminance / before).clamp(1.0, 1.0 / 0.0722);
            let exact = (0.02 * luminance).max(f * (after - before).abs());
            // The inverse uses a table with an error of 0.1 % of luminance, or 0.6 % in the last code value.
            let table = |luma: f32, gray: f64| if luma > 218.0 { 6e-3 * gray } else { 1e-3 * gray };
            let slack = 1e-6 + f * (table(picture.luma.samples()[i], before) + table(distorted.samples()[i], after));
            prop_assert!((f64::from(e.samples()[i]) - exact).abs() < slack, "{} {exact}", e.samples()[i]);
            prop_assert!(f64::from(e.samples()[i]) >= 0.02 * luminance * (1.0 - 1e-6));
        }
    }

    #[test]
    fn blending_follows_equation_5(
        e in prop::collection::vec(1e-6f32..1e6, 24), previous in prop::collection::vec(1e-6f32..1e6, 24),
        matches in prop::collection::vec(prop_oneof![4 => 0u32..24, 1 => Just(NO_MATCH), 1 => 24u32..99], 24), w in 0.0f32..1.0,
    ) {
        let no_motion = Plane::filled(6, 4, [0.0; 2]);
        let known = Correspondence::new(no_motion, Plane::from_vec(6, 4, matches.clone())).unwrap();
        let past = Plane::from_vec(6, 4, previous.clone());
        let blended = blend(&Plane::from_vec(6, 4, e.clone()), &past, &known, w);
        let reprojected = reproject(&past, &known);
        for i in 0..24 {
            let (now, w) = (f64::from(e[i]), f64::from(w));
            let past = previous.get(matches[i] as usize).copied();
            let exact = past.map_or(now, |past| (1.0 - w) * now + w * f64::from(past));
            prop_assert!((f64::from(blended.samples()[i]) / exact - 1.0).abs() < 1e-5);
            prop_assert_eq!(reprojected.get(i % 6, i / 6), past);
        }
    }

    #[test]
    fn errors_are_finite_and_above_zero_whatever_comes_in(
        pixels in prop::collection::vec(prop::array::uniform3(any::<f32>()), 100), quantiser_scale in any::<f32>(),
        operator in prop::sample::select(Operator::ALL.to_vec()),
    ) {
        let radiance = Plane::from_vec(10, 10, pixels.clone());
        let e = thresholds(&radiance, quantiser_scale, &ToneMap::of(operator));
        prop_assert!(e.samples().iter().all(|e| e.is_finite() && *e > 0.0));
        // Random bits as luma and luminance are not a valid picture.
        let (luma, luminance) = (radiance.map(|p| p[0]), radiance.map(|p| p[1]));
        let (tone_map, model) = (ToneMap::of(operator), MaskingModel::default());
        let e = tolerable_error_counted(&luma, &luminance, quantiser_scale, &tone_map, &model);
        prop_assert!(e.error.samples().iter().all(|e| e.is_finite() && *e > 0.0));
        let broken = pixels.iter().filter(|p| !(p[0].is_finite() && p[1].is_finite())).count();
        prop_assert_eq!(e.non_finite, broken);
    }
}

#[test]
fn thresholds_grow_with_the_quantiser() {
    for operator in Operator::ALL {
        let tone_map = ToneMap::of(operator);
        let (picture, flat) = (radiance(64, 48, 3), Plane::filled(16, 16, [0.2; 3]));
        let mut before = (0.0, Plane::filled(16, 16, 0.0));
        for quantiser_scale in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 62.0, 112.0] {
            let here = (
                mean(&thresholds(&picture, quantiser_scale, &tone_map)),
                thresholds(&flat, quantiser_scale, &tone_map),
            );
            assert!(here.0 > before.0, "{operator}: {} after {} at {quantiser_scale}", here.0, before.0);
            for (now, then) in here.1.samples().iter().zip(before.1.samples()) {
                assert!(now >= then, "{operator}: {now} after {then} at {quantiser_scale}");
            }
            before = here;
        }
    }
}

#[test]
fn texture_hides_more_than_a_flat_wall() {
    let tone_map = ToneMap::srgb();
    let level = |x: usize, y: usize| if (x / 2 + y / 3).is_multiple_of(2) { 0.35f32 } else { 0.05 };
    let texture = Plane::from_fn(64, 64, |x, y| [if x < 32 { level(x, y) } else { 0.16 }; 3]);
    let e = thresholds(&texture, 4.0, &tone_map);
    let side = |left: usize| mean(&Plane::from_fn(32, 64, |x, y| e.get(left + x, y)));
    assert!(side(0) > 1.5 * side(32), "{} {}", side(0), side(32));
}

#[test]
fn black_frames_have_thresholds() {
    for operator in Operator::ALL {
        for quantiser_scale in [1.0, 112.0] {
            let e = thresholds(&Plane::filled(24, 16, [0.0; 3]), quantiser_scale, &ToneMap::of(operator));
            assert!(e.samples().iter().all(|e| e.is_finite() && *e > 0.0 && *e <= 255.0), "{operator}");
        }
    }
}

#[test]
fn a_white_block_in_black_leaves_the_rest_alone() {
    let tone_map = ToneMap::gamma(2.0);
    let lone = Plane::from_fn(256, 256, |x, y| if x / 8 == 3 && y / 8 == 4 { [1.0f32; 3] } else { [0.0; 3] });
    let e = thresholds(&lone, 16.0, &tone_map);
    let black = thresholds(&Plane::filled(256, 256, [0.0; 3]), 16.0, &tone_map);
    assert!(e.samples().iter().all(|e| *e <= 1.0));
    // The DC of a black block vanishes, so all its coefficients are q_min, independent of masking.
    assert_eq!(e.get(200, 200), black.get(200, 200));
}

#[test]
fn twelve_decades_in_a_frame() {
    for operator in Operator::ALL {
        let radiance = Plane::from_fn(96, 32, |x, y| [1e-6 * 10f32.powf((x + y) as f32 / 126.0 * 12.0); 3]);
        for quantiser_scale in [1.0, 112.0] {
            let e = thresholds(&radiance, quantiser_scale, &ToneMap::of(operator));
            for (e, pixel) in e.samples().iter().zip(radiance.samples()) {
                // The largest decoded display value is 255.
                let most = (0.0201 * pixel[0]).max(255.0 / 0.0722);
                assert!(*e >= 0.0199 * pixel[0] && *e <= most, "{operator}: {e} at {}", pixel[0]);
            }
        }
    }
}

/// A pure color of luminance Y at a display gamma of 2 has luma weight · √(Y / weight). For pure colors and for gray,
/// equal relative changes of luma must give equal relative changes of luminance.
#[test]
fn pure_colors_get_their_relative_error() {
    let (tone_map, model) = (ToneMap::gamma(2.0), MaskingModel::default());
    let relative = |rgb: [f32; 3]| {
        let radiance = Plane::filled(8, 8, rgb);
        let picture = YCbCr::from_radiance(&radiance, &tone_map);
        let luminance = luminance_plane(&radiance);
        let e = tolerable_error(&picture.luma, &luminance, 1.0, &tone_map, &model);
        let distorted = model.worst_case_luma(&picture.luma, 1.0);
        let change = distorted.get(0, 0) / picture.luma.get(0, 0);
        (e.get(0, 0) / luminance.get(0, 0), (change * change - 1.0).abs())
    };
    for rgb in [[0.4; 3], [0.9, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.95], [0.3, 0.0, 0.8]] {
        let (found, wanted) = relative(rgb);
        assert!((found / wanted - 1.0).abs() < 5e-3, "{rgb:?}: {found} {wanted}");
    }
}

#[test]
fn maps_keep_what_is_known() {
    let map = ThresholdMap::relative(5, 4);
    assert_eq!((map.width(), map.height()), (5, 4));
    assert_eq!(map.get(4, 3), None);
    assert!((map.resolve(4, 3, 10.0) - 0.2).abs() < 1e-6);
    let odd = Plane::from_vec(3, 2, vec![0.5, 0.0, f32::NAN, f32::INFINITY, -1.0, 1e-30]);
    let map = ThresholdMap::from_plane(&odd);
    let read: Vec<_> = (0..6).map(|i| map.get(i % 3, i / 3)).collect();
    assert_eq!(read, [Some(0.5), None, None, None, None, Some(1e-30)]);
    assert_eq!(ThresholdMap::from_plane(map.plane()), map);
    assert_eq!(map.resolve(0, 0, 10.0), 0.5);
    let still = reproject(&Plane::filled(3, 2, 0.25), &Correspondence::still(3, 2));
    assert!((0..6).all(|i| still.get(i % 3, i / 3) == Some(0.25)));
}

/// One call gives the same result as its separate steps: the loop over frames, then division by white.
#[test]
fn a_picture_in_one_call_is_the_steps_by_hand() {
    let picture = Plane::from_fn(21, 13, |x, y| [(x * 12) as u8, (y * 19) as u8, ((x * y) % 256) as u8]);
    let tone_map = ToneMap::srgb();
    let radiance = picture.map(|rgb| rgb.map(|code| tone_map.decode(f32::from(code) / 255.0)));
    let (luma, luminance) = (YCbCr::from_radiance(&radiance, &tone_map).luma, luminance_plane(&radiance));
    for quantiser_scale in [1.0, 8.0, 112.0] {
        let mut feedback = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT);
        let frame = ObservedFrame { luma: &luma, luminance: &luminance, known: None };
        assert_eq!(&thresholds_of_srgb(&picture, quantiser_scale), feedback.observe(frame, quantiser_scale));
    }
    assert!(
        thresholds_of_srgb(&Plane::filled(8, 8, [255; 3]), 1.0).samples().iter().all(|&e| (0.02..0.1).contains(&e))
    );
    assert!(thresholds_of_srgb(&Plane::filled(8, 8, [0; 3]), 1.0).samples().iter().all(|&e| e > 0.0 && e < 0.01));
    assert_eq!(thresholds_of_srgb(&Plane::filled(0, 0, [0; 3]), 8.0).samples(), []);
}
