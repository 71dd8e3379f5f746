//! Display stage: converts radiance to Y′C_BC_R code values with the film's tone curve.

use super::linear::write_linear;
use crate::picture_file::{shown, write_shown};
use crate::settings::{CodedRate, ExrDepth, Settings};
use perceptual::{ColorMatrix, ToneMap, YCbCr, luminance_plane};
use pipeline::error::Result;
use pipeline::exposure::exposure_for;
use pipeline::output::{Output, Written};
use pipeline::stage::{Displayed, Shaded};
use pipeline::state::{decode, encode};
use plane::Picture;
use renderer::settings::Size;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Tone curve of a film, and output files of uncompressed frames.
#[derive(Debug)]
pub struct Display {
    tone_map: ToneMap,
    /// Whether the first frame sets the exposure.
    auto_exposure: bool,
    /// Color matrix of the film.
    matrix: ColorMatrix,
    /// Folder for frames as PNG files; `None` for no files.
    png: Option<PathBuf>,
    /// Folder for frames as linear OpenEXR files; `None` for no files.
    exr: Option<PathBuf>,
    exr_depth: ExrDepth,
    y4m: Option<Y4m>,
}

impl Display {
    /// Returns a display stage with `tone_map` that writes no files.
    #[must_use]
    pub fn new(tone_map: ToneMap) -> Self {
        let (matrix, exr_depth) = (ColorMatrix::default(), ExrDepth::default());
        Self { tone_map, auto_exposure: false, matrix, png: None, exr: None, exr_depth, y4m: None }
    }

    /// Returns a display stage with the tone curve and files of `settings`.
    ///
    /// # Errors
    /// If the standard does not support the frame rate.
    pub fn of(settings: &Settings) -> crate::Result<Self> {
        let y4m = settings.files.y4m.as_deref().map(|path| Y4m::new(path, settings)).transpose()?;
        // Independent chunks share one exposure, which `set_exposure` sets before the first frame.
        let auto_exposure = settings.render.auto_exposure && !settings.is_in_chunks();
        let (png, exr) = (settings.files.png.clone(), settings.files.exr.clone());
        let exr_depth = settings.files.exr_depth.unwrap_or_default();
        let matrix = settings.matrix();
        Ok(Self { auto_exposure, matrix, png, exr, exr_depth, y4m, ..Self::new(settings.render.tone_map) })
    }

    /// Sets a constant exposure, the factor on radiance.
    pub(crate) fn set_exposure(&mut self, exposure: f32) {
        self.auto_exposure = false;
        self.tone_map = self.tone_map.with_exposure(exposure);
    }
}

impl pipeline::stage::Display for Display {
    fn begin(&mut self, kept: &Arc<AtomicBool>) -> Result<()> {
        self.y4m.as_mut().map_or(Ok(()), |file| file.begin(kept.clone()))
    }

    fn show(&mut self, index: u32, shaded: &Shaded) -> Displayed {
        // Keep the exposure of the first frame, because a changing exposure would flicker.
        if self.auto_exposure && index == 0 {
            self.tone_map = self.tone_map.with_exposure(exposure_for(&luminance_plane(&shaded.radiance)));
        }
        let tone_map = self.tone_map;
        let radiance = shaded.blended(&tone_map);
        let luminance = luminance_plane(&radiance);
        let picture = Arc::new(YCbCr::with_matrix(&radiance, &tone_map, self.matrix));
        let (luminance, importance) = (Arc::new(luminance), shaded.importance.clone());
        Displayed { index, picture, luminance, tone_map, importance, correspondence: None, forward: None }
    }

