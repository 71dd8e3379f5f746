//! Two independent decoders show the encoder's reconstructions.

use mpeg2enc::{Picture, psnr};
use render2mpeg::Options;
use tests::{cornell, correspondences, decode_ffmpeg, decode_mpeg2dec, encode, load, read_y4m, render_as_coded};

const SIZE: (usize, usize) = (96, 96);
const FRAMES: usize = 100;
/// Lowest PSNR between decoders \[dB\]: integer transforms differ by one in 1 to 2 % of the samples, and prediction adds up.
const AGREEMENT_DB: f64 = 55.0;

/// PSNR of the worst of the three planes, at most 99 dB.
fn agreement(a: &Picture, b: &Picture) -> f64 {
    // The PSNR of equal planes is infinite, which no mean can include.
    psnr(a.luma(), b.luma()).min(psnr(a.cb(), b.cb())).min(psnr(a.cr(), b.cr())).min(99.0)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn a_rendered_film_is_shown_as_it_was_coded() {
    let folder = tempfile::tempdir().unwrap();
    let video = folder.path().join("film.m2v");
    let options = Options {
        frames: Some(FRAMES as u32),
        size: "96x96".parse().ok(),
        vpls: Some(200),
        photons: Some(20_000),
        output: Some(video.clone()),
        y4m: Some(folder.path().join("film.y4m")),
        ..Options::default()
    };
    let (scene, settings) = load(&cornell(), options);
    let report = render_as_coded(&scene, &settings);
    let source = read_y4m(&folder.path().join("film.y4m"), SIZE);
    assert_eq!(source.len(), FRAMES);

    // Encode the same pictures and motion with the encoder alone. As the streams are equal, its reconstructions are the
    // film's.
    let (stream, packets) = encode(&settings, &source, &correspondences(&scene, &settings));
    assert!(stream == std::fs::read(&video).expect("the film is there"), "pictures and motion determine the stream");

    let told: Vec<f64> = report.frames.iter().map(|frame| frame.psnr_y.unwrap_or(f64::INFINITY)).collect();
    for (decoder, shown) in [("ffmpeg", decode_ffmpeg(&video, SIZE)), ("mpeg2dec", decode_mpeg2dec(&video, SIZE))] {
        assert_eq!(shown.len(), FRAMES, "{decoder} shows every picture");
        let agreements: Vec<f64> =
            shown.iter().zip(&packets).map(|(shown, packet)| agreement(shown, &packet.reconstruction)).collect();
        let worst = agreements.iter().copied().fold(f64::INFINITY, f64::min);
        let (early, late) = (mean(&agreements[..25]), mean(&agreements[75..]));
        println!("{decoder}: {worst:.1} dB at worst, {early:.1} dB in the first 25 pictures, {late:.1} in the last");
        assert!(worst >= AGREEMENT_DB, "{decoder}: {worst:.1} dB from the reconstruction");
        assert!(late > early - 2.0, "{decoder} drifts away: from {early:.1} to {late:.1} dB");

        // Compared with the rendered frames: the quality in the report.
        for (index, ((shown, source), told)) in shown.iter().zip(&source).zip(&told).enumerate() {
            let found = psnr(shown.luma(), source.luma());
            assert!((found - told).abs() < 0.1, "{decoder}, frame {index}: {found:.2} dB, reported {told:.2}");
        }
    }
}
