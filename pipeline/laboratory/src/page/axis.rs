//! Axes with positions of values and tick marks.

/// Axis between two values, drawn between two positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    log: bool,
    from: f64,
    to: f64,
}

impl Axis {
    /// Returns an axis drawn from position `from` to position `to`, which contains all `values` with a margin. A
    /// logarithmic axis ignores values that are not positive.
    pub(super) fn holding(values: impl Iterator<Item = f64>, log: bool, from: f64, to: f64) -> Self {
        let known: Vec<f64> = values.filter(|v| v.is_finite() && (!log || *v > 0.0)).collect();
        let low = known.iter().copied().reduce(f64::min).unwrap_or(if log { 0.1 } else { 0.0 });
        let high = known.iter().copied().reduce(f64::max).unwrap_or(1.0);
        // Add 6 % of the range at both ends, with a minimum if the values are nearly equal.
        let (low, high) = if log {
            let room = (high / low).powf(0.06).max(1.15);
            (low / room, high * room)
        } else {
            let room = if high > low { 0.06 * (high - low) } else { 0.5 * high.abs().max(1e-3) };
            // Extend ranges near zero to start at zero.
            let low = if low >= 0.0 && low < 0.35 * high { 0.0 } else { low - room };
            (low, high + room)
        };
        Self { low, high, log, from, to }
    }

    /// Returns the axis label: `name`, with a note if logarithmic.
    pub(super) fn label(&self, name: &str) -> String {
        if self.log { format!("{name} (logarithmic)") } else { name.to_owned() }
    }

    /// Returns the position of `value`; `None` if the axis cannot show it.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        if !value.is_finite() || (self.log && value <= 0.0) {
            return None;
        }
        let share = if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        Some(self.from + share * (self.to - self.from))
    }

    /// Returns the tick values with their labels.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        let values = if self.log { self.log_ticks() } else { self.linear_ticks() };
        values.into_iter().map(|value| (value, short(value))).collect()
    }

    fn linear_ticks(&self) -> Vec<f64> {
        // Choose the smallest round step that makes at most five intervals.
        let rough = (self.high - self.low) / 5.0;
        let decade = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|&s| s >= rough).unwrap_or(10.0 * decade);
        // Tolerate rounding errors at both ends.
        let first = (self.low / step - 1e-9).ceil() as i64;
        (first..).map(|i| i as f64 * step).take_while(|&v| v <= self.high + 1e-9 * step).collect()
    }

    /// Returns the fewest ticks that show the scale: powers of ten, these times 1, 2 and 5, or these times all digits.
    fn log_ticks(&self) -> Vec<f64> {
        const MULTIPLES: [&[f64]; 3] = [&[1.0], &[1.0, 2.0, 5.0], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]];
        let first = self.low.log10().floor() as i32;
        let last = self.high.log10().ceil() as i32;
        for multiples in MULTIPLES {
            let mut ticks: Vec<f64> = Vec::new();
            for e in first..=last {
                let all = multiples.iter().map(|m| m * 10f64.powi(e));
                ticks.extend(all.filter(|v| (self.low..=self.high).contains(v)));
            }
            if ticks.len() >= 3 {
                return ticks;
            }
        }
        // Logarithmic steps are too coarse for a narrow range.
        self.linear_ticks()
    }
}

/// Formats a number in few characters: 0.02, 1500, 2·10⁻⁵.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    // Write numbers of moderate size without trailing zeros.
    if (1e-3..1e5).contains(&size) {
        let text = format!("{value:.4}");
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    // Write very small and very large numbers as mantissa and power of ten.
    let exponent = size.log10().floor() as i32;
    let mantissa = value / 10f64.powi(exponent);
    let mut raised = String::new();
    for c in exponent.to_string().chars() {
        let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
        raised.push(c.to_digit(10).map_or('⁻', |digit| digits[digit as usize]));
    }
    // Omit a mantissa of 1.
    if (mantissa - 1.0).abs() < 1e-6 {
        format!("10{raised}")
    } else {
        format!("{}·10{raised}", short(round(mantissa)))
    }
}

fn round(value: f64) -> f64 {
    (100.0 * value).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::holding([30.91, 48.66].into_iter(), false, 0.0, 100.0);
        let ticks: Vec<String> = axis.ticks().into_iter().map(|(_, text)| text).collect();
        assert_eq!(ticks, ["30", "35", "40", "45"]);
        assert!(axis.ticks().iter().all(|(v, _)| (0.0..=100.0).contains(&axis.place(*v).unwrap())));
        let axis = Axis::holding([2e-5, 3e-2, 0.0].into_iter(), true, 0.0, 100.0);
        let ticks: Vec<String> = axis.ticks().into_iter().map(|(_, text)| text).collect();
        assert_eq!(ticks, ["10⁻⁴", "0.001", "0.01"]);
        let texts = |low, high| -> Vec<String> {
            let axis = Axis::holding([low, high].into_iter(), true, 0.0, 100.0);
            axis.ticks().into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(texts(2.0, 48.0), ["2", "5", "10", "20", "50"]);
        assert_eq!(texts(0.25, 0.7), ["0.3", "0.4", "0.5", "0.6", "0.7", "0.8"]);
        assert!(texts(0.071, 0.072).len() >= 3);
        assert_eq!((axis.place(0.0), axis.place(f64::NAN)), (None, None));
        // Check that no values, or a single value, still produce an axis.
        for values in [vec![], vec![5.0], vec![0.0, 0.0]] {
            for log in [false, true] {
                let axis = Axis::holding(values.clone().into_iter(), log, 0.0, 100.0);
                assert!(axis.ticks().len() < 20 && axis.place(1.0).is_some_and(f64::is_finite));
            }
        }
        assert_eq!((short(0.02), short(2.5e-5), short(1500.0)), ("0.02".into(), "2.5·10⁻⁵".into(), "1500".into()));
    }
}
