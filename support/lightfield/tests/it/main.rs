//! Tests of the crate's guarantees for any samples.

mod damage;
mod near_lossless;
mod segments;
#[path = "../../examples/light_field_coding/segments.rs"]
mod thesis;

use lightfield::{Field, LogScale, LookUp, Samples, Slot, TexelTiles};
use proptest::prelude::*;

/// Largest code differences between two fields, for one channel and for the mean of three.
#[derive(Clone, Copy, Debug, Default)]
pub struct Largest {
    /// Largest difference of one channel.
    pub channel: f32,
    /// Largest mean difference of three channels.
    pub mean: f32,
}

/// Returns the largest differences over all slots and directions. `field` and `stored` must have the same texels.
pub fn largest(field: &Field, stored: &impl LookUp) -> Largest {
    let mut largest = Largest::default();
    for slot in (0..field.tiles().len() * 256 + 1).map(Slot) {
        for direction in 0..field.directions() + 1 {
            let (exact, found) = (field.codes(slot, direction), stored.codes(slot, direction));
            assert_eq!(exact.is_some(), found.is_some(), "{slot:?}, direction {direction}");
            let (Some(exact), Some(found)) = (exact, found) else { continue };
            let errors = [0, 1, 2].map(|c| (exact[c] - found[c]).abs());
            largest.channel = errors.into_iter().fold(largest.channel, f32::max);
            largest.mean = largest.mean.max(errors.iter().sum::<f32>() / 3.0);
        }
    }
    largest
}

/// Generates samples of all types: flat, smooth, at the ends of the range, random.
fn samples(count: usize) -> impl Strategy<Value = Vec<u16>> {
    let smooth = (any::<u16>(), -400..400i32).prop_map(move |(start, slope)| {
        (0..count).map(|k| (i32::from(start) + slope * (k as i32 / 3)).rem_euclid(65_536) as u16).collect()
    });
    prop_oneof![
        any::<u16>().prop_map(move |code| vec![code; count]),
        smooth,
        prop::collection::vec(any::<u16>(), count),
        prop::collection::vec(prop_oneof![Just(0), Just(65_535), Just(256)], count),
    ]
}

/// Generates fields of 8-bit or logarithmic codes in up to three tiles, some with absent texels.
pub fn fields() -> impl Strategy<Value = Field> {
    let mask = prop_oneof![
        Just([u64::MAX; 4]),
        Just([0; 4]),
        any::<[u64; 4]>(),
        // Keep only a few texels.
        any::<[u64; 4]>().prop_map(|word| word.map(|bits| bits & (bits >> 7) & (bits >> 13))),
    ];
    let shape = (prop::collection::vec(mask, 1..4), 1..7usize, any::<bool>());
    shape.prop_flat_map(|(masks, directions, bytes)| {
        let tiles = TexelTiles::new(masks);
        samples(tiles.texels() * directions * 3).prop_map(move |codes| {
            let samples = if bytes {
                Samples::Bytes(codes.iter().map(|code| (code >> 8) as u8).collect())
            } else {
                Samples::Logarithmic { scale: LogScale::new(0.01).unwrap(), codes }
            };
            Field::new(tiles.clone(), directions, samples).unwrap()
        })
    })
}
