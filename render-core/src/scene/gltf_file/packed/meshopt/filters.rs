//! "Appendix B: Filters". Values that a filter leaves undefined become arbitrary numbers.

use super::Filter;

/// Applies the filter to elements of `stride` bytes, in place.
pub(super) fn apply(filter: Filter, stride: usize, data: &mut [u8]) {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => each::<4>(data, |e| {
            let [x, y, z] = octahedral(e.map(|b| f32::from(b as i8)), 127.0);
            [x as i8 as u8, y as i8 as u8, z as i8 as u8, e[3]]
        }),
        (Filter::Octahedral, _) => each::<8>(data, |e| {
            let e = shorts(e);
            let [x, y, z] = octahedral(e.map(f32::from), 32767.0);
            bytes([x as i16, y as i16, z as i16, e[3]])
        }),
        (Filter::Quaternion, _) => each::<8>(data, |e| bytes(quaternion(shorts(e)))),
        (Filter::Exponential, _) => each::<4>(data, |e| exponential(i32::from_le_bytes(e)).to_le_bytes()),
        (Filter::Color, 4) => each::<4>(data, |[y, co, cg, a]| {
            let chroma = [i32::from(co as i8), i32::from(cg as i8)];
            color(i32::from(y), chroma, i32::from(a), 255.0).map(|c| c as u8)
        }),
        (Filter::Color, _) => each::<8>(data, |e| {
            let [y, co, cg, a] = shorts(e);
            let chroma = [i32::from(co), i32::from(cg)];
            bytes(color(i32::from(y as u16), chroma, i32::from(a as u16), 65535.0).map(|c| c as u16 as i16))
        }),
    }
}

fn each<const N: usize>(data: &mut [u8], change: impl Fn([u8; N]) -> [u8; N]) {
    for element in data.as_chunks_mut::<N>().0 {
        *element = change(*element);
    }
}

fn shorts(e: [u8; 8]) -> [i16; 4] {
    std::array::from_fn(|i| i16::from_le_bytes([e[2 * i], e[2 * i + 1]]))
}

fn bytes(numbers: [i16; 4]) -> [u8; 8] {
    let [[a, b], [c, d], [e, f], [g, h]] = numbers.map(i16::to_le_bytes);
    [a, b, c, d, e, f, g, h]
}

/// Decodes filter 1: a unit vector from two octahedral coordinates. The third number represents 1.
fn octahedral([x, y, one, _]: [f32; 4], most: f32) -> [f32; 3] {
    // Unfold the lower hemisphere, then scale the vector to unit length.
    let z = one - x.abs() - y.abs();
    let fold = z.min(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let scale = most / (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| (c * scale).round())
}

/// Decodes filter 2: a rotation without its largest component. The last number contains the index of this component.
fn quaternion(e: [i16; 4]) -> [i16; 4] {
    // Scale by the stored maximum, which also contains the index in its lowest two bits.
    let one = f32::from(e[3] | 3);
    let [x, y, z, _] = e.map(|c| f32::from(c) / one * std::f32::consts::FRAC_1_SQRT_2);
    // Compute the largest component from the unit length, and rotate it to its position.
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (e[3] & 3) as usize;
    let mut out = [0; 4];
    for (place, value) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + place) % 4] = (value * 32767.0).round() as i16;
    }
    out
}

/// Decodes filter 3: an 8-bit binary exponent and a signed 24-bit factor.
fn exponential(code: i32) -> f32 {
    let (exponent, factor) = (code >> 24, (code << 8) >> 8);
    // The result is exact for exponents from −100 to 100, the range of the specification.
    f32::from_bits(((exponent.clamp(-126, 127) + 127) as u32) << 23) * factor as f32
}

/// Decodes filter 4: luma, two chroma values, and opacity. The highest bit of opacity determines the scale of all four.
fn color(y: i32, [co, cg]: [i32; 2], a: i32, most: f32) -> [f32; 4] {
    // The highest bit of the opacity marks the number of bits per component.
    let bits = 32 - a.leading_zeros();
    let scale = (1i32 << bits) - 1;
    let opacity = a & (scale >> 1);
    let factor = most / scale as f32;
    [y + co - cg, y + cg, y - co - cg, (opacity << 1) | (opacity & 1)].map(|c| (c as f32 * factor).round())
}
