//! Saliency: a model of the first glance of a viewer without a task, based on \[Itti98\].
//!
//! ```text
//! (S1)  I = (r + g + b) / 3                    r, g, b ← r/I, g/I, b/I  where I > max(I) / 10,  0 elsewhere
//! (S2)  R = [r − (g + b)/2]⁺    G = [g − (r + b)/2]⁺    B = [b − (r + g)/2]⁺    Y = [(r + g)/2 − |r − g|/2 − b]⁺
//! (S3)  M(c, s) = |F_c − F_s|                  c = 2, 3, 4;  s = c + 3, c + 4;  F_s enlarged to the size of F_c
//! (S4)  N(M) = M / max(M_max, f) · (1 − m̄ / M_max)²
//! (S5)  Σ_F = ⊕_c ⊕_s N(M(c, s))               ⊕ adds at level 4
//! (S6)  Ī = Σ_I    C̄ = Σ_(R−G) + Σ_(B−Y)    Ō = Σ_θ N(Σ_O(θ))    Ū = Σ_(u_x) + Σ_(u_y)
//! (S7)  S = (N(Ī) + N(C̄) + N(Ō) + N(Ū)) / 4    or the mean of the first three without motion
//!
//!   r, g, b  display values, 0…1                F_k   a feature at level k of its pyramid: I, R−G, B−Y, O(θ), u_x or u_y
//!   [x]⁺     max(x, 0)                          O(θ)  magnitude of a pair of Gabor filters, θ = 0°, 45°, 90°, 135°
//!   M_max    largest value of a map             u     motion in pixels per frame, x to the right and y down
//!   m̄        mean of its other local maxima     f     smallest divisor M_max of a map
//! ```
//!
//! # Differences from the paper
//! - **Surround.** The paper prints |(R−G)_c − (G−R)_s|. That sign hides a red item among green items, because its
//!   center and surround cancel. This module uses the same sign for center and surround.
//! - **Noise.** N has a floor f. Without a floor, a map of pure noise would be stretched to the range of the other
//!   maps. Channels have the floor 1, so that a channel of suppressed maps stays small.
//! - **Local maxima** are searched in windows of an eighth of the map. Equal values in a window count as one maximum.
//! - **Quadrature.** O is the magnitude of an even and an odd filter, so the phase of an edge does not change it.
//! - **Motion** is a fourth channel with one map per axis, like the two color pairs. An item with its own direction of
//!   motion is then the only item in one of the maps.
//! - **Size.** Borders are reflected. Small pictures have fewer levels. Pairs (c, s) with missing levels are skipped.
//!
//! S is in 0…1 and is not stretched. An item that is odd in one of three channels has a saliency of about ⅓. Frames of
//! `cornell`, `nave` and `sponza` peak at 0.18 to 0.35. Noise with a standard deviation of 0.01 stays below 0.01.
//!
//! `bench/saliency.py` of the project `render2mpeg` is an independent implementation of these formulas.

mod channels;
mod gabor;
mod normalize;
mod opponents;
mod pyramid;
mod steady;

use channels::{channel, orientation_channel, sum_of};
use opponents::{Opponents, motion_axes};
use plane::Plane;
use pyramid::{MAP_LEVEL, Pyramid, enlarged};

pub use steady::steady_saliency;

// Floors f: smallest divisor M_max of maps. White noise with a standard deviation of 0.01 (2.6 code values of eight
// bits) reaches at most half of each floor. For 512×512 pixels with a mean of 0.5, its maximum is 0.005 in I, 0.013 in
// R−G and B−Y, and 0.002 in O.

/// Floor of I maps: 1 % of the range, chosen in experiments with noise.
const INTENSITY_FLOOR: f32 = 0.01;
/// Floor of R−G and B−Y maps: 2 % of 3, the largest value of R, G and B, chosen in experiments with noise. Hues of dark
/// pixels are noisier.
const COLOR_FLOOR: f32 = 0.02 * 3.0;
/// Floor of O maps: 0.5 %, chosen in experiments with noise. A wave from black to white has O = ½.
const ORIENTATION_FLOOR: f32 = 0.005;
/// Floor of motion maps \[pixels per frame\]. At 25 frames per second and 30 pixels per degree, 0.1 pixels per frame
/// are 0.08° per second, about the slowest visible relative motion.
const MOTION_FLOOR: f32 = 0.1;

/// Returns the saliency S of every pixel, 0…1.
///
/// `rgb` contains display values, which are clamped to 0…1. A pixel with a NaN or infinite component counts as black.
/// `motion` is in pixels per frame. Reversing all motion does not change the result. Motion that is not finite counts
/// as 0. If the longer side of a picture has at most 16 pixels, the pyramid has no pair of levels and the saliency is
/// 0.
///
/// ```
/// use plane::Plane;
///
/// // A red square on gray.
/// let inside = |x, y| (90..106).contains(&x) && (30..46).contains(&y);
/// let rgb = Plane::from_fn(128, 128, |x, y| if inside(x, y) { [0.8, 0.4, 0.4] } else { [0.5; 3] });
/// let saliency = perceptual::saliency(&rgb, None);
/// assert!(saliency.get(98, 38) > 0.3 && saliency.get(30, 98) < 0.05);
/// ```
///
/// # Panics
/// If the two planes have different sizes.
#[must_use]
pub fn saliency(rgb: &Plane<[f32; 3]>, motion: Option<&Plane<[f32; 2]>>) -> Plane<f32> {
    let (width, height) = (rgb.width(), rgb.height());
    if let Some(motion) = motion {
        assert_eq!((motion.width(), motion.height()), (width, height), "every pixel needs its motion");
    }
    if !Pyramid::has_pairs(width, height) {
        return Plane::filled(width, height, 0.0);
    }
    // Compute the channels according to (S1) to (S6).
    let Opponents { intensity, red_green, blue_yellow } = Opponents::new(rgb);
    let intensity = Pyramid::new(intensity);
    let colors = [red_green, blue_yellow].map(Pyramid::new);
    let orientation = orientation_channel(&intensity, ORIENTATION_FLOOR);
    let mut channels = vec![channel(&[intensity], INTENSITY_FLOOR), channel(&colors, COLOR_FLOOR), orientation];
    if let Some(motion) = motion {
        channels.push(channel(&motion_axes(motion).map(Pyramid::new), MOTION_FLOOR));
    }

    // Compute the mean of the channels according to (S7).
    let count = channels.len() as f32;
    let mean = sum_of(channels.into_iter()).map(|sum| sum / count);
    enlarged(&mean, MAP_LEVEL, width, height)
}
