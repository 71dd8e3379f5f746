//! Streams with B pictures, varying quantisers and bounded rates: decoded pictures and buffer fullness.

use crate::common::*;
use fastrand::Rng;
use mpeg2enc::{
    CoefficientTable, Config, Effort, FrameRate, Packet, Passes, PictureType, Rate, RestoreError, SuppliedMotion,
};
use plane::Plane;

/// Returns a random element of a non-empty list.
fn choose<T: Copy>(random: &mut Rng, list: &[T]) -> T {
    list[random.usize(..list.len())]
}

/// Tests random settings, sizes and content. `MPEG2ENC_STREAMS` sets the number of streams and `MPEG2ENC_SEED` the first seed. A
/// failure prints its seed; `--nocapture` prints the decoders' differences from the reconstructions.
#[test]
fn random_streams_are_understood() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse().expect("a number"));
    let (first, count) = (number("MPEG2ENC_SEED").unwrap_or(0), number("MPEG2ENC_STREAMS").unwrap_or(12));
    let mut distances: [Distance; 2] = Default::default();
    for seed in first..first + count {
        let mut random = Rng::with_seed(seed);
        let large = seed % 64 == 63;
        let (width, height) = if large {
            (1920, 1088)
        } else {
            (
                choose(&mut random, &[1, 2, 15, 16, 17, 33, 64, 97, 176]),
                choose(&mut random, &[1, 3, 16, 31, 48, 66, 144]),
            )
        };
        let rates = [
            Rate::ConstantQuantiser,
            Rate::ConstantQuantiser,
            Rate::Constant { bits_per_second: 700_000, buffer_bits: 400_000 },
            Rate::Capped { bits_per_second: 500_000, buffer_bits: 300_000 },
        ];
        let matrix = std::array::from_fn(|i| if i == 0 { 8 } else { (16 + 2 * i) as u8 });
        let mut config = Config::new(width, height, choose(&mut random, &[FrameRate::FPS_25, FrameRate::FPS_30]))
            .with_quantiser_scale(choose(&mut random, &[1, 2, 5, 8, 24, 62, 112]))
            .with_gop(choose(&mut random, &[1, 2, 5, 15]))
            .with_b_pictures(choose(&mut random, &[0, 1, 2, 3, 7]))
            .with_effort(choose(&mut random, &[Effort::Fast, Effort::Balanced, Effort::Best]))
            .with_closed_gop(random.bool())
            .with_scene_cuts(random.bool())
            .with_uniform_quantiser(random.u32(..3) == 0)
            .with_adaptive_quantisation(random.u32(..3) == 0)
            .with_alternate_scan(random.u32(..3) == 0)
            .with_intra_table(choose(&mut random, &[CoefficientTable::Zero, CoefficientTable::One]))
            .with_intra_dc_precision(choose(&mut random, &[8, 9, 10, 11]))
            .with_rate(choose(&mut random, &rates));
        if random.u32(..4) == 0 {
            config = config.with_matrices(matrix, matrix.map(|weight| weight + 5));
        }
        if random.u32(..6) == 0 {
            config = config.with_mean_quantiser_scale(1.0 + f64::from(random.u32(..1200)) / 10.0);
        }
        let what = format!("seed {seed}: {config:?}");
        let frames = if large { 4 } else { 4 + random.usize(..16) };
        let start = random.usize(..100);
        let kind = random.u32(..5);
        let motion = (random.bool()).then(|| uniform_motion(width, height, 1.7, -0.6));
        let content = (start..start + frames).map(|time| match kind {
            0 => noise(width, height, time as u64),
            1 => pan(width, height, 5.5 * time as f64, 0.0),
            _ => moving(width, height, time),
        });
        let (stream, packets) = encode_ahead(config, content, motion.as_ref());
        measure_distances(&stream, &packets, &what, &mut distances);
    }
    // Print and check the agreement of each decoder over all streams.
    for (decoder, distance) in ["ffmpeg", "mpeg2dec"].into_iter().zip(distances) {
        let mean_square = distance.squares as f64 / distance.samples as f64;
        println!("{decoder}: {count} streams, largest difference {}, mean square {mean_square:.4}", distance.largest);
        // ffmpeg uses its floating-point transform, which is practically exact; mpeg2dec's larger differences come from its
        // integer transform.
        assert!(decoder != "ffmpeg" || distance.largest <= 1 && mean_square < 1e-3, "{decoder}: {mean_square}");
    }
}

