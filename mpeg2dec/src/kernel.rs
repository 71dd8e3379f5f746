//! Half-sample prediction of rows (7.6.4): loops that compilers vectorize.

/// Samples at a whole position of a reference plane, in lines `stride` apart.
#[derive(Clone, Copy)]
pub(crate) struct Origin<'a> {
    pub samples: &'a [u8],
    pub stride: usize,
    /// Half-sample steps to the right and down.
    pub half: [bool; 2],
}

/// Destination of a prediction.
pub(crate) struct Target<'a> {
    pub samples: &'a mut [u8],
    pub stride: usize,
    pub rows: usize,
    /// Whether the prediction is averaged with the samples, instead of replacing them.
    pub average: bool,
}

/// Predicts rows of W samples.
pub(crate) fn predict<const W: usize>(origin: Origin, target: Target) {
    match (origin.half, target.average) {
        ([false, false], false) => rows::<W, false, false, false>(origin, target),
        ([true, false], false) => rows::<W, true, false, false>(origin, target),
        ([false, true], false) => rows::<W, false, true, false>(origin, target),
        ([true, true], false) => rows::<W, true, true, false>(origin, target),
        ([false, false], true) => rows::<W, false, false, true>(origin, target),
        ([true, false], true) => rows::<W, true, false, true>(origin, target),
        ([false, true], true) => rows::<W, false, true, true>(origin, target),
        ([true, true], true) => rows::<W, true, true, true>(origin, target),
    }
}

fn rows<const W: usize, const H: bool, const V: bool, const AVERAGE: bool>(origin: Origin, target: Target) {
    for y in 0..target.rows {
        let upper = &origin.samples[y * origin.stride..][..W + usize::from(H)];
        let lower = if V { &origin.samples[(y + 1) * origin.stride..][..W + usize::from(H)] } else { upper };
        let out = &mut target.samples[y * target.stride..][..W];
        let mut row = [0; W];
        for x in 0..W {
            row[x] = match (H, V) {
                (false, false) => upper[x],
                (true, false) => mean(upper[x], upper[x + 1]),
                (false, true) => mean(upper[x], lower[x]),
                (true, true) => mean_of_four([upper[x], lower[x], upper[x + 1], lower[x + 1]]),
            };
        }
        if AVERAGE {
            for x in 0..W {
                row[x] = mean(out[x], row[x]);
            }
        }
        out.copy_from_slice(&row);
    }
}

/// Returns the mean of two samples, rounded up. Compilers recognize this form as one instruction.
#[inline(always)]
fn mean(a: u8, b: u8) -> u8 {
    ((u16::from(a) + u16::from(b) + 1) >> 1) as u8
}

/// Returns the mean of four samples; one half is rounded up.
///
/// Two steps round up twice. The result is too large by 1 if the means differ in their last bit and one of them was rounded.
#[inline(always)]
fn mean_of_four([a, b, c, d]: [u8; 4]) -> u8 {
    let (first, second) = (mean(a, b), mean(c, d));
    mean(first, second) - (((a ^ b) | (c ^ d)) & (first ^ second) & 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_four_are_exact() {
        for i in 0..1 << 16 {
            let [a, b] = [(i >> 8) as u8, i as u8];
            for [c, d] in [[0, 0], [0, 1], [1, 1], [254, 255], [255, 255], [b, a], [a ^ 1, 77]] {
                let sum = u32::from(a) + u32::from(b) + u32::from(c) + u32::from(d);
                assert_eq!(u32::from(mean_of_four([a, b, c, d])), (sum + 2) / 4);
            }
        }
    }

    #[test]
    fn predictions_follow_their_definition() {
        let samples: Vec<u8> = (0..20 * 20).map(|i| (i * i * 7 + i / 3) as u8).collect();
        for (half, average) in [[false, false], [true, false], [false, true], [true, true]].map(|h| (h, h[0])) {
            let mut out = [77; 8 * 8];
            let origin = Origin { samples: &samples, stride: 20, half };
            predict::<8>(origin, Target { samples: &mut out, stride: 8, rows: 8, average });
            for (i, &sample) in out.iter().enumerate() {
                let (x, y) = (i % 8, i / 8);
                let at = |dx: bool, dy: bool| u32::from(samples[(y + usize::from(dy)) * 20 + x + usize::from(dx)]);
                let [h, v] = half;
                let predicted = (at(false, false) + at(h, false) + at(false, v) + at(h, v) + 2) / 4;
                assert_eq!(u32::from(sample), if average { (77 + predicted).div_ceil(2) } else { predicted });
            }
        }
    }
}
