//! How far a linear picture is from another.

use anyhow::{Context, Result, bail};
use plane::Plane;
use render_core::image_file::{self, Layers};
use serde::Serialize;
use std::path::Path;

/// Differences of picture a from reference b, over all pixels and channels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Mean of a over mean of b, of their luminance; nothing when b is black.
    pub mean_ratio: Option<f64>,
    /// Root of the mean of (a − b)² \[W·m⁻²·sr⁻¹\].
    pub rmse: f64,
    /// Mean of (a − b)² / (b² + 0.01), see [`perceptual::relative_mse`].
    pub relative_mse: f64,
    /// The same without the part that is the reference's own noise: mean of ((a − b)² − Var b) / (b² + 0.01). Only where b has
    /// a variance; it may fall below 0 when nothing but noise separates the two.
    pub relative_mse_without_noise: Option<f64>,
}

/// Compares the OpenEXR picture `a` with the reference `b`.
///
/// # Errors
/// A file that cannot be read or has no colours, or two sizes.
pub fn compare_files(a: &Path, b: &Path) -> Result<Comparison> {
    let (first, reference) = (read(a)?, read(b)?);
    let colors = |layers: &Layers, path: &Path| {
        layers.colors("").with_context(|| format!("{}: it has no channels R, G and B", path.display()))
    };
    let (pictures, sizes) = (
        (colors(&first, a)?, colors(&reference, b)?),
        [(first.width, first.height), (reference.width, reference.height)],
    );
    if sizes[0] != sizes[1] {
        let [(w, h), (v, k)] = sizes;
        bail!("{} has {w}x{h} pixels, {} has {v}x{k}; render both in one size", a.display(), b.display());
    }
    Ok(compare(&pictures.0, &pictures.1, reference.colors("variance.").as_ref()))
}

fn read(path: &Path) -> Result<Layers> {
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("exr")) {
        bail!("{}: pictures to compare are OpenEXR files, named .exr", path.display());
    }
    image_file::read_layers(path).map_err(anyhow::Error::msg)
}

/// Compares `a` with the reference `b` of the same size, whose noise has the variance `noise` if it is known.
///
/// # Panics
/// If the sizes differ.
pub fn compare(a: &Plane<[f32; 3]>, b: &Plane<[f32; 3]>, noise: Option<&Plane<[f32; 3]>>) -> Comparison {
    let luminance = |plane: &Plane<[f32; 3]>| {
        plane.samples().iter().map(|&rgb| f64::from(render_core::luminance(rgb.into()))).sum::<f64>()
    };
    let relative_mse = perceptual::relative_mse(a, b);
    // The noise alone, by the same formula: a picture that is one standard deviation off everywhere.
    let relative_noise = noise.map(|noise| {
        let off = b.samples().iter().zip(noise.samples());
        let off = off.map(|(b, v)| std::array::from_fn(|c| b[c] + v[c].max(0.0).sqrt())).collect();
        perceptual::relative_mse(&Plane::from_vec(b.width(), b.height(), off), b)
    });
    Comparison {
        width: a.width(),
        height: a.height(),
        mean_ratio: Some(luminance(a) / luminance(b)).filter(|ratio| ratio.is_finite()),
        rmse: perceptual::rmse(a, b),
        relative_mse,
        relative_mse_without_noise: relative_noise.map(|noise| relative_mse - noise),
    }
}

impl std::fmt::Display for Comparison {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { width, height, mean_ratio, rmse, relative_mse, relative_mse_without_noise } = self;
        writeln!(f, "pixels                {width}x{height}")?;
        if let Some(ratio) = mean_ratio {
            writeln!(f, "mean luminance        {ratio:.5} of the reference's")?;
        }
        writeln!(f, "RMSE                  {rmse:.6e}")?;
        write!(f, "relative MSE          {relative_mse:.6e}   mean of (a - b)^2 / (b^2 + 0.01)")?;
        if let Some(without) = relative_mse_without_noise {
            write!(f, "\n  without b's noise   {without:.6e}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_of_the_reference_is_taken_off() {
        let truth = Plane::filled(64, 64, [1.0f32, 2.0, 0.5]);
        // One standard deviation up or down, in turn.
        let noisy = Plane::from_fn(64, 64, |x, y| {
            let sign = if (x + y) % 2 == 0 { 0.1 } else { -0.1 };
            truth.get(x, y).map(|c| c + sign)
        });
        let variance = Plane::filled(64, 64, [0.01f32; 3]);
        let found = compare(&truth, &noisy, Some(&variance));
        assert!((found.rmse - 0.1).abs() < 1e-6 && (found.mean_ratio.unwrap() - 1.0).abs() < 1e-6);
        assert!(found.relative_mse > 1e-3 && found.relative_mse_without_noise.unwrap().abs() < 1e-6);
        assert_eq!(compare(&truth, &truth, None).relative_mse_without_noise, None);
    }
}
