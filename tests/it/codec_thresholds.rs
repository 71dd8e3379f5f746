//! Thresholds from the encoder's actual quantisation, through the whole program and with the encoder alone.

use mpeg2enc::{Config, FrameRate, PictureType, SuppliedMotion};
use perceptual::{Feedback, MaskingModel, NextPicture, ObservedFrame, QuantiserSteps, ToneMap, YCbCr, luminance_plane};
use pipeline::stage;
use pipeline::stage::{Displayed, Encode};
use plane::{Coded, Plane};
use render2mpeg::Options;
use render2mpeg::stages::Video;
use std::sync::Arc;
use tests::{cornell, decode_ffmpeg, load, render};

/// Textured hills: some blocks are smooth, others are not.
fn hills(time: f32) -> Plane<[f32; 3]> {
    Plane::from_fn(128, 96, |x, y| {
        let (x, y) = (x as f32 + 3.0 * time, y as f32);
        let texture = 0.5 + 0.5 * (0.9 * x).sin() * (1.1 * y).sin() * (0.03 * (x + 2.0 * y)).cos().powi(2);
        [0.05 + 0.4 * texture * (1.0 + (0.05 * x).sin() * (0.04 * y).cos()) / 2.0; 3]
    })
}

struct CodedFrame {
    frame: YCbCr,
    luminance: Plane<f32>,
    coded: Coded,
}

/// Encodes two pictures, the first intra, the second as `gop` requires.
fn coded(quantiser_scale: u32, gop: u32) -> Vec<CodedFrame> {
    let config = Config::new(128, 96, FrameRate::from_fps(25.0).unwrap());
    let mut encoder = config.with_gop(gop).with_quantiser_scale(quantiser_scale).encoder().unwrap();
    (0..2)
        .map(|time| {
            let radiance = hills(time as f32);
            let frame = YCbCr::from_radiance(&radiance, &ToneMap::default());
            let packet = encoder.push(&frame.picture, SuppliedMotion::default()).remove(0);
            CodedFrame { luminance: luminance_plane(&radiance), coded: packet.coded(), frame }
        })
        .collect()
}

/// Mean threshold relative to luminance, for the picture after `coded`.
fn mean_threshold(coded: &CodedFrame, next: NextPicture) -> f64 {
    let mut feedback = Feedback::new(MaskingModel::default(), ToneMap::default(), 0.5);
    let CodedFrame { frame, luminance, coded } = coded;
    let observed = ObservedFrame { luma: &frame.luma, luminance, known: None };
    let thresholds = feedback.observe_coded(observed, &QuantiserSteps::default(), coded, next);
    let relative = thresholds.samples().iter().zip(luminance.samples()).map(|(&t, &y)| f64::from(t / y));
    relative.sum::<f64>() / luminance.samples().len() as f64
}

/// Losses of an intra picture are predicted from a predicted picture. The thresholds are close to thresholds after an actual
/// intra picture.
#[test]
fn an_intra_picture_is_predicted() {
    for quantiser_scale in [4, 16, 48] {
        let predicted = mean_threshold(&coded(quantiser_scale, 2)[1], NextPicture::Intra { group: 1 });
        let known = mean_threshold(&coded(quantiser_scale, 1)[1], NextPicture::Intra { group: 1 });
        println!("quantiser_scale {quantiser_scale}: predicted {predicted:.4}, known {known:.4}");
        // The README of `perceptual` states 13 %.
        assert!((predicted / known - 1.0).abs() < 0.135, "{quantiser_scale}: {predicted}, known {known}");
    }
}

/// Coarser quantisers give larger thresholds, for the next intra picture and for the next predicted one.
#[test]
fn coarser_quantisers_allow_more() {
    for next in [NextPicture::Intra { group: 1 }, NextPicture::Predicted] {
        let means: Vec<f64> = [2, 8, 16, 32, 62].map(|scale| mean_threshold(&coded(scale, 9)[0], next)).into();
        assert!(means.is_sorted(), "{next:?}: {means:?}");
        assert!(means[0] < 0.022 && means[4] > 4.0 * means[0], "{next:?}: from 2 % to much more: {means:?}");
    }
}

#[test]
fn a_film_is_rendered_by_them() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = "--size 96x96 --frames 8 --gop 4 --vpls 200 --photons 20000 --cache off --qscale 32";
    let codec = render(folder.path(), "codec", &cornell(), &format!("{arguments} --thresholds codec"));
    let fixed = render(folder.path(), "fixed", &cornell(), &format!("{arguments} --thresholds fixed:0.02"));
    assert_eq!(decode_ffmpeg(&folder.path().join("codec.m2v"), (96, 96)).len(), 8);
    let mean = |film: &tests::Rendered, figure: &str| film.figures(&[figure])[1..].iter().sum::<f64>() / 7.0;
    assert!(mean(&codec, "threshold_mean_relative") > 0.03);
    assert!(mean(&codec, "cut_size_mean") < 0.8 * mean(&fixed, "cut_size_mean"));
}

