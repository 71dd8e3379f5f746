//! The five stages of the loop as state machines: one step per frame, and a state that another process can restore.
//!
//! ```text
//! Prepare ──► Shade ──► Display ──► Encode ──► Mask
//!               ▲                               │
//!               └── ΔY(n−1), one frame late ◄───┘
//! ```
//! Stages are independent of channels, threads, checkpoints and observers, which [`couple`](crate::couple) adds.
//! Implement one of these traits for another renderer, masking model or encoder. [`perceptual::Feedback`] implements
//! [`Mask`], and [`ToneMap`] implements [`Display`].

use crate::error::Result;
use crate::figures::FrameFigures;
use perceptual::{
    ColorMatrix, Feedback, NextPicture, ObservedFrame, PixelFragment, ThresholdMap, ToneMap, YCbCr, luminance_plane,
    reproject,
};
use plane::{Coded, Correspondence, FrameHeader, Picture, PictureType, Plane};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// First half of a renderer: work that needs no thresholds. It runs one frame ahead of the other stages.
pub trait Prepare: Send {
    /// Prepared frame for [`Shade`].
    type Frame: Send;

    /// Prepares frame `index`, counted from 0; returns `None` after the last frame.
    fn step(&mut self, index: u32) -> Option<Prepared<Self::Frame>>;

    /// Computes the state that all frames of the film have in common, before the first step. Without a call, the first
    /// step does this.
    fn make_ready(&mut self) {}

    /// Returns the state after the last step, for a checkpoint.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Restores the [`state`](Prepare::state) after frame `last`, and prepares that frame again.
    ///
    /// # Errors
    /// If the state does not fit this stage.
    fn restore(&mut self, state: &[u8], last: u32) -> Result<Prepared<Self::Frame>>;
}

/// Second half of a renderer: computation of light.
pub trait Shade<F>: Send {
    /// Computes the radiance of every pixel. `thresholds` contains the permitted error of each pixel's luminance, 2 %
    /// by default.
    fn step(&mut self, prepared: &Prepared<F>, thresholds: LastThresholds<'_>) -> Shaded;

    /// Returns the state after the last step, for a checkpoint.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Restores the [`state`](Shade::state) after frame `last`.
    ///
    /// # Errors
    /// If the state does not fit this stage or frame.
    fn restore(&mut self, state: &[u8], last: &Prepared<F>) -> Result<()>;
}

/// Display: converts light into pictures, and writes files of uncompressed frames.
pub trait Display: Send {
    /// Opens the files of a new film. Files dropped while `kept` is true remain, although unfinished.
    ///
    /// # Errors
    /// If a file cannot be written.
    fn begin(&mut self, _kept: &Arc<AtomicBool>) -> Result<()> {
        Ok(())
    }

    /// Converts frame `index` into a picture, without motion: the driver adds it.
    fn show(&mut self, index: u32, shaded: &Shaded) -> Displayed;

    /// Writes the uncompressed frame, shown as `picture`, into the requested files.
    ///
    /// # Errors
    /// If a file cannot be written.
    fn write(&mut self, _index: u32, _shaded: Shaded, _picture: &YCbCr) -> Result<()> {
        Ok(())
    }

    /// Returns the state after the last step, for a checkpoint.
    ///
    /// # Errors
    /// If a file cannot be synced to the disk.
    fn state(&self) -> Result<Vec<u8>> {
        Ok(Vec::new())
    }

    /// Restores a [`state`](Display::state), and truncates the files to the lengths stored in it. Files dropped while
    /// `kept` is true remain, although unfinished.
    ///
    /// # Errors
    /// If the state belongs to another display, or a file is shorter than its stored length.
    fn restore(&mut self, state: &[u8], kept: &Arc<AtomicBool>) -> Result<()>;

    /// Completes the files.
    ///
    /// # Errors
    /// If a file cannot be completed.
    fn finish(self) -> Result<()>
    where
        Self: Sized,
    {
        Ok(())
    }
}

/// Display that applies only the tone curve, in BT.709, and writes no files.
impl Display for ToneMap {
    fn show(&mut self, index: u32, shaded: &Shaded) -> Displayed {
        let tone_map = *self;
        let radiance = shaded.blended(&tone_map);
        Displayed {
            index,
            picture: Arc::new(YCbCr::with_matrix(&radiance, &tone_map, ColorMatrix::default())),
            luminance: Arc::new(luminance_plane(&radiance)),
            tone_map,
            importance: shaded.importance.clone(),
            correspondence: None,
            forward: None,
        }
    }

    fn restore(&mut self, _state: &[u8], _kept: &Arc<AtomicBool>) -> Result<()> {
        Ok(())
    }
}

/// Masking model: computes the largest invisible error.
pub trait Mask: Send {
    /// Returns the permitted luminance error of each pixel of `displayed` \[W·m⁻²·sr⁻¹\] for the given `coding`.
    fn step(&mut self, displayed: &Displayed, coding: &Coding) -> Arc<Plane<f32>>;

