//! Random streams that use syntax that no available encoder writes: field pictures, 16×8 and dual-prime prediction, 4:4:4,
//! concealment vectors, slices that start anywhere.

mod dc_only; // D pictures
mod macroblock; // random macroblocks
mod stream; // headers and slices
mod syntax; // codes of syntax elements

use crate::common::check;
use stream::{Features, random_stream};

/// Name and features of a stream.
fn rows() -> Vec<(&'static str, Features)> {
    let plain = Features::default();
    let fields = Features { field_pictures: true, interlaced: true, ..plain };
    let frames = Features { interlaced: true, ..plain };
    vec![
        ("progressive frames", plain),
        ("MPEG-1", Features { mpeg1: true, ..plain }),
        ("MPEG-1, vectors in whole samples", Features { mpeg1: true, full_pel: true, ..plain }),
        ("field and dual-prime prediction in frames", frames),
        ("field pictures: field, 16×8, dual-prime", fields),
        ("field pictures, bottom field first", Features { bottom_first: true, ..fields }),
        ("frames, bottom field first", Features { bottom_first: true, ..frames }),
        ("frame pictures, concealment vectors", Features { concealment: true, ..frames }),
        ("field pictures, concealment vectors", Features { concealment: true, ..fields }),
        ("alternate scan, Table B.15, non-linear scale", Features { alternate: true, ..frames }),
        ("field pictures, alternate scan", Features { alternate: true, ..fields }),
        ("DC of 11 bits", Features { dc_precision: 3, ..plain }),
        ("4:2:2 frames, chroma matrices", Features { chroma: 2, matrices: true, ..frames }),
        ("4:2:2 field pictures", Features { chroma: 2, ..fields }),
        ("4:4:4 frames, chroma matrices", Features { chroma: 3, matrices: true, alternate: true, ..frames }),
        ("4:4:4 field pictures", Features { chroma: 3, ..fields }),
    ]
}

/// Returns a stream with each set of features.
pub fn streams(seed: u64) -> Vec<Vec<u8>> {
    rows().into_iter().map(|(_, features)| random_stream(features, seed)).collect()
}

/// Returns a stream of field pictures.
pub fn field_stream() -> Vec<u8> {
    random_stream(Features { field_pictures: true, interlaced: true, ..Features::default() }, 1)
}

#[test]
fn random_streams() {
    for (feature, features) in rows() {
        for seed in 0..3 {
            let found = check(feature, "random syntax", &random_stream(features, seed), "mpegvideo");
            assert_eq!(found.pictures.len(), stream::PICTURES);
        }
    }
}