/// Some quantisers of the nonlinear scale, in order.
const QUANTISERS: [u32; 18] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 112];

/// The nearest of [`QUANTISERS`] to at most two thirds of `finest`, and at least three halves of `coarsest`.
fn around(finest: u32, coarsest: u32) -> [u32; 2] {
    let finer = QUANTISERS.into_iter().rfind(|&qscale| 3 * qscale <= 2 * finest);
    let coarser = QUANTISERS.into_iter().find(|&qscale| 2 * qscale >= 3 * coarsest);
    [finer.unwrap_or(1), coarser.unwrap_or(112)]
}

/// An encoder with look-ahead predicts its coding. The thresholds are close to the thresholds of known coding, at constant
/// quantisers with B pictures and at a bit rate.
#[test]
fn films_of_encoders_that_look_ahead() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = "--size 96x96 --frames 8 --vpls 200 --photons 20000 --cache off --thresholds codec";
    let film = |name: &str, more: &str| render(folder.path(), name, &cornell(), &format!("{arguments} {more}"));
    let mean = |film: &tests::Rendered| film.figures(&["threshold_mean_relative"])[2..].iter().sum::<f64>() / 6.0;
    let known = |qscale: u32| mean(&film("known", &format!("--qscale {qscale}")));
    // Predictions are off by less than half a quantiser: they lie between known thresholds of two thirds and three halves of it.
    for qscale in [8, 32] {
        let predicted = mean(&film("predicted", &format!("--qscale {qscale} --bframes 2")));
        let [finer, coarser] = around(qscale, qscale).map(known);
        println!("quantiser_scale {qscale}: {predicted:.4} predicted, known are {finer:.4} to {coarser:.4}");
        assert!((finer..coarser).contains(&predicted), "{qscale}: {predicted}, known {finer} to {coarser}");
    }
    // With a bit rate, the quantisers of the film span the range.
    let rate = film("rate", "--bitrate 150k --bframes 2");
    let qscales = rate.figures(&["qscale"]);
    let [finest, coarsest] = [f64::min, f64::max].map(|of| qscales.iter().copied().reduce(of).unwrap() as u32);
    let [finer, coarser] = around(finest, coarsest).map(known);
    let rate = mean(&rate);
    assert!((finer..coarser).contains(&rate), "quantisers {finest} to {coarsest}: {rate}, known {finer} to {coarser}");
    assert_eq!(decode_ffmpeg(&folder.path().join("rate.m2v"), (96, 96)).len(), 8);
}

/// The feedback announces the first frame of each group, also after a shot change in a film with B pictures and a bit rate.
/// Only the shot change itself is not announced, as the encoder cannot foresee it.
#[test]
fn thresholds_follow_the_groups_after_a_scene_cut() {
    let (frames, gop, cut) = (30, 6, 14);
    let options = Options {
        frames: Some(frames),
        size: "128x96".parse().ok(),
        gop: Some(gop),
        bitrate: "400k".parse().ok(),
        bframes: Some(2),
        ..Options::default()
    };
    let (_, settings) = load(&cornell(), options);
    let mut video = Video::new(&settings).unwrap();
    // Encode the film, and note the announced groups.
    let (mut announced, mut pictures) = (Vec::new(), Vec::new());
    for index in 0..frames {
        // Tiles, which hills cannot predict.
        let tile = |x: usize, y: usize| [0.02 + 0.005 * ((x / 3 * 7919 + y / 3 * 104_729) % 97) as f32; 3];
        let radiance = if index < cut { hills(0.3 * index as f32) } else { Plane::from_fn(128, 96, tile) };
        let tone_map = ToneMap::default();
        let displayed = Displayed {
            index,
            picture: Arc::new(YCbCr::from_radiance(&radiance, &tone_map)),
            luminance: Arc::new(luminance_plane(&radiance)),
            tone_map,
            importance: None,
            correspondence: None,
            forward: None,
        };
        let coded = video.step(&displayed).unwrap();
        if index + 1 < frames && matches!(coded.coding.next, NextPicture::Intra { .. }) {
            announced.push(index + 1);
        }
        pictures.extend(coded.pictures);
    }
    pictures.extend(video.finish().unwrap().pictures);

    // Every group except the shot change was announced.
    let is_intra = |picture: &&stage::CodedFrame| picture.picture_type == PictureType::I;
    let mut intra: Vec<u32> = pictures.iter().filter(is_intra).map(|picture| picture.index).collect();
    intra.sort_unstable();
    assert_eq!(intra, [0, 6, 12, 14, 20, 26]);
    assert_eq!(announced, [6, 12, 20, 26]);
}
