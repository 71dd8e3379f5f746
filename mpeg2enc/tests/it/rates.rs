//! Bounded rates on quiet films, compared with a constant quantiser that fits the same buffer.

use crate::common::*;
use mpeg2enc::{Config, Effort, Picture, Rate, SuppliedMotion};
use plane::Plane;

const SIZE: (usize, usize) = (96, 80);
const FPS: f64 = 25.0;

/// Bits of each picture in the order of coding, and PSNR of luma over all pictures.
struct Film {
    bits: Vec<f64>,
    psnr: f64,
}

impl Film {
    fn of(config: Config, frames: &[Picture]) -> Self {
        let mut encoder = config.with_lookahead(30).with_b_pictures(2).encoder().expect("a valid configuration");
        let mut packets = Vec::new();
        for frame in frames {
            packets.extend(encoder.push(frame, SuppliedMotion::default()));
        }
        packets.extend(encoder.finish().packets);
        let error: f64 = packets.iter().map(|packet| 10f64.powf(-packet.psnr_y / 10.0)).sum();
        Self {
            bits: packets.iter().map(|packet| packet.bits as f64).collect(),
            psnr: -10.0 * (error / packets.len() as f64).log10(),
        }
    }

    fn size(&self) -> f64 {
        self.bits.iter().sum()
    }

    /// Returns the initial, minimum and final fullness of a decoder's buffer at this rate, in bits.
    fn fullness(&self, rate: Rate) -> [f64; 3] {
        let (bits_per_second, buffer_bits, start) = match rate {
            Rate::Constant { bits_per_second, buffer_bits } => (bits_per_second, buffer_bits, 11.0 / 16.0),
            Rate::Capped { bits_per_second, buffer_bits } => (bits_per_second, buffer_bits, 1.0),
            _ => panic!("a bounded rate"),
        };
        let size = f64::from(buffer_bits / 16384 * 16384);
        let (mut fullness, mut least) = (start * size, size);
        for bits in &self.bits {
            least = least.min(fullness - bits);
            fullness = (fullness - bits + f64::from(bits_per_second) / FPS).min(size);
        }
        [start * size, least, fullness]
    }

    fn never_runs_dry(&self, rate: Rate) -> bool {
        self.fullness(rate)[1] >= 0.0
    }

    /// Returns whether the buffer never underflows and, at a constant rate, is finally at least as full as initially.
    fn is_held(&self, rate: Rate) -> bool {
        let [start, _, end] = self.fullness(rate);
        self.never_runs_dry(rate) && (matches!(rate, Rate::Capped { .. }) || end >= start)
    }
}

/// Returns this constant rate in kbit/s, with a buffer of half a second.
fn constant(kbps: u32) -> Rate {
    Rate::Constant { bits_per_second: 1000 * kbps, buffer_bits: 500 * kbps }
}

/// Returns this maximum rate in kbit/s, with a buffer of half a second.
fn capped(kbps: u32) -> Rate {
    Rate::Capped { bits_per_second: 1000 * kbps, buffer_bits: 500 * kbps }
}

/// Checks that a film at a bounded rate is at most 0.3 dB worse than with a constant quantiser. The reference is the finest
/// quantiser that takes no more bits and fits the same buffer.
fn check_rates(frames: &[Picture], rates: &[Rate]) {
    for &effort in Effort::ALL {
        let settings = config(SIZE.0, SIZE.1).with_effort(effort);
        let scales = (1..=8).chain((10..=62).step_by(4));
        let of_scale = |scale| Film::of(settings.clone().with_quantiser_scale(scale), frames);
        let uniform: Vec<Film> = scales.map(of_scale).collect();
        for &rate in rates {
            let film = Film::of(settings.clone().with_quantiser_scale(4).with_rate(rate), frames);
            let best = uniform.iter().find(|other| other.size() <= film.size() && other.is_held(rate));
            let best = best.expect("a quantiser that fits the buffer");
            let what = format!("{effort:?}, {rate:?}");
            println!("{what}: {:.2} dB, a constant quantiser {:.2} dB", film.psnr, best.psnr);
            assert!(film.never_runs_dry(rate), "{what} underflows");
            assert!(film.psnr >= best.psnr - 0.3, "{what}: {:.2} dB, not {:.2}", film.psnr, best.psnr);
        }
    }
}

/// Returns slow waves, with an amplitude of `light` sixteenths and noise of at most one, which depends on `seed`.
fn waves(time: usize, light: usize, seed: usize) -> Picture {
    let hash = |x: usize, y: usize| (x * 7919 + y * 104_729 + seed * 1_299_709 + x * y % 31 * 17) >> 3;
    let wave = |x: usize, y: usize| {
        let (x, y, t) = (x as f64, y as f64, time as f64);
        80.0 + 50.0 * (0.11 * x + 0.05 * y + 0.2 * t).sin() + 20.0 * (0.4 * x - 0.3 * y + 0.1 * t).sin()
    };
    let luma = |x, y| (16.0 + wave(x, y) * light as f64 / 16.0) as u8 + (hash(x, y) % 2) as u8;
    let chroma = Plane::filled(SIZE.0 / 2, SIZE.1 / 2, 128);
    Picture::new(Plane::from_fn(SIZE.0, SIZE.1, luma), chroma.clone(), chroma).expect("the planes must match")
}

#[test]
fn black_and_a_fade_are_as_good_as_a_constant_quantiser() {
    let frames: Vec<Picture> = (0..75).map(|time| waves(time, time.saturating_sub(40).min(16), time)).collect();
    check_rates(&frames, &[capped(70), capped(150), constant(150)]);
}

#[test]
fn action_after_a_dark_rest_is_as_good_as_a_constant_quantiser() {
    let picture = |time| if time < 40 { waves(0, 1, time) } else { waves(time, 16, time) };
    let frames: Vec<Picture> = (0..75).map(picture).collect();
    check_rates(&frames, &[capped(70), constant(150)]);
}

#[test]
fn flashes_over_a_rest_are_as_good_as_a_constant_quantiser() {
    let picture = |time| if time % 12 == 11 { waves(61, 16, time) } else { waves(7, 8, time) };
    let frames: Vec<Picture> = (0..60).map(picture).collect();
    check_rates(&frames, &[capped(70), constant(70)]);
}
