//! The five parts of the loop, as plain state machines: one step for each frame, and a state that another process can restore.
//!
//! ```text
//! Prepare ──► Shade ──► Display ──► Encode ──► Mask
//!               ▲                               │
//!               └── ΔY(n−1), one frame late ◄───┘
//! ```
//! A part knows no channel, thread, checkpoint or observer: [`couple`](crate::couple) joins them. A renderer, masking model or
//! encoder of one's own implements one of these traits; [`perceptual::Feedback`] is a [`Mask`], [`ToneMap`] a [`Display`].

use crate::error::Result;
use crate::figures::FrameFigures;
use perceptual::{
    ColorMatrix, Feedback, NextPicture, ObservedFrame, PixelPart, ThresholdMap, ToneMap, YCbCr, luminance_plane,
    reproject,
};
use plane::{Coded, Correspondence, FrameHeader, Picture, PictureType, Plane};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The first half of a renderer: everything that needs no thresholds. It works one frame ahead of the rest.
pub trait Prepare: Send {
    /// A frame up to here, for [`Shade`].
    type Frame: Send;

    /// Prepares frame `index`, counted from 0; none after the last frame.
    fn step(&mut self, index: u32) -> Option<Prepared<Self::Frame>>;

    /// The state after the last step, for a checkpoint.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Continues after frame `last` from its [`state`](Prepare::state), and gives that frame once more.
    ///
    /// # Errors
    /// The state does not fit this part.
    fn restore(&mut self, state: &[u8], last: u32) -> Result<Prepared<Self::Frame>>;
}

/// The second half of a renderer: light.
pub trait Shade<F>: Send {
    /// Computes the radiance of every pixel. The luminance of a pixel may be wrong by the threshold that `thresholds` has for
    /// it, or by 2 % of itself where there is none.
    fn step(&mut self, prepared: &Prepared<F>, thresholds: LastThresholds<'_>) -> Shaded;

    /// The state after the last step, for a checkpoint.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Continues after the frame `last` from its [`state`](Shade::state).
    ///
    /// # Errors
    /// The state does not fit this part, or that frame.
    fn restore(&mut self, state: &[u8], last: &Prepared<F>) -> Result<()>;
}

/// A display: light into a picture, and files of uncompressed frames.
pub trait Display: Send {
    /// Opens the files of a film that begins. Unfinished, they stay if `kept` is true then.
    ///
    /// # Errors
    /// A file cannot be written.
    fn begin(&mut self, _kept: &Arc<AtomicBool>) -> Result<()> {
        Ok(())
    }

    /// Frame `index` as a picture. The driver adds its motion.
    fn show(&mut self, index: u32, shaded: &Shaded) -> Displayed;

    /// Writes the uncompressed frame, of which `picture` is shown, into the files that are wanted.
    ///
    /// # Errors
    /// A file cannot be written.
    fn write(&mut self, _index: u32, _shaded: Shaded, _picture: &YCbCr) -> Result<()> {
        Ok(())
    }

    /// The state after the last step, for a checkpoint.
    ///
    /// # Errors
    /// A file cannot be brought to the disk.
    fn state(&self) -> Result<Vec<u8>> {
        Ok(Vec::new())
    }

    /// Continues from a [`state`](Display::state), and cuts files to the length that they had. Unfinished, they stay if `kept` is true.
    ///
    /// # Errors
    /// The state is of another display, or a file is shorter than it was.
    fn restore(&mut self, state: &[u8], kept: &Arc<AtomicBool>) -> Result<()>;

    /// Completes the files.
    ///
    /// # Errors
    /// A file cannot be completed.
    fn finish(self) -> Result<()>
    where
        Self: Sized,
    {
        Ok(())
    }
}

/// Shows frames by the curve alone, in BT.709, and writes no files.
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

/// A masking model: the error that stays invisible.
pub trait Mask: Send {
    /// The luminance that each pixel of `displayed` may be wrong by \[W·m⁻²·sr⁻¹\], given how the picture was coded.
    fn step(&mut self, displayed: &Displayed, coding: &Coding) -> Arc<Plane<f32>>;

    /// The state after the last step, for a checkpoint; the thresholds themselves are kept by the loop.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Continues after a frame from its [`state`](Mask::state) and its thresholds.
    ///
    /// # Errors
    /// The state does not fit this part.
    fn restore(&mut self, state: &[u8], thresholds: &LuminanceThresholds) -> Result<()>;
}

/// A video encoder with its container.
pub trait Encode: Send {
    /// Encodes the next picture, in display order, and gives what can be written now.
    ///
    /// # Errors
    /// The picture cannot be coded.
    fn step(&mut self, displayed: &Displayed) -> Result<Encoded>;

    /// Encodes the pictures that wait, and ends the stream.
    ///
    /// # Errors
    /// A picture cannot be coded.
    fn finish(self) -> Result<Encoded>;

    /// Bytes that would make a whole file of what the steps gave until now. A film that is ended at once ends with them. Pictures that
    /// still wait to be coded are not in it.
    fn ending(&self) -> Vec<u8> {
        Vec::new()
    }

    /// The state after the last step, for a checkpoint.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Continues from a [`state`](Encode::state) of an encoder with the same settings.
    ///
    /// # Errors
    /// The state is of another encoder.
    fn restore(&mut self, state: &[u8]) -> Result<()>;
}

/// A frame up to where thresholds are needed.
#[derive(Clone, Debug, Default)]
pub struct Prepared<F> {
    /// The renderer's own data.
    pub frame: F,
    /// Where each pixel was in the frame before; none for the first frame and after a cut.
    pub correspondence: Option<Arc<Correspondence>>,
    /// Where each pixel of the frame before is in this one, for encoders with B pictures.
    pub forward: Option<Arc<Correspondence>>,
    /// CPU seconds and counts so far.
    pub figures: FrameFigures,
}

/// Names of channels, and their samples in raster order.
pub type Channels = Vec<(String, Vec<f32>)>;

/// A pixel that shows several surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Its place in raster order.
    pub pixel: usize,
    /// The surfaces that it shows: share of its area and radiance of each.
    pub parts: Vec<PixelPart>,
}

