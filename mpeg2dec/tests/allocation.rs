//! Memory: steady streams are decoded without allocation, and no input needs unbounded memory.

use mpeg2dec::{Decoder, Input, PictureType};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use std::alloc::System;

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Six pictures with B pictures.
const STREAM: &[u8] = include_bytes!("data/small.m2v");
/// Twice the maximum size of a unit, because buffers grow by doubling, and some space for tables.
const MEMORY_MAX: isize = (2 * 4 + 2) << 20;

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

/// Pushes 40 MB that begin with `start` and repeat `rest`, and checks the memory in use.
fn check_memory(name: &str, start: &[u8], rest: &[u8]) {
    let region = Region::new(ALLOCATOR);
    let mut input = Input::default();
    input.push(start, |_| ());
    let piece = rest.repeat(100_000 / rest.len());
    for number in 0..400 {
        input.push(&piece, |_| ());
        let change = region.change();
        let used = change.bytes_allocated as isize - change.bytes_deallocated as isize;
        assert!(used < MEMORY_MAX, "{name}: {used} bytes after piece {number}");
    }
}

#[test]
fn memory_is_bounded() {
    later_pictures_need_no_allocation();
    let pack = [0, 0, 1, 0xba, 0x44, 0, 4, 0, 4, 1, 0, 0, 3, 0xf8];
    let slice = [STREAM, &[0, 0, 1, 1]].concat();
    let user_data = [0, 0, 1, 0xb2, 1, 2, 3, 4, 5, 6, 7, 8, 9];
    check_memory("zeros", &[], &[0]);
    check_memory("no start code", &[], &[9]);
    check_memory("an endless slice", &slice, &[0x55]);
    check_memory("only start codes", STREAM, &[0, 0, 1]);
    check_memory("user data", STREAM, &user_data);
    check_memory("packets of padding", &pack, &[0, 0, 1, 0xbe, 0, 2, 0xff, 0xff]);
    check_memory("an endless packet", &[&pack[..], &[0, 0, 1, 0xe0, 0, 0, 0x80, 0, 0]].concat(), &[7]);
    check_memory("packs", &pack, &pack);
    check_memory("sync bytes", &[0x47; 1000], &[0x47]);
    check_memory("pictures without slices", STREAM, &[0, 0, 1, 0, 0, 0x0f, 0xff, 0xf8]);
}
