//! quantiser_scale and its codes (7.4.2.2).

use crate::ConfigError;
use mpeg2::NON_LINEAR_SCALES;

/// Coded form of a quantiser_scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuantiserScaleCode {
    /// False for the linear table (2, 4, … 62), true for the non-linear one (1 … 112).
    pub q_scale_type: bool,
    /// quantiser_scale_code, 1 to 31.
    pub code: u8,
}

/// Returns the quantiser_scale of a code (Table 7-6).
pub(crate) fn quantiser_scale_of(code: QuantiserScaleCode) -> u32 {
    if code.q_scale_type { NON_LINEAR_SCALES[usize::from(code.code) - 1] } else { 2 * u32::from(code.code) }
}

/// Returns the quantiser_scale_code nearest to a scale in sixteenths.
pub(crate) fn nearest_code(q_scale_type: bool, scale_x16: u32) -> u8 {
    let distance =
        |&code: &u8| (16 * quantiser_scale_of(QuantiserScaleCode { q_scale_type, code })).abs_diff(scale_x16);
    (1..=31).min_by_key(distance).expect("31 codes")
}

/// Returns one of the two scales around `scale_x16`, in sixteenths. Their mean over many rows is `scale_x16`.
pub(crate) fn spread_over_rows(q_scale_type: bool, scale_x16: u32, row: usize) -> u32 {
    neighbors(q_scale_type, scale_x16).map_or(scale_x16, |neighbors| one_of(neighbors, scale_x16, row))
}

/// Returns the two scales around `scale_x16`, in sixteenths; both are equal if it exists. `None` outside the table.
pub(crate) fn neighbors(q_scale_type: bool, scale_x16: u32) -> Option<[u32; 2]> {
    let scales = (1..=31).map(|code| 16 * quantiser_scale_of(QuantiserScaleCode { q_scale_type, code }));
    let below = scales.clone().filter(|&scale| scale <= scale_x16).max()?;
    Some([below, scales.filter(|&scale| scale >= scale_x16).min()?])
}

/// Returns the neighbor that a row uses for a scale between two existing scales.
pub(crate) fn one_of([below, above]: [u32; 2], scale_x16: u32, row: usize) -> u32 {
    // This order separates neighboring rows: 0, 128, 64, 192, …
    let order = u32::from((row as u8).reverse_bits());
    if 256 * (scale_x16 - below) > order * (above - below) { above } else { below }
}

/// Returns the code of a quantiser_scale (7.4.2.2, Table 7-6). Even values to 62 use the linear table, other values the
/// non-linear one.
///
/// ```
/// use mpeg2enc::quantiser_scale_code;
/// assert_eq!(quantiser_scale_code(16)?.code, 8);
/// assert!(quantiser_scale_code(7)?.q_scale_type);
/// let message = quantiser_scale_code(113).unwrap_err().to_string();
/// assert_eq!(message, "quantiser_scale 113 does not exist; the nearest values are 112 and 104");
/// # Ok::<(), mpeg2enc::ConfigError>(())
/// ```
///
/// # Errors
/// If neither table contains the value.
pub fn quantiser_scale_code(quantiser_scale: u32) -> Result<QuantiserScaleCode, ConfigError> {
    if (2..=62).contains(&quantiser_scale) && quantiser_scale.is_multiple_of(2) {
        return Ok(QuantiserScaleCode { q_scale_type: false, code: (quantiser_scale / 2) as u8 });
    }
    if let Some(index) = NON_LINEAR_SCALES.iter().position(|&scale| scale == quantiser_scale) {
        return Ok(QuantiserScaleCode { q_scale_type: true, code: index as u8 + 1 });
    }
    // Suggest the nearest values of both tables.
    let mut scales: Vec<u32> = NON_LINEAR_SCALES.into_iter().chain((1..=31).map(|code| 2 * code)).collect();
    scales.sort_unstable();
    scales.dedup();
    scales.sort_by_key(|scale| scale.abs_diff(quantiser_scale));
    Err(ConfigError::QuantiserScale { value: quantiser_scale, nearest: scales[0], second: scales[1] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_the_requested_mean() {
        for q_scale_type in [false, true] {
            for scale_x16 in 32..16 * 62 {
                let rows: Vec<u32> = (0..256).map(|row| spread_over_rows(q_scale_type, scale_x16, row)).collect();
                let mean = f64::from(rows.iter().sum::<u32>()) / 256.0;
                assert!((mean - f64::from(scale_x16)).abs() <= 0.5, "{mean} for {scale_x16}");
                // Each scale exists, and at most two different ones occur.
                assert!(rows.iter().all(|&x16| x16 % 16 == 0 && spread_over_rows(q_scale_type, x16, 1) == x16));
                assert!(rows.iter().max().unwrap() - rows.iter().min().unwrap() <= 16 * 8);
            }
        }
        assert_eq!(spread_over_rows(true, 16 * 120, 3), 16 * 120, "above the last");
    }

    #[test]
    fn every_code_gives_its_scale() {
        for scale in 0..200 {
            match quantiser_scale_code(scale) {
                Ok(QuantiserScaleCode { q_scale_type: false, code }) => assert_eq!(2 * u32::from(code), scale),
                Ok(QuantiserScaleCode { q_scale_type: true, code }) => {
                    assert_eq!(NON_LINEAR_SCALES[usize::from(code) - 1], scale)
                }
                Err(error) => {
                    assert!(error.to_string().starts_with(&format!("quantiser_scale {scale} does not exist")))
                }
            }
        }
        let nearest = |scale| quantiser_scale_code(scale).unwrap_err().to_string();
        assert!(nearest(0).ends_with("nearest values are 1 and 2"));
        assert!(nearest(63).ends_with("nearest values are 62 and 64"));
    }
}
