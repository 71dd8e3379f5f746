//! Numbers that headers contain as codes.

/// quantiser_scale of quantiser_scale_code 1 to 31 with q_scale_type 1 (Table 7-6).
#[rustfmt::skip]
pub const NON_LINEAR_SCALES: [u32; 31] = [
    1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20, 22, 24, 28, 32, 36, 40, 44, 48, 52, 56, 64, 72, 80, 88, 96, 104, 112,
];

/// Frame rates, as (numerator, denominator), for frame_rate_code 1, 2, 3, … (Table 6-4).
pub const FRAME_RATES: [(u32, u32); 8] =
    [(24000, 1001), (24, 1), (25, 1), (30000, 1001), (30, 1), (50, 1), (60000, 1001), (60, 1)];

/// Height of a sample divided by its width, for pel_aspect_ratio 1, 2, 3, … of MPEG-1 (11172-2, 2.4.3.2).
pub const PEL_ASPECT_RATIOS: [f64; 14] =
    [1.0, 0.6735, 0.7031, 0.7615, 0.8055, 0.8437, 0.8935, 0.9157, 0.9815, 1.0255, 1.0695, 1.0950, 1.1575, 1.2015];