#[test]
fn pictures_come_in_the_order_of_coding() {
    let settings = config(64, 48).with_gop(6).with_b_pictures(2).with_effort(Effort::Fast);
    let mut encoder = settings.with_lookahead(Config::LOOKAHEAD_MAX).encoder().unwrap();
    let mut packets: Vec<Packet> = Vec::new();
    for time in 0..14 {
        packets.extend(encoder.push(&moving(64, 48, time), SuppliedMotion::default()));
    }
    packets.extend(encoder.finish().packets);
    let order: String = packets.iter().map(|p| format!("{:?}{} ", p.picture_type, p.display_index)).collect();
    assert_eq!(order, "I0 P3 B1 B2 I6 B4 B5 P9 B7 B8 I12 B10 B11 P13 ");
}

#[test]
fn without_b_pictures_a_packet_follows_each_frame() {
    let settings = config(64, 48).with_effort(Effort::Fast);
    let mut encoder = settings.with_lookahead(Config::LOOKAHEAD_MAX).encoder().unwrap();
    for time in 0..5 {
        assert_eq!(encoder.push(&moving(64, 48, time), SuppliedMotion::default()).len(), 1);
    }
}

#[test]
fn a_cut_begins_a_group() {
    // moving() has a shot change at frame 60.
    let settings = config(96, 64).with_gop(100).with_b_pictures(2);
    let types = |settings: Config| -> Vec<PictureType> {
        let (_, packets) = encode_ahead(settings, (52..68).map(|time| moving(96, 64, time)), None);
        packets.iter().map(|packet| packet.picture_type).collect()
    };
    let found = types(settings.clone());
    let intra: Vec<usize> = (0..found.len()).filter(|&i| found[i] == PictureType::I).collect();
    assert_eq!(intra, [0, 8]);
    let found = types(settings.with_scene_cuts(false));
    assert_eq!(found.iter().filter(|&&t| t == PictureType::I).count(), 1);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = config(160, 128)
            .with_gop(6)
            .with_b_pictures(2)
            .with_effort(Effort::Best)
            .with_rate(Rate::Constant { bits_per_second: 400_000, buffer_bits: 200_000 });
        pool.install(|| encode_ahead(settings, (0..12).map(|time| moving(160, 128, time)), None).0)
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert_eq!(one, run(4));
}

#[test]
fn more_effort_takes_fewer_bits_for_as_good_a_picture() {
    // Compare bits at equal quality, assuming 6 dB for each halving of quantiser_scale and doubling of bits.
    let mut last = f64::INFINITY;
    for effort in [Effort::Fast, Effort::Balanced, Effort::Best] {
        let settings = config(176, 144).with_gop(15).with_b_pictures(2).with_effort(effort);
        let (stream, packets) = encode_ahead(settings, (0..30).map(|time| moving(176, 144, time)), None);
        let mean_error = |packet: &Packet| 10f64.powf(-packet.psnr_y / 10.0) / packets.len() as f64;
        let psnr = -10.0 * packets.iter().map(mean_error).sum::<f64>().log10();
        let bits = stream.len() as f64 * 2f64.powf(-psnr / 6.0);
        assert!(bits < last, "{effort:?}: {bits}, after {last}");
        last = bits;
    }
}

/// The decoder's buffer of Annex C, parsed only from the bytes of the stream: rate, size and pictures.
struct Verifier {
    bit_rate: f64,
    buffer: f64,
    /// For each picture: its bits, the bits up to and including its picture_start_code, and vbv_delay.
    pictures: Vec<(f64, f64, u32)>,
}

fn verifier(stream: &[u8]) -> Verifier {
    let mut v = Verifier { bit_rate: 0.0, buffer: 0.0, pictures: Vec::new() };
    let (mut end, mut in_picture) = (0, false);
    let starts: Vec<usize> = (0..stream.len() - 3).filter(|&i| stream[i..i + 3] == [0, 0, 1]).collect();
    for &i in &starts {
        let b = |k: usize| f64::from(stream[i + k]);
        match stream[i + 3] {
            0xb3 => {
                v.bit_rate = 400.0 * (b(8) * 1024.0 + b(9) * 4.0 + f64::from(stream[i + 10] >> 6));
                v.buffer = 16384.0 * (f64::from(stream[i + 10] & 31) * 32.0 + f64::from(stream[i + 11] >> 3));
            }
            0x01..=0xaf | 0xb5 | 0xb2 => continue,
            _ => {}
        }
        if in_picture {
            // The previous picture ends where this header begins.
            v.pictures.last_mut().expect("a picture").0 += 8.0 * (i - end) as f64;
            (end, in_picture) = (i, false);
        }
        if stream[i + 3] == 0 {
            let delay =
                u32::from(stream[i + 5] & 7) << 13 | u32::from(stream[i + 6]) << 5 | u32::from(stream[i + 7]) >> 3;
            v.pictures.push((0.0, 8.0 * (i + 4 - end) as f64, delay));
            in_picture = true;
        }
    }
    v
}

