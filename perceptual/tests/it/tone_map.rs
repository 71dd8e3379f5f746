//! Tests of tone curves: round trips, slopes, limits and settings files.

use perceptual::{Display, Operator, ToneMap};
use proptest::prelude::*;

/// Returns every operator at several exposures, with each display curve that it uses.
fn all() -> Vec<ToneMap> {
    let mut out = Vec::new();
    for operator in Operator::ALL {
        for display in [Display::Srgb, Display::Gamma] {
            for exposure in [0.01, 1.0, 40.0] {
                out.push(ToneMap { operator, display, exposure, ..ToneMap::default() });
            }
        }
    }
    out.extend([ToneMap::gamma(1.0), ToneMap::gamma(2.0), ToneMap::gamma(4.0)]);
    out.extend([0.5, 1.0, 20.0].map(ToneMap::extended_reinhard));
    out
}

#[test]
fn decoding_undoes_encoding_up_to_saturation() {
    for tone_map in all() {
        let saturation = tone_map.saturation();
        for i in 0..=20_000 {
            let linear = 1e-6 * (saturation / 1e-6).powf(i as f32 / 20_000.0);
            let back = tone_map.decode(tone_map.encode(linear));
            assert!((back / linear - 1.0).abs() < 1e-4, "{tone_map:?}: {linear} became {back}");
        }
    }
}

#[test]
fn encoding_undoes_decoding() {
    for tone_map in all() {
        let last = tone_map.encode(tone_map.saturation());
        for i in 0..=1000 {
            let display = last * i as f32 / 1000.0;
            let back = tone_map.encode(tone_map.decode(display));
            assert!((back - display).abs() < 1e-5, "{tone_map:?}: {display} became {back}");
        }
    }
}

#[test]
fn curves_never_fall_and_stay_within_zero_and_one() {
    for tone_map in all() {
        let mut before = 0.0;
        for i in 0..=100_000 {
            let linear = 1e-12 * 10f32.powf(i as f32 * 5e-4);
            let display = tone_map.encode(linear);
            assert!((0.0..=1.0).contains(&display) && display >= before, "{tone_map:?} at {linear}");
            before = display;
        }
        assert!(before > 0.99, "{tone_map:?} reaches only {before}");
    }
}

#[test]
fn slopes_are_those_of_the_curve() {
    for tone_map in all() {
        for i in 0..200 {
            // Test from 1e-4 to 0.9 of the saturating radiance. Finite differences in `f32` are accurate to about 1 %.
            let linear = tone_map.saturation() * 0.9 * 10f32.powf(-4.0 * i as f32 / 200.0);
            let step = 0.005 * linear;
            let difference = (tone_map.encode(linear + step) - tone_map.encode(linear - step)) / (2.0 * step);
            let slope = tone_map.derivative(linear);
            let breakpoint = (tone_map.encode(linear) - 0.04045).abs() < 1e-3;
            assert!(
                breakpoint || (slope / difference - 1.0).abs() < 0.015,
                "{tone_map:?} {linear}: {slope} {difference}"
            );
        }
        assert!(tone_map.derivative(0.0).is_finite());
        if tone_map.operator != Operator::Reinhard {
            assert_eq!(tone_map.derivative(2.0 * tone_map.saturation()), 0.0, "saturated");
        }
    }
}

#[test]
fn extremes_are_finite() {
    for tone_map in all() {
        assert_eq!(tone_map.encode(f32::NAN), 0.0);
        assert_eq!(tone_map.encode(-1.0), 0.0);
        assert_eq!(tone_map.encode(f32::NEG_INFINITY), 0.0);
        assert_eq!(tone_map.encode(0.0), 0.0);
        assert_eq!(tone_map.encode(f32::MAX), 1.0);
        assert_eq!(tone_map.encode(f32::INFINITY), 1.0);
        assert_eq!(tone_map.decode(f32::NAN), 0.0);
        assert_eq!(tone_map.decode(-0.5), 0.0);
        assert!(tone_map.decode(1.0).is_finite());
        assert_eq!(tone_map.decode(7.0), tone_map.decode(1.0));
    }
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -3.0, f32::MAX] {
        for operator in Operator::ALL {
            let odd = ToneMap { operator, exposure: value, gamma: value, white: value, display: Display::Gamma };
            assert!(odd.check().is_err());
            for linear in [0.0, 1e-6, 1.0, 1e6, f32::MAX] {
                assert!((0.0..=1.0).contains(&odd.encode(linear)), "{odd:?}");
                assert!(odd.decode(linear).is_finite() && odd.derivative(linear).is_finite(), "{odd:?}");
            }
        }
    }
}

