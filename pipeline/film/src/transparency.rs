//! Pictures without their background, for composition over any other.
//!
//! ```text
//! D = α C + (1 − α) B        D  displayed color        B  displayed background        C  color of the result
//! ```
//! The opacity α is the larger of two numbers: the fraction of the pixel that the scene covers, and the least opacity
//! with which any color C gives D. The second makes shadows on the ground of a studio dark and transparent. Over the
//! original background, the result looks exactly like the original picture.
//!
//! Linear light has associated opacity, as OpenEXR defines it: P = α C = D − (1 − α) B for radiances D and B. P may
//! exceed α, so only darker pixels need opacity outside the covered fraction: α ≥ 1 − D / B.

use plane::Plane;
use render_core::PosedScene;
use renderer::Frame;

/// Number of rays per pixel that measure the covered fraction.
const RAYS: usize = 16;
/// Maximum difference from the background that counts as noise \[codes\].
const NOISE: f32 = 1.5;
/// [`NOISE`] of radiance, as a fraction of a background of about 180 codes.
const LINEAR_NOISE: f32 = 0.02;

/// Picture without its background.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Transparent {
    /// Red, green, blue and opacity as 8-bit codes; the color is not multiplied by the opacity.
    pub shown: Plane<[u8; 4]>,
    /// Radiance, multiplied by the opacity \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Opacity of the radiance, 0…1.
    pub opacity: Plane<f32>,
}

/// Background of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Background {
    /// Radiance \[W·m⁻²·sr⁻¹\].
    pub radiance: [f32; 3],
    /// Displayed color, 0…1.
    pub shown: [f32; 3],
}

/// Returns the fraction of each pixel that surfaces cover, without the ground of a studio.
pub(crate) fn coverage(frame: &Frame) -> Plane<f32> {
    let scene = frame.surfaces.scene();
    let posed = PosedScene::new(&frame.accelerator, &frame.surfaces);
    let shares = frame.seen.instance_shares(posed, RAYS).value;
    let is_behind = |instance: u32| {
        instance == render_core::NOTHING || scene.ground.is_some_and(|ground| ground.instance == instance)
    };
    let mut covered = Vec::new();
    for shares in shares.pixels() {
        covered.push(shares.iter().filter(|share| !is_behind(share.instance)).map(|share| share.share).sum());
    }
    Plane::from_vec(frame.seen.pixels.width(), frame.seen.pixels.height(), covered)
}

/// Returns a picture without its background, given the covered fraction of each pixel.
pub(crate) fn transparent(
    shown: &Plane<[u8; 3]>,
    radiance: &Plane<[f32; 3]>,
    covered: &Plane<f32>,
    background: Background,
) -> Transparent {
    let (width, height) = (shown.width(), shown.height());
    let covered = covered.map(|share| share.clamp(0.0, 1.0));
    let associated =
        Plane::from_fn(width, height, |x, y| associated(radiance.get(x, y), covered.get(x, y), background.radiance));
    Transparent {
        shown: Plane::from_fn(width, height, |x, y| without(shown.get(x, y), covered.get(x, y), background.shown)),
        radiance: associated.map(|(radiance, _)| radiance),
        opacity: associated.map(|(_, opacity)| opacity),
    }
}

/// Returns associated radiance P and opacity α of a pixel without its background.
fn associated(radiance: [f32; 3], covered: f32, background: [f32; 3]) -> ([f32; 3], f32) {
    // Find the least opacity for which P is not negative.
    let mut opacity = covered;
    let mut is_background = covered == 0.0;
    for (d, b) in radiance.into_iter().zip(background) {
        if (d - b).abs() > LINEAR_NOISE * b {
            is_background = false;
            opacity = opacity.max(1.0 - d / b.max(f32::MIN_POSITIVE));
        }
    }
    if is_background {
        return ([0.0; 3], 0.0);
    }
    // Differences within noise may leave a color slightly below 0.
    (std::array::from_fn(|c| (radiance[c] - (1.0 - opacity) * background[c]).max(0.0)), opacity)
}

