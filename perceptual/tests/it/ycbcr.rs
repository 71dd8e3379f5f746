//! Tests of conversion to pictures for the encoder: Rec. 709 colors, chroma siting, odd sizes, invalid pixels.

use perceptual::{Operator, ToneMap, YCbCr, luminance, luminance_plane, to_rgb8};
use plane::{Picture, Plane};

fn flat(rgb: [f32; 3]) -> YCbCr {
    YCbCr::from_radiance(&Plane::filled(6, 4, rgb), &ToneMap::srgb())
}

/// Fully saturated colors have the eight-bit limited-range code values of Rec. 709.
#[test]
fn known_colors() {
    for (name, rgb, codes) in [
        ("black", [0.0, 0.0, 0.0], [16, 128, 128]),
        ("white", [1.0, 1.0, 1.0], [235, 128, 128]),
        ("red", [1.0, 0.0, 0.0], [63, 102, 240]),
        ("green", [0.0, 1.0, 0.0], [173, 42, 26]),
        ("blue", [0.0, 0.0, 1.0], [32, 240, 118]),
        ("yellow", [1.0, 1.0, 0.0], [219, 16, 138]),
        ("cyan", [0.0, 1.0, 1.0], [188, 154, 16]),
        ("magenta", [1.0, 0.0, 1.0], [78, 214, 230]),
    ] {
        let picture = flat(rgb);
        for (plane, code) in picture.picture.planes().into_iter().zip(codes) {
            assert!(plane.samples().iter().all(|&c| c == code), "{name}: {:?} instead of {code}", plane.samples());
        }
        let back = to_rgb8(&picture.picture).get(3, 2);
        for (back, wanted) in back.into_iter().zip(rgb) {
            assert!((f32::from(back) - 255.0 * wanted).abs() <= 2.0, "{name}: {back} instead of {wanted}");
        }
    }
}

#[test]
fn luma_before_rounding_starts_at_black() {
    let gray = flat([0.214_041_14; 3]);
    assert!((gray.luma.get(0, 0) - 109.5).abs() < 0.01, "{}", gray.luma.get(0, 0));
    let ramp = Plane::from_fn(64, 8, |x, y| [x as f32 / 63.0, y as f32 / 7.0, 0.3]);
    let picture = YCbCr::from_radiance(&ramp, &ToneMap::srgb());
    for (&code, &luma) in picture.picture.luma().samples().iter().zip(picture.luma.samples()) {
        assert!((f32::from(code) - 16.0 - luma).abs() <= 0.5001);
    }
    assert!(flat([1e6; 3]).luma.samples().iter().all(|&luma| luma == 219.0));
}

/// `Picture::from_rgb8` computes in integers. Only codes near the middle between two codes may differ, by 1.
#[test]
fn codes_and_their_light_give_the_same_picture() {
    for (width, height) in [(1, 1), (1, 4), (7, 5), (64, 48)] {
        let rgb: Vec<u8> = (0..3 * width * height).map(|i| (i * i * 37 + 11 * i) as u8).collect();
        let light = rgb
            .as_chunks()
            .0
            .iter()
            .map(|rgb: &[u8; 3]| rgb.map(|code| ToneMap::srgb().decode(f32::from(code) / 255.0)));
        let floats = YCbCr::from_radiance(&Plane::from_vec(width, height, light.collect()), &ToneMap::srgb()).picture;
        let integers = Picture::from_rgb8(width, height, &rgb).expect("matching sizes");
        for (floats, integers) in floats.planes().into_iter().zip(integers.planes()) {
            let pairs = floats.samples().iter().zip(integers.samples());
            assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 1));
            assert!(pairs.clone().filter(|(a, b)| a != b).count() <= floats.samples().len() / 100);
        }
    }
}

/// A red column at a chroma sample has the weight ½ in this sample. A red column between two chroma samples has the
/// weight ¼ in each.
#[test]
fn chroma_lies_in_line_with_even_columns() {
    let red_at = |column: usize| {
        let radiance = Plane::from_fn(12, 4, |x, _| if x == column { [1.0, 0.0, 0.0] } else { [0.0; 3] });
        YCbCr::from_radiance(&radiance, &ToneMap::srgb()).picture.cr().row(0).to_vec()
    };
    assert_eq!(red_at(4), [128, 128, 184, 128, 128, 128]);
    assert_eq!(red_at(5), [128, 128, 156, 156, 128, 128]);
    assert_eq!(red_at(0), [212, 128, 128, 128, 128, 128], "the first column stands for the one left of it");
    let red_row = Plane::from_fn(4, 6, |_, y| if y == 3 { [1.0, 0.0, 0.0] } else { [0.0; 3] });
    let picture = YCbCr::from_radiance(&red_row, &ToneMap::srgb());
    assert_eq!([0, 1, 2].map(|y| picture.picture.cr().get(0, y)), [128, 184, 128], "half-way between two rows");
}

#[test]
fn any_size() {
    for (width, height) in [(0, 0), (0, 3), (1, 1), (1, 2), (2, 1), (3, 5), (17, 9), (16, 1)] {
        let radiance = Plane::filled(width, height, [0.0, 0.0, 1.0]);
        let picture = YCbCr::from_radiance(&radiance, &ToneMap::srgb());
        assert_eq!((picture.picture.luma().width(), picture.picture.luma().height()), (width, height));
        assert_eq!(
            (picture.picture.cb().width(), picture.picture.cb().height()),
            (width.div_ceil(2), height.div_ceil(2))
        );
        assert_eq!(
            (picture.picture.cr().width(), picture.picture.cr().height()),
            (width.div_ceil(2), height.div_ceil(2))
        );
        assert!(picture.picture.luma().samples().iter().all(|&y| y == 32));
        assert!(picture.picture.cb().samples().iter().all(|&cb| cb == 240));
        assert_eq!(to_rgb8(&picture.picture).samples().len(), width * height);
    }
}

#[test]
fn broken_pixels_are_black_and_counted() {
    let broken = [[f32::NAN, 1.0, 1.0], [1.0, f32::INFINITY, 1.0], [1.0, 1.0, f32::NEG_INFINITY]];
    for operator in Operator::ALL {
        let tone_map = ToneMap::of(operator);
        let radiance = Plane::from_fn(9, 7, |x, y| if y == 4 && x < 3 { broken[x] } else { [0.5, -0.5, 1e6] });
        let picture = YCbCr::from_radiance(&radiance, &tone_map);
        assert_eq!(picture.non_finite, 3);
        assert!((0..3).all(|x| picture.picture.luma().get(x, 4) == 16));
        let clean = radiance.map(|rgb| if rgb.iter().all(|c| c.is_finite()) { rgb } else { [0.0; 3] });
        let clean = YCbCr::from_radiance(&clean, &tone_map);
        assert_eq!(clean.non_finite, 0);
        assert_eq!(YCbCr { non_finite: 0, ..picture }, clean, "nothing spreads");
        let luminances = luminance_plane(&radiance);
        assert!(luminances.samples().iter().all(|y| y.is_finite() && *y >= 0.0));
        assert_eq!(luminances.get(1, 4), 0.0);
    }
}

#[test]
fn luminance_of_white_is_one() {
    assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
    assert_eq!(luminance([0.0, 0.0, 2.0]), 0.1444);
}
