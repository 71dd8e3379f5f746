//! Times of random reads on one thread.

use crate::light::DIRECTIONS;
use crate::segments::{SegmentRule, Segmented};
use lightfield::{Field, FieldError, LookUp, NearLossless, Slot};
use std::time::Instant;

/// Number of reads per run.
const LOOK_UPS: usize = 1 << 21;
/// Number of runs. The fastest run is reported.
const RUNS: usize = 5;

/// Returns random pairs of slot and direction, from Weyl sequences of the golden ratio and its square.
fn pairs(field: &Field) -> Vec<[u32; 2]> {
    let slots: Vec<Slot> = field.tiles().slots().collect();
    let pair = |k: usize| {
        let bits = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (bits ^ bits >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let slot = slots[(mixed >> 32) as usize % slots.len()];
        [slot.0 as u32, (mixed as u32 >> 8) % DIRECTIONS as u32]
    };
    (1..=LOOK_UPS).map(pair).collect()
}

/// Returns the time per read \[ns\] and the mean code. Using the mean keeps the compiler from removing the reads.
fn nanoseconds(stored: &impl LookUp, pairs: &[[u32; 2]]) -> [f64; 2] {
    let (mut fastest, mut sum) = (f64::INFINITY, 0.0);
    for _ in 0..RUNS {
        sum = 0.0;
        let start = Instant::now();
        for &[slot, direction] in pairs {
            let codes = stored.codes(Slot(slot as usize), direction as usize).unwrap_or_default();
            sum += f64::from(codes[0] + codes[1] + codes[2]);
        }
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    [fastest * 1e9, sum / 3.0].map(|value| value / pairs.len() as f64)
}

/// Prints the times of all readers of a field's codes.
pub fn print(field: &Field) -> Result<(), FieldError> {
    let pairs = pairs(field);
    let segmented = Segmented::encode(field, 6, SegmentRule::Checked);
    let start = Instant::now();
    let near = NearLossless::encode(field, 2)?;
    let encoded = start.elapsed();
    // Decode every tile once, from an empty cache.
    let mut read = NearLossless::from_bytes(near.as_bytes().to_vec())?;
    let start = Instant::now();
    read.forget_decoded();
    for tile in 0..read.tiles().len() {
        read.codes(Slot(tile * lightfield::TILE_SLOTS), 0);
    }
    let decoded = start.elapsed().as_secs_f64() * 1e6 / read.tiles().len() as f64;

    println!("\nLook-ups at random, {} texels, one thread, fastest of {RUNS} runs\n", field.tiles().texels());
    println!("| | ns a look-up | mean code |\n|---|---|---|");
    let segments = format!("segments T=6, {:.0} keys a texel", segmented.keys() as f64 / field.tiles().texels() as f64);
    let rows = [
        ("raw".to_owned(), nanoseconds(field, &pairs)),
        (format!("{segments}, along the keys"), nanoseconds(&segmented.linear(), &pairs)),
        (format!("{segments}, bisection"), nanoseconds(&segmented.bisection(), &pairs)),
        ("ours δ=2, tiles decoded".to_owned(), nanoseconds(&read, &pairs)),
    ];
    for (name, [nanoseconds, mean]) in rows {
        println!("| {name} | {nanoseconds:.1} | {mean:.2} |");
    }
    println!("\nA tile is decoded in {decoded:.0} µs; all are stored in {:.2} s.", encoded.as_secs_f64());
    Ok(())
}
