//! Measurement of an encoded film against the reference, frame by frame, as a [`MethodRun`].

use super::coded::{CodedFrame, Coder, DecoderCheck};
use super::figures::{Maps, MethodRun, RunPictures, label, mean_of, mean_seconds};
use super::film::{Film, FilmFrame};
use super::histogram::Ratios;
use super::method::Method;
use crate::compare::{Comparison, Picture, measure};
use crate::page::PageStream;
use perceptual::{ColorMatrix, YCbCr, flicker, luminance, to_rgb8};
use plane::{Correspondence, NO_MATCH, Plane};
use render2mpeg::error::{Error, Result};
use render2mpeg::settings::Settings;
use renderer::settings::Thresholds;
use std::path::Path;

/// Results of a film at one quantiser.
pub struct Measured {
    /// Figures of the run.
    pub run: MethodRun,
    /// Pictures of the last frame.
    pub pictures: RunPictures,
    /// Stream of the film, for the page.
    pub stream: PageStream,
    /// Result of the check by another decoder, if requested.
    pub check: Option<DecoderCheck>,
}

/// Optional results of a measurement.
pub struct Wanted<'a> {
    /// Maximum length of the stream to keep \[bytes\].
    pub stream_max: usize,
    /// Folder for temporary files of another decoder; `None` for no check.
    pub check_below: Option<&'a Path>,
}

/// Encodes `film` at quantiser_scale `qscale`, and compares the result with `reference`.
///
/// # Errors
/// If frames cannot be read, the stream differs from the run's stream, or another decoder's pictures differ.
pub fn measured(method: &Method, qscale: u32, film: &Film, reference: &Film, wanted: &Wanted<'_>) -> Result<Measured> {
    let mut coder = Coder::new(film, qscale)?;
    let mut of_reference = Coder::new(reference, qscale)?;
    let mut flicker = Flicker::default();
    wanted.check_below.map(|folder| coder.check_below(folder)).transpose()?;
    let count = film.reports.len();
    // Code the first frame, but count it only if it is the only frame, because it has no thresholds.
    let uncounted = usize::from(count > 1);
    let lightcuts = film.stream.is_some();
    let (mut sums, mut last) = (FrameSums::new(film, count - uncounted), None);
    let mut stream = PageStream::new(wanted.stream_max);

    // Read film and reference in parallel, frame by frame.
    for (n, (frame, truth)) in film.frames()?.zip(reference.frames()?).enumerate() {
        let (frame, truth) = (frame?, truth?);
        let coded = coder.push(&frame)?;
        flicker.add(&frame, &coded.decoded, &of_reference.push(&truth)?.decoded);
        stream.push(&coded.unit);
        if n >= uncounted {
            sums.add(&frame, &truth, &coded);
        }
        // Keep the decoded picture and the maps of the last frame only.
        if n + 1 == count {
            let maps = lightcuts.then(|| maps_of(&film.settings, &frame, &truth));
            last = Some(RunPictures { method: method.name, qscale, decoded: to_rgb8(&coded.decoded), maps });
        }
    }
    if last.is_none() {
        return Err(Error::fault("a film without frames: this is a bug"));
    }
    let run = MethodRun { flicker: flicker.mean(), ..sums.into_run(method, qscale, film) };
    Ok(Measured { run, pictures: last.expect("checked"), stream, check: coder.finish()? })
}

/// Additional change between frames of a decoded film, compared with the decoded reference.
#[derive(Default)]
struct Flicker {
    /// Luma of the previous frame: film and reference.
    before: Option<[Plane<u8>; 2]>,
    squares: f64,
    frames: u32,
}

impl Flicker {
    fn add(&mut self, frame: &FilmFrame, decoded: &plane::Picture, reference: &plane::Picture) {
        let now = [decoded.luma().clone(), reference.luma().clone()];
        if let (Some(before), Some(known)) = (&self.before, &frame.known) {
            // Round motion to whole pixels, and discard matches outside the picture.
            let (width, height) = (known.width(), known.height());
            let matches = Plane::from_fn(width, height, |x, y| {
                let Some([dx, dy]) = known.motion_of(x, y) else { return NO_MATCH };
                let (from_x, from_y) = ((x as f32 + dx).round(), (y as f32 + dy).round());
                let inside = from_x >= 0.0 && from_y >= 0.0 && from_x < width as f32 && from_y < height as f32;
                if inside { (from_y as usize * width + from_x as usize) as u32 } else { NO_MATCH }
            });
            self.squares +=
                flicker([&now[0], &before[0]], [&now[1], &before[1]], &Correspondence::from_matches(matches));
            self.frames += 1;
        }
        self.before = Some(now);
    }

