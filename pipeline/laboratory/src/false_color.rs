//! False colors: dark for low values, bright for high values.

/// Colors at equal steps of the scale from 0 to 1, as R′G′B′ (ours). Brightness rises monotonically, so the scale also
/// works in grayscale.
const STOPS: [[f32; 3]; 6] = [
    [0.02, 0.02, 0.08],
    [0.16, 0.10, 0.44],
    [0.55, 0.15, 0.50],
    [0.88, 0.34, 0.30],
    [0.98, 0.68, 0.25],
    [1.00, 0.98, 0.82],
];

/// Returns the color of `value` on a scale from 0 to 1. Values outside the scale have the color of the nearest end.
pub fn false_color(value: f32) -> [u8; 3] {
    // Interpolate between the two nearest colors.
    let place = value.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let below = (place as usize).min(STOPS.len() - 2);
    let share = place - below as f32;
    std::array::from_fn(|c| {
        let mixed = STOPS[below][c] * (1.0 - share) + STOPS[below + 1][c] * share;
        (255.0 * mixed).round() as u8
    })
}

/// Returns the logarithmic position of `value` between positive `low` and `high`, clamped to 0…1.
pub fn log_share(value: f32, low: f32, high: f32) -> f32 {
    if value > low { ((value / low).ln() / (high / low).ln()).min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_rises_with_the_number() {
        let gray =
            |value: f32| false_color(value).map(f32::from).iter().zip([0.21, 0.72, 0.07]).map(|(c, w)| c * w).sum();
        let grays: Vec<f32> = (0..=100).map(|i| gray(i as f32 / 100.0)).collect();
        assert!(grays.windows(2).all(|pair| pair[1] >= pair[0]), "{grays:?}");
        assert!(grays[0] < 10.0 && grays[100] > 240.0);
        assert_eq!(false_color(f32::NAN), false_color(f32::NAN), "no panic");
        assert!((log_share(4.0, 1.0, 16.0) - 0.5).abs() < 1e-6 && log_share(0.0, 1.0, 2.0) == 0.0);
    }
}
