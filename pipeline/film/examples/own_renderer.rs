//! A custom renderer in the loop. It has no scenes, lights or lightcuts, but passes exact motion to the encoder and
//! takes only the samples that the decoded picture requires.
//!
//! ```text
//! cargo run --release -p render2mpeg --example own_renderer -- orbit.mpg
//! ```
//! The film shows a disc of fine rings that moves over a gradient. Each pixel is the mean of its samples, which are
//! taken until the standard error is below the pixel's threshold. Lightcuts stop by a similar rule.

use mpeg2enc::{Config, Container, FrameRate};
use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel, ToneMap};
use pipeline::checkpoint::Checkpoints;
use pipeline::observe::Observer;
use pipeline::stage::{LastThresholds, Prepare, Prepared, Shade, Shaded};
use pipeline::{Run, Stages, couple};
use plane::{Correspondence, NO_MATCH, Plane};
use render2mpeg::stages::{Display, Video};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

const SIZE: (usize, usize) = (192, 128);
const FRAMES: u32 = 50;
const RADIUS: f32 = 40.0;

/// Returns the disc's center in a frame \[pixels\].
fn center(frame: u32) -> [f32; 2] {
    let angle = frame as f32 * 0.12;
    [96.0 + 40.0 * angle.cos(), 64.0 + 20.0 * angle.sin()]
}

fn is_on_disc([x, y]: [f32; 2], [cx, cy]: [f32; 2]) -> bool {
    (x - cx).hypot(y - cy) < RADIUS
}

/// Returns the radiance at a position in the picture, given the disc's center.
fn radiance([x, y]: [f32; 2], [cx, cy]: [f32; 2]) -> f32 {
    let r = (x - cx).hypot(y - cy);
    if r < RADIUS { 0.4 + 0.35 * (0.02 * r * r).sin() } else { 0.05 + 0.3 * x / SIZE.0 as f32 }
}

/// Stage that computes the position of every pixel's surface point in the previous frame.
struct Motion;

impl Prepare for Motion {
    type Frame = u32;

    fn step(&mut self, frame: u32) -> Option<Prepared<u32>> {
        if frame == FRAMES {
            return None;
        }
        let (width, height) = SIZE;
        let known = (frame > 0).then(|| {
            let (now, then) = (center(frame), center(frame - 1));
            // Compute the position of the pixel's point in the previous frame, if the point was visible there.
            let before = |x: usize, y: usize| {
                let here = [x as f32 + 0.5, y as f32 + 0.5];
                let on_disc = is_on_disc(here, now);
                let was = if on_disc { [here[0] + then[0] - now[0], here[1] + then[1] - now[1]] } else { here };
                let inside = was[0] >= 0.0 && was[1] >= 0.0 && was[0] < width as f32 && was[1] < height as f32;
                (inside && on_disc == is_on_disc(was, then)).then_some((here, was))
            };

            // Store the motion as a vector and as the index of the matching pixel.
            let vector = |(here, was): ([f32; 2], [f32; 2])| [was[0] - here[0], was[1] - here[1]];
            let motion = Plane::from_fn(width, height, |x, y| before(x, y).map_or([0.0; 2], vector));
            let matches = Plane::from_fn(width, height, |x, y| {
                before(x, y).map_or(NO_MATCH, |(_, was)| was[1] as u32 * width as u32 + was[0] as u32)
            });
            Arc::new(Correspondence::new(motion, matches).expect("planes of one size"))
        });
        Some(Prepared { frame, correspondence: known, ..Prepared::default() })
    }

    fn restore(&mut self, _state: &[u8], last: u32) -> pipeline::Result<Prepared<u32>> {
        Ok(self.step(last).expect("a frame of the film"))
    }
}

/// Renderer that takes samples until the thresholds are met, and counts the samples.
#[derive(Clone, Default)]
struct Samples(Arc<AtomicU64>);

impl Shade<u32> for Samples {
    fn step(&mut self, prepared: &Prepared<u32>, thresholds: LastThresholds<'_>) -> Shaded {
        let (frame, thresholds) = (prepared.frame, thresholds.map(SIZE.0, SIZE.1));
        let mut taken = 0;
        let picture = Plane::from_fn(SIZE.0, SIZE.1, |x, y| {
            let (mut sum, mut squares, mut count) = (0.0f32, 0.0f32, 0.0f32);
            loop {
                // Use a Halton point of bases 2 and 3, equal for every pixel and frame.
                let place = [x as f32 + radical_inverse(2, count as u32), y as f32 + radical_inverse(3, count as u32)];
                let value = radiance(place, center(frame));
                (sum, squares, count) = (sum + value, squares + value * value, count + 1.0);
                // Stop when the standard error of the mean is within the pixel's threshold.
                let mean = sum / count;
                let error = ((squares / count - mean * mean).max(0.0) / count).sqrt();
                let allowed = thresholds.get(x, y).unwrap_or(0.02 * mean);
                if count >= 4.0 && error <= allowed || count >= 256.0 {
                    taken += count as u64;
                    break [mean; 3];
                }
            }
        });
        self.0.fetch_add(taken, Ordering::Relaxed);
        Shaded { radiance: picture, ..Shaded::default() }
    }

    fn restore(&mut self, _state: &[u8], _last: &Prepared<u32>) -> pipeline::Result<()> {
        Ok(())
    }
}

fn radical_inverse(base: u32, mut index: u32) -> f32 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f32);
    while index > 0 {
        value += digit * (index % base) as f32;
        (index, digit) = (index / base, digit / base as f32);
    }
    value
}

/// Observer of the maximum threshold of a film.
#[derive(Default)]
struct Widest(Mutex<f32>);

impl Observer for Widest {
    fn thresholds(&self, _: u32, delta: &Plane<f32>) {
        let mut widest = self.0.lock().expect("no observer panicked");
        *widest = delta.samples().iter().copied().fold(*widest, f32::max);
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "own_renderer.mpg".into()));
    let container = Container::of(&path).ok_or("name the output .mpg, .mp4, .mkv, .ts or .m2v")?;
    // Make the film twice: a coarser quantiser permits larger errors, which need fewer samples.
    for quantiser_scale in [2, 16] {
        let config = Config::new(SIZE.0, SIZE.1, FrameRate::FPS_25);
        let video = Video::immediate(config, container, quantiser_scale)?;
        let tone_map = ToneMap::default();
        let masking = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT);
        let samples = Samples::default();

        // Combine the custom renderer with the display, encoder and masking model of the workspace.
        let mut stages = Stages {
            prepare: Motion,
            shade: samples.clone(),
            display: Display::new(tone_map),
            encode: video,
            mask: Some(masking),
        };

        // Run the loop, and observe the thresholds.
        let checkpoints = Checkpoints::off();
        let mut start = stages.begin(&checkpoints)?;
        start.write_to(&path)?;
        let widest = Widest::default();
        let frames = couple(stages, start, Run { observer: &widest, ..Run::default() })?;
        let per_pixel = samples.0.load(Ordering::Relaxed) as f64 / (SIZE.0 * SIZE.1) as f64 / f64::from(FRAMES);
        println!(
            "quantiser_scale {quantiser_scale}: {per_pixel:.2} samples per pixel, {} bits, thresholds up to {:.3}",
            frames.iter().map(|frame| frame.bits).sum::<u64>(),
            widest.0.into_inner().expect("no observer panicked")
        );
    }
    Ok(())
}