    /// Returns the root mean square \[code values\].
    fn mean(&self) -> f64 {
        (self.squares / f64::from(self.frames.max(1))).sqrt()
    }
}

/// Sums over the counted frames.
struct FrameSums {
    exposure: f32,
    rendered: Vec<Comparison>,
    decoded: Vec<Comparison>,
    bits: u64,
    seconds: f64,
    ratios: Option<Ratios>,
}

impl FrameSums {
    fn new(film: &Film, frames: usize) -> Self {
        let ratios = film.stream.is_some().then(|| Ratios::of(film, frames));
        let exposure = film.settings.render.tone_map.exposure;
        Self { exposure, rendered: Vec::new(), decoded: Vec::new(), bits: 0, seconds: 0.0, ratios }
    }

    fn add(&mut self, frame: &FilmFrame, truth: &FilmFrame, coded: &CodedFrame) {
        let linear = |frame: &FilmFrame| {
            Picture::Linear { radiance: frame.radiance.clone(), variance: None }.view(self.exposure)
        };
        // Measure linear light before exposure, and luma as passed to the encoder, so that the display exposure does
        // not affect these figures.
        let mut rendered = measure(&linear(frame), &linear(truth));
        rendered.psnr_y = Some(perceptual::psnr(frame.picture.luma(), truth.picture.luma())).filter(|p| p.is_finite());
        rendered.ssim = perceptual::ssim(frame.picture.luma(), truth.picture.luma());
        self.rendered.push(rendered);
        // Compare the decoded picture with the uncompressed reference.
        let video = |frame: &plane::Picture| Picture::Video(frame.clone(), ColorMatrix::Bt709).view(1.0);
        self.decoded.push(measure(&video(&coded.decoded), &video(&truth.picture)));
        self.bits += coded.bits;
        self.seconds += coded.seconds;
        self.ratios.iter_mut().for_each(|ratios| ratios.add(frame, truth));
    }

    fn into_run(self, method: &Method, qscale: u32, film: &Film) -> MethodRun {
        let count = self.decoded.len().max(1) as f64;
        // Use the encoding time at this quantiser, since the film may have been encoded with another.
        let mut seconds = mean_seconds(&film.reports);
        seconds.encode = self.seconds / count;
        seconds.add_up();
        // Report κ only if the thresholds depend on masking.
        let lightcuts = film.stream.is_some();
        let steered_by_masking = lightcuts && !matches!(film.settings.render.thresholds, Thresholds::Fixed(_));
        MethodRun {
            method: method.name,
            label: label(method, &film.settings),
            qscale,
            cache: method.cache,
            lightcuts,
            kappa: steered_by_masking.then_some(film.settings.render.kappa),
            seconds,
            threshold_mean_relative: mean_of(&film.reports, |frame| frame.figures.threshold_mean_relative),
            tree_swaps_share: mean_of(&film.reports, |frame| frame.figures.tree_swaps_share),
            cut_size_mean: mean_of(&film.reports, |frame| frame.figures.cut_size_mean),
            shadow_rays: mean_of(&film.reports, |frame| frame.figures.shadow_rays as f64),
            bits: self.bits as f64 / count,
            rendered: Comparison::mean(&self.rendered),
            decoded: Comparison::mean(&self.decoded),
            flicker: 0.0,
            error_by_threshold: self.ratios.map(Ratios::histogram),
            against_baseline: None,
        }
    }
}

/// Returns thresholds and cut sizes of `frame`, and the luma difference from the reference.
fn maps_of(settings: &Settings, frame: &FilmFrame, truth: &FilmFrame) -> Maps {
    let share = settings.render.thresholds.share_elsewhere();
    // Use the fixed fraction for pixels without a threshold.
    let relative = |x, y| {
        let (threshold, light) = (frame.thresholds.get(x, y), luminance(frame.radiance.get(x, y)));
        if threshold > 0.0 && light > 0.0 { threshold / light } else { share }
    };
    let (width, height) = (frame.radiance.width(), frame.radiance.height());
    // Compare luma in floating point, before rounding to code values.
    let luma = |frame: &FilmFrame| YCbCr::from_radiance(&frame.radiance, &settings.render.tone_map).luma;
    let (own, other) = (luma(frame), luma(truth));
    Maps {
        relative_threshold: Plane::from_fn(width, height, relative),
        cut_size: frame.cut_sizes.clone(),
        error: Plane::from_fn(width, height, |x, y| (own.get(x, y) - other.get(x, y)).abs()),
    }
}
