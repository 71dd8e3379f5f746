//! Steady streams are decoded without allocation.

use mpeg2dec::{Decoder, PictureType};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use std::alloc::System;

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Six pictures with B pictures.
const STREAM: &[u8] = include_bytes!("data/small.m2v");

#[test]
fn later_pictures_need_no_allocation() {
    let (mut decoder, mut kinds) = (Decoder::default(), [0; 4]);
    let mut repeat = |decoder: &mut Decoder, times: usize| {
        for _ in 0..times {
            for piece in STREAM.chunks(500) {
                decoder.push(piece, |picture| kinds[picture.flags().kind as usize] += 1);
            }
        }
    };
    repeat(&mut decoder, 4);
    let region = Region::new(ALLOCATOR);
    repeat(&mut decoder, 10);
    let change = region.change();
    assert_eq!((change.allocations, change.reallocations), (0, 0));
    assert!(kinds[PictureType::B as usize] >= 13 * 3, "{kinds:?}");
}
