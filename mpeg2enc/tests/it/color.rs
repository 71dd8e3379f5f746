//! Color and aspect ratio in headers, as read by ffprobe and bit by bit.

use crate::common::*;
use mpeg2enc::{
    AspectRatio, ColorDescription, ColorPrimaries, Config, FrameRate, MatrixCoefficients, Standard,
    TransferCharacteristics,
};

/// Returns a stream of one picture.
fn stream(config: Config, (width, height): (usize, usize)) -> Vec<u8> {
    encode(config, [moving(width, height, 0)].into_iter()).0
}

/// Returns the values that ffprobe reads from a stream, one for each entry.
fn probed(stream: &[u8], entries: &str) -> Vec<String> {
    let file = StreamFile::new(stream);
    let shown = format!("stream={entries}");
    let (listed, _) =
        run("ffprobe", &["-v", "error", "-show_entries", &shown, "-of", "default=nw=1:nk=1", file.path()]);
    String::from_utf8(listed).expect("text").lines().map(str::to_owned).collect()
}

/// Returns the bytes after extension_start_code with this identifier.
fn extension(stream: &[u8], identifier: u8) -> &[u8] {
    let found = stream.windows(5).position(|bytes| bytes[..4] == [0, 0, 1, 0xb5] && bytes[4] >> 4 == identifier);
    &stream[found.expect("an extension") + 4..]
}

#[test]
fn every_color_is_stated() {
    let (size, colors) = ((96, 80), ColorPrimaries::ALL.len().max(TransferCharacteristics::ALL.len()));
    for number in 0..colors {
        let color = ColorDescription {
            primaries: ColorPrimaries::ALL[number % ColorPrimaries::ALL.len()],
            transfer: TransferCharacteristics::ALL[number % TransferCharacteristics::ALL.len()],
            matrix: MatrixCoefficients::ALL[number % MatrixCoefficients::ALL.len()],
        };
        let stream = stream(config(size.0, size.1).with_color(color), size);
        // Identifier, video_format and colour_description fill the first byte.
        let codes = [color.primaries.code(), color.transfer.code(), color.matrix.code()];
        assert_eq!(extension(&stream, 2)[..4], [0x2b, codes[0], codes[1], codes[2]], "{color:?}");

        let told = probed(&stream, "color_space,color_transfer,color_primaries");
        assert_eq!(told, [color.matrix.name(), color.transfer.name(), color.primaries.name()], "{color:?}");
    }
}

/// The default is code 1 of Tables 6-7 to 6-9 and 6-3, as in all earlier versions.
#[test]
fn without_settings_bt_709_and_square_samples_are_stated() {
    let stream = stream(config(96, 80), (96, 80));
    assert_eq!(extension(&stream, 2)[..4], [0x2b, 1, 1, 1]);
    assert_eq!(stream[7] >> 4, 1);
    let explicit = config(96, 80).with_color(ColorDescription::default()).with_aspect(AspectRatio::SquareSamples);
    assert_eq!(explicit, config(96, 80));
}

#[test]
fn every_shape_is_stated() {
    for (code, (shape, (sample, display))) in AspectRatio::ALL
        .iter()
        .zip([("1:1", "5:4"), ("16:15", "4:3"), ("64:45", "16:9"), ("221:125", "221:100")])
        .enumerate()
    {
        let config = Config::new(720, 576, FrameRate::FPS_25).with_aspect(*shape);
        let stream = stream(config, (720, 576));
        assert_eq!(usize::from(stream[7] >> 4), code + 1, "{shape}");
        assert_eq!(probed(&stream, "sample_aspect_ratio,display_aspect_ratio"), [sample, display], "{shape}");
    }
}

#[test]
fn mpeg1_states_the_nearest_sample() {
    let config = |shape| {
        Config::new(720, 576, FrameRate::FPS_25)
            .with_standard(Standard::Mpeg1)
            .with_quantiser_scale(16)
            .with_aspect(shape)
    };
    for (shape, code) in [(AspectRatio::SquareSamples, 1), (AspectRatio::Display4x3, 8), (AspectRatio::Display16x9, 3)]
    {
        assert_eq!(stream(config(shape), (720, 576))[7] >> 4, code, "{shape}");
    }
}

#[test]
fn mpeg1_refuses_what_it_cannot_state() {
    let config = |width, height| Config::new(width, height, FrameRate::FPS_25).with_standard(Standard::Mpeg1);
    let message = |config: Config| config.encoder().expect_err("an error").to_string();
    let color = ColorDescription { primaries: ColorPrimaries::Smpte170M, ..ColorDescription::default() };
    assert!(message(config(64, 48).with_color(color)).contains("a color description: omit it"));
    assert!(
        message(config(64, 64).with_aspect(AspectRatio::Display221x100)).contains("this sample aspect ratio: scale")
    );
}
