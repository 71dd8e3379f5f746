//! Tests that segments satisfy the error bounds of their rule.

use crate::thesis::{SegmentRule, Segmented};
use crate::{fields, largest};
use lightfield::{Field, LookUp, Samples, Slot, TexelTiles};
use proptest::prelude::*;

/// Generates one texel with 8-bit codes of any number of directions. The codes are random walks, so that segments have
/// some length.
fn walks() -> impl Strategy<Value = Field> {
    let step = prop_oneof![
        Just([0i16; 3]),
        Just([1, 1, 1]),
        prop::array::uniform3(-2..=2i16),
        any::<[i8; 3]>().prop_map(|rgb| rgb.map(i16::from))
    ];
    prop::collection::vec(step, 1..60).prop_map(|steps| {
        let mut at = [128i16; 3];
        let mut codes = Vec::new();
        for step in &steps {
            at = [0, 1, 2].map(|c| (at[c] + step[c]).clamp(0, 255));
            codes.extend(at.map(|code| code as u8));
        }
        Field::new(TexelTiles::new(vec![[4, 0, 0, 0]]), steps.len(), Samples::Bytes(codes)).unwrap()
    })
}

/// Asserts that both readers return the same codes.
fn agree(field: &Field, stored: &Segmented) {
    for slot in (0..field.tiles().len() * 256).map(Slot) {
        for direction in 0..field.directions() {
            assert_eq!(stored.linear().codes(slot, direction), stored.bisection().codes(slot, direction));
        }
    }
}

/// Returns whether a segment from s to e is allowed. Evaluates the definition in floating point.
fn is_allowed(colors: &[[u8; 3]], s: usize, e: usize, threshold: u16) -> bool {
    let value = |j: usize, c: usize| f64::from(colors[j][c]);
    let turned =
        (s..e).any(|j| (0..3).any(|c| (value(j + 1, c) - value(j, c)) * (value(s + 1, c) - value(s, c)) < 0.0));
    let fits = (s + 1..e).all(|j| {
        let share = (j - s) as f64 / (e - s) as f64;
        let errors = [0, 1, 2].map(|c| (value(j, c) - value(s, c) - (value(e, c) - value(s, c)) * share).abs());
        let (sum, most) = (errors.iter().sum::<f64>(), errors.into_iter().fold(0.0, f64::max));
        sum < 1e-9 || sum < f64::from(threshold) - 1e-9 && most < f64::from(threshold) / 2.0 - 1e-9
    });
    fits && !turned
}

/// Returns the number of keys according to the definition: each segment extends while it is allowed.
fn keys_by_definition(codes: &[u8], threshold: u16) -> usize {
    let colors: Vec<[u8; 3]> = codes.chunks(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect();
    let (mut keys, mut start) = (1, 0);
    while start + 1 < colors.len() {
        let mut end = start + 1;
        while end + 1 < colors.len() && is_allowed(&colors, start, end + 1, threshold) {
            end += 1;
        }
        (keys, start) = (keys + 1, end);
    }
    keys
}

proptest! {
    #[test]
    fn checked_segments_keep_within_a_third_of_the_threshold(field in walks(), threshold in 1..20u16) {
        let stored = Segmented::encode(&field, threshold, SegmentRule::Checked);
        let largest = largest(&field, &stored.linear());
        // Allow for the rounding of interpolated values to `f32`.
        prop_assert!(largest.mean < f32::from(threshold) / 3.0 + 1e-4);
        prop_assert!(largest.channel < f32::from(threshold) / 2.0 + 1e-4);
        let Samples::Bytes(codes) = field.samples() else { unreachable!("made above") };
        prop_assert_eq!(stored.keys(), keys_by_definition(codes, threshold));
        agree(&field, &stored);
    }

    #[test]
    fn nothing_is_lost_at_threshold_zero(field in walks()) {
        for rule in [SegmentRule::Checked, SegmentRule::FirstDifference] {
            let stored = Segmented::encode(&field, 0, rule);
            prop_assert!(largest(&field, &stored.linear()).channel < 1e-4);
            agree(&field, &stored);
        }
    }

    #[test]
    fn any_field_is_stored(field in fields(), threshold in 0..10u16) {
        if field.samples().scale().is_none() {
            agree(&field, &Segmented::encode(&field, threshold, SegmentRule::FirstDifference));
        }
    }
}

/// With more than 65 536 colors the object is split, and its colors stay exact.
#[test]
fn objects_of_many_colors_are_split() {
    let tiles = TexelTiles::of_picture(160, 160);
    let mut codes = Vec::new();
    for k in 0..tiles.texels() as u32 * 4 {
        // Multiplication by an odd number maps 24 bits onto themselves.
        codes.extend(&(k.wrapping_mul(0x9e_3779).to_le_bytes())[..3]);
    }
    let field = Field::new(tiles, 4, Samples::Bytes(codes)).unwrap();
    let stored = Segmented::encode(&field, 0, SegmentRule::Checked);
    assert!(largest(&field, &stored.linear()).channel < 1e-4);
    agree(&field, &stored);
    // All colors differ, so each key needs its own color.
    assert!(stored.keys() > 65_536);
    assert_eq!(stored.size(), 4 * field.tiles().texels() + 7 * stored.keys());
}
