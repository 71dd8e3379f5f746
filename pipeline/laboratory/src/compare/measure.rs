//! Measures of differences between pictures, for one pair and for many.

use super::picture::View;
use plane::Plane;
use serde::Serialize;
use ssimulacra2::{LinearRgb, compute_frame_ssimulacra2};

/// Differences between a picture a and a reference b, over all pixels and channels.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Width \[pixels\].
    pub width: usize,
    /// Height \[pixels\].
    pub height: usize,
    /// Mean luminance of a divided by mean luminance of b; `None` if b is black.
    pub mean_ratio: Option<f64>,
    /// Root mean square of a − b in linear light \[W·m⁻²·sr⁻¹\]. For displayed pictures, white is 1.
    pub rmse: f64,
    /// Mean of (a − b)² / (b² + 0.01); see [`perceptual::relative_mse`].
    pub relative_mse: f64,
    /// Relative MSE without the reference's own noise: mean of ((a − b)² − Var b) / (b² + 0.01). `None` if the variance
    /// of b is unknown. May be negative if the pictures differ only by noise.
    pub relative_mse_without_noise: Option<f64>,
    /// Peak signal-to-noise ratio of 8-bit luma \[dB\]; see [`perceptual::psnr`]. `None` for equal pictures.
    pub psnr_y: Option<f64>,
    /// Structural similarity of luma; see [`perceptual::ssim`]. It is 1 for equal pictures.
    pub ssim: f64,
    /// SSIMULACRA 2 of the displayed pictures: 100 means equal, 90 hardly distinguishable, 70 good, 50 fair. `None` for
    /// pictures with a side below 8 pixels.
    pub ssimulacra2: Option<f64>,
}

/// Measures the differences between `a` and the reference `b`.
///
/// # Panics
/// If the sizes differ.
pub fn measure(a: &View, b: &View) -> Comparison {
    let luminance = |plane: &Plane<[f32; 3]>| {
        plane.samples().iter().map(|&rgb| f64::from(render_core::luminance(rgb.into()))).sum::<f64>()
    };
    let relative_mse = perceptual::relative_mse(&a.linear, &b.linear);
    // Apply the formula to the noise alone, as for a picture that differs by one standard deviation everywhere.
    let relative_noise = b.variance.as_ref().map(|noise| {
        let off = b.linear.samples().iter().zip(noise.samples());
        let off = off.map(|(b, v)| std::array::from_fn(|c| b[c] + v[c].max(0.0).sqrt())).collect();
        perceptual::relative_mse(&Plane::from_vec(noise.width(), noise.height(), off), &b.linear)
    });
    // Pass the light that the display emits to SSIMULACRA 2.
    let linear_rgb = |view: &View| {
        let shown = &view.shown;
        LinearRgb::new(shown.samples().to_vec(), shown.width(), shown.height()).expect("one sample per pixel")
    };
    Comparison {
        width: a.luma.width(),
        height: a.luma.height(),
        mean_ratio: Some(luminance(&a.linear) / luminance(&b.linear)).filter(|ratio| ratio.is_finite()),
        rmse: perceptual::rmse(&a.linear, &b.linear),
        relative_mse,
        relative_mse_without_noise: relative_noise.map(|noise| relative_mse - noise),
        psnr_y: Some(perceptual::psnr(&a.luma, &b.luma)).filter(|psnr| psnr.is_finite()),
        ssim: perceptual::ssim(&a.luma, &b.luma),
        ssimulacra2: compute_frame_ssimulacra2(linear_rgb(b), linear_rgb(a)).ok(),
    }
}

impl Comparison {
    /// Returns the means over pictures of the same size. Each measure is averaged over the pictures that have it; the
    /// RMSE is averaged as a root mean square.
    pub fn mean(all: &[Self]) -> Self {
        let count = all.len().max(1) as f64;
        let mean = |value: &dyn Fn(&Self) -> f64| all.iter().map(value).sum::<f64>() / count;
        let mean_of_known = |value: &dyn Fn(&Self) -> Option<f64>| {
            let known: Vec<f64> = all.iter().filter_map(value).collect();
            (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
        };
        Self {
            width: all.first().map_or(0, |first| first.width),
            height: all.first().map_or(0, |first| first.height),
            mean_ratio: mean_of_known(&|one| one.mean_ratio),
            rmse: mean(&|one| one.rmse.powi(2)).sqrt(),
            relative_mse: mean(&|one| one.relative_mse),
            relative_mse_without_noise: mean_of_known(&|one| one.relative_mse_without_noise),
            psnr_y: mean_of_known(&|one| one.psnr_y),
            ssim: mean(&|one| one.ssim),
            ssimulacra2: mean_of_known(&|one| one.ssimulacra2),
        }
    }
}

impl std::fmt::Display for Comparison {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { width, height, mean_ratio, rmse, relative_mse, .. } = self;
        writeln!(f, "pixels                {width}x{height}")?;
        // Omit unknown measures, and replace infinite PSNR by a word.
        if let Some(ratio) = mean_ratio {
            writeln!(f, "mean luminance        {ratio:.5} of the reference")?;
        }
        writeln!(f, "RMSE                  {rmse:.6e}")?;
        writeln!(f, "relative MSE          {relative_mse:.6e}   mean of (a - b)^2 / (b^2 + 0.01)")?;
        if let Some(without) = self.relative_mse_without_noise {
            writeln!(f, "  without b's noise   {without:.6e}")?;
        }
        match self.psnr_y {
            Some(psnr) => writeln!(f, "luma PSNR             {psnr:.3} dB")?,
            None => writeln!(f, "luma PSNR             equal")?,
        }
        write!(f, "luma SSIM             {:.6}", self.ssim)?;
        if let Some(score) = self.ssimulacra2 {
            write!(f, "\nSSIMULACRA 2          {score:.3}   100 equal, 90 hardly distinguishable, 70 good, 50 fair")?;
        }
        Ok(())
    }
}