    /// Returns the state after the last step, for a checkpoint. The loop itself stores the thresholds.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Restores the [`state`](Mask::state) and the thresholds of a frame.
    ///
    /// # Errors
    /// If the state does not fit this stage.
    fn restore(&mut self, state: &[u8], thresholds: &LuminanceThresholds) -> Result<()>;
}

/// Video encoder with its container.
pub trait Encode: Send {
    /// Encodes the next picture, in display order, and returns the bytes available now.
    ///
    /// # Errors
    /// If the picture cannot be coded.
    fn step(&mut self, displayed: &Displayed) -> Result<Encoded>;

    /// Encodes the waiting pictures and ends the stream.
    ///
    /// # Errors
    /// If a picture cannot be coded.
    fn finish(self) -> Result<Encoded>;

    /// Returns the bytes that would complete the file after the steps so far, without the waiting pictures. A film that
    /// is ended at once is completed with these bytes.
    fn ending(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Returns the state after the last step, for a checkpoint.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Restores the [`state`](Encode::state) of an encoder with the same settings.
    ///
    /// # Errors
    /// If the state belongs to another encoder.
    fn restore(&mut self, state: &[u8]) -> Result<()>;
}

/// Frame after all work that needs no thresholds.
#[derive(Clone, Debug, Default)]
pub struct Prepared<F> {
    /// Data of the renderer for this frame.
    pub frame: F,
    /// Position of each pixel in the previous frame; `None` for the first frame and after a shot change.
    pub correspondence: Option<Arc<Correspondence>>,
    /// Position in this frame of each pixel of the previous frame, for encoders with B pictures.
    pub forward: Option<Arc<Correspondence>>,
    /// CPU seconds and counts of preparation.
    pub figures: FrameFigures,
}

/// List of channels, each with its name and its samples in raster order.
pub type Channels = Vec<(String, Vec<f32>)>;

/// Pixel that shows several surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Index of the pixel in raster order.
    pub pixel: usize,
    /// Surfaces in the pixel, each with its fraction of the pixel's area and its radiance.
    pub parts: Vec<PixelFragment>,
}

/// Light of a frame.
#[derive(Clone, Debug, Default)]
pub struct Shaded {
    /// Linear RGB radiance of each pixel \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Pixels that show several surfaces. A display shows the mean of their tone-mapped surfaces, not of `radiance`.
    pub outlines: Vec<Outline>,
    /// Importance of each pixel, 0…1, if it steers the encoder.
    pub importance: Option<Arc<Plane<f32>>>,
    /// Additional channels for the frame's OpenEXR file.
    pub channels: Channels,
    /// Attributes for the header of the frame's OpenEXR file.
    pub header: FrameHeader,
    /// Channels for observers only; no file contains them.
    pub watched: Channels,
    /// CPU seconds and counts, including preparation.
    pub figures: FrameFigures,
}

impl Shaded {
    /// Returns the radiance that `tone_map` displays as the mean of each pixel's tone-mapped surfaces \[W·m⁻²·sr⁻¹\].
    /// Blending before the curve would let a light far above white cover thin objects in front of it.
    #[must_use]
    pub fn blended(&self, tone_map: &ToneMap) -> Cow<'_, Plane<[f32; 3]>> {
        // Copy the radiance only if a pixel shows several surfaces.
        let mut radiance = Cow::Borrowed(&self.radiance);
        for Outline { pixel, parts } in &self.outlines {
            radiance.to_mut().samples_mut()[*pixel] = tone_map.mean_shown(parts.iter().copied());
        }
        radiance
    }
}

/// Picture of a frame.
#[derive(Clone, Debug)]
pub struct Displayed {
    /// Number of the frame, from 0.
    pub index: u32,
    /// Picture as Y′C_BC_R.
    pub picture: Arc<YCbCr>,
    /// Luminance of each pixel before tone mapping \[W·m⁻²·sr⁻¹\].
    pub luminance: Arc<Plane<f32>>,
    /// Tone curve from luminance to picture.
    pub tone_map: ToneMap,
    /// Importance of each pixel, from [`Shaded`].
    pub importance: Option<Arc<Plane<f32>>>,
    /// Position of each pixel in the previous frame, from [`Prepared`].
    pub correspondence: Option<Arc<Correspondence>>,
    /// Position in this frame of each pixel of the previous frame, from [`Prepared`].
    pub forward: Option<Arc<Correspondence>>,
}

/// Result of one step of the encoder.
#[derive(Clone, Debug, Default)]
pub struct Encoded {
    /// Bytes to append to the file.
    pub bytes: Vec<u8>,
    /// Pictures coded in this step, in coding order.
    pub pictures: Vec<CodedFrame>,
    /// The same pictures without a container, for observers; empty if the encoder does not provide them.
    pub units: Vec<CodedUnit>,
    /// Coding of this step's picture, or the expected coding.
    pub coding: Coding,
}

