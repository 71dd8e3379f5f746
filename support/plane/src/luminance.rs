//! Luminance of linear RGB, and the weights of its components.

/// Weights of linear red, green and blue in luminance, and of R′, G′ and B′ in luma (Rec. ITU-R BT.709). Their sum is
/// 1, so luminance has the unit of its components.
pub const LUMINANCE_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Returns the luminance of linear RGB with Rec. ITU-R BT.709 primaries, in the unit of its components.
///
/// ```
/// assert_eq!(plane::luminance([0.0, 2.0, 0.0]), 2.0 * 0.7152);
/// ```
#[inline]
#[must_use]
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    LUMINANCE_WEIGHTS[0] * r + LUMINANCE_WEIGHTS[1] * g + LUMINANCE_WEIGHTS[2] * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_has_the_luminance_of_its_components() {
        assert!((luminance([1.0; 3]) - 1.0).abs() <= f32::EPSILON);
        assert_eq!(luminance([0.0; 3]), 0.0);
        let colors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(colors.map(luminance), LUMINANCE_WEIGHTS);
    }
}
