//! Features of single pixels: intensity, opponent colors, and motion along each axis.

use super::normalize::largest_of;
use plane::Plane;

/// Intensity below which a pixel has no hue, as a fraction of the largest intensity \[Itti98\].
const DARKEST_HUE: f32 = 0.1;

/// Intensity and opponent colors of a picture, according to (S1) and (S2).
pub struct Opponents {
    /// Intensity I, 0…1.
    pub intensity: Plane<f32>,
    /// Opponent color R − G, −3…3.
    pub red_green: Plane<f32>,
    /// Opponent color B − Y, −1.5…3.
    pub blue_yellow: Plane<f32>,
}

impl Opponents {
    /// Computes the features from display values. Pixels that are not finite count as black.
    pub fn new(rgb: &Plane<[f32; 3]>) -> Self {
        // Compute I. Its maximum decides which pixels have hues.
        let intensity = rgb.map(|rgb| shown(rgb).iter().sum::<f32>() / 3.0);
        let darkest = DARKEST_HUE * largest_of(intensity.samples());

        // Compute R − G and B − Y.
        let (width, height) = (rgb.width(), rgb.height());
        let mut red_green = Plane::filled(width, height, 0.0);
        let mut blue_yellow = red_green.clone();
        let opponents = red_green.samples_mut().iter_mut().zip(blue_yellow.samples_mut());
        let pixels = rgb.samples().iter().zip(intensity.samples());
        for ((red_green, blue_yellow), (&rgb, &i)) in opponents.zip(pixels) {
            let scale = if i > darkest { 1.0 / i } else { 0.0 };
            [*red_green, *blue_yellow] = opponents_of(shown(rgb).map(|c| c * scale));
        }
        Self { intensity, red_green, blue_yellow }
    }
}

/// Returns display values clamped to 0…1, or black if a value is not finite.
#[inline(always)]
fn shown(rgb: [f32; 3]) -> [f32; 3] {
    let finite = rgb.iter().all(|c| c.is_finite());
    rgb.map(|c| if finite { c.clamp(0.0, 1.0) } else { 0.0 })
}

/// Returns R − G and B − Y of (S2) for r/I, g/I and b/I.
#[inline(always)]
fn opponents_of([r, g, b]: [f32; 3]) -> [f32; 2] {
    let red = (r - 0.5 * (g + b)).max(0.0);
    let green = (g - 0.5 * (r + b)).max(0.0);
    let blue = (b - 0.5 * (r + g)).max(0.0);
    let yellow = (0.5 * (r + g) - 0.5 * (r - g).abs() - b).max(0.0);
    [red - green, blue - yellow]
}

/// Returns planes of u_x and u_y. Motion that is not finite counts as 0. Motion longer than the longer side of the
/// picture is clamped to it.
pub fn motion_axes(motion: &Plane<[f32; 2]>) -> [Plane<f32>; 2] {
    let longest = motion.width().max(motion.height()) as f32;
    [0, 1].map(|axis| {
        motion.map(|u| {
            let finite = u.iter().all(|c| c.is_finite());
            if finite { u[axis].clamp(-longest, longest) } else { 0.0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saliency_opponents_of_pure_colors() {
        let of = |rgb: [f32; 3]| {
            let o = Opponents::new(&Plane::filled(1, 1, rgb));
            [o.intensity.get(0, 0), o.red_green.get(0, 0), o.blue_yellow.get(0, 0)]
        };
        let third = 1.0 / 3.0;
        let colors = [
            ([1.0, 0.0, 0.0], [third, 3.0, 0.0]),
            ([0.0, 1.0, 0.0], [third, -3.0, 0.0]),
            ([0.0, 0.0, 1.0], [third, 0.0, 3.0]),
            ([1.0, 1.0, 0.0], [2.0 * third, 0.0, -1.5]),
            ([0.5, 0.5, 0.5], [0.5, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([f32::NAN, 1.0, 1.0], [0.0, 0.0, 0.0]),
        ];
        for (rgb, expected) in colors {
            let found = of(rgb);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{rgb:?}: {found:?}");
        }
    }

    #[test]
    fn saliency_sees_no_hue_in_the_dark() {
        let rgb = Plane::from_vec(3, 1, vec![[0.9; 3], [0.2, 0.03, 0.03], [0.3, 0.01, 0.01]]);
        let red_green = Opponents::new(&rgb).red_green;
        assert_eq!((red_green.get(0, 0), red_green.get(1, 0)), (0.0, 0.0));
        assert!(red_green.get(2, 0) > 2.0);
    }
}
