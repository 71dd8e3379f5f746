//! Options of a film, for the library, the command line and option files.

use super::aspect::PictureAspect;
use super::chunks::FrameRange;
use super::emphasis::AdaptiveQuantiser;
use super::preset::Preset;
use super::values::{BitRate, ExrDepth, Switch, size_as_text};
use mpeg2enc::Effort;
use renderer::settings::{
    Aov, Importance, Lighting, PixelShading, SampleCount, Size, Stopping, Thresholds, TileSettings,
};
use serde::{Deserialize, Serialize, Serializer};
use std::path::PathBuf;

/// Options of a film. An option left out has the default named in its description.
///
/// On the command line each field is an option; in a file, such as TOML, it is a key: `run-everything = true`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct Options {
    /// Quality preset: draft (small and coarse), good (the defaults) or final (large, smooth edges); explicit options
    /// win [default: good]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "HOW", hide_possible_values = true, help_heading = "Film")
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Number of frames [default: the scene's TOML file, else the length of its animation, else 100]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Film"))]
    pub frames: Option<u32>,
    /// First frame of the scene, counted from 0 [default: 0]
    #[cfg_attr(feature = "clap", arg(long, value_name = "K", help_heading = "Film", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<u32>,
    /// Last frame of the scene [default: the scene's last]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "K", conflicts_with = "frames", help_heading = "Film", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<u32>,
    /// Render only every N-th frame of the scene: a preview that plays N times as fast [default: 1]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Film", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u32>,
    /// Reset all state every N frames: chunks made on several machines join bit-exactly [default: never]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "N", help_heading = "Parts of a film", hide_short_help = true)
    )]
    pub chunk: Option<u32>,
    /// Render only these frames, counted from 0, as a part for `render2mpeg join`; with --chunk, whole chunks
    /// [default: all]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "A-B", help_heading = "Parts of a film", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<FrameRange>,
    /// Render only chunk K of --chunk N, counted from 0: for array jobs [default: all]
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_name = "K",
            requires = "chunk",
            conflicts_with = "range",
            help_heading = "Parts of a film",
            hide_short_help = true
        )
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunk_index: Option<u32>,
    /// File of the film's light: read if it exists, otherwise made and written; it saves the start of each part
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "FILE", help_heading = "Parts of a film", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<PathBuf>,
    /// Frames per second: 23.976, 24, 25, 29.97, 30, 50, 59.94, 60, or a fraction such as 24000/1001; rates that
    /// divide one of these, such as 12 or 15, repeat frames [default: the scene's TOML file, else 25]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_parser = super::coded_rate::parse_fps, help_heading = "Film", hide_short_help = true)
    )]
    #[serde(deserialize_with = "super::coded_rate::optional_fps")]
    pub fps: Option<f64>,
    /// Picture size in pixels [default: 512x512 pixels in the camera's shape, such as 682x384]
    #[cfg_attr(feature = "clap", arg(long, value_name = "WxH", help_heading = "Film"))]
    #[serde(with = "size_as_text", skip_serializing_if = "Option::is_none")]
    pub size: Option<Size>,
    /// Display aspect ratio, 4:3 or 16:9, or "square" for square pixels [default: square; the nearer of 4:3 and 16:9
    /// for .vob]
    #[cfg_attr(feature = "clap", arg(long, value_name = "SHAPE", help_heading = "Film", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aspect: Option<PictureAspect>,
    /// MPEG-2 quantiser_scale, 1 (best) to 112 (smallest); twice ffmpeg's -q:v [default: 8]
    #[cfg_attr(feature = "clap", arg(long, value_name = "Q", help_heading = "Quality"))]
    pub qscale: Option<u32>,
    /// Adaptive quantisation [default: off]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "BY", help_heading = "Encoder", hide_short_help = true)
    )]
    pub aq: Option<AdaptiveQuantiser>,
    /// Distance from one I picture to the next, at most 132 pictures [default: 15]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Encoder", hide_short_help = true))]
    pub gop: Option<u32>,
    /// Maximum bit rate in bits per second, such as 1500k or 2M; overrides --qscale where the rate would exceed it
    /// [default: no limit]
    #[cfg_attr(feature = "clap", arg(long, value_name = "R", help_heading = "Encoder", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bitrate: Option<BitRate>,
    /// Constant bit rate, at --bitrate
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Encoder", hide_short_help = true))]
    pub cbr: bool,
    /// Maximum number of consecutive B pictures, 0 to 7: fewer bits, but coding waits for later frames [default: 0]
    #[cfg_attr(feature = "clap", arg(long, value_name = "M", help_heading = "Encoder", hide_short_help = true))]
    pub bframes: Option<u32>,
    /// Encoder effort: time against bits [default: balanced]
    #[cfg_attr(feature = "clap", arg(long, value_parser = super::values::effort(), help_heading = "Encoder", hide_short_help = true))]
    pub effort: Option<Effort>,
    /// Write MPEG-1, for players without MPEG-2
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Encoder", hide_short_help = true))]
    pub mpeg1: bool,
    /// Permitted error of a pixel: "codec", from the encoder's measured error; "perceptual", from the masking model;
    /// or "fixed:SHARE" of its luminance [default: codec]
    #[cfg_attr(feature = "clap", arg(long, value_name = "KIND", help_heading = "Research", hide_short_help = true))]
    pub thresholds: Option<Thresholds>,
    /// Multiplier on the permitted error beyond 2 %: smaller is finer, 1 is the paper's [default: 1; 0.25 with
    /// "perceptual"]
    #[cfg_attr(feature = "clap", arg(long, value_name = "K", help_heading = "Research", hide_short_help = true))]
    pub kappa: Option<f32>,
    /// Stopping rule of lightcuts [default: bound]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "WHEN", help_heading = "Research", hide_short_help = true)
    )]
    pub stopping: Option<Stopping>,
    /// Fraction of pixels that calibrated stopping keeps within their thresholds, 0.5 to 0.999 [default: 0.95]
    #[cfg_attr(feature = "clap", arg(long, value_name = "SHARE", help_heading = "Research", hide_short_help = true))]
    pub within: Option<f64>,
    /// Pixels shaded in each frame: all, or only pixels that the previous frame does not predict within their
    /// thresholds [default: adaptive]
    #[cfg_attr(feature = "clap", arg(long, value_enum, help_heading = "Research", hide_short_help = true))]
    pub shading: Option<PixelShading>,
    /// Importance maps: more samples, finer thresholds and finer quantisers where viewers look. "saliency:W" detects
    /// conspicuous regions, "task:W" marks the nodes named in the scene's TOML file, "edges:W" marks outlines and
    /// textures, and "cost:W" regions that took much work in the previous frame. "map:W:FOLDER" reads gray .png or .exr
    /// files, one for each frame or one for all. Join maps with commas [default: uniform]
    #[cfg_attr(feature = "clap", arg(long, value_name = "MAPS", help_heading = "Research", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub importance: Option<Importance>,
    /// Factor by which importance makes thresholds finer or coarser at most, 1 to 8 [default: 2]
    #[cfg_attr(feature = "clap", arg(long, value_name = "G", help_heading = "Research", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub importance_gain: Option<f32>,
    /// Let each rank shade tiles on request: "rays" or "time" to balance them, then the exchange of cache records,
    /// "none", "central:N" or "each:N" [default: ranks divide all work evenly]
    #[cfg_attr(feature = "clap", arg(long, value_name = "HOW", help_heading = "Research", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<TileSettings>,
    /// SampleCount per pixel: "auto" has 1, and 4 or 8 where light changes within a pixel; N has N everywhere, or at most N
    /// with --importance [default: auto; 5 with --importance, 1 with --tiles or --antialiasing off]
    #[cfg_attr(feature = "clap", arg(long, value_name = "auto|N", help_heading = "Quality"))]
    pub samples: Option<SampleCount>,
    /// Blend the surfaces that meet in a pixel at outlines; --samples above 1 blends everywhere [default: on]
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
    /// Maximum number of reflections [default: no limit]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality", hide_short_help = true))]
    pub bounces: Option<u32>,
    /// Method for indirect light [default: lightcuts]
    #[cfg_attr(feature = "clap", arg(long, value_enum, help_heading = "Quality", hide_short_help = true))]
    pub lighting: Option<Lighting>,
    /// Light from `render2mpeg bake`, for --lighting baked [default: the scene's path with .slf]
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE.slf", hide = !cfg!(feature = "bake"), help_heading = "Quality", hide_short_help = true))]
    pub baked: Option<PathBuf>,
    /// Interpolate indirect light between cached records; off: one lightcut per pixel [default: on]
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
    /// Restore the short-range light lost to softened virtual lights [default: on]
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
    /// Number of anchor lights, the sources of indirect light [default: 4000 for a box, up to 40000 for a building]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality", hide_short_help = true))]
    pub vpls: Option<usize>,
    /// Photons per frame [default: 36, 18 or 9 per anchor light, for quantisers below 4, below 16 and above; at least 100000 in a studio]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", help_heading = "Quality", hide_short_help = true))]
    #[serde(serialize_with = "integer")]
    pub photons: Option<u64>,
    /// Random seed of photons and light tree [default: 1]
    #[cfg_attr(feature = "clap", arg(long, value_name = "S", help_heading = "Research", hide_short_help = true))]
    #[serde(serialize_with = "integer")]
    pub seed: Option<u64>,
    /// Run every stage for every frame, even if unneeded; the bits are the same
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Research", hide_short_help = true))]
    pub run_everything: bool,
    /// Withhold the renderer's motion vectors from the encoder, which searches instead
    #[cfg_attr(feature = "clap", arg(long, help_heading = "Research", hide_short_help = true))]
    pub no_motion: bool,
    /// Video file: .mpg, .mp4, .mkv, .ts, .vob, or .m2v without timestamps; - is standard output [default: the
    /// scene's name with .mpg, in the current folder; with _A-B.m2v for a --range]
    #[cfg_attr(feature = "clap", arg(short, long, value_name = "FILE", help_heading = "Output"))]
    pub output: Option<PathBuf>,
    /// Also write every frame into this folder as PNG, tone mapped as in the film
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR", hide = !cfg!(feature = "still"), help_heading = "Output", hide_short_help = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub png: Option<PathBuf>,
    /// Also write every frame into this folder as linear OpenEXR
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR", hide = !cfg!(feature = "exr"), help_heading = "Output", hide_short_help = true))]
    pub exr: Option<PathBuf>,
    /// Bit depth of colors in OpenEXR files [default: half]
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_name = "BITS", hide = !cfg!(feature = "exr"), help_heading = "Output", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exr_depth: Option<ExrDepth>,
    /// Additional named layers of the OpenEXR files: a list such as albedo,normal,depth
    #[cfg_attr(
        feature = "clap",
        arg(long, value_enum, value_delimiter = ',', value_name = "LIST", hide = !cfg!(feature = "exr"), help_heading = "Output", hide_short_help = true)
    )]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub aov: Vec<Aov>,
    /// Also write the uncompressed frames as YUV4MPEG2
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE", help_heading = "Output", hide_short_help = true))]
    pub y4m: Option<PathBuf>,
}

/// Serializes numbers above 2⁶³−1 as strings, because TOML integers are signed 64-bit numbers.
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
        // Check that filled-in options survive writing and reading, and that filling them in again changes nothing.
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

    /// Checks that the renderer's own defaults, for callers without options, equal the film's defaults.
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