/// Returns color and opacity of a pixel without its background.
fn without(shown: [u8; 3], covered: f32, background: [f32; 3]) -> [u8; 4] {
    // Find the least opacity for which C is in 0…1.
    let mut least: f32 = 0.0;
    for (code, back) in shown.into_iter().zip(background) {
        let apart = f32::from(code) / 255.0 - back;
        let room = if apart > 0.0 { 1.0 - back } else { back };
        if apart.abs() * 255.0 > NOISE {
            least = least.max(apart.abs() / room.max(1e-6));
        }
    }
    // Round the opacity first, so that the color fits the rounded opacity.
    let opacity = (covered.max(least).min(1.0) * 255.0).round() / 255.0;
    if opacity == 0.0 {
        return [0; 4];
    }
    let mut result = [0, 0, 0, (opacity * 255.0) as u8];
    for (c, (code, back)) in shown.into_iter().zip(background).enumerate() {
        let color = (f32::from(code) / 255.0 - (1.0 - opacity) * back) / opacity;
        result[c] = (color * 255.0).round().clamp(0.0, 255.0) as u8;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over its own background, each pixel looks as before, up to rounding.
    #[test]
    fn pictures_over_their_background_look_as_before() {
        let background = [0.7, 0.72, 0.75];
        for shown in [[0, 0, 0], [255, 255, 255], [178, 184, 191], [90, 200, 30], [150, 160, 170], [250, 10, 250]] {
            for covered in [0.0, 0.1, 0.5, 1.0] {
                let [r, g, b, a] = without(shown, covered, background).map(f32::from);
                let opacity = a / 255.0;
                assert!(opacity >= covered - 1.0 / 255.0, "{opacity} of {covered}");
                // The background itself disappears.
                for ((code, color), back) in shown.into_iter().zip([r, g, b]).zip(background) {
                    let over = opacity * color + (1.0 - opacity) * back * 255.0;
                    assert!((over - f32::from(code)).abs() <= 2.0, "{shown:?} {covered}: {over} for {code}");
                }
            }
        }
        assert_eq!(without([179, 184, 191], 0.0, background), [0; 4]);
    }

    /// Over its own background, each radiance is as before, up to noise. Light above the background is added.
    #[test]
    fn radiances_over_their_background_are_as_before() {
        let background = [0.5, 0.25, 4.0];
        for radiance in [[0.0; 3], [0.5, 0.25, 4.0], [0.1, 0.2, 3.0], [9.0, 0.3, 0.0], [0.6, 0.3, 5.0]] {
            for covered in [0.0, 0.1, 0.5, 1.0] {
                let (color, opacity) = associated(radiance, covered, background);
                assert!((covered..=1.0).contains(&opacity) && color.iter().all(|&c| c >= 0.0));
                for c in 0..3 {
                    let over = color[c] + (1.0 - opacity) * background[c];
                    assert!((over - radiance[c]).abs() <= LINEAR_NOISE * background[c], "{radiance:?} {covered}");
                }
            }
        }
        assert_eq!(associated(background, 0.0, background), ([0.0; 3], 0.0));
        // Shadow is black with opacity, half of a covered pixel is half its color, and added light has no opacity.
        assert_eq!(associated([0.25, 0.125, 2.0], 0.0, background), ([0.0; 3], 0.5));
        assert_eq!(associated([1.0, 0.5, 2.5], 0.5, background), ([0.75, 0.375, 0.5], 0.5));
        assert_eq!(associated([1.0, 0.5, 8.0], 0.0, background), (background, 0.0));
        // Over black, all light is added.
        assert_eq!(associated([1.0, 0.0, 0.0], 0.25, [0.0; 3]), ([1.0, 0.0, 0.0], 0.25));
    }

    /// A pixel half covered by a white object over a gray background contains the object's color.
    #[test]
    fn borders_have_the_color_of_the_object() {
        let near = |found: [u8; 4], expected: [u8; 4]| {
            let is_near = found.into_iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(is_near, "{found:?} for {expected:?}");
        };
        near(without([191, 191, 191], 0.5, [0.5; 3]), [254, 254, 254, 128]);
        // A shadow is black.
        near(without([64, 64, 64], 0.0, [128.0 / 255.0; 3]), [0, 0, 0, 128]);
    }
}
