//! Radiance into what a display shows: tone curve and Y′C_BC_R. Here light changes its unit to code values.

use crate::checkpoint::{Checkpoints, Part};
use crate::error::{Error, Result};
use crate::message::{Displayed, Shaded, ToMask};
use crate::observe::Observer;
use crate::output::Output;
use crate::plan::{Plan, Stage};
use crate::settings::Settings;
use crossbeam_channel::{Receiver, Sender};
use perceptual::{ToneMap, YCbCr, luminance_plane};
use plane::{Picture, Plane};
use render_core::Busy;
use std::path::Path;
use std::sync::Arc;

/// Names of channels, and their samples in raster order.
type Layers = Vec<(String, Vec<f32>)>;

/// Luminance that the middle of a picture is brought to when nobody said how bright it should be: photography's grey card.
const MIDDLE_GREY: f64 = 0.18;

/// Tone maps frame after frame, for the encoder and, with masking on, for the masking model.
///
/// # Errors
/// A file for linear or uncompressed frames cannot be written.
pub fn run(
    settings: &Settings,
    plan: &Plan,
    checkpoints: &Checkpoints,
    observer: &dyn Observer,
    frames: &Receiver<Shaded>,
    to_encode: &Sender<Displayed>,
    to_mask: &Sender<ToMask>,
) -> Result<()> {
    let mut tone_map = settings.tone_map;
    let pool = super::pool_of_one()?;
    let known = known(checkpoints)?;
    if let Some((exposure, _)) = known {
        tone_map = tone_map.with_exposure(exposure);
    }
    let mut uncompressed = match (&settings.y4m, known) {
        (Some(path), Some((_, Some(length)))) => Some(Y4m(Output::resume(path, length)?)),
        (Some(path), _) => Some(Y4m::create(path, settings)?),
        (None, _) => None,
    };
    let mut last = None;
    for Shaded { frame, checkpoint, radiance, layers, correspondence, forward, mut figures } in frames {
        let span = tracing::debug_span!("display", frame).entered();
        let busy = Busy::default();
        let (luminance, picture) = pool.install(|| {
            busy.measure(|| {
                let luminance = luminance_plane(&radiance);
                if settings.auto_exposure && frame == 0 {
                    tone_map = tone_map.with_exposure(exposure_for(&luminance));
                }
                (luminance, Arc::new(YCbCr::from_radiance(&radiance, &tone_map)))
            })
        });
        observer.picture(frame, &picture);
        figures.non_finite = picture.non_finite;
        figures.tone_map = busy.seconds();
        if let Some(folder) = &settings.exr {
            write_linear(&folder.join(format!("frame_{frame:05}.exr")), &radiance, layers)?;
        }
        if let Some(file) = &mut uncompressed {
            file.write(&picture.picture)?;
        }
        if checkpoint {
            leave(checkpoints, frame, &tone_map, uncompressed.as_ref())?;
        }
        last = Some(frame);
        drop(span);
        if plan.is_on(Stage::Masking) {
            let (picture, correspondence) = (picture.clone(), correspondence.clone());
            let message = ToMask { frame, checkpoint, picture, luminance, tone_map, correspondence };
            if to_mask.send(message).is_err() {
                return Ok(());
            }
        }
        if to_encode.send(Displayed { frame, checkpoint, picture, correspondence, forward, figures }).is_err() {
            return Ok(());
        }
    }
    if let Some(frame) = last.filter(|&frame| checkpoints.ends_behind(frame)) {
        leave(checkpoints, frame, &tone_map, uncompressed.as_ref())?;
    }
    if let Some(file) = uncompressed {
        file.finish()?;
    }
    Ok(())
}

/// What [`leave`] has left.
pub(super) fn known(checkpoints: &Checkpoints) -> Result<Option<(f32, Option<u64>)>> {
    checkpoints.part(Part::Display)
}

/// What is carried behind `frame`: the exposure, and how much of the uncompressed film there is.
fn leave(checkpoints: &Checkpoints, frame: u32, tone_map: &ToneMap, uncompressed: Option<&Y4m>) -> Result<()> {
    uncompressed.map_or(Ok(()), |file| file.0.sync())?;
    checkpoints.leave(frame, Part::Display, &(tone_map.exposure, uncompressed.map(|file| file.0.len())))
}

/// A frame as linear light, with further layers.
#[cfg(feature = "exr")]
fn write_linear(path: &Path, radiance: &Plane<[f32; 3]>, layers: Layers) -> Result<()> {
    let channel = |c: usize| radiance.samples().iter().map(|rgb| rgb[c]).collect();
    let colors = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| (name.to_owned(), channel(c)));
    let channels = colors.chain(layers).collect();
    let written = render_core::image_file::write_layers(path, radiance.width(), radiance.height(), channels);
    written.map_err(Error::other)
}

/// Settings ask for none of these.
#[cfg(not(feature = "exr"))]
fn write_linear(path: &Path, _: &Plane<[f32; 3]>, _: Layers) -> Result<()> {
    Err(Error::content(path, ": this build writes no OpenEXR; build it with the feature exr"))
}

/// Brings the geometric mean of the lit pixels' luminance to middle grey.
pub(crate) fn exposure_for(luminance: &Plane<f32>) -> f32 {
    let logs: Vec<f64> = luminance.samples().iter().filter(|&&y| y > 0.0).map(|&y| f64::from(y).ln()).collect();
    if logs.is_empty() {
        return 1.0;
    }
    let mean = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
    ((MIDDLE_GREY / mean) as f32).clamp(1e-20, 1e20)
}

/// Uncompressed frames in a YUV4MPEG2 file, chroma sited as MPEG-2 has it.
pub(crate) struct Y4m(Output);

impl Y4m {
    pub(crate) fn create(path: &Path, settings: &Settings) -> Result<Self> {
        let mut output = Output::create(path)?;
        let (numerator, denominator) = mpeg2enc::FrameRate::from_fps(settings.fps)?.fraction();
        let (width, height) = (settings.size.width, settings.size.height);
        let header = format!("YUV4MPEG2 W{width} H{height} F{numerator}:{denominator} Ip A1:1 C420mpeg2\n");
        output.write(header.as_bytes())?;
        Ok(Self(output))
    }

    pub(crate) fn write(&mut self, picture: &Picture) -> Result<()> {
        let planes = picture.planes().map(|plane| plane.samples());
        self.0.write(&[b"FRAME\n", planes[0], planes[1], planes[2]].concat())
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.0.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_brings_the_middle_to_grey() {
        let picture = Plane::from_fn(4, 1, |x, _| [0.0, 10.0, 1000.0, 100.0][x]);
        assert!((exposure_for(&picture) - 0.0018).abs() < 1e-6);
        assert_eq!(exposure_for(&Plane::filled(2, 2, 0.0)), 1.0);
    }
}
