//! Transcoding of a finished film for common players: ffmpeg codes the decoded pictures again.
//!
//! If installed, ffmpeg runs as a separate program. This crate does not contain ffmpeg code.

use crate::error::{Error, Result};
use crate::settings::Settings;
use pipeline::output::part_of;
use renderer::settings::Size;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// ffmpeg encoder and its options.
#[derive(Debug)]
struct Encoder {
    /// Name of the encoder in ffmpeg.
    name: &'static str,
    /// File ending, which is also ffmpeg's name of the container.
    ending: &'static str,
    options: &'static [&'static str],
    /// Pixel format in ffmpeg.
    pixels: &'static str,
    /// Last filter, empty for none.
    filter: &'static str,
    /// Minimum width and height \[pixels\].
    least: usize,
    /// Whether width and height must be even.
    is_even: bool,
}

/// Encoders in order of preference. The quality of each is slightly above its visually lossless level, so that only the
/// film's own losses are visible.
const ENCODERS: [Encoder; 6] = [
    Encoder {
        name: "libx264",
        ending: "mp4",
        options: &["-preset", "slow", "-crf", "16", "-movflags", "+faststart"],
        pixels: "yuv420p",
        filter: "",
        least: 2,
        is_even: true,
    },
    Encoder {
        name: "libsvtav1",
        ending: "webm",
        options: &["-preset", "6", "-crf", "24"],
        pixels: "yuv420p",
        filter: "",
        least: 64,
        is_even: true,
    },
    Encoder {
        name: "libvpx-vp9",
        ending: "webm",
        options: &["-crf", "20", "-b:v", "0", "-row-mt", "1"],
        pixels: "yuv420p",
        filter: "",
        least: 1,
        is_even: false,
    },
    // ProRes 422 HQ, for editing.
    Encoder {
        name: "prores_ks",
        ending: "mov",
        options: &["-profile:v", "hq", "-vendor", "apl0"],
        pixels: "yuv422p10le",
        filter: "",
        least: 2,
        is_even: true,
    },
    // Loops for pages. WebP has another matrix than the film, so its encoder receives RGB.
    Encoder {
        name: "libwebp_anim",
        ending: "webp",
        options: &["-quality", "90", "-loop", "0"],
        pixels: "bgra",
        filter: "",
        least: 1,
        is_even: false,
    },
    // Browsers show pictures of less than 0.02 s for 0.1 s. The palette favors moving areas.
    Encoder {
        name: "gif",
        ending: "gif",
        options: &["-loop", "0"],
        pixels: "pal8",
        filter: "fps=fps='min(source_fps,50)',split[film][colors];[colors]palettegen=stats_mode=diff[palette];\
                 [film][palette]paletteuse=dither=sierra2_4a",
        least: 1,
        is_even: false,
    },
];
/// File endings of [`ENCODERS`], as listed in messages.
const ENDINGS: &str = ".mp4, .webm, .mov, .webp or .gif";
/// Color properties of films, set explicitly because encoders do not always copy them.
const COLOR: [&str; 8] =
    ["-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709", "-color_range", "tv"];

impl Encoder {
    /// Returns whether the file contains luma and chroma, and not RGB.
    fn has_luma(&self) -> bool {
        self.pixels.starts_with("yuv")
    }
}

/// Additional file, transcoded from a finished film.
#[derive(Debug)]
pub struct Companion {
    path: PathBuf,
    encoder: &'static Encoder,
    size: Size,
    /// Whether the film is MPEG-1, which does not signal a matrix and uses BT.601.
    is_mpeg1: bool,
}

