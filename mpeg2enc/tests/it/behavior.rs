//! Behavior of the encoder for all kinds of input.

use crate::common::*;
use mpeg2enc::{Config, FrameRate, Packet, PictureType, Rate, SuppliedMotion};
use plane::{Correspondence, Plane};
use proptest::prelude::*;

fn bits(packets: &[Packet]) -> u64 {
    packets.iter().map(|packet| packet.bits).sum()
}

#[test]
fn exact_motion_saves_bits() {
    let (width, height) = (256, 192);
    let step = [14.25, -9.5];
    let frames: Vec<_> =
        (0..12).map(|time| pan(width, height, step[0] * f64::from(time), step[1] * f64::from(time))).collect();
    let with = |motion: [f32; 2]| {
        let mut encoder = config(width, height).with_gop(132).with_quantiser_scale(6).encoder().unwrap();
        let motion = uniform_motion(width, height, motion[0], motion[1]);
        frames.iter().flat_map(|frame| encoder.push(frame, SuppliedMotion::from(&motion))).collect::<Vec<_>>()
    };
    let (exact, still) = (with(step.map(|s| s as f32)), with([0.0, 0.0]));
    let (_, searched) = encode(config(width, height).with_gop(132).with_quantiser_scale(6), frames.iter().cloned());
    assert!(10 * bits(&exact) < 9 * bits(&still), "{} against {} bits", bits(&exact), bits(&still));
    assert!(bits(&exact) <= bits(&searched) * 21 / 20, "{} against {} bits", bits(&exact), bits(&searched));
}

#[test]
fn a_still_sequence_is_skipped() {
    for quantiser_scale in [2, 8, 16, 48] {
        let frame = moving(160, 128, 3);
        let settings = config(160, 128).with_gop(20).with_quantiser_scale(quantiser_scale);
        let (_, packets) = encode(settings, std::iter::repeat_n(frame, 20));
        let (intra, predicted) = packets.split_at(1);
        for (i, packet) in predicted.iter().enumerate() {
            assert_eq!(packet.picture_type, PictureType::P);
            // The first predicted pictures may still refine coarse details of the I picture.
            if i >= 2 {
                let statistics = packet.statistics;
                let most = 8 * (160 / 16 - 2);
                assert!(statistics.skipped * 20 >= most * 19, "picture {i} at {quantiser_scale}: {statistics:?}");
            }
        }
        // Only headers and the first and last macroblock of each slice remain.
        let headers = 200 + 8 * 80;
        assert!(
            predicted[2..].iter().all(|packet| packet.bits < headers.max(intra[0].bits / 20)),
            "at {quantiser_scale}"
        );
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encode(config(160, 128).with_gop(6), (0..9).map(|time| moving(160, 128, time))).0)
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(5));
}

#[test]
fn statistics_add_up() {
    let (stream, packets) = encode(config(100, 60).with_gop(5), (0..10).map(|time| moving(100, 60, time)));
    let bytes: usize = packets.iter().map(|packet| packet.data.len()).sum();
    assert_eq!(stream.len(), bytes + 4);
    for (i, packet) in packets.iter().enumerate() {
        let s = packet.statistics;
        assert_eq!(s.intra + s.inter + s.skipped, 7 * 4);
        assert!(s.motion_bits + s.coefficient_bits < packet.bits);
        assert_eq!(packet.picture_type == PictureType::I, i % 5 == 0);
        assert_eq!(packet.data.starts_with(&[0, 0, 1, 0xb3]), i % 5 == 0);
    }
}

#[test]
fn finer_quantisers_give_better_pictures_and_more_bits() {
    let mut last = (0, 0.0);
    for quantiser_scale in [112, 62, 32, 16, 8, 4, 2, 1] {
        let settings = config(128, 96).with_quantiser_scale(quantiser_scale);
        let (_, packets) = encode(settings, (0..4).map(|time| pan(128, 96, 1.3 * time as f64, 0.0)));
        let psnr = packets.iter().map(|packet| packet.psnr_y).sum::<f64>() / packets.len() as f64;
        assert!(bits(&packets) > last.0 && psnr > last.1, "at {quantiser_scale}: {} bits, {psnr} dB", bits(&packets));
        last = (bits(&packets), psnr);
    }
}

