//! Picture types that may be rendered coarser: two films of the same frames, a fine and a coarse one, are mixed by the type
//! that each picture has in the stream.
//!
//! ```sh
//! film="--size 160x160 --vpls 1000 --frames 24 --cache off --compensation off"
//! render2mpeg render SCENE $film --lighting all-lights         --y4m truth.y4m
//! render2mpeg render SCENE $film --thresholds uniform:0.02     --y4m fine.y4m
//! render2mpeg render SCENE $film --thresholds uniform:0.16     --y4m coarse.y4m
//! cargo run --release -p tests --example picture_types -- 160x160 truth.y4m fine.y4m coarse.y4m
//! ```
//! Printed for each quantiser: decoded PSNR and bits of the fine film, and by how much both change where only I pictures are
//! coarse, only P, only B, or all. Beside them, what share of the error that the coarse pictures bring with them arrives.

use mpeg2enc::{Config, FrameRate, Picture, PictureType, psnr};
use std::path::Path;
use tests::read_y4m;

const GOP: u32 = 12;
const B_PICTURES: u32 = 2;

/// A film in its stream: type of each picture as shown, decoded, and bits.
struct Coded {
    pictures: Vec<(PictureType, Picture)>,
    bits: u64,
}

fn code(frames: &[Picture], quantiser_scale: u32) -> Coded {
    let (width, height) = (frames[0].width(), frames[0].height());
    let mut encoder = Config::new(width, height, FrameRate::from_fps(25.0).expect("a rate of the table"))
        .with_gop(GOP)
        .with_b_pictures(B_PICTURES)
        .with_scene_cuts(false)
        .with_uniform_quantiser(true)
        .with_quantiser_scale(quantiser_scale)
        .with_lookahead(Config::LOOKAHEAD_MAX)
        .encoder()
        .expect("a size and a quantiser of the standard");
    let mut packets = Vec::new();
    for frame in frames {
        packets.extend(encoder.push(frame, Default::default()));
    }
    packets.extend(encoder.finish().packets);
    packets.sort_by_key(|packet| packet.display_index);
    let bits = packets.iter().map(|packet| packet.bits).sum();
    let pictures = packets.into_iter().map(|packet| (packet.picture_type, (*packet.reconstruction).clone())).collect();
    Coded { pictures, bits }
}

/// Mean square error of luma over a film.
fn error(decoded: &[(PictureType, Picture)], truth: &[Picture]) -> f64 {
    let of = |((_, frame), truth): (&(PictureType, Picture), &Picture)| mean_square(frame, truth);
    decoded.iter().zip(truth).map(of).sum::<f64>() / truth.len() as f64
}

fn mean_square(a: &Picture, b: &Picture) -> f64 {
    255.0 * 255.0 / 10f64.powf(psnr(a.luma(), b.luma()).min(200.0) / 10.0)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [size, truth, fine, coarse] = &arguments[..] else {
        eprintln!("picture_types WIDTHxHEIGHT TRUTH.y4m FINE.y4m COARSE.y4m");
        std::process::exit(2);
    };
    let (width, height) = size.split_once('x').expect("a size, such as 160x160");
    let size = (width.parse().expect("a width"), height.parse().expect("a height"));
    let [truth, fine, coarse] = [truth, fine, coarse].map(|path| read_y4m(Path::new(path), size));
    println!(
        "quantiser  coarse     dB      bits    brought  arrives   (coarse in all pictures of the type; change against fine)"
    );
    for quantiser_scale in [2, 8, 16, 32, 48] {
        let base = code(&fine, quantiser_scale);
        let base_error = error(&base.pictures, &truth);
        println!("{quantiser_scale:9}  none   {:6.2} dB {:7.1} kbit", decibels(base_error), base.bits as f64 / 1000.0);
        let types: Vec<PictureType> = base.pictures.iter().map(|&(kind, _)| kind).collect();
        let sets: [(&str, &[PictureType]); 4] = [
            ("I", &[PictureType::I]),
            ("P", &[PictureType::P]),
            ("B", &[PictureType::B]),
            ("all", &[PictureType::I, PictureType::P, PictureType::B]),
        ];
        for (name, set) in sets {
            let of = |(i, kind): (usize, &PictureType)| if set.contains(kind) { &coarse[i] } else { &fine[i] };
            let mixed: Vec<Picture> = types.iter().enumerate().map(|pair| of(pair).clone()).collect();
            // Sizes of groups are fixed; where B pictures are is decided by content, and may change a little.
            let coded = code(&mixed, quantiser_scale);
            let arrived = error(&coded.pictures, &truth) - base_error;
            let own = |films: &[Picture]| films.iter().zip(&truth).map(|(a, b)| mean_square(a, b)).sum::<f64>();
            let brought = (own(&mixed) - own(&fine)) / truth.len() as f64;
            println!(
                "           {name:<5} {:+7.3} dB {:+6.2} %  {brought:8.3} {:7.0} %",
                decibels(base_error + arrived) - decibels(base_error),
                100.0 * (coded.bits as f64 / base.bits as f64 - 1.0),
                100.0 * arrived / brought,
            );
        }
    }
}

fn decibels(mean_square: f64) -> f64 {
    10.0 * (255.0 * 255.0 / mean_square).log10()
}
