//! Weights without a look-ahead: their effect on quality and bits, and the scales that packets report.

use crate::common::*;
use mpeg2enc::{Config, Effort, MacroblockKind, Packet, Picture, Standard, SuppliedMotion};
use plane::Plane;

/// Columns and rows of macroblocks of the clips.
const COUNTS: (usize, usize) = (11, 9);
const SIZE: (usize, usize) = (16 * COUNTS.0, 16 * COUNTS.1);

/// Returns whether a macroblock is in the weighted rectangle.
fn is_inside(column: usize, row: usize) -> bool {
    (3..8).contains(&column) && (2..7).contains(&row)
}

/// Returns one factor inside the rectangle and another one outside.
fn rectangle(inside: f32, outside: f32) -> Plane<f32> {
    Plane::from_fn(COUNTS.0, COUNTS.1, |column, row| if is_inside(column, row) { inside } else { outside })
}

/// Encodes all frames with the same weights, or without any.
fn encode_weighted(settings: Config, clip: &[Picture], weights: Option<&Plane<f32>>) -> (Vec<u8>, Vec<Packet>) {
    let mut encoder = settings.encoder().expect("a valid configuration");
    let push = |frame: &Picture| match weights {
        Some(weights) => encoder.push_weighted(frame, SuppliedMotion::default(), weights),
        None => encoder.push(frame, SuppliedMotion::default()),
    };
    let packets: Vec<Packet> = clip.iter().flat_map(push).collect();
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(encoder.finish().end);
    (stream, packets)
}

/// Returns the PSNR of luma decoded by ffmpeg, inside and outside the rectangle, in dB.
fn psnr_by_place(stream: &[u8], clip: &[Picture]) -> [f64; 2] {
    let mut sums = [(0u64, 0u64); 2];
    for (shown, source) in decode_ffmpeg(stream, SIZE.0, SIZE.1, "faani").iter().zip(clip) {
        for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
            let (squares, samples) = &mut sums[usize::from(!is_inside(x / 16, y / 16))];
            *squares += u64::from(shown.luma().get(x, y).abs_diff(source.luma().get(x, y))).pow(2);
            *samples += 1;
        }
    }
    sums.map(|(squares, samples)| 10.0 * (255f64.powi(2) * samples as f64 / squares as f64).log10())
}

/// Returns two clips: moving objects, and a slow pan.
fn clips() -> [Vec<Picture>; 2] {
    let (width, height) = SIZE;
    [
        (0..15).map(|time| moving(width, height, time)).collect(),
        (0..15).map(|time| pan(width, height, 1.3 * time as f64, 0.4 * time as f64)).collect(),
    ]
}

fn settings(quantiser_scale: u32) -> Config {
    config(SIZE.0, SIZE.1).with_quantiser_scale(quantiser_scale)
}

/// Weights a rectangle with a factor of 2 to the power of −1/4 or −1/6. Bits then change by less than 1 %. With −1 they grow by 1
/// to 8 %: finer quantisers cost more bits than coarser ones elsewhere save.
#[test]
fn a_rectangle_gets_better_for_the_same_bits() {
    for (c, clip) in clips().iter().enumerate() {
        for (quantiser_scale, exponent) in [(12, -1.0 / 4.0), (16, -1.0 / 6.0)] {
            let (even, _) = encode_weighted(settings(quantiser_scale), clip, None);
            let weights = rectangle(2f32.powf(exponent), 1.0);
            let (stream, _) = encode_weighted(settings(quantiser_scale), clip, Some(&weights));
            let bits = stream.len() as f64 / even.len() as f64 - 1.0;
            let [before, after] = [&even, &stream].map(|stream| psnr_by_place(stream, clip));
            let (inside, outside) = (after[0] - before[0], after[1] - before[1]);
            println!(
                "clip {c}, quantiser {quantiser_scale}: bits {:+.2} %, inside {inside:+.2} dB, outside {outside:+.2} dB",
                100.0 * bits
            );
            assert!(bits.abs() < 0.01, "clip {c}, quantiser {quantiser_scale}: {bits}");
            assert!(inside >= 0.5, "clip {c}, quantiser {quantiser_scale}: {inside} dB");
        }
    }
}

/// With half the scale, the rectangle has better quality than in a film with finer quantisers everywhere and more bits.
#[test]
fn half_the_scale_beats_a_finer_film() {
    for (c, clip) in clips().iter().enumerate() {
        for quantiser_scale in [8, 16, 24] {
            let (finer, _) = encode_weighted(settings(quantiser_scale - 2), clip, None);
            let (stream, _) = encode_weighted(settings(quantiser_scale), clip, Some(&rectangle(0.5, 1.0)));
            let bits = stream.len() as f64 / finer.len() as f64 - 1.0;
            let gain = psnr_by_place(&stream, clip)[0] - psnr_by_place(&finer, clip)[0];
            println!("clip {c}, quantiser {quantiser_scale}: bits {:+.2} %, inside {gain:+.2} dB", 100.0 * bits);
            assert!(bits < 0.0 && gain > 0.5, "clip {c}, quantiser {quantiser_scale}: {bits}, {gain} dB");
        }
    }
}

