//! D pictures of MPEG-1. No available encoder or decoder supports them, so the expected samples are the written means.

use super::{
    stream::{COLUMNS, Features, ROWS, sequence_header},
    syntax::Writer,
};
use crate::common::{decoded, raw};
use fastrand::Rng;

/// Number of pictures of the stream.
const PICTURES: usize = 3;

/// Writes a D picture, and returns the mean of each block of its three components.
fn picture(writer: &mut Writer, random: &mut Rng, number: usize) -> [Vec<i32>; 3] {
    writer.start_code(0);
    writer.put(number as u32, 10);
    writer.put(4, 3); // picture_coding_type
    writer.put(0xffff, 16);
    writer.put(0, 1);
    let mut means = [vec![0; 4 * COLUMNS * ROWS], vec![0; COLUMNS * ROWS], vec![0; COLUMNS * ROWS]];
    for row in 0..ROWS {
        writer.start_code(row as u8 + 1);
        writer.put(8, 5);
        writer.put(0, 1);
        let mut predictors = [128; 3];
        for column in 0..COLUMNS {
            writer.increment(1);
            writer.put(1, 1); // macroblock_type
            for i in 0..6 {
                let component = if i < 4 { 0 } else { i - 3 };
                let place = match i {
                    0..4 => (2 * row + i / 2) * 2 * COLUMNS + 2 * column + i % 2,
                    _ => row * COLUMNS + column,
                };
                let mean = random.i32(0..=255);
                writer.dc(mean - predictors[component], i < 4);
                predictors[component] = mean;
                means[component][place] = mean;
            }
            writer.put(1, 1); // end_of_macroblock
        }
    }
    means
}

/// Returns the samples of a component from the means of its blocks.
fn samples(means: &[i32], columns: usize) -> impl Iterator<Item = u8> {
    let rows = 8 * means.len() / columns;
    (0..rows).flat_map(move |y| (0..8 * columns).map(move |x| means[y / 8 * columns + x / 8] as u8))
}

#[test]
fn dc_pictures_have_the_written_means() {
    let (mut writer, mut random) = (Writer::default(), Rng::with_seed(4));
    sequence_header(&mut writer, Features { mpeg1: true, ..Features::default() });
    let mut expected = Vec::new();
    for number in 0..PICTURES {
        let [y, cb, cr] = picture(&mut writer, &mut random, number);
        expected.extend(samples(&y, 2 * COLUMNS).chain(samples(&cb, COLUMNS)).chain(samples(&cr, COLUMNS)));
    }
    writer.start_code(0xb7);
    let found = decoded(&writer.bytes, 100);
    assert_eq!(found.pictures.len(), PICTURES);
    assert!(found.pictures.iter().all(|picture| picture.flags().is_dc_only));
    assert!(found.pictures.iter().flat_map(raw).eq(expected), "{:?}", found.counts);
    // Without end_of_macroblock, slices are damaged.
    let mut stream = writer.bytes;
    let last = stream.len() - 5;
    stream[last] = 0;
    assert!(decoded(&stream, 100).counts.damaged_slices > 0);
}
