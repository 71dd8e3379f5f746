//! Tests that errors never exceed the limit, and that the bytes do not depend on the number of threads.

use crate::{fields, largest};
use lightfield::{Field, FieldError, LogScale, LookUp, NearLossless, Samples, Slot, TexelTiles};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_code_is_wrong_by_more_than_delta(field in fields(), delta in prop_oneof![0..9u16, 0..=4095u16]) {
        let stored = NearLossless::encode(&field, delta).unwrap();
        prop_assert!(largest(&field, &stored).channel <= f32::from(delta));

        // The bytes are sufficient to restore the field.
        let mut read = NearLossless::from_bytes(stored.as_bytes().to_vec()).unwrap();
        prop_assert_eq!(read.tiles(), field.tiles());
        prop_assert_eq!((read.directions(), read.delta()), (field.directions(), delta));
        prop_assert_eq!(read.scale(), field.samples().scale());
        prop_assert!(largest(&field, &read).channel <= f32::from(delta));
        read.forget_decoded();
        prop_assert!(largest(&field, &read).channel <= f32::from(delta));
    }
}

/// Returns a field of several tiles.
fn field() -> Field {
    let tiles = TexelTiles::of_picture(70, 50);
    let codes = (0..tiles.texels() * 5 * 3).map(|k| (k * k / 977 % 256) as u8).collect();
    Field::new(tiles, 5, Samples::Bytes(codes)).unwrap()
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let field = field();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| NearLossless::encode(&field, 2).unwrap().as_bytes().to_vec())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn many_readers_find_the_same() {
    let field = field();
    let stored = NearLossless::encode(&field, 0).unwrap();
    std::thread::scope(|scope| {
        for reader in 0..4 {
            let (field, stored) = (&field, &stored);
            scope.spawn(move || {
                for slot in (reader..field.tiles().len() * 256).step_by(7).map(Slot) {
                    assert_eq!(field.codes(slot, 3), stored.codes(slot, 3));
                }
            });
        }
    });
}

/// The error of the light is within the bound that follows from the code's error.
#[test]
fn light_is_wrong_by_what_the_scale_says() {
    let (unit, delta) = (0.02f32, 3);
    let scale = LogScale::new(unit).unwrap();
    let light: Vec<[f32; 3]> = (0..400 * 2).map(|k| [0.0, 1.01f32.powi(k), 1e4 * (k as f32).sin().abs()]).collect();
    let field = Field::of_light(TexelTiles::of_picture(20, 20), 2, scale, &light).unwrap();
    let stored = NearLossless::encode(&field, delta).unwrap();
    let factor = 2f64.powf((f64::from(delta) + 0.5) / 256.0) - 1.0;
    for (rank, slot) in field.tiles().slots().enumerate() {
        for direction in 0..2 {
            let found = stored.light(slot, direction).unwrap();
            for c in 0..3 {
                let exact = light[rank * 2 + direction][c];
                let bound = factor * f64::from(exact + unit) * (1.0 + 1e-6);
                assert!(f64::from((found[c] - exact).abs()) <= bound, "{exact}: {}", found[c]);
            }
        }
    }
}

#[test]
fn too_large_a_limit_is_refused() {
    let message = NearLossless::encode(&field(), 4096).map(drop).unwrap_err();
    assert_eq!(message, FieldError::Delta(4096));
    assert_eq!(message.to_string(), "an error of 4096 codes: expected at most 4095");
}
