//! Periodic noise and hashing for repeating procedural textures.

/// Returns a hash of three integers in 0..1.
#[must_use]
pub fn hash(x: i32, y: i32, seed: u32) -> f32 {
    let mut h =
        (x as u32).wrapping_mul(0x8da6_b343) ^ (y as u32).wrapping_mul(0xd816_3841) ^ seed.wrapping_mul(0xcb1a_b31f);
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^= h >> 16;
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Returns the smooth step of x from 0 at `low` to 1 at `high`.
#[must_use]
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Returns the linear interpolation from `a` to `b`.
#[must_use]
pub fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Returns value noise in 0..1 that repeats over the unit square. The grid has `nx` × `ny` cells.
#[must_use]
pub fn value(u: f32, v: f32, nx: i32, ny: i32, seed: u32) -> f32 {
    let (x, y) = (u * nx as f32, v * ny as f32);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    // Smooth the fractions, so that the gradient is continuous across cells.
    let (sx, sy) = (fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy));
    // Find the four corners of the cell. The last cell of a row or column wraps around to the first.
    let (left, top) = ((x0 as i32).rem_euclid(nx), (y0 as i32).rem_euclid(ny));
    let right = if left + 1 == nx { 0 } else { left + 1 };
    let bottom = if top + 1 == ny { 0 } else { top + 1 };
    let upper = mix(hash(left, top, seed), hash(right, top, seed), sx);
    let lower = mix(hash(left, bottom, seed), hash(right, bottom, seed), sx);
    mix(upper, lower, sy)
}

/// Returns several octaves of value noise in 0..1 with a mean near ½. Each octave is twice as fine and half as strong
/// as the previous one.
#[must_use]
pub fn fractal([u, v]: [f32; 2], [nx, ny]: [i32; 2], octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for octave in 0..octaves {
        sum += weight * value(u, v, nx << octave, ny << octave, seed + octave * 101);
        total += weight;
        weight *= 0.5;
    }
    sum / total
}
