use super::*;
use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};

fn quantiser(scale: u32) -> Quantiser {
    quantiser_of(Standard::Mpeg2, scale)
}

fn quantiser_of(standard: Standard, scale: u32) -> Quantiser {
    let parameters = QuantiserParameters {
        standard,
        q_scale_type: true,
        intra_dc_precision: 8,
        alternate_scan: false,
        intra_table: CoefficientTable::Zero,
        intra_matrix: DEFAULT_INTRA_MATRIX,
        non_intra_matrix: DEFAULT_NON_INTRA_MATRIX,
    };
    Quantiser::new(scale, &parameters)
}

fn quantise(quantiser: &Quantiser, coefficients: &[i32; 64], kind: BlockKind, rounding: Rounding) -> Block {
    let start = usize::from(kind == BlockKind::Intra);
    let energy = coefficients[start..].iter().map(|&c| i64::from(c).pow(2)).sum();
    let mut block = Block::EMPTY;
    quantiser.quantise(Transformed { coefficients, energy }, kind, rounding, &mut block);
    block
}

fn trellis(scale: u32) -> Rounding {
    Rounding::Trellis { lambda: 10 * i64::from(scale * scale) }
}

#[test]
fn mismatch_control_makes_the_sum_odd() {
    let quantiser = quantiser(8);
    for seed in 0..500i32 {
        let coefficients = std::array::from_fn(|i| (seed * 7919 + i as i32 * 104_729) % 9000 - 4500);
        for kind in [BlockKind::Intra, BlockKind::Inter] {
            let block = quantise(&quantiser, &coefficients, kind, trellis(8));
            assert_eq!(quantiser.dequantise(&block, kind).iter().sum::<i32>() & 1, 1);
        }
    }
}

#[test]
fn mpeg_1_makes_each_coefficient_odd_toward_zero() {
    for scale in [2, 10, 62] {
        let (ours, mpeg2) = (quantiser_of(Standard::Mpeg1, scale), quantiser(scale));
        for seed in 0..100i32 {
            let coefficients = std::array::from_fn(|i| (seed * 7919 + i as i32 * 104_729) % 9000 - 4500);
            for kind in [BlockKind::Intra, BlockKind::Inter] {
                let block = quantise(&ours, &coefficients, kind, trellis(scale));
                assert!(block.levels.iter().skip(1).all(|level| level.unsigned_abs() <= 255));
                let (odd, before) = (ours.dequantise(&block, kind), mpeg2.dequantise(&block, kind));
                // Mismatch control changes the last coefficient.
                for i in usize::from(kind == BlockKind::Intra)..63 {
                    assert!(odd[i] == 0 || odd[i] & 1 == 1 || odd[i].abs() >= 2047, "{}", odd[i]);
                    assert_eq!(odd[i], before[i] - if before[i] & 1 == 0 { before[i].signum() } else { 0 });
                }
            }
        }
    }
}

#[test]
fn levels_come_back_near_the_coefficients() {
    for scale in [1, 2, 8, 31, 112] {
        let quantiser = quantiser(scale);
        for seed in 0..100i32 {
            let coefficients: [i32; 64] = std::array::from_fn(|i| {
                (seed * 7919 + i as i32 * 104_729).rem_euclid(1600) - 800 + if i == 0 { 3000 } else { 0 }
            });
            for (kind, widest) in [(BlockKind::Intra, 83), (BlockKind::Inter, 16)] {
                let restored = quantiser.dequantise(&quantise(&quantiser, &coefficients, kind, trellis(scale)), kind);
                let step = f64::from(widest * scale) / 16.0;
                for (i, (&a, &b)) in coefficients.iter().zip(&restored).enumerate() {
                    let error = (f64::from(a) / 8.0 - f64::from(b)).abs();
                    assert!(error <= 8.0f64.max(2.0 * step), "{kind:?} {i}: {error} at step {step}");
                }
            }
        }
    }
}

#[test]
fn the_error_and_bits_of_a_block_are_what_the_stream_has() {
    for (scale, rounding) in [(3, trellis(3)), (10, Rounding::DeadZone), (24, trellis(24))] {
        let quantiser = quantiser(scale);
        for seed in 0..100i32 {
            let coefficients: [i32; 64] = std::array::from_fn(|i| {
                (seed * 7919 + i as i32 * 104_729).rem_euclid(2400 / (1 + i as i32)) + if i == 0 { 3000 } else { 0 }
            });
            for kind in [BlockKind::Intra, BlockKind::Inter] {
                // Mismatch control is not included in the block's error, so the last coefficient may differ.
                let block = quantise(&quantiser, &coefficients, kind, rounding);
                let mut restored = quantiser.dequantise(&block, kind);
                restored[63] = 0; // mismatch control
                let error: i64 = coefficients
                    .iter()
                    .zip(&restored)
                    .map(|(&c, &r)| i64::from(c - (r << dct::COEFFICIENT_BITS)).pow(2))
                    .sum();
                let last = i64::from(coefficients[63] - 8).pow(2).max(i64::from(coefficients[63] + 8).pow(2));
                assert!((block.error - error).abs() <= last, "{} is not {error}", block.error);
                // The number of written bits must equal the counted number. Intra blocks have 3 more bits, for a DC without
                // difference.
                let mut counter = crate::bits::BitWriter::default();
                match kind {
                    BlockKind::Intra => {
                        let dc = i32::from(block.levels[0]);
                        crate::vlc::put_intra_block(&mut counter, quantiser.codes[0], &block, dc, true);
                        assert_eq!(crate::bits::BitSink::bits(&counter), u64::from(block.bits) + 3);
                    }
                    BlockKind::Inter if block.is_coded() => {
                        crate::vlc::put_inter_block(&mut counter, quantiser.codes[1], &block);
                        assert_eq!(crate::bits::BitSink::bits(&counter), u64::from(block.bits));
                    }
                    BlockKind::Inter => assert_eq!(block.bits, 0),
                }
            }
        }
    }
}

#[test]
fn values_saturate() {
    let quantiser = quantiser(112);
    let mut block = Block::EMPTY;
    (block.levels[5], block.levels[6], block.places) = (2047, -2047, 0b110_0000);
    let restored = quantiser.dequantise(&block, BlockKind::Inter);
    assert_eq!((restored[turned(ZIGZAG[5])], restored[turned(ZIGZAG[6])]), (2047, -2048));
}
