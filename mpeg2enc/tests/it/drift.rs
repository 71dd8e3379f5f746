//! Tests over long films: the quality of decoded pictures equals the quality of the encoder's reconstruction.

use crate::common::*;
use mpeg2enc::Picture;

/// Difference that counts as equal, in dB.
const EQUAL_DB: f64 = 0.02;

/// Returns the PSNR of luma over all pictures, in dB.
fn psnr_of_all<'a>(shown: impl Iterator<Item = &'a Picture>, sources: &[Picture]) -> f64 {
    let (mut squares, mut samples) = (0u64, 0);
    for (shown, source) in shown.zip(sources) {
        let pairs = shown.luma().samples().iter().zip(source.luma().samples());
        squares += pairs.map(|(&a, &b)| u64::from(a.abs_diff(b)).pow(2)).sum::<u64>();
        samples += source.luma().samples().len();
    }
    10.0 * (255f64.powi(2) * samples as f64 / squares as f64).log10()
}

/// Over the longest groups, decoders with an exact transform lose no quality. The integer transforms of ffmpeg's default and of
/// mpeg2dec are sometimes off by one. Coarse quantisers hide these errors; the finest common quantiser shows their effect on any
/// stream. No decoder loses more at the end than at the beginning.
#[test]
fn three_hundred_pictures_lose_no_quality_in_decoders() {
    let (width, height, count) = (64, 48, 300);
    let sources: Vec<Picture> = (0..count).map(|time| moving(width, height, time)).collect();
    for (quantiser_scale, gop, by_integers) in [(2, 15, 0.1), (2, 132, 0.25), (112, 132, EQUAL_DB)] {
        let settings = config(width, height).with_quantiser_scale(quantiser_scale).with_gop(gop).with_b_pictures(2);
        let (stream, packets) = encode_ahead(settings, sources.iter().cloned(), None);
        assert_eq!(packets.len(), count);
        let ours = psnr_of_all(packets.iter().map(|packet| &*packet.reconstruction), &sources);
        for (decoder, frames, allowed) in [
            ("ffmpeg in floats", decode_ffmpeg(&stream, width, height, "faani"), EQUAL_DB),
            ("ffmpeg", decode_ffmpeg(&stream, width, height, "auto"), by_integers),
            ("mpeg2dec", decode_mpeg2dec(&stream, width, height), by_integers),
        ] {
            assert_eq!(frames.len(), count);
            let change = psnr_of_all(frames.iter(), &sources) - ours;
            // The loss must not grow from the first hundred pictures to the last.
            let [first, last] = [0, count - 100].map(|from| {
                let hundred = from..from + 100;
                let said = packets[hundred.clone()].iter().map(|packet| &*packet.reconstruction);
                let said = psnr_of_all(said, &sources[hundred.clone()]);
                psnr_of_all(frames[hundred.clone()].iter(), &sources[hundred]) - said
            });
            let drift = last - first;
            println!(
                "quantiser_scale {quantiser_scale}, groups of {gop}, {decoder}: {ours:.3} dB {change:+.4}, drift {drift:+.4}"
            );
            assert!(drift.abs() <= EQUAL_DB, "quantiser_scale {quantiser_scale}, {decoder}: from {first} to {last} dB");
            assert!(
                change.abs() <= allowed,
                "quantiser_scale {quantiser_scale}, groups of {gop}, {decoder}: {change} dB"
            );
        }
    }
}
