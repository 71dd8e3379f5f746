//! Picture metrics for reports: squared errors, PSNR, and structural similarity \[Wang04\].
//!
//! All functions accept the picture first and the reference second. They panic if the two have different sizes. Sums
//! use `f64` in raster order. Errors of planes without samples are 0.

use plane::{Correspondence, Plane};

/// A sample with one or more numeric components.
pub trait Components: Copy {
    /// Components of the sample.
    fn components(&self) -> &[f32];
}

impl Components for f32 {
    fn components(&self) -> &[f32] {
        std::slice::from_ref(self)
    }
}

impl Components for [f32; 3] {
    fn components(&self) -> &[f32] {
        self
    }
}

/// Term added to the squared reference in [`relative_mse`], so that black pixels do not dominate. 0.01 is usual in
/// papers on denoising, for pictures with values of about 1.
const RELATIVE_MSE_EPSILON: f64 = 0.01;

fn assert_same_size<T: Copy>(a: &Plane<T>, b: &Plane<T>) {
    let size = (a.width(), a.height());
    assert_eq!(size, (b.width(), b.height()), "the two pictures must have the same size");
}

/// Returns the mean of `term(value, reference)` over all components.
fn mean<T: Components>(picture: &Plane<T>, reference: &Plane<T>, term: impl Fn(f64, f64) -> f64) -> f64 {
    assert_same_size(picture, reference);
    let (mut sum, mut count) = (0.0, 0usize);
    for (a, b) in picture.samples().iter().zip(reference.samples()) {
        for (&a, &b) in a.components().iter().zip(b.components()) {
            sum += term(f64::from(a), f64::from(b));
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// Mean squared error of 8-bit planes \[code values²\].
#[must_use]
pub fn mse(picture: &Plane<u8>, reference: &Plane<u8>) -> f64 {
    assert_same_size(picture, reference);
    let square = |(&a, &b): (&u8, &u8)| u64::from(a.abs_diff(b)).pow(2);
    let sum: u64 = picture.samples().iter().zip(reference.samples()).map(square).sum();
    sum as f64 / picture.samples().len().max(1) as f64
}

/// Peak signal-to-noise ratio of 8-bit planes \[dB\], with a peak of 255. Infinite for equal pictures.
///
/// ```
/// use plane::Plane;
/// let (black, off_by_one) = (Plane::filled(8, 8, 16u8), Plane::filled(8, 8, 17u8));
/// assert!((perceptual::psnr(&off_by_one, &black) - 48.1308).abs() < 1e-4);
/// ```
#[must_use]
pub fn psnr(picture: &Plane<u8>, reference: &Plane<u8>) -> f64 {
    10.0 * (255.0 * 255.0 / mse(picture, reference)).log10()
}

/// Returns flicker: the mean squared difference between the temporal changes of a film and of its reference \[code
/// values²\].
///
/// ```text
/// (a_t(x) − a_{t−1}(x')) − (b_t(x) − b_{t−1}(x'))        over the pixels x with a match x' in the previous frame
/// ```
/// a is the film and b the reference. `pictures` and `references` contain the current and the previous frame. `known`
/// contains the match x' of every pixel of the current frame. A constant error, or an error that moves with its
/// surface, does not flicker. Without matches the result is 0.
///
/// # Panics
/// If the planes have different sizes.
#[must_use]
pub fn flicker(pictures: [&Plane<u8>; 2], references: [&Plane<u8>; 2], known: &Correspondence) -> f64 {
    let [picture, picture_before] = pictures;
    let [reference, reference_before] = references;
    [picture_before, reference, reference_before].into_iter().for_each(|other| assert_same_size(picture, other));
    let size = (known.width(), known.height());
    assert_eq!((picture.width(), picture.height()), size, "there must be a match for every pixel");
    let (mut sum, mut count) = (0.0, 0usize);
    for (x, &before) in known.matches().samples().iter().enumerate() {
        let before = before as usize;
        // Skip pixels without a match. Their index is outside the picture.
        if let (Some(&a), Some(&b)) = (picture_before.samples().get(before), reference_before.samples().get(before)) {
            let now = f64::from(picture.samples()[x]) - f64::from(reference.samples()[x]);
            sum += (now - (f64::from(a) - f64::from(b))).powi(2);
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// Root mean squared error, in the unit of the samples. For colors, the mean is over all components.
#[must_use]
pub fn rmse<T: Components>(picture: &Plane<T>, reference: &Plane<T>) -> f64 {
    mean(picture, reference, |a, b| (a - b).powi(2)).sqrt()
}

/// Relative squared error of a to the reference b: mean of (a − b)² / (b² + 0.01).
#[must_use]
pub fn relative_mse<T: Components>(picture: &Plane<T>, reference: &Plane<T>) -> f64 {
    mean(picture, reference, |a, b| (a - b).powi(2) / (b * b + RELATIVE_MSE_EPSILON))
}

/// Radius of the window of [`ssim`] \[samples\].
const RADIUS: usize = 5;
/// Standard deviation of the Gaussian window of [`ssim`] \[samples\] \[Wang04, §III-C\].
const SIGMA: f64 = 1.5;

/// Structural similarity of 8-bit planes \[Wang04\]: 1 for equal pictures, otherwise less than 1.
///
/// ```text
/// SSIM = (2 μ_a μ_b + C1) (2 σ_ab + C2) / ((μ_a² + μ_b² + C1) (σ_a² + σ_b² + C2))      C1 = (0.01·255)², C2 = (0.03·255)²
/// ```
///
/// Means μ and variances σ² use an 11×11 Gaussian window with a standard deviation of 1.5 samples. The result is the
/// mean over all window positions inside the picture. For pictures smaller than the window, the mean is over all
/// pixels, and the border is repeated.
#[must_use]
pub fn ssim(picture: &Plane<u8>, reference: &Plane<u8>) -> f64 {
    assert_same_size(picture, reference);
    let (width, height) = (picture.width(), picture.height());
    if width == 0 || height == 0 {
        return 1.0;
    }
    const C1: f64 = 0.01 * 255.0 * 0.01 * 255.0;
    const C2: f64 = 0.03 * 255.0 * 0.03 * 255.0;
    // Filter the first and second moments with the window.
    let moment = |product: fn(f64, f64) -> f64| {
        windowed(&Plane::from_fn(width, height, |x, y| {
            product(f64::from(picture.get(x, y)), f64::from(reference.get(x, y)))
        }))
    };
    let (mean_a, mean_b) = (moment(|a, _| a), moment(|_, b| b));
    let (aa, bb, ab) = (moment(|a, _| a * a), moment(|_, b| b * b), moment(|a, b| a * b));
    // Skip windows that reach beyond the border, unless the picture is smaller than a window.
    let places = |length: usize| if length > 2 * RADIUS { RADIUS..length - RADIUS } else { 0..length };
    let mut sum = 0.0;
    // Compute variances and covariance from the windowed moments.
    for y in places(height) {
        for x in places(width) {
            let (a, b) = (mean_a.get(x, y), mean_b.get(x, y));
            let (variance_a, variance_b) = (aa.get(x, y) - a * a, bb.get(x, y) - b * b);
            let covariance = ab.get(x, y) - a * b;
            sum +=
                (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variance_a + variance_b + C2));
        }
    }
    sum / (places(height).len() * places(width).len()) as f64
}

/// Returns the window weights along one axis, with a sum of 1.
fn window() -> [f64; 2 * RADIUS + 1] {
    let bell = |i: usize| (-(i as f64 - RADIUS as f64).powi(2) / (2.0 * SIGMA * SIGMA)).exp();
    let total: f64 = (0..=2 * RADIUS).map(bell).sum();
    std::array::from_fn(|i| bell(i) / total)
}

/// Convolves the plane with the window. Outside the plane, the border is repeated.
fn windowed(plane: &Plane<f64>) -> Plane<f64> {
    let weights = window();
    let offset = |i: usize, k: usize| (i + k) as isize - RADIUS as isize;
    let along = Plane::from_fn(plane.width(), plane.height(), |x, y| {
        weights.iter().enumerate().map(|(k, w)| w * plane.get_clamped(offset(x, k), y as isize)).sum::<f64>()
    });
    Plane::from_fn(plane.width(), plane.height(), |x, y| {
        weights.iter().enumerate().map(|(k, w)| w * along.get_clamped(x as isize, offset(y, k))).sum::<f64>()
    })
}