impl Companion {
    /// Finds ffmpeg and the encoder for the ending of `path`. Call this function before the film is made.
    ///
    /// # Errors
    /// If the ending is unknown, ffmpeg is not installed, or it was built without the encoder.
    pub fn new(path: &Path, settings: &Settings) -> Result<Self> {
        // Reject unknown endings before ffmpeg is started.
        let size = settings.render.size;
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        let wanted: Vec<&Encoder> = ENCODERS.iter().filter(|encoder| encoder.ending == ending).collect();
        if wanted.is_empty() {
            let name = path.display();
            return Err(Error::Options(format!("--also {name}: unknown format; name it {ENDINGS}")));
        }

        // Choose the first encoder that supports the size and is built into the installed ffmpeg.
        let known = encoders_of_ffmpeg(path)?;
        let fits = |encoder: &&Encoder| size.width.min(size.height) >= encoder.least;
        let is_known =
            |encoder: &&Encoder| known.lines().any(|line| line.split_whitespace().nth(1) == Some(encoder.name));
        match wanted.iter().copied().filter(fits).find(is_known) {
            Some(encoder) => Ok(Self { path: path.into(), encoder, size, is_mpeg1: settings.coding.mpeg1 }),
            None => {
                let names = wanted.iter().map(|encoder| encoder.name).collect::<Vec<_>>().join(" or ");
                Err(Error::content(
                    path,
                    format!(
                        ": needs {names}, which the installed ffmpeg lacks; install another ffmpeg, or drop --also"
                    ),
                ))
            }
        }
    }

    /// Returns the name of the encoder.
    #[must_use]
    pub fn encoder(&self) -> &'static str {
        self.encoder.name
    }

    /// Returns the path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Decodes the `film` and codes its pictures again. The new file is renamed to its final name when complete.
    ///
    /// # Errors
    /// If ffmpeg fails; the message ends with ffmpeg's last line.
    pub fn make(&self, film: &Path) -> Result<()> {
        let Self { path, encoder, size, is_mpeg1 } = self;
        let part = part_of(path);
        // Prefix paths with `file:`, because they may begin with a dash or look like a URL.
        let file = |path: &Path| {
            let mut address = std::ffi::OsString::from("file:");
            address.push(path);
            address
        };

        // Write one video stream, in the pixel format of the encoder.
        let mut command = Command::new("ffmpeg");
        command.args(["-nostdin", "-v", "error", "-y", "-i"]).arg(file(film));
        command.args(["-map", "0:v:0", "-pix_fmt", encoder.pixels, "-c:v", encoder.name]);
        command.args(encoder.options);
        if encoder.has_luma() {
            command.args(COLOR);
        }

        // Crop sides that are multiples of 4096: the film's header cannot code them, so they are coded one sample
        // larger.
        let is_longer = size.width.is_multiple_of(4096) || size.height.is_multiple_of(4096);
        let shown = |side: usize| if encoder.is_even { side / 2 * 2 } else { side };
        let (width, height) = (shown(size.width), shown(size.height));
        let mut filters = Vec::new();
        if is_longer || (width, height) != (size.width, size.height) {
            filters.push(format!("crop={width}:{height}:0:0"));
        }
        // Convert the matrix of MPEG-1, because the new file is labeled BT.709.
        if *is_mpeg1 && encoder.has_luma() {
            filters.push("scale=in_color_matrix=bt601:out_color_matrix=bt709".into());
        }
        if !encoder.filter.is_empty() {
            filters.push(encoder.filter.into());
        }
        if !filters.is_empty() {
            command.arg("-vf").arg(filters.join(","));
        }
        command.args(["-f", encoder.ending]).arg(file(&part));

        // Rename the file only if ffmpeg succeeds.
        let output =
            command.stdin(Stdio::null()).output().map_err(Error::file(path, "cannot be made: ffmpeg did not start"))?;
        if !output.status.success() {
            let _ = fs::remove_file(&part);
            let text = String::from_utf8_lossy(&output.stderr);
            let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("unknown reason");
            return Err(Error::content(path, format!(" cannot be made: ffmpeg: {}", last.trim())));
        }
        fs::rename(&part, path).map_err(Error::file(path, "cannot be completed"))
    }
}

/// Returns ffmpeg's list of encoders.
fn encoders_of_ffmpeg(path: &Path) -> Result<String> {
    let output = Command::new("ffmpeg").args(["-v", "error", "-encoders"]).stdin(Stdio::null()).output();
    let output =
        output.map_err(Error::file(path, "needs ffmpeg, which is not installed; install it, or drop --also"))?;
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