/// Returns the root mean square difference between two planes, in code values.
fn root_mean_square(a: &Plane<u8>, b: &Plane<u8>) -> f64 {
    let squares = a.samples().iter().zip(b.samples()).map(|(&a, &b)| f64::from(a.abs_diff(b)).powi(2));
    (squares.sum::<f64>() / a.samples().len() as f64).sqrt()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn no_input_panics(
        width in 1usize..70, height in 1usize..50, scale in prop::sample::select(vec![1u32, 2, 3, 7, 8, 30, 62, 72, 112]),
        seed in any::<u64>(), motion in prop::array::uniform2(any::<f32>()), gop in 1u32..5,
    ) {
        let mut encoder = config(width, height).with_quantiser_scale(scale).with_gop(gop).encoder().unwrap();
        let field = Correspondence::from_motion(Plane::from_fn(width, height, |x, y| {
            if (x + y) % 3 == 0 { motion } else { [motion[0] / (x + 1) as f32, f32::NAN * (y % 2) as f32] }
        }));
        for i in 0..4 {
            let frame = match (seed >> i) % 3 {
                0 => noise(width, height, seed ^ i),
                1 => moving(width, height, seed as usize % 100),
                _ => {
                    let extreme = |w: usize, h: usize| Plane::from_fn(w, h, |x, y| if (x / 3 + y / 2) % 2 == 0 { 0 } else { 255 });
                    let (w, h) = (width.div_ceil(2), height.div_ceil(2));
                    mpeg2enc::Picture::new(extreme(width, height), extreme(w, h), extreme(w, h)).unwrap()
                }
            };
            let packets = encoder.push(&frame, (i % 2 == 0).then_some(&field).into());
            let [packet] = &packets[..] else { return Err(TestCaseError::fail("exactly one packet expected")) };
            prop_assert!(packet.bits > 0);
            let error = root_mean_square(frame.luma(), packet.reconstruction.luma());
            let told = 255.0 / 10f64.powf(packet.psnr_y / 20.0);
            prop_assert!((error - told).abs() <= 1e-6 * error, "an error of {error} is reported as {} dB", packet.psnr_y);
            // The difference was at most 1.48 in a quarter of a million pictures; pictures of a few pixels are closest to the
            // limit.
            prop_assert!(error <= 2.0 * f64::from(scale + 1), "quantiser_scale {scale}: an error of {error}");
        }
    }
}

/// The planned quantiser is available while frames wait, and is close to the quantiser of their coding.
#[test]
fn the_quantiser_of_waiting_frames_is_planned() {
    let config = || Config::new(96, 80, FrameRate::FPS_25).with_lookahead(20).with_b_pictures(1);
    let rate = Rate::Constant { bits_per_second: 300_000, buffer_bits: 200_000 };
    let mut encoder = config().with_rate(rate).encoder().expect("a valid configuration");
    assert_eq!(encoder.planned_quantiser_scale(), None, "nothing waits");
    let mut planned = Vec::new();
    for time in 0..20 {
        assert!(encoder.push(&moving(96, 80, time), SuppliedMotion::default()).is_empty(), "it waits");
        planned.extend(encoder.planned_quantiser_scale());
    }
    assert_eq!(planned.len(), 19, "all but the first frame, whose successor is unknown");
    let packets = encoder.finish().packets;
    let coded = packets.iter().map(|packet| packet.quantiser_scale as f32).sum::<f32>() / packets.len() as f32;
    assert!(planned.iter().all(|planned| (0.5..2.0).contains(&(planned / coded))), "{planned:?}, {coded}");

    // A constant quantiser needs no plan, and without look-ahead no frames wait.
    for config in [config(), Config::new(96, 80, FrameRate::FPS_25)] {
        let mut encoder = config.encoder().expect("a valid configuration");
        let _ = encoder.push(&moving(96, 80, 0), SuppliedMotion::default());
        assert_eq!(encoder.planned_quantiser_scale(), None);
    }
}