/// A frame as light.
#[derive(Clone, Debug, Default)]
pub struct Shaded {
    /// Linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Pixels that show several surfaces: a display shows the mean of what it shows of these, and not of `radiance`.
    pub outlines: Vec<Outline>,
    /// Importance of each pixel, 0…1, where it is to steer the encoder.
    pub importance: Option<Arc<Plane<f32>>>,
    /// Further channels for the frame's OpenEXR file.
    pub channels: Channels,
    /// Facts for the header of that file.
    pub header: FrameHeader,
    /// Channels that observers alone want: they go into no file.
    pub watched: Channels,
    /// CPU seconds and counts, those of [`Prepared`] included.
    pub figures: FrameFigures,
}

impl Shaded {
    /// Radiance of which each pixel is shown as the mean of its surfaces, each shown by `tone_map`. Blended before the curve, a light
    /// far above white would cover thin things before it.
    #[must_use]
    pub fn blended(&self, tone_map: &ToneMap) -> Cow<'_, Plane<[f32; 3]>> {
        let mut radiance = Cow::Borrowed(&self.radiance);
        for Outline { pixel, parts } in &self.outlines {
            radiance.to_mut().samples_mut()[*pixel] = tone_map.mean_shown(parts.iter().copied());
        }
        radiance
    }
}

/// A frame as a picture.
#[derive(Clone, Debug)]
pub struct Displayed {
    /// Its number, from 0.
    pub index: u32,
    /// Y′C_BC_R.
    pub picture: Arc<YCbCr>,
    /// Luminance before tone mapping \[W·m⁻²·sr⁻¹\].
    pub luminance: Arc<Plane<f32>>,
    /// The curve between the two.
    pub tone_map: ToneMap,
    /// As in [`Shaded`].
    pub importance: Option<Arc<Plane<f32>>>,
    /// As in [`Prepared`].
    pub correspondence: Option<Arc<Correspondence>>,
    /// As in [`Prepared`].
    pub forward: Option<Arc<Correspondence>>,
}

/// The result of a step of encoding.
#[derive(Clone, Debug, Default)]
pub struct Encoded {
    /// The next bytes of the file.
    pub bytes: Vec<u8>,
    /// The pictures that were coded, in the order of coding.
    pub pictures: Vec<CodedFrame>,
    /// How the picture of this step was coded, as far as that is known now.
    pub coding: Coding,
}

/// A coded frame, for the report.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CodedFrame {
    /// Its frame.
    pub index: u32,
    /// I, P or B.
    pub picture_type: PictureType,
    /// Size in the elementary stream, headers included.
    pub bits: u64,
    /// quantiser_scale of the picture's settings.
    pub quantiser_scale: u32,
    /// PSNR of luma \[dB\]; infinite when nothing is lost.
    pub psnr_y: f64,
    /// The picture that a decoder shows, for observers; an encoder need not tell.
    pub decoded: Option<Arc<Picture>>,
}

/// How a picture was coded, or will be where the encoder has not come to it yet.
#[derive(Clone, Debug)]
pub struct Coding {
    /// quantiser_scale of MPEG-2, the mean over the picture.
    pub quantiser_scale: f32,
    /// The coded picture, where masking needs it.
    pub outcome: Option<Coded>,
    /// Whether the picture is an I picture.
    pub begins_group: bool,
    /// How the next picture will be coded.
    pub next: NextPicture,
}

impl Coding {
    /// Nothing is known but the quantiser.
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

/// ΔY of a frame, on its way back to the renderer.
#[derive(Clone, Debug)]
pub struct LuminanceThresholds {
    /// The frame that they were derived from; the frame after it uses them.
    pub of: u32,
    /// \[W·m⁻²·sr⁻¹\] of luminance.
    pub delta: Arc<Plane<f32>>,
    /// Luminance of that frame \[W·m⁻²·sr⁻¹\].
    pub luminance: Arc<Plane<f32>>,
}

/// The thresholds of the frame before, seen from the frame that is shaded now.
#[derive(Clone, Copy, Debug, Default)]
pub struct LastThresholds<'a> {
    thresholds: Option<&'a LuminanceThresholds>,
    known: Option<&'a Correspondence>,
}

impl<'a> LastThresholds<'a> {
    /// No thresholds: every pixel may be wrong by 2 % of its luminance.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// `thresholds` of frame `index` − 1, for frame `index`. Without a correspondence they say nothing.
    ///
    /// # Panics
    /// If they are of another frame: the feedback is exactly one frame late.
    #[must_use]
    pub fn new(index: u32, thresholds: Option<&'a LuminanceThresholds>, known: Option<&'a Correspondence>) -> Self {
        assert!(thresholds.is_none_or(|thresholds| thresholds.of + 1 == index), "thresholds out of step");
        Self { thresholds, known }
    }

    /// ΔY along the motion; 2 % of luminance everywhere, for a picture of `width` × `height`, where nothing is known.
    #[must_use]
    pub fn map(&self, width: usize, height: usize) -> ThresholdMap {
        self.reprojected(|thresholds| &thresholds.delta).unwrap_or_else(|| ThresholdMap::relative(width, height))
    }

    /// Luminance of the frame before along the motion; none where nothing is known.
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