#[test]
fn a_constant_rate_keeps_buffer_and_delays() {
    for (kbps, b_pictures, gop) in [(200, 2, 15), (600, 0, 12), (1200, 2, 60), (3000, 2, 60)] {
        let rate = Rate::Constant { bits_per_second: 1000 * kbps, buffer_bits: 500 * kbps };
        let settings = config(176, 144).with_gop(gop).with_b_pictures(b_pictures).with_rate(rate);
        let (stream, packets) = encode_ahead(settings, (0..75).map(|time| moving(176, 144, time)), None);
        let v = verifier(&stream);
        assert_eq!(v.bit_rate, f64::from(1000 * kbps));
        assert!(v.buffer <= f64::from(500 * kbps) && v.buffer > f64::from(500 * kbps) - 16384.0);
        assert_eq!(v.pictures.len(), packets.len());
        let mut fullness = f64::from(v.pictures[0].2) / 90_000.0 * v.bit_rate + v.pictures[0].1;
        for (i, &(bits, ahead, delay)) in v.pictures.iter().enumerate() {
            let stated = f64::from(delay) / 90_000.0 * v.bit_rate + ahead;
            assert!(
                (stated - fullness).abs() < 2.0 * v.bit_rate / 90_000.0 + 64.0,
                "picture {i} at {kbps}: delay {delay}"
            );
            assert!(fullness <= v.buffer + v.bit_rate / 90_000.0 + 64.0, "picture {i} at {kbps} overflows: {fullness}");
            assert!(bits <= fullness, "picture {i} at {kbps} underflows: {bits} of {fullness}");
            fullness += v.bit_rate / 25.0 - bits;
        }
        let seconds = packets.len() as f64 / 25.0;
        let reached = 8.0 * stream.len() as f64 / seconds / v.bit_rate;
        println!("{kbps} kbit/s are reached to {reached:.4}");
        // If even the finest quantiser takes too few bits, the buffer fills before stuffing begins.
        let finest = packets.iter().any(|packet| packet.quantiser_scale == 1);
        assert_eq!(finest, kbps == 3000);
        assert!(reached < 1.01 && (finest || reached > 0.99), "{kbps} kbit/s are reached to {reached}");
        // In the longest of these groups libmpeg2's rounding errors accumulate to 3 in a sample. The limit of the mean equals the
        // limit for a group of 15.
        let (width, height) = (176, 144);
        check_agreement("ffmpeg", &decode_ffmpeg(&stream, width, height, "faani"), &packets, 55.0);
        check_agreement("mpeg2dec", &decode_mpeg2dec(&stream, width, height), &packets, 55.0);
    }
}

#[test]
fn a_capped_rate_never_runs_dry() {
    let rate = Rate::Capped { bits_per_second: 300_000, buffer_bits: 200_000 };
    let settings = config(176, 144).with_b_pictures(2).with_quantiser_scale(2).with_rate(rate);
    let (stream, packets) = encode_ahead(settings, (0..50).map(|time| moving(176, 144, time)), None);
    let v = verifier(&stream);
    let mut fullness = v.buffer;
    for &(bits, _, delay) in &v.pictures {
        assert_eq!(delay, 0xffff);
        assert!(bits <= fullness);
        fullness = (fullness + v.bit_rate / 25.0 - bits).min(v.buffer);
    }
    assert!(packets.iter().any(|packet| packet.quantiser_scale > 2), "the cap must have an effect");
    // If the cap is high, the quantiser is the requested one.
    let rate = Rate::Capped { bits_per_second: 14_000_000, buffer_bits: 1_800_000 };
    let settings = config(176, 144).with_b_pictures(2).with_quantiser_scale(8).with_rate(rate);
    let (_, packets) = encode_ahead(settings, (0..20).map(|time| moving(176, 144, time)), None);
    assert!(packets.iter().all(|packet| packet.quantiser_scale == 8));
}

