//! The loop with parts of one's own: any renderer, any masking model, any encoder.
//!
//! ```text
//! Prepare ──► Shade ──► tone curve ──► Encode ──► bytes
//!               ▲            │
//!               └── ΔY(n) ◄──┴─► Mask
//! ```
//! Each part is a small trait and runs on a thread of its own; [`couple`] joins them as [`render`](crate::render) joins the
//! stages of this crate. [`perceptual::Feedback`] is a [`Mask`], [`Video`] an [`Encode`]. What a run of this loop gives is a
//! function of its parts alone, as long as they are.

use crate::error::{Error, Result};
use crate::video::Video;
use crossbeam_channel::bounded;
use mpeg2enc::MotionField;
use perceptual::{Feedback, ObservedFrame, ThresholdMap, ToneMap, YCbCr, luminance_plane, reproject};
use plane::Plane;
use render_core::Correspondence;
use std::sync::Arc;

/// The first half of a renderer: all that needs no thresholds. It is one frame ahead of the rest.
pub trait Prepare: Send {
    /// What a frame is up to here.
    type Frame: Send;

    /// Frame `index`, counted from 0, with where its pixels were in the frame before if that is known; none after the last.
    fn prepare(&mut self, index: u32) -> Option<(Self::Frame, Option<Arc<Correspondence>>)>;
}

/// The second half of a renderer: light.
pub trait Shade<F>: Send {
    /// Linear RGB \[W·m⁻²·sr⁻¹\] of every pixel; the luminance of each may be wrong by what `thresholds` says there, or by 2 %
    /// of itself where that says nothing.
    fn shade(&mut self, frame: F, thresholds: &ThresholdMap) -> Plane<[f32; 3]>;
}

/// What nobody would see.
pub trait Mask: Send {
    /// The luminance that each pixel may be wrong by \[W·m⁻²·sr⁻¹\]: of a picture with this luma (code values above black)
    /// and luminance that is coded with `quantiser_scale`. `matches` says where each pixel was in the picture before.
    fn thresholds(
        &mut self,
        luma: &Plane<f32>,
        luminance: &Plane<f32>,
        quantiser_scale: f32,
        matches: Option<&Plane<u32>>,
    ) -> Plane<f32>;
}

/// A video encoder.
pub trait Encode: Send {
    /// Takes the next picture, with where its pixels were in the one before (`NaN`: not visible there), and gives the bytes
    /// that can be written now.
    ///
    /// # Errors
    /// The picture cannot be coded.
    fn encode(&mut self, picture: &YCbCr, motion_px: Option<&Plane<[f32; 2]>>) -> Result<Vec<u8>>;

    /// The quantiser_scale of MPEG-2 that comes nearest to how the last picture was coded.
    fn quantiser_scale(&self) -> f32;

    /// What is left, and the end of the stream.
    fn finish(self) -> Vec<u8>;
}

impl Mask for Feedback {
    fn thresholds(
        &mut self,
        luma: &Plane<f32>,
        luminance: &Plane<f32>,
        quantiser_scale: f32,
        matches: Option<&Plane<u32>>,
    ) -> Plane<f32> {
        self.observe(ObservedFrame { luma, luminance, matches }, quantiser_scale).clone()
    }
}

impl Encode for Video {
    fn encode(&mut self, picture: &YCbCr, motion_px: Option<&Plane<[f32; 2]>>) -> Result<Vec<u8>> {
        let motion = motion_px.map(|motion| MotionField::new(motion.clone()));
        Ok(self.push(&picture.picture, motion.as_ref(), None).bytes)
    }

    fn quantiser_scale(&self) -> f32 {
        Video::quantiser_scale(self)
    }

    fn finish(self) -> Vec<u8> {
        Video::finish(self).bytes
    }
}

/// What comes out of the loop, in this order for each frame.
#[derive(Debug)]
pub enum Event {
    /// Frame `index` as it goes to the encoder.
    Picture {
        /// Which one, from 0.
        index: u32,
        /// Y′C_BC_R.
        picture: Arc<YCbCr>,
    },
    /// Bytes of the stream.
    Bytes(Vec<u8>),
    /// What the next frame may be wrong by.
    Thresholds {
        /// The frame that they follow from.
        of: u32,
        /// \[W·m⁻²·sr⁻¹\].
        delta: Arc<Plane<f32>>,
    },
}

/// Runs the loop to the end of a film of pictures of `width` × `height`. `out` gets everything, on the thread that calls.
///
/// Shading frame n waits for the thresholds of n − 1, which follow from the picture as it was coded; preparation of frame
/// n + 1 goes on meanwhile.
///
/// # Errors
/// The first failure of the encoder, of `out`, or of a part that panicked.
pub fn couple<P: Prepare>(
    mut prepare: P,
    mut shade: impl Shade<P::Frame>,
    mut mask: impl Mask,
    mut encode: impl Encode,
    (width, height): (usize, usize),
    tone_map: ToneMap,
    mut out: impl FnMut(Event) -> Result<()>,
) -> Result<()> {
    let (prepared_out, prepared_in) = bounded(0);
    let (shaded_out, shaded_in) = bounded::<(Plane<[f32; 3]>, Option<Arc<Correspondence>>)>(1);
    let (thresholds_out, thresholds_in) = bounded::<Arc<Plane<f32>>>(1);
    std::thread::scope(|scope| {
        let preparing = scope.spawn(move || {
            let frames = (0..).map_while(|index| prepare.prepare(index));
            // Nobody takes it: someone behind has failed.
            frames.map(|frame| prepared_out.send(frame)).take_while(Result::is_ok).count()
        });
        let shading = scope.spawn(move || {
            for (index, (frame, correspondence)) in prepared_in.into_iter().enumerate() {
                let before = if index > 0 { thresholds_in.recv().ok() } else { None };
                let map = match (&before, &correspondence) {
                    (Some(delta), Some(known)) => reproject(delta, &known.matches),
                    // Nothing is known of the frame before.
                    _ => ThresholdMap::relative(width, height),
                };
                if index > 0 && before.is_none() {
                    return;
                }
                if shaded_out.send((shade.shade(frame, &map), correspondence)).is_err() {
                    return;
                }
            }
        });
        // Coding and masking take little: both are done here, so that masking knows how the picture was coded.
        let film = move || -> Result<()> {
            for (index, (radiance, correspondence)) in (0..).zip(shaded_in) {
                let luminance = luminance_plane(&radiance);
                let picture = Arc::new(YCbCr::from_radiance(&radiance, &tone_map));
                out(Event::Picture { index, picture: picture.clone() })?;
                let known = correspondence.as_deref();
                out(Event::Bytes(encode.encode(&picture, known.map(|known| &known.motion))?))?;
                let matches = known.map(|known| &known.matches);
                let delta = Arc::new(mask.thresholds(&picture.luma, &luminance, encode.quantiser_scale(), matches));
                // The last ones are for nobody.
                let _ = thresholds_out.send(delta.clone());
                out(Event::Thresholds { of: index, delta })?;
            }
            out(Event::Bytes(encode.finish()))
        };
        // When it ends, well or not, its ends of the channels close, and the others end too.
        let made = film();
        let ended = [preparing.join().map(drop), shading.join()];
        made?;
        ended.into_iter().collect::<Result<(), _>>().map_err(|_| Error::Fault("the renderer panicked".into()))
    })
}