#[test]
fn equal_weights_change_no_byte() {
    let clip: Vec<Picture> = (0..4).map(|time| moving(SIZE.0, SIZE.1, time)).collect();
    for (quantiser_scale, effort) in [
        (1, Effort::Fast),
        (2, Effort::Fast),
        (7, Effort::Balanced),
        (16, Effort::Best),
        (62, Effort::Fast),
        (112, Effort::Fast),
    ] {
        let settings = settings(quantiser_scale).with_gop(3).with_effort(effort);
        let (unweighted, _) = encode_weighted(settings.clone(), &clip, None);
        for factor in [0.0, 0.3, 1.0, 1.7, 16.0, f32::NAN] {
            let (stream, _) = encode_weighted(settings.clone(), &clip, Some(&rectangle(factor, factor)));
            assert!(stream == unweighted, "factor {factor}, quantiser {quantiser_scale}, {effort:?}");
        }
        let uniform = settings.with_uniform_quantiser(true);
        assert!(encode_weighted(uniform, &clip, Some(&rectangle(0.5, 2.0))).0 == unweighted, "a uniform quantiser");
    }
}

/// Returns quantiser_scale of all macroblocks of all pictures, as ffmpeg reads the stream: two characters each, on separate
/// lines.
fn scales_by_ffmpeg(stream: &[u8]) -> Vec<u8> {
    let file = StreamFile::new(stream);
    let options =
        ["-nostdin", "-threads", "1", "-debug", "qp", "-f", "mpegvideo", "-i", file.path(), "-f", "null", "-"];
    let (_, messages) = run("ffmpeg", &options);
    let rows = messages.lines().filter_map(|line| line.split_once("] ")).map(|(_, row)| row.as_bytes());
    let is_row = |row: &&[u8]| row.len() == 2 * COUNTS.0 && row.iter().all(|c| b" 0123456789".contains(c));
    let number = |text: &[u8]| std::str::from_utf8(text).ok()?.trim().parse().ok();
    rows.filter(is_row).flat_map(|row| row.chunks(2)).map(|text| number(text).expect("a number")).collect()
}

/// Packets report the quantisers that ffmpeg reads from the stream. The masking model receives the quantisers that produced the
/// levels.
#[test]
fn packets_tell_the_scale_of_every_macroblock() {
    let frame = moving(SIZE.0, SIZE.1, 0);
    // The second picture repeats the first: if the quantiser is equal, nothing is written.
    let clip = [frame.clone(), frame, moving(SIZE.0, SIZE.1, 1), moving(SIZE.0, SIZE.1, 2)];
    let weights = Plane::from_fn(COUNTS.0, COUNTS.1, |x, y| [0.4, 1.0, 2.0][(x / 2 + y) % 3]);
    for (quantiser_scale, standard) in [(7, Standard::Mpeg2), (16, Standard::Mpeg2), (16, Standard::Mpeg1)] {
        let settings = settings(quantiser_scale).with_standard(standard);
        let (stream, packets) = encode_weighted(settings, &clip, Some(&weights));
        check(&stream, &packets, "weights that vary within rows");
        let told: Vec<u8> = packets.iter().flat_map(|packet| packet.quantiser_scales.samples().to_vec()).collect();
        // All pictures have the same weights, and all levels of an I picture are written.
        let wanted = &packets[0].quantiser_scales;
        // ffmpeg reports nothing about the last picture of MPEG-1.
        let read = scales_by_ffmpeg(&stream);
        assert!(read.len() >= 3 * wanted.samples().len(), "{} macroblocks", read.len());
        assert_eq!(told[..read.len()], read);
        assert!(wanted.samples().iter().collect::<std::collections::BTreeSet<_>>().len() >= 3, "{wanted:?}");
        for packet in &packets {
            assert_eq!(packet.quantiser_scale, quantiser_scale);
            assert_eq!(packet.coded().quantiser_scales(), wanted);
        }
        let skipped =
            packets[1].macroblock_kinds.samples().iter().filter(|&&kind| kind == MacroblockKind::Skipped).count();
        assert!(skipped > 40 && packets[1].quantiser_scales != *wanted, "{skipped} skipped");
    }
}

#[test]
#[should_panic(expected = "the weights must have one sample for each macroblock")]
fn weights_of_another_size_are_refused() {
    let weights = Plane::filled(COUNTS.0, COUNTS.1 + 1, 1.0);
    let _ = encode_weighted(settings(8), &[moving(SIZE.0, SIZE.1, 0)], Some(&weights));
}
