//! Benchmarks that encode whole panned pictures of 512×512: `cargo bench -p mpeg2enc`.

use divan::{Bencher, counter::ItemsCount};
use mpeg2enc::{Config, Encoder, FrameRate, Picture};
use plane::{Correspondence, Plane};

const SIZE: usize = 512;

fn main() {
    divan::main();
}

fn frame(time: usize) -> Picture {
    let at = |scale: usize| {
        move |x: usize, y: usize| {
            let (x, y) = ((scale * x) as f32 + 1.75 * time as f32, (scale * y) as f32);
            (128.0
                + 40.0 * (0.05 * x + 0.02 * y).sin()
                + 30.0 * (0.3 * x - 0.4 * y).sin()
                + 15.0 * (0.9 * y + 0.6 * x).cos()) as u8
        }
    };
    let chroma = Plane::from_fn(SIZE / 2, SIZE / 2, at(2));
    Picture::new(Plane::from_fn(SIZE, SIZE, at(1)), chroma.clone(), chroma).expect("the planes must match")
}

fn encoder(quantiser_scale: u32, gop: u32) -> Encoder {
    Config::new(SIZE, SIZE, FrameRate::FPS_25)
        .with_quantiser_scale(quantiser_scale)
        .with_gop(gop)
        .encoder()
        .expect("a valid configuration")
}

fn pictures(bencher: Bencher, quantiser_scale: u32, gop: u32, motion: Option<Correspondence>) {
    let frames: Vec<Picture> = (0..16).map(frame).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    bencher.counter(ItemsCount::new(frames.len())).bench(|| {
        pool.install(|| {
            let mut encoder = encoder(quantiser_scale, gop);
            frames
                .iter()
                .flat_map(|frame| encoder.push(frame, motion.as_ref().into()))
                .map(|packet| packet.bits)
                .sum::<u64>()
        })
    });
}

#[divan::bench(args = [4, 8, 32], sample_count = 5)]
fn intra_pictures(bencher: Bencher, quantiser_scale: u32) {
    pictures(bencher, quantiser_scale, 1, None);
}

#[divan::bench(args = [4, 8, 32], sample_count = 5)]
fn predicted_pictures_with_motion(bencher: Bencher, quantiser_scale: u32) {
    let motion = Correspondence::from_motion(Plane::filled(SIZE, SIZE, [1.75, 0.0]));
    pictures(bencher, quantiser_scale, 132, Some(motion));
}

#[divan::bench(args = [4, 8, 32], sample_count = 5)]
fn predicted_pictures_by_search(bencher: Bencher, quantiser_scale: u32) {
    pictures(bencher, quantiser_scale, 132, None);
}
