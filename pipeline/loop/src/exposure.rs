//! Automatic exposure.

use plane::Plane;

/// Luminance to which automatic exposure maps the middle of a picture: photography's 18 % gray card.
const MIDDLE_GRAY: f64 = 0.18;
/// Maximum luminance of pixels that are treated as black, relative to the mean luminance: seventeen stops less.
/// Automatic exposure ignores such pixels.
const LEAST_LIT: f64 = 1.0 / 131_072.0;

/// Returns the exposure that maps the geometric mean of the lit pixels' luminance to middle gray; 1 for a black
/// picture.
#[must_use]
pub fn exposure_for(luminance: &Plane<f32>) -> f32 {
    exposure_for_luminances(luminance.samples()).unwrap_or(1.0)
}

/// Returns the exposure for the luminances of any number of pictures, as [`exposure_for`]; `None` if all are black.
#[must_use]
pub fn exposure_for_luminances(luminances: &[f32]) -> Option<f32> {
    // Ignore pixels far darker than the mean: they are noise and light leaks.
    let mean = luminances.iter().map(|&y| f64::from(y)).sum::<f64>() / luminances.len() as f64;
    let least = mean * LEAST_LIT;
    let lit = luminances.iter().map(|&y| f64::from(y)).filter(|&y| y > 0.0 && y >= least);
    let logs: Vec<f64> = lit.map(f64::ln).collect();
    if logs.is_empty() {
        return None;
    }
    // Use the geometric mean, so that few bright pixels do not darken the picture.
    let mean = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
    Some(((MIDDLE_GRAY / mean) as f32).clamp(1e-20, 1e20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_brings_the_middle_to_gray() {
        let picture = Plane::from_fn(4, 1, |x, _| [0.0, 10.0, 1000.0, 100.0][x]);
        assert!((exposure_for(&picture) - 0.0018).abs() < 1e-6);
        assert_eq!(exposure_for(&Plane::filled(2, 2, 0.0)), 1.0);
        // A light leak next to a lit wall must not change the exposure.
        let leaking = Plane::from_fn(4, 1, |x, _| [1e-9, 10.0, 1000.0, 100.0][x]);
        assert_eq!(exposure_for(&leaking), exposure_for(&picture));
    }
}