#[test]
fn known_values() {
    assert!((ToneMap::srgb().encode(0.5) - 0.735_357).abs() < 1e-5);
    assert!((ToneMap::srgb().encode(0.001) - 0.01292).abs() < 1e-6);
    assert!((ToneMap::gamma(2.0).encode(0.25) - 0.5).abs() < 1e-6);
    assert!((ToneMap::gamma(2.0).with_exposure(2.0).encode(0.125) - 0.5).abs() < 1e-6);
    let linear_display = ToneMap { gamma: 1.0, display: Display::Gamma, ..ToneMap::of(Operator::Reinhard) };
    assert!((linear_display.encode(1.0) - 0.5).abs() < 1e-6);
    assert!((linear_display.decode(1.0) - 255.0).abs() < 1e-3, "the limit of the inverse");
    assert_eq!(ToneMap::extended_reinhard(4.0).encode(4.0), 1.0);
    assert!((ToneMap::extended_reinhard(4.0).saturation() - 4.0).abs() < 1e-5);
}

#[test]
fn filmic_keeps_gray_and_has_toe_and_shoulder() {
    let filmic = ToneMap { gamma: 1.0, display: Display::Gamma, ..ToneMap::of(Operator::Filmic) };
    assert!((filmic.encode(0.18) - 0.18).abs() < 1e-6);
    // Compute the slope relative to a proportional curve: above 1 in the toe, well below 1 in the shoulder.
    let steepness = |linear: f32| filmic.derivative(linear) * linear / filmic.encode(linear);
    assert!((1.05..1.2).contains(&steepness(0.02)), "the toe is there and slight: {}", steepness(0.02));
    assert!((0.85..1.0).contains(&steepness(0.18)), "{}", steepness(0.18));
    assert!(steepness(1.0) < 0.6 && steepness(3.0) < 0.3, "{} {}", steepness(1.0), steepness(3.0));
    assert!(filmic.encode(1.0) > 0.6 && filmic.encode(1.0) < 0.7);
    assert!((filmic.saturation() - 3.5435).abs() < 1e-3, "{}", filmic.saturation());
}

#[cfg(feature = "serde")]
#[test]
fn settings_file() {
    let text = "operator = \"extended_reinhard\"\nexposure = 1.5\nwhite = 6.0\n";
    let tone_map: ToneMap = toml::from_str(text).unwrap();
    assert_eq!(tone_map, ToneMap::extended_reinhard(6.0).with_exposure(1.5));
    assert_eq!(toml::from_str::<ToneMap>("").unwrap(), ToneMap::default());
    for tone_map in all() {
        assert_eq!(toml::from_str::<ToneMap>(&toml::to_string(&tone_map).unwrap()).unwrap(), tone_map);
    }
    assert!(toml::from_str::<ToneMap>("exposre = 2.0").is_err(), "misspelt fields are refused");
    assert!(toml::from_str::<ToneMap>("operator = \"aces\"").is_err());
}

#[test]
fn names_and_ranges() {
    assert_eq!("extended-reinhard".parse(), Ok(Operator::ExtendedReinhard));
    let error = "aces".parse::<Operator>().unwrap_err().to_string();
    assert!(error.contains("aces") && error.contains("filmic"), "{error}");
    for (bad, said) in [
        (ToneMap::srgb().with_exposure(-1.0), "exposure is -1; it must be above 0 (1e-20 to 1e20)"),
        (ToneMap::srgb().with_exposure(f32::NAN), "exposure is NaN; it must lie in 1e-20 to 1e20"),
        (ToneMap::gamma(5.0), "gamma is 5; it must lie in 1 to 4"),
        (ToneMap::extended_reinhard(0.0), "white is 0; it must be above 0 (0.01 to 1000)"),
    ] {
        assert_eq!(bad.check().unwrap_err().to_string(), said);
    }
    assert!(ToneMap::default().check().is_ok());
}

proptest! {
    #[test]
    fn any_setting_can_be_undone(
        operator in prop::sample::select(Operator::ALL.to_vec()),
        exposure in 1e-3f32..1e3, gamma in 1.0f32..4.0, white in 0.1f32..100.0, part in 1e-6f32..1.0,
    ) {
        let tone_map = ToneMap { operator, exposure, gamma, white, display: Display::Gamma };
        let linear = part * tone_map.saturation();
        let back = tone_map.decode(tone_map.encode(linear));
        // At a white of 100, one rounding of the display value is (1 + white) / 2 · gamma roundings of radiance.
        prop_assert!((back / linear - 1.0).abs() < 2e-4, "{linear} became {back}");
    }
}
