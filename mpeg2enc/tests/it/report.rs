//! Statistics of a picture reported by the encoder, compared with the input.

use crate::common::*;
use mpeg2enc::{MacroblockKind, Packet, Picture};
use plane::Plane;
use std::f64::consts::PI;

/// Returns one DCT basis function in every block, on middle gray; `u` is the horizontal and `v` the vertical frequency.
fn wave(u: usize, v: usize) -> Picture {
    let cosine = |x: usize, u: usize| ((2 * (x % 8) + 1) as f64 * u as f64 * PI / 16.0).cos();
    let luma = Plane::from_fn(64, 48, |x, y| (126.0 + 60.0 * cosine(x, u) * cosine(y, v)).round() as u8);
    Picture::new(luma, Plane::filled(32, 24, 128), Plane::filled(32, 24, 128)).unwrap()
}

fn code(frames: impl IntoIterator<Item = Picture>, alternate: bool) -> Vec<Packet> {
    encode(config(64, 48).with_gop(9).with_quantiser_scale(16).with_alternate_scan(alternate), frames.into_iter()).1
}

#[test]
fn levels_are_told_in_raster_order_whatever_the_scan() {
    for (u, v) in [(1, 0), (0, 1), (3, 0), (2, 5), (7, 7), (0, 7)] {
        for alternate in [false, true] {
            let packets = code([wave(u, v)], alternate);
            let coded = packets[0].coded();
            let levels = coded.levels();
            assert_eq!((levels.width(), levels.height()), (8, 6));
            for &set in levels.samples() {
                assert_eq!(set, 1 | 1 << (8 * v + u), "u {u}, v {v}, alternate {alternate}: {set:#x}");
            }
            assert!(packets[0].macroblock_kinds.samples().iter().all(|&kind| kind == MacroblockKind::Intra));
            assert!(coded.intra().samples().iter().all(|&intra| intra));
            assert!(std::sync::Arc::ptr_eq(coded.decoded(), &packets[0].reconstruction), "no copy");
            assert_eq!(coded.quantiser_scales(), &packets[0].quantiser_scales);
        }
    }
}

#[test]
fn what_does_not_change_is_skipped_without_levels() {
    let packets = code([wave(2, 1), wave(2, 1)], false);
    let (kinds, levels) = (&packets[1].macroblock_kinds, packets[1].luma_levels());
    for y in 0..3 {
        // The first and the last macroblock of a slice are always written (7.6.6).
        let row: Vec<MacroblockKind> = (0..4).map(|x| kinds.get(x, y)).collect();
        use MacroblockKind::{Inter, Skipped};
        assert_eq!(row, [Inter, Skipped, Skipped, Inter]);
    }
    assert!(levels.samples().iter().all(|&set| set == 0));
}
