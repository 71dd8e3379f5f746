//! Differences between pictures, sequences or videos and a reference.
//!
//! Pictures are measured as linear light, which is additive, and as luma, which viewers perceive. Linear pictures are
//! displayed with the sRGB curve. Their exposure maps the geometric mean of the first reference to middle gray.

mod heat_map;
mod measure;
mod mpeg;
mod picture;
mod read;

pub use super::{false_color, png_file};
pub use heat_map::{HeatMap, RANGE as HEAT_MAP_RANGE};
pub use measure::{Comparison, measure};
pub use picture::{Picture, View};
pub use read::Pictures;

use render2mpeg::error::{Error, Result};
use serde::Serialize;
use std::path::Path;

/// Comparison of each picture of a sequence, and the mean.
#[derive(Clone, Debug, Serialize)]
pub struct SequenceComparison {
    /// Comparison of each picture, in order.
    pub frames: Vec<Comparison>,
    /// Mean of all comparisons; see [`Comparison::mean`].
    pub mean: Comparison,
}

/// Compares `a` with the reference `b`: two pictures, two folders of pictures, or two videos.
///
/// Calls `each` with every comparison, and adds all differences to `heat_map`.
///
/// # Errors
/// If a file cannot be read, if pictures differ in size or kind, or if sequences differ in length.
pub fn compare_paths(
    a: &Path,
    b: &Path,
    mut heat_map: Option<&mut HeatMap>,
    mut each: impl FnMut(usize, &Comparison),
) -> Result<SequenceComparison> {
    let (mut pictures, mut references) = (Pictures::open(a)?, Pictures::open(b)?);
    let mut frames = Vec::new();
    let mut exposure = None;
    loop {
        // Require that both sequences end together.
        let (picture, reference) = match (pictures.next().transpose()?, references.next().transpose()?) {
            (Some(picture), Some(reference)) => (picture, reference),
            (None, None) => break,
            (more, _) => {
                let (short, long) = if more.is_some() { (b, a) } else { (a, b) };
                let end = end_of(short, frames.len());
                let (short, long) = (short.display(), long.display());
                let problem = format!("{short} {end}, but {long} is longer; compare sequences of the same length");
                return Err(Error::Comparison(problem));
            }
        };

        // Only pictures of the same kind and size can be compared.
        if picture.is_linear() != reference.is_linear() {
            let (linear, shown) = if picture.is_linear() { (a, b) } else { (b, a) };
            let (linear, shown) = (linear.display(), shown.display());
            let problem = format!("{linear} is linear light, but {shown} is tone mapped; compare pictures of one kind");
            return Err(Error::Comparison(problem));
        }
        let sizes = [picture.size(), reference.size()];
        if sizes[0] != sizes[1] {
            let [(w, h), (v, k)] = sizes;
            let (a, b) = (a.display(), b.display());
            return Err(Error::Comparison(format!(
                "{a} has {w}x{h} pixels, but {b} has {v}x{k}; render both in one size"
            )));
        }

        // Use the exposure of the first reference for all pictures.
        let exposure = *exposure.get_or_insert_with(|| reference.exposure());
        let (picture, reference) = (picture.view(exposure), reference.view(exposure));
        let comparison = measure(&picture, &reference);
        if let Some(map) = heat_map.as_deref_mut() {
            map.add(&picture, &reference);
        }
        each(frames.len(), &comparison);
        frames.push(comparison);
    }
    if frames.is_empty() {
        return Err(Error::content(a, " contains no pictures"));
    }
    let mean = Comparison::mean(&frames);
    Ok(SequenceComparison { frames, mean })
}

/// Describes the end of the sequence at `path`, after `count` pictures.
fn end_of(path: &Path, count: usize) -> String {
    match count {
        0 => "contains no pictures".into(),
        1 if is_single(path) => "is a single picture".into(),
        1 => "ends after 1 picture".into(),
        _ => format!("ends after {count} pictures"),
    }
}

/// Returns whether `path` is a single picture.
pub fn is_single(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    path.is_file() && matches!(ending.as_str(), "exr" | "png")
}

#[cfg(test)]
mod tests {
    use super::*;
    use plane::Plane;

    fn view(radiance: Plane<[f32; 3]>, variance: Option<Plane<[f32; 3]>>) -> View {
        Picture::Linear { radiance, variance }.view(1.0)
    }

    #[test]
    fn noise_of_the_reference_is_taken_off() {
        let truth = Plane::filled(64, 64, [1.0f32, 2.0, 0.5]);
        // Add noise of one standard deviation, alternately up and down.
        let noisy = Plane::from_fn(64, 64, |x, y| {
            let sign = if (x + y) % 2 == 0 { 0.1 } else { -0.1 };
            truth.get(x, y).map(|c| c + sign)
        });
        let variance = Plane::filled(64, 64, [0.01f32; 3]);
        let found = measure(&view(truth.clone(), None), &view(noisy, Some(variance)));
        assert!((found.rmse - 0.1).abs() < 1e-6 && (found.mean_ratio.unwrap() - 1.0).abs() < 1e-6);
        assert!(found.relative_mse > 1e-3 && found.relative_mse_without_noise.unwrap().abs() < 1e-6);
        let same = measure(&view(truth.clone(), None), &view(truth, None));
        assert_eq!((same.relative_mse_without_noise, same.psnr_y, same.rmse), (None, None, 0.0));
        assert!((same.ssim - 1.0).abs() < 1e-12 && (same.ssimulacra2.unwrap() - 100.0).abs() < 1e-6);
    }

    #[test]
    fn a_worse_picture_scores_worse_and_its_map_shows_where() {
        let truth = Plane::from_fn(64, 64, |x, y| [0.2 + 0.1 * ((x / 8 + y / 8) % 2) as f32; 3]);
        let off_by = |step: f32| {
            let picture = Plane::from_fn(64, 64, |x, y| {
                let off = if x < 32 { 0.0 } else { step * ((x * 7 + y * 13) % 5) as f32 };
                truth.get(x, y).map(|c| c + off)
            });
            view(picture, None)
        };
        let truth = view(truth.clone(), None);
        let (good, bad) = (measure(&off_by(0.002), &truth), measure(&off_by(0.02), &truth));
        assert!(good.psnr_y > bad.psnr_y && good.ssim > bad.ssim && good.ssimulacra2 > bad.ssimulacra2);
        // A tenfold difference lowers PSNR by 20 dB, apart from rounding to code values.
        assert!((good.psnr_y.unwrap() - bad.psnr_y.unwrap() - 20.0).abs() < 1.5, "{good:?} {bad:?}");
        let mut map = HeatMap::default();
        map.add(&off_by(0.02), &truth);
        let map = map.picture();
        assert_eq!(map.get(5, 5), false_color::false_color(0.0));
        assert!(map.get(42, 6)[0] > 100);
        let mean = Comparison::mean(&[good.clone(), bad.clone()]);
        assert!((mean.rmse.powi(2) - 0.5 * (good.rmse.powi(2) + bad.rmse.powi(2))).abs() < 1e-12);
    }
}