#[test]
fn a_rate_that_no_level_allows_is_an_error() {
    let rate = Rate::Constant { bits_per_second: 90_000_000, buffer_bits: 200_000 };
    let message = config(176, 144).with_lookahead(30).with_rate(rate).encoder().expect_err("an error").to_string();
    assert!(message.contains("90000000") && message.contains("80000000"), "{message}");
    let message = config(176, 144).with_b_pictures(2).encoder().expect_err("an error").to_string();
    assert!(message.contains("a look-ahead of at least 2 frames, not 0"), "{message}");
    let message = config(176, 144).with_lookahead(31).validate().expect_err("an error").to_string();
    assert!(message.contains("0 to 30"), "{message}");
    let message = config(176, 144).with_b_pictures(8).encoder().expect_err("an error").to_string();
    assert!(message.contains("0 to 7"), "{message}");
}

#[test]
fn weights_move_quantisers_and_bits() {
    let (width, height) = (96, 64);
    // Request finer quantisers on the left and coarser ones on the right.
    let weights = Plane::from_fn(6, 4, |x, _| if x < 3 { 0.5 } else { 2.0 });
    let mut encoder = config(width, height).with_quantiser_scale(16).with_lookahead(30).encoder().unwrap();
    let mut packets = Vec::new();
    for time in 0..6 {
        packets.extend(encoder.push_weighted(&moving(width, height, time), SuppliedMotion::default(), &weights));
    }
    let finish = encoder.finish();
    packets.extend(finish.packets);
    for packet in packets.iter().filter(|packet| packet.picture_type == PictureType::I) {
        let scales = &packet.quantiser_scales;
        assert!((0..4).all(|y| (0..3).all(|x| 2 * scales.get(x, y) < scales.get(x + 3, y))), "{scales:?}");
    }
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(finish.end);
    check(&stream, &packets, "weights");
}

#[test]
fn passes_reach_the_requested_rate() {
    let capped = Rate::Capped { bits_per_second: 900_000, buffer_bits: 900_000 };
    for (effort, rate, kbps) in [
        (Effort::Fast, Rate::ConstantQuantiser, 250),
        (Effort::Balanced, Rate::ConstantQuantiser, 1200),
        (Effort::Balanced, capped, 600),
    ] {
        let (mut passes, mut next, mut taken) = (Passes::new(1000 * kbps), Some(8.0), Vec::new());
        while let Some(quantiser_scale) = next {
            let settings = config(176, 144).with_gop(6).with_b_pictures(2).with_effort(effort).with_rate(rate);
            let settings = settings.with_mean_quantiser_scale(quantiser_scale);
            let (stream, packets) = encode_ahead(settings, (0..45).map(|time| moving(176, 144, time)), None);
            let bits: u64 = packets.iter().map(|packet| packet.bits).sum();
            taken.push(bits as f64 / 45.0 * 25.0);
            next = passes.next(quantiser_scale, taken[taken.len() - 1]);
            if next.is_none() {
                check(&stream, &packets, &format!("{effort:?}, {kbps} kbit/s"));
            }
        }
        let last = taken[taken.len() - 1] / f64::from(1000 * kbps);
        assert!((last - 1.0).abs() < 0.01 && taken.len() <= 6, "{effort:?}, {kbps} kbit/s: {taken:?}");
    }
}

/// With a buffer of half a second, a constant rate loses less than 0.3 dB compared with constant quality. With too short a
/// look-ahead, an I picture would take all bits and leave none for the others.
#[test]
fn a_constant_rate_costs_little_quality() {
    let psnr = |packets: &[Packet]| {
        let errors = packets.iter().map(|packet| 10f64.powf(-packet.psnr_y / 10.0));
        -10.0 * (errors.sum::<f64>() / packets.len() as f64).log10()
    };
    for effort in [Effort::Fast, Effort::Balanced] {
        for (b_pictures, kbps) in [(0, 500), (2, 400), (2, 1200)] {
            let film = |settings: Config| {
                let settings = settings.with_b_pictures(b_pictures).with_effort(effort);
                encode_ahead(settings, (0..45).map(|time| moving(176, 144, time)), None).1
            };
            let rate = Rate::Constant { bits_per_second: 1000 * kbps, buffer_bits: 500 * kbps };
            let constant = film(config(176, 144).with_rate(rate));
            let bits: u64 = constant.iter().map(|packet| packet.bits).sum();
            let (mut passes, mut next, mut even) = (Passes::new((bits as f64 / 45.0 * 25.0) as u32), Some(8.0), 0.0);
            while let Some(quantiser_scale) = next {
                let packets = film(config(176, 144).with_mean_quantiser_scale(quantiser_scale));
                let taken: u64 = packets.iter().map(|packet| packet.bits).sum();
                even = psnr(&packets);
                next = passes.next(quantiser_scale, taken as f64 / 45.0 * 25.0);
            }
            let lost = even - psnr(&constant);
            println!("{effort:?}, {b_pictures} B pictures, {kbps} kbit/s: {lost:.2} dB below constant quality");
            assert!(lost < 0.3, "{effort:?}, {b_pictures} B pictures, {kbps} kbit/s: {lost} dB");
        }
    }
}