/// Picture of an elementary stream.
#[derive(Clone, Debug)]
pub struct CodedUnit {
    /// Display position. It starts with the number of the film's first frame, times the number of pictures per frame.
    pub position: u64,
    /// Type of the picture: I, P or B.
    pub picture_type: PictureType,
    /// Coded picture with its headers.
    pub bytes: Vec<u8>,
}

/// Coded frame, for the report.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CodedFrame {
    /// Number of the frame.
    pub index: u32,
    /// Type of the picture: I, P or B.
    pub picture_type: PictureType,
    /// Size in the elementary stream with headers \[bits\].
    pub bits: u64,
    /// quantiser_scale of the picture's settings.
    pub quantiser_scale: u32,
    /// PSNR of the coded luma \[dB\]; infinite if lossless.
    pub psnr_y: f64,
    /// Picture as a decoder displays it, for observers; `None` if the encoder does not provide it.
    pub decoded: Option<Arc<Picture>>,
}

/// Coding of a picture, or the expected coding if the encoder has not reached it yet.
#[derive(Clone, Debug)]
pub struct Coding {
    /// Mean quantiser_scale of the picture.
    pub quantiser_scale: f32,
    /// Coded picture; `None` if masking does not need it or the encoder has not coded it yet.
    pub outcome: Option<Coded>,
    /// Whether the picture is an I picture.
    pub begins_group: bool,
    /// Expected coding of the next picture.
    pub next: NextPicture,
}

impl Coding {
    /// Returns a coding in which only the quantiser is known.
    #[must_use]
    pub fn of_quantiser(quantiser_scale: f32) -> Self {
        Self { quantiser_scale, outcome: None, begins_group: false, next: NextPicture::Predicted }
    }
}

impl Default for Coding {
    fn default() -> Self {
        Self::of_quantiser(1.0)
    }
}

/// Thresholds ΔY of a frame, which masking sends back to the renderer.
#[derive(Clone, Debug)]
pub struct LuminanceThresholds {
    /// Number of the frame from which the thresholds were derived; the next frame uses them.
    pub of: u32,
    /// Permitted luminance error of each pixel \[W·m⁻²·sr⁻¹\].
    pub delta: Arc<Plane<f32>>,
    /// Luminance of each pixel in the frame \[W·m⁻²·sr⁻¹\].
    pub luminance: Arc<Plane<f32>>,
}

/// Thresholds of the previous frame, for reprojection to the current frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct LastThresholds<'a> {
    thresholds: Option<&'a LuminanceThresholds>,
    known: Option<&'a Correspondence>,
}

impl<'a> LastThresholds<'a> {
    /// Returns default thresholds: every pixel's luminance may have an error of 2 %.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Returns the `thresholds` of frame `index` − 1, for use in frame `index`. Without a correspondence they are
    /// unused.
    ///
    /// # Panics
    /// If the thresholds belong to another frame: the feedback is exactly one frame late.
    #[must_use]
    pub fn new(index: u32, thresholds: Option<&'a LuminanceThresholds>, known: Option<&'a Correspondence>) -> Self {
        assert!(thresholds.is_none_or(|thresholds| thresholds.of + 1 == index), "thresholds out of step");
        Self { thresholds, known }
    }

    /// Returns ΔY reprojected along the motion, for a picture of `width` × `height`. Without thresholds, ΔY is 2 % of
    /// luminance.
    #[must_use]
    pub fn map(&self, width: usize, height: usize) -> ThresholdMap {
        self.reprojected(|thresholds| &thresholds.delta).unwrap_or_else(|| ThresholdMap::relative(width, height))
    }

    /// Returns the luminance of the previous frame reprojected along the motion \[W·m⁻²·sr⁻¹\]; `None` without
    /// thresholds.
    #[must_use]
    pub fn luminance(&self) -> Option<ThresholdMap> {
        self.reprojected(|thresholds| &thresholds.luminance)
    }

    fn reprojected(&self, plane: impl Fn(&LuminanceThresholds) -> &Plane<f32>) -> Option<ThresholdMap> {
        Some(reproject(plane(self.thresholds?), self.known?))
    }
}

impl Mask for Feedback {
    fn step(&mut self, displayed: &Displayed, coding: &Coding) -> Arc<Plane<f32>> {
        let known = displayed.correspondence.as_deref();
        let (luma, luminance) = (&displayed.picture.luma, &*displayed.luminance);
        self.observe(ObservedFrame { luma, luminance, known }, coding.quantiser_scale);
        self.thresholds().clone()
    }

    fn restore(&mut self, _state: &[u8], thresholds: &LuminanceThresholds) -> Result<()> {
        Feedback::restore(self, thresholds.delta.clone());
        Ok(())
    }
}
