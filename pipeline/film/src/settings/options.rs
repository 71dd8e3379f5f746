//! Options, by library, command line and file.

use super::aspect::PictureAspect;
use super::chunks::FrameRange;
use super::emphasis::AdaptiveQuantiser;
use super::preset::Preset;
use super::values::{BitRate, ExrDepth, Switch, size_as_text};
use mpeg2enc::Effort;
use renderer::settings::{Aov, Importance, Lighting, PixelShading, Size, Stopping, Thresholds, TileSettings};
use serde::{Deserialize, Serialize, Serializer};
use std::path::PathBuf;

/// Every choice of a film; what is left open has the default that is named with it.
///
/// As a command line each field is an option of its name; as a file, such as TOML, a key of its name: `run-everything = true`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct Options {
    /// How good and how slow: "draft" is small and coarse, "good" the defaults, "final" large, with smooth edges; what is typed
    /// besides overrides it [default: good]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "HOW", hide_possible_values = true, help_heading = "Film")
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Pictures to make [default: as the scene's TOML file says, else as long as its animation, else 100]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Film"))]
    pub frames: Option<u32>,
    /// Begin with this frame of the scene, counted from 0 [default: 0]
    #[cfg_attr(feature = "clap", arg(long, value_name = "K", help_heading = "Film", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<u32>,
    /// End with this frame of the scene [default: the last]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "K", conflicts_with = "frames", help_heading = "Film", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<u32>,
    /// Show each N-th frame of the scene alone, N times as fast: a preview [default: 1]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Film", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u32>,
    /// Every N frames all begins anew, so that machines can make parts of the film: the same bits as one machine [default: never]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "N", help_heading = "Parts of a film", hide_short_help = true)
    )]
    pub chunk: Option<u32>,
    /// Make these frames of a film as a part for `render2mpeg join`, counted from 0; with --chunk whole chunks [default: all]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "A-B", help_heading = "Parts of a film", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<FrameRange>,
    /// Frames a second: 23.976, 24, 25, 29.97, 30, 50, 59.94, 60, or a fraction such as 24000/1001; others of which these are multiples
    /// repeat frames, such as 12 or 15 [default: as the TOML file says, else 25]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_parser = super::coded_rate::parse_fps, help_heading = "Film", hide_short_help = true)
    )]
    #[serde(deserialize_with = "super::coded_rate::optional_fps")]
    pub fps: Option<f64>,
    /// Size of the picture, in pixels [default: 512x512 pixels in the camera's shape, such as 682x384]
    #[cfg_attr(feature = "clap", arg(long, value_name = "WxH", help_heading = "Film"))]
    #[serde(with = "size_as_text", skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// Shape of the displayed picture: 4:3 or 16:9, with pixels of the shape that follows, or square pixels [default: square; the nearer
    /// of 4:3 and 16:9 in .vob]
    #[cfg_attr(feature = "clap", arg(long, value_name = "SHAPE", help_heading = "Film", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aspect: Option<PictureAspect>,
    /// MPEG-2's quantiser_scale, 1 (best) to 112 (smallest); ffmpeg's -q:v is half of it [default: 8]
    #[cfg_attr(feature = "clap", arg(long, value_name = "Q", help_heading = "Quality"))]
    pub qscale: Option<u32>,
    /// Choice of the macroblocks of a picture that are quantised finer than others [default: off]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "BY", help_heading = "Encoder", hide_short_help = true)
    )]
    pub aq: Option<AdaptiveQuantiser>,
    /// Pictures from one I picture to the next, at most 132 [default: 15]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Encoder", hide_short_help = true))]
    pub gop: Option<u32>,
    /// At most this many bits a second, such as 1500k or 2M: coarser than --qscale where that is too much [default: no bound]
    #[cfg_attr(feature = "clap", arg(long, value_name = "R", help_heading = "Encoder", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bitrate: Option<BitRate>,
    /// Just as many bits a second as --bitrate says, all the time
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Encoder", hide_short_help = true))]
    pub cbr: bool,
    /// The most B pictures in a row, 0 to 7: fewer bits, coded when later frames are there [default: 0]
    #[cfg_attr(feature = "clap", arg(long, value_name = "M", help_heading = "Encoder", hide_short_help = true))]
    pub bframes: Option<u32>,
    /// How much the encoder tries for few bits [default: balanced]
    #[cfg_attr(feature = "clap", arg(long, value_parser = super::values::effort(), help_heading = "Encoder", hide_short_help = true))]
    pub effort: Option<Effort>,
    /// Write MPEG-1, for players that know nothing else
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Encoder", hide_short_help = true))]
    pub mpeg1: bool,
    /// The error a pixel may have: "codec", by what the encoder really did; "perceptual", by the masking model; "fixed:SHARE" of its
    /// luminance [default: codec]
    #[cfg_attr(feature = "clap", arg(long, value_name = "KIND", help_heading = "Research", hide_short_help = true))]
    pub thresholds: Option<Thresholds>,
    /// Multiplier on what is allowed beyond 2 %: smaller is finer, 1 is the paper's [default: 1; 0.25 of "perceptual"]
    #[cfg_attr(feature = "clap", arg(long, value_name = "K", help_heading = "Research", hide_short_help = true))]
    pub kappa: Option<f32>,
    /// When a cut ends [default: bound]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "WHEN", help_heading = "Research", hide_short_help = true)
    )]
    pub stopping: Option<Stopping>,
    /// Share of pixels that calibrated stopping keeps within their thresholds, 0.5 to 0.999 [default: 0.95]
    #[cfg_attr(feature = "clap", arg(long, value_name = "SHARE", help_heading = "Research", hide_short_help = true))]
    pub within: Option<f64>,
    /// Which pixels of a frame are lit: all, or those whose light in the frame before does not tell it within their thresholds
    /// [default: adaptive]
    #[cfg_attr(feature = "clap", arg(long, value_enum, help_heading = "Research", hide_short_help = true))]
    pub shading: Option<PixelShading>,
    /// Where people look gets more samples, finer thresholds and finer quantisers: "saliency:W" for what catches the eye, "task:W"
    /// for the nodes that the scene's TOML file names, or both with a comma [default: everywhere alike]
    #[cfg_attr(feature = "clap", arg(long, value_name = "MAPS", help_heading = "Research", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub importance: Option<Importance>,
    /// Factor by which thresholds are finer where all people look, and coarser where nobody does, 1 to 8 [default: 2]
    #[cfg_attr(feature = "clap", arg(long, value_name = "G", help_heading = "Research", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub importance_gain: Option<f32>,
    /// Let each rank light tiles of the picture by itself, as it asks for them: "rays" or "time" in equal shares, then the records
    /// that go to others: "none", "central:N" or "each:N" [default: ranks share all work in turns]
    #[cfg_attr(feature = "clap", arg(long, value_name = "HOW", help_heading = "Research", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<TileSettings>,
    /// Samples of visibility and light to the pixel: 1 is fast, 4 smooths edges; with --importance, the most [default: 1; 5 with
    /// --importance]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality"))]
    pub samples: Option<u32>,
    /// Blend the surfaces that the area of a pixel shows, where outlines cross it; more --samples do so everywhere [default: on]
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_enum,
            value_name = "on|off",
            hide_possible_values = true,
            help_heading = "Quality",
            hide_short_help = true
        )
    )]
    pub antialiasing: Option<Switch>,
    /// Reflections of light on its way to the eye, at most [default: no limit]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality", hide_short_help = true))]
    pub bounces: Option<u32>,
    /// How indirect light is computed [default: lightcuts]
    #[cfg_attr(feature = "clap", arg(long, value_enum, help_heading = "Quality", hide_short_help = true))]
    pub lighting: Option<Lighting>,
    /// Light by `render2mpeg bake`, for --lighting baked [default: the scene's name with .slf, beside it]
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE.slf", hide = !cfg!(feature = "bake"), help_heading = "Quality", hide_short_help = true))]
    pub baked: Option<PathBuf>,
    /// Compute indirect light at few places and interpolate; off: a lightcut for each pixel [default: on]
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_enum,
            value_name = "on|off",
            hide_possible_values = true,
            help_heading = "Quality",
            hide_short_help = true
        )
    )]
    pub cache: Option<Switch>,
    /// Compensate the light from close by that softened virtual lights lose [default: on]
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_enum,
            value_name = "on|off",
            hide_possible_values = true,
            help_heading = "Research",
            hide_short_help = true
        )
    )]
    pub compensation: Option<Switch>,
    /// Anchor lights that carry the indirect light [default: 4000 for a box, up to 40000 for a building]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality", hide_short_help = true))]
    pub vpls: Option<usize>,
    /// Photons a frame [default: 36, 18 or 9 for each anchor light, by quantiser: below 4, below 16 and from there on]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality", hide_short_help = true))]
    #[serde(serialize_with = "integer")]
    pub photons: Option<u64>,
    /// Seed of photons and light tree [default: 1]
    #[cfg_attr(feature = "clap", arg(long, value_name = "S", help_heading = "Research", hide_short_help = true))]
    #[serde(serialize_with = "integer")]
    pub seed: Option<u64>,
    /// Run every stage for every frame, needed or not; the bits are the same
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Research", hide_short_help = true))]
    pub run_everything: bool,
    /// Keep the renderer's motion from the encoder, which then searches
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Research", hide_short_help = true))]
    pub no_motion: bool,
    /// The video: .mpg, .mp4, .mkv, .ts, .vob, or .m2v without times; - is standard output [default: the scene's name with .mpg,
    /// in this folder; with _A-B.m2v for a --range]
    #[cfg_attr(feature = "clap", arg(short, long, value_name = "FILE", help_heading = "Output"))]
    pub output: Option<PathBuf>,
    /// Also write every frame as PNG into this folder, as displays show it
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR", hide = !cfg!(feature = "still"), help_heading = "Output", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub png: Option<PathBuf>,
    /// Also write every frame as linear OpenEXR into this folder
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR", hide = !cfg!(feature = "exr"), help_heading = "Output", hide_short_help = true))]
    pub exr: Option<PathBuf>,
    /// Bits of the colors in these files [default: half]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "BITS", hide = !cfg!(feature = "exr"), help_heading = "Output", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exr_depth: Option<ExrDepth>,
    /// Further named layers of these files: a list such as albedo,normal,depth
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_delimiter = ',', value_name = "LIST", hide = !cfg!(feature = "exr"), help_heading = "Output", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub aov: Vec<Aov>,
    /// Also write the frames before compression, as YUV4MPEG2
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE", help_heading = "Output", hide_short_help = true))]
    pub y4m: Option<PathBuf>,
}

