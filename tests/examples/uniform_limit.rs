//! The loosest threshold that keeps the decoded picture as good: what any model of thresholds can gain at most, if it treats
//! all pixels alike.
//!
//! ```sh
//! film="--size 160x160 --vpls 1000 --frames 24 --cache off --compensation off"
//! render2mpeg render SCENE $film --lighting all-lights       --y4m truth.y4m
//! render2mpeg render SCENE $film --thresholds fixed:0.02     --y4m two.y4m
//! render2mpeg render SCENE $film --thresholds uniform:0.04   --y4m 4.y4m           # and so on
//! cargo run --release -p tests --example uniform_limit -- 160x160 truth.y4m two.y4m 0.04=4.y4m 0.08=8.y4m …
//! ```
//! Printed for each quantiser: PSNR and bits of every film beside those of the 2 % film, and the largest share of luminance up
//! to which decoded PSNR is no more than 0.1 dB below.

use mpeg2enc::{Config, FrameRate, KnownMotion, Picture, psnr};
use std::path::Path;
use tests::read_y4m;

/// Loss at equal decoded quality \[dB\].
const EQUAL: f64 = 0.1;

/// Decoded PSNR over the film and its bits.
fn coded(frames: &[Picture], truth: &[Picture], quantiser_scale: u32) -> (f64, f64) {
    let (width, height) = (frames[0].width(), frames[0].height());
    let config = Config::new(width, height, FrameRate::from_fps(25.0).expect("a rate of the table")).with_gop(15);
    let mut encoder = config.with_quantiser_scale(quantiser_scale).encoder().expect("a size of the standard");
    let (mut error, mut bits) = (0.0, 0.0);
    for (frame, truth) in frames.iter().zip(truth) {
        let packet = encoder.push(frame, KnownMotion::default()).remove(0);
        error += 10f64.powf(-psnr(packet.reconstruction.luma(), truth.luma()) / 10.0);
        bits += packet.bits as f64;
    }
    (-10.0 * (error / frames.len() as f64).log10(), bits)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [size, truth, base, films @ ..] = &arguments[..] else {
        eprintln!("uniform_limit WIDTHxHEIGHT TRUTH.y4m TWO_PER_CENT.y4m SHARE=FILM.y4m …");
        std::process::exit(2);
    };
    let (width, height) = size.split_once('x').expect("a size, such as 160x160");
    let size = (width.parse().expect("a width"), height.parse().expect("a height"));
    let read = |path: &str| read_y4m(Path::new(path), size);
    let (truth, base) = (read(truth), read(base));
    let films: Vec<(f64, Vec<Picture>)> = films
        .iter()
        .map(|film| film.split_once('=').expect("SHARE=FILM.y4m"))
        .map(|(share, path)| (share.parse().expect("a share, such as 0.04"), read(path)))
        .collect();
    for quantiser_scale in [2, 8, 16, 32, 48] {
        let (base_psnr, base_bits) = coded(&base, &truth, quantiser_scale);
        println!("quantiser {quantiser_scale}: 2 % {base_psnr:.2} dB, {:.1} kbit", base_bits / 1000.0);
        let mut loosest = None;
        for (share, film) in &films {
            let (psnr, bits) = coded(film, &truth, quantiser_scale);
            let (difference, more) = (psnr - base_psnr, 100.0 * (bits / base_bits - 1.0));
            println!("  {:5.1} %  {difference:+.3} dB  {more:+.2} % of bits", 100.0 * share);
            if difference >= -EQUAL {
                loosest = Some(*share);
            }
        }
        let loosest = loosest.map_or("none of these".into(), |share| format!("{:.1} %", 100.0 * share));
        println!("  loosest within {EQUAL} dB: {loosest}");
    }
}