/// For each pushed frame the encoder decides immediately whether it begins a group; later groups follow by counting.
#[test]
fn groups_are_known_before_they_are_coded() {
    // moving() has a shot change at frame 60: the seventh frame, which begins no group of four.
    let (start, cut, count, gop) = (54, 6, 20, 4);
    for (b_pictures, effort) in [(0, Effort::Balanced), (2, Effort::Fast), (2, Effort::Best)] {
        let settings = config(96, 64).with_lookahead(30).with_gop(gop).with_b_pictures(b_pictures).with_effort(effort);
        let mut encoder = settings.encoder().unwrap();
        let mut packets: Vec<Packet> = Vec::new();
        let (mut known, mut announced) = (Vec::new(), vec![encoder.begins_group(0)]);
        for index in 0..count {
            packets.extend(encoder.push(&moving(96, 64, start + index), SuppliedMotion::default()));
            known.push(encoder.begins_group(index as u64));
            announced.push(encoder.begins_group(index as u64 + 1));
        }
        packets.extend(encoder.finish().packets);
        packets.sort_by_key(|packet| packet.display_index);
        let coded: Vec<_> = packets.iter().map(|packet| Some(packet.picture_type == PictureType::I)).collect();
        assert_eq!(known, coded, "{effort:?}, {b_pictures} B pictures");
        assert_eq!(coded[cut], Some(true));
        // Only the shot change was not announced.
        announced.pop();
        announced[cut] = Some(true);
        assert_eq!(announced, coded, "{effort:?}, {b_pictures} B pictures");
    }
    let encoder = config(96, 64).with_gop(gop).encoder().unwrap();
    let groups: Vec<bool> = (0..9).map(|index| encoder.begins_group(index).unwrap()).collect();
    assert_eq!(groups, [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|index| index % 4 == 0));
}

/// A stream continued by another encoder from any state is identical. An encoder with other settings refuses the state.
#[test]
fn a_state_fits_its_settings_only() {
    let frames: Vec<_> = (52..70).map(|time| moving(64, 48, time)).collect();
    let constant = Rate::Constant { bits_per_second: 300_000, buffer_bits: 200_000 };
    let ahead = config(64, 48).with_lookahead(5).with_b_pictures(2).with_gop(6);
    let variants = [config(64, 48).with_gop(6), ahead.clone(), ahead.clone().with_rate(constant)];
    for settings in &variants {
        let others = [
            settings.clone().with_gop(7),
            settings.clone().with_effort(Effort::Best),
            settings.clone().with_lookahead(settings.clone().encoder().unwrap().config().lookahead() + 1),
        ];
        let mut whole: Vec<u8> = Vec::new();
        let (mut continued, mut encoder, mut other) =
            (Vec::new(), settings.clone().encoder().unwrap(), settings.clone().encoder().unwrap());
        for frame in &frames {
            whole.extend(encoder.push(frame, SuppliedMotion::default()).into_iter().flat_map(|packet| packet.data));
            let state = other.state().clone();
            // Encoders with other settings must refuse the state.
            for settings in &others {
                let error = settings.clone().encoder().unwrap().restore(state.clone()).unwrap_err();
                assert_eq!(error, RestoreError::OtherSettings);
            }
            // Continue each frame with a new encoder, even one with another quantiser.
            other = settings.clone().with_quantiser_scale(62).encoder().unwrap();
            other.restore(state).unwrap();
            other.set_quantiser_scale(8).unwrap();
            continued.extend(other.push(frame, SuppliedMotion::default()).into_iter().flat_map(|packet| packet.data));
        }
        for (stream, encoder) in [(&mut whole, encoder), (&mut continued, other)] {
            let finish = encoder.finish();
            stream.extend(finish.packets.into_iter().flat_map(|packet| packet.data));
            stream.extend(finish.end);
        }
        assert!(whole == continued, "{settings:?}");
    }
}