    fn write(&mut self, index: u32, shaded: Shaded, picture: &YCbCr) -> Result<()> {
        // Encode PNG files from linear light, because Y′C_BC_R would lose chroma resolution.
        if let Some(folder) = &self.png {
            let shown = shown(&shaded.blended(&self.tone_map), &self.tone_map);
            write_shown(&folder.join(format!("frame_{index:05}.png")), &shown)?;
        }
        if let Some(file) = &mut self.y4m {
            // Readers of YUV4MPEG2 assume BT.601, so convert films with another matrix.
            match file.matrix == self.matrix {
                true => file.write(&picture.picture)?,
                false => {
                    let radiance = shaded.blended(&self.tone_map);
                    file.write(&YCbCr::with_matrix(&radiance, &self.tone_map, file.matrix).picture)?;
                }
            }
        }
        // Write OpenEXR files last, because they consume the channels.
        if let Some(folder) = &self.exr {
            let path = folder.join(format!("frame_{index:05}.exr"));
            write_linear(&path, &shaded.header, &shaded.radiance, shaded.channels, self.exr_depth)?;
        }
        Ok(())
    }

    fn state(&self) -> Result<Vec<u8>> {
        let written = self.y4m.as_ref().map(Y4m::sync).transpose()?;
        Ok(encode(&(self.tone_map.exposure, written)))
    }

    fn restore(&mut self, state: &[u8], kept: &Arc<AtomicBool>) -> Result<()> {
        let (exposure, written): (f32, Option<Written>) = decode(state)?;
        self.tone_map = self.tone_map.with_exposure(exposure);
        match (&mut self.y4m, written) {
            (Some(file), Some(written)) => file.resume(written, kept.clone()),
            (Some(file), None) => file.begin(kept.clone()),
            (None, _) => Ok(()),
        }
    }

    fn finish(self) -> Result<()> {
        self.y4m.map_or(Ok(()), Y4m::finish)
    }
}

/// Uncompressed frames in a YUV4MPEG2 file, with MPEG-2's chroma siting. The format does not signal a matrix, and
/// readers assume BT.601.
#[derive(Debug)]
pub struct Y4m {
    path: PathBuf,
    header: String,
    matrix: ColorMatrix,
    output: Option<Output>,
}

impl Y4m {
    fn new(path: &Path, settings: &Settings) -> crate::Result<Self> {
        let (numerator, denominator) = CodedRate::of(settings.render.fps)?.frames();
        let [wide, high] = settings.aspect.pixel(settings.render.size);
        let Size { width, height } = settings.render.size;
        // Describe the size, rate, pixel shape and chroma siting in the header.
        let header = format!("YUV4MPEG2 W{width} H{height} F{numerator}:{denominator} Ip A{wide}:{high} C420mpeg2\n");
        let matrix = if settings.files.y4m_is_coded { settings.matrix() } else { ColorMatrix::Bt601 };
        Ok(Self { path: path.into(), header, matrix, output: None })
    }

    /// Creates a file at `path` for a film with `settings`.
    ///
    /// # Errors
    /// If the file cannot be written, or the standard does not support the frame rate.
    pub fn create(path: &Path, settings: &Settings) -> crate::Result<Self> {
        let mut file = Self::new(path, settings)?;
        file.begin(Arc::default())?;
        Ok(file)
    }

    fn begin(&mut self, kept: Arc<AtomicBool>) -> Result<()> {
        let output = self.output.insert(Output::create(&self.path)?.kept_if(kept));
        output.write(self.header.as_bytes())
    }

    fn resume(&mut self, written: Written, kept: Arc<AtomicBool>) -> Result<()> {
        self.output = Some(Output::resume(&self.path, written)?.kept_if(kept));
        Ok(())
    }

    /// Writes the next frame.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&mut self, picture: &Picture) -> Result<()> {
        let Some(output) = &mut self.output else { return Ok(()) };
        let planes = picture.planes().map(|plane| plane.samples());
        output.write(&[b"FRAME\n", planes[0], planes[1], planes[2]].concat())
    }

    /// Syncs the file to the disk, and returns its length and checksum.
    fn sync(&self) -> Result<Written> {
        let Some(output) = &self.output else { return Ok(Written::default()) };
        output.sync()?;
        Ok(output.written())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If the file cannot be completed.
    pub fn finish(self) -> Result<()> {
        self.output.map_or(Ok(()), Output::finish)
    }
}