/// Numbers above 2⁶³−1 are written as texts, since TOML has no such integers.
fn integer<S: Serializer>(number: &Option<u64>, serializer: S) -> Result<S::Ok, S::Error> {
    match number.map(|number| i64::try_from(number).map_err(|_| number)) {
        None => serializer.serialize_none(),
        Some(Ok(number)) => serializer.serialize_i64(number),
        Some(Err(number)) => serializer.collect_str(&number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use render_core::scene::Scene;
    use renderer::settings::RenderSettings;

    #[test]
    fn files_hold_every_option_under_its_name() {
        let text = r#"
            frames = 4
            size = "48x32"
            bitrate = "1M"
            thresholds = "fixed:0.02"
            kappa = 0.3
            cache = false
            compensation = "on"
            run-everything = true
            exr = "frames"
            aov = ["cut-size", "albedo"]
        "#;
        let mut options: Options = toml::from_str(text).unwrap();
        assert_eq!(options.size, Some(Size { width: 48, height: 32 }));
        assert_eq!(options.bitrate, Some(BitRate(1_000_000)));
        assert_eq!((options.cache, options.compensation), (Some(Switch::Off), Some(Switch::On)));
        assert_eq!(options.aov, [Aov::CutSize, Aov::Albedo]);
        // Filled in and written, they are read as they were, and filled in again they stay.
        let first = options.fill_in("scene.glb".into(), &Scene::default()).unwrap();
        let written = toml::to_string(&options).unwrap();
        let mut again: Options = toml::from_str(&written).unwrap();
        assert_eq!(again, options, "{written}");
        let second = again.fill_in("scene.glb".into(), &Scene::default()).unwrap();
        assert_eq!(again, options);
        assert_eq!(serde_json::to_string(&first).unwrap(), serde_json::to_string(&second).unwrap());
        for line in ["kappa = 0.3\n", "cache = \"off\"\n", "size = \"48x32\"\n", "bitrate = 1000000\n"] {
            assert!(written.contains(line), "{line}{written}");
        }
    }

    /// Defaults stand in the renderer too, for callers without options: both are the same.
    #[test]
    fn the_renderer_has_the_defaults_of_films() {
        let options = Options { frames: Some(1), vpls: Some(4000), ..Options::default() };
        let of_film = Settings::new("scene.glb".into(), &Scene::default(), &options).unwrap().render;
        assert_eq!(format!("{of_film:?}"), format!("{:?}", RenderSettings::default()));
    }

    #[test]
    fn unknown_keys_and_values_are_refused() {
        for (text, word) in [("qscal = 8", "qscal"), ("size = \"big\"", "512x512"), ("cache = 3", "on")] {
            let error = toml::from_str::<Options>(text).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
