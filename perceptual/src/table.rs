//! Tables of tone curves, for whole frames.

use crate::ToneMap;

/// Number of segments per octave of the argument. With 64, the relative error of a power 1/2.2 is below 1e-5.
const SEGMENTS_PER_OCTAVE: u32 = 64;
/// Number of mantissa bits below the segment number in an `f32`.
const SHIFT: u32 = 23 - SEGMENTS_PER_OCTAVE.ilog2();
/// Smallest argument with its own segment, 2⁻⁴⁰. Below this argument, the table is a straight line to 0.
const SMALLEST: f32 = 1.0 / (1u64 << 40) as f32;
/// Largest argument, 2²⁴. Above it the curve is constant.
const LARGEST: f32 = (1 << 24) as f32;

/// Table of [`ToneMap::encode`] with linear segments: 64 per octave, from 2⁻⁴⁰ to 2²⁴ times the saturating radiance. A
/// segment ends at the saturating radiance, where the slope jumps to 0.
///
/// The error is below 1e-5 (0.002 code values of 219) for display gammas up to 2.4. The table is monotonic.
pub(crate) struct EncodeTable {
    scale: f32,
    nodes: Vec<f32>,
}

impl EncodeTable {
    pub fn new(tone_map: &ToneMap) -> Self {
        let saturation = tone_map.saturation();
        let (first, last) = (SMALLEST.to_bits() >> SHIFT, LARGEST.to_bits() >> SHIFT);
        // The table has one more node than segments, so that the last segment has an end.
        let node = |segment| tone_map.encode(f32::from_bits(segment << SHIFT) * saturation);
        Self { scale: 1.0 / saturation, nodes: (first..=last + 1).map(node).collect() }
    }

    /// Returns the display value of a finite radiance.
    #[inline]
    pub fn get(&self, linear: f32) -> f32 {
        let x = (linear * self.scale).clamp(0.0, LARGEST);
        // Below the first segment, interpolate from 0.
        if x < SMALLEST {
            return self.nodes[0] * (x / SMALLEST);
        }
        // Exponent and leading mantissa bits select the segment. The other bits interpolate.
        let bits = x.to_bits();
        let segment = ((bits >> SHIFT) - (SMALLEST.to_bits() >> SHIFT)) as usize;
        let along = (bits & ((1 << SHIFT) - 1)) as f32 * (1.0 / (1u32 << SHIFT) as f32);
        let (from, to) = (self.nodes[segment], self.nodes[segment + 1]);
        from + along * (to - from)
    }
}

/// Number of segments of [`LumaDecodeTable`], more than 18 per code value. It is a power of two, so that a mask limits
/// the index.
const LUMA_SEGMENTS: usize = 4096;

/// Table of the luminance of a gray pixel as a function of luma, with linear segments. Luma is in code values above
/// black.
///
/// The table approximates [`ToneMap::decode`] of `luma / 219`. It is exact at the nodes. The error is below 0.1 % for
/// luma from 1 to 218. The error is below 0.6 % in the last code value below white, where the inverse of Reinhard's
/// global curve is steep.
pub(crate) struct LumaDecodeTable {
    /// Start value and rise of each segment. Both are read together.
    segments: Box<[[f32; 2]; LUMA_SEGMENTS]>,
}

/// The output omits the segments, which follow from the tone map.
impl std::fmt::Debug for LumaDecodeTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LumaDecodeTable").finish_non_exhaustive()
    }
}

impl LumaDecodeTable {
    pub fn new(tone_map: &ToneMap) -> Self {
        let node = |i: usize| tone_map.decode(i as f32 / LUMA_SEGMENTS as f32);
        let segment = |i: usize| [node(i), node(i + 1) - node(i)];
        let segments: Box<[[f32; 2]]> = (0..LUMA_SEGMENTS).map(segment).collect();
        Self { segments: segments.try_into().expect("as many as there are") }
    }

    /// Returns the luminance of gray pixels for eight luma values. Luma is clamped to 0…219 and must not be NaN.
    ///
    /// Everything except the table access is vectorized over the eight lanes. Luma is scaled to segments. The index of
    /// the segment is the scaled luma minus ½, rounded to the nearest integer. At a node, both adjacent segments are
    /// correct. Adding 2²³ rounds, and leaves the integer in the lowest bits.
    #[inline]
    pub fn get(&self, luma: [f32; 8]) -> [f32; 8] {
        const WHOLE: f32 = (1 << 23) as f32;
        const LAST: f32 = LUMA_SEGMENTS as f32;
        let position = luma.map(|luma| (luma * (LAST / crate::WHITE_LUMA)).clamp(0.0, LAST));
        let whole = position.map(|position| position.clamp(0.5, LAST - 0.5) - 0.5 + WHOLE);
        std::array::from_fn(|i| {
            let [from, rise] = self.segments[whole[i].to_bits() as usize % LUMA_SEGMENTS];
            from + (position[i] - (whole[i] - WHOLE)) * rise
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Operator;

    #[test]
    fn tables_follow_the_curves() {
        for operator in Operator::ALL {
            let tone_map = ToneMap::of(operator).with_exposure(3.0);
            let (encode, decode) = (EncodeTable::new(&tone_map), LumaDecodeTable::new(&tone_map));
            let mut before = 0.0;
            for i in 0..220_000 {
                let radiance = 1e-11 * 10f32.powf(i as f32 * 1e-4);
                let fast = encode.get(radiance);
                assert!((fast - tone_map.encode(radiance)).abs() < 1e-5, "{operator} {radiance}");
                assert!(fast >= before, "{operator} {radiance}");
                before = fast;
            }
            let decode = |luma| decode.get([luma; 8])[7];
            for i in 0..=10_000 {
                let luma = 1.0 + 218.0 * i as f32 * 1e-4;
                let (fast, exact) = (decode(luma), tone_map.decode(luma / crate::WHITE_LUMA));
                let tolerance = if luma > 218.0 { 6e-3 } else { 1e-3 };
                assert!((fast / exact - 1.0).abs() < tolerance, "{operator} {luma}: {fast} {exact}");
            }
            assert!((decode(219.0) / tone_map.decode(1.0) - 1.0).abs() < 1e-6);
            assert!((decode(500.0) / decode(219.0) - 1.0).abs() < 1e-6);
            assert_eq!(decode(-3.0), 0.0);
        }
    }
}
