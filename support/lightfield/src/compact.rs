//! Light of a texel by direction in a form of fixed size, which a GPU samples without decoding.
//!
//! ```text
//! M(ω) ≈ Σ c_k B_k(ω)        Σ w_i |M(ω_i) − Σ c_k B_k(ω_i)|² → min
//!
//! kind          B                                              coefficients    bytes
//! constant      1                                              1               4      shared exponent
//! linear        spherical harmonics of degrees 0 and 1         4               24     half floats
//! quadratic     spherical harmonics of degrees 0 to 2          9               54     half floats
//! octahedral    bilinear weights of a map of 8×8 directions    64              256    shared exponent
//!
//! w  1 above the horizon, 10⁻⁶ below it
//! ```
//!
//! A texel has the smallest kind with a relative RMS error, after rounding and above the horizon, within a tolerance.

use crate::harmonics::basis;
use crate::octahedral::{DirectionCells, OctahedralMap};
use crate::packed::{from_shared_exponent, half, shared_exponent};
use glam::{DVec3, Vec3};
use half::f16;

/// Map of the octahedral kind.
const MAP: OctahedralMap = OctahedralMap { side: 8 };
/// Weight of directions below the horizon: they only determine coefficients without any other direction.
const BELOW: f64 = 1e-6;
/// Ridge of the normal equations, as a fraction of their mean diagonal. It bounds undetermined coefficients.
const RIDGE: f64 = 1e-9;

/// Form of a texel's light, from the smallest to the largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CompactKind {
    /// The same light in all directions.
    Constant,
    /// Spherical harmonics of degrees 0 and 1, in the order of [`basis`].
    Linear,
    /// Spherical harmonics of degrees 0 to 2, in the order of [`basis`].
    Quadratic,
    /// Octahedral map of 8×8 directions with bilinear weights, in the order of [`OctahedralMap`].
    Octahedral,
}

impl CompactKind {
    /// All kinds, from the smallest to the largest.
    pub const ALL: [Self; 4] = [Self::Constant, Self::Linear, Self::Quadratic, Self::Octahedral];

    /// Returns the number of RGB coefficients of a texel.
    #[must_use]
    pub fn coefficients(self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 4,
            Self::Quadratic => 9,
            Self::Octahedral => MAP.len(),
        }
    }

    /// Returns whether coefficients are three half floats. Otherwise, they are four bytes with a shared exponent.
    #[must_use]
    pub fn has_halves(self) -> bool {
        matches!(self, Self::Linear | Self::Quadratic)
    }

    /// Returns the number of bytes of a texel.
    #[must_use]
    pub fn bytes(self) -> usize {
        self.coefficients() * if self.has_halves() { 6 } else { 4 }
    }

    /// Returns the functions B_k that are not zero in a unit direction.
    fn functions(self, direction: Vec3) -> Functions {
        let mut row = Functions { count: 0, indices: [0; 9], values: [0.0; 9] };
        match self {
            Self::Constant => row.push(0, 1.0),
            Self::Linear | Self::Quadratic => {
                for (k, y) in basis(direction).into_iter().enumerate().take(self.coefficients()) {
                    row.push(k, y);
                }
            }
            Self::Octahedral => {
                let DirectionCells { cells, weights } = MAP.bilinear(direction);
                for (cell, weight) in cells.into_iter().zip(weights) {
                    row.push(cell, weight);
                }
            }
        }
        row
    }
}

/// Values of the functions B_k in one direction. An index may be repeated.
#[derive(Clone, Copy, Debug)]
struct Functions {
    count: usize,
    indices: [u8; 9],
    values: [f32; 9],
}

impl Functions {
    fn push(&mut self, index: usize, value: f32) {
        (self.indices[self.count], self.values[self.count]) = (index as u8, value);
        self.count += 1;
    }

    fn iter(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        (0..self.count).map(|at| (self.indices[at].into(), self.values[at]))
    }
}

/// Light of one texel in compact form.
#[derive(Clone, Debug, PartialEq)]
pub struct CompactMap {
    kind: CompactKind,
    bytes: Vec<u8>,
    error: f32,
}

impl CompactMap {
    /// Kind of the map.
    #[must_use]
    pub fn kind(&self) -> CompactKind {
        self.kind
    }

    /// Coefficients in little-endian order, red first.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Relative RMS error above the horizon, √(Σ|M − M'|² / Σ|M|²). It may exceed the tolerance of the fit, if no kind
    /// reaches the tolerance.
    #[must_use]
    pub fn error(&self) -> f32 {
        self.error
    }

    /// Returns the radiance in a unit direction, at least 0 \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        radiance(self.kind, &self.bytes, direction)
    }
}

/// Least-squares fits for all texels with the same normal and the same directions.
#[derive(Clone, Debug)]
pub struct CompactFit {
    /// Whether each direction is above the horizon.
    is_above: Vec<bool>,
    systems: [System; 4],
}

impl CompactFit {
    /// Prepares fits to samples in these unit `directions`, for texels with this unit `normal`.
    #[must_use]
    pub fn new(directions: &[Vec3], normal: Vec3) -> Self {
        let is_above: Vec<bool> = directions.iter().map(|direction| direction.dot(normal) > 0.0).collect();
        let systems = CompactKind::ALL.map(|kind| System::new(kind, directions, &is_above));
        Self { is_above, systems }
    }

    /// Fits a map to the radiance in each direction \[W·m⁻²·sr⁻¹\]: the smallest kind with a relative RMS error of at
    /// most `tolerance`, or the kind with the smallest error if none is within the tolerance. Missing or non-finite
    /// radiance counts as zero.
    #[must_use]
    pub fn map(&self, light: &[Vec3], tolerance: f32) -> CompactMap {
        let finite = |at: usize| light.get(at).copied().filter(|light| light.is_finite()).unwrap_or(Vec3::ZERO);
        let light: Vec<Vec3> = (0..self.is_above.len()).map(finite).collect();
        let mut best: Option<CompactMap> = None;
        for system in &self.systems {
            let bytes = system.fit(&light, &self.is_above);
            let error = self.error(system, &bytes, &light);
            if best.as_ref().is_none_or(|best| error < best.error) {
                best = Some(CompactMap { kind: system.kind, bytes, error });
            }
            if error <= tolerance {
                break;
            }
        }
        best.expect("the first kind has an error, which is a number")
    }

    /// Returns the relative RMS error above the horizon.
    fn error(&self, system: &System, bytes: &[u8], light: &[Vec3]) -> f32 {
        let (mut error, mut all) = (0.0, 0.0);
        for ((row, light), _) in system.rows.iter().zip(light).zip(&self.is_above).filter(|(_, above)| **above) {
            error += f64::from((sum(system.kind, bytes, row) - *light).length_squared());
            all += f64::from(light.length_squared());
        }
        if error > 0.0 { (error / all.max(f64::MIN_POSITIVE)).sqrt() as f32 } else { 0.0 }
    }
}

/// Normal equations of one kind, factored as L Lᵀ by Cholesky's method.
#[derive(Clone, Debug)]
struct System {
    kind: CompactKind,
    /// Functions in each direction.
    rows: Vec<Functions>,
    /// Rows of L, each as long as the matrix is wide.
    lower: Vec<f64>,
}

impl System {
    fn new(kind: CompactKind, directions: &[Vec3], is_above: &[bool]) -> Self {
        let count = kind.coefficients();
        let rows: Vec<Functions> = directions.iter().map(|&direction| kind.functions(direction)).collect();
        let mut lower = vec![0.0; count * count];
        for (row, &above) in rows.iter().zip(is_above) {
            for (i, a) in row.iter() {
                for (j, b) in row.iter() {
                    lower[i * count + j] += weight(above) * f64::from(a) * f64::from(b);
                }
            }
        }
        // Add the ridge, so that the matrix is positive definite.
        let diagonal: f64 = (0..count).map(|i| lower[i * count + i]).sum();
        let ridge = (RIDGE * diagonal / count as f64).max(f64::MIN_POSITIVE.sqrt());
        for i in 0..count {
            lower[i * count + i] += ridge;
        }
        factor(&mut lower, count);
        Self { kind, rows, lower }
    }

    /// Returns the bytes of the coefficients that fit `light` best.
    fn fit(&self, light: &[Vec3], is_above: &[bool]) -> Vec<u8> {
        let count = self.kind.coefficients();
        let mut right = vec![DVec3::ZERO; count];
        for ((row, light), &above) in self.rows.iter().zip(light).zip(is_above) {
            for (i, a) in row.iter() {
                right[i] += light.as_dvec3() * (weight(above) * f64::from(a));
            }
        }
        solve(&self.lower, &mut right);

        // Round the coefficients to the format of the kind.
        let mut bytes = Vec::with_capacity(self.kind.bytes());
        for coefficient in right {
            let coefficient = coefficient.as_vec3();
            match self.kind.has_halves() {
                true => coefficient.to_array().iter().for_each(|&channel| bytes.extend(half(channel).to_le_bytes())),
                false => bytes.extend(shared_exponent(coefficient).to_le_bytes()),
            }
        }
        bytes
    }
}

/// Returns the weight of a direction.
fn weight(is_above: bool) -> f64 {
    if is_above { 1.0 } else { BELOW }
}

/// Replaces the lower triangle of a positive definite matrix by its factor L.
fn factor(matrix: &mut [f64], count: usize) {
    for i in 0..count {
        for j in 0..=i {
            let mut rest = matrix[i * count + j];
            for k in 0..j {
                rest -= matrix[i * count + k] * matrix[j * count + k];
            }
            matrix[i * count + j] = if i == j { rest.sqrt() } else { rest / matrix[j * count + j] };
        }
    }
}

/// Replaces `right` by the solution x of L Lᵀ x = `right`.
fn solve(lower: &[f64], right: &mut [DVec3]) {
    let count = right.len();
    for i in 0..count {
        for k in 0..i {
            let known = right[k];
            right[i] -= known * lower[i * count + k];
        }
        right[i] /= lower[i * count + i];
    }
    for i in (0..count).rev() {
        for k in i + 1..count {
            let known = right[k];
            right[i] -= known * lower[k * count + i];
        }
        right[i] /= lower[i * count + i];
    }
}

/// Returns the radiance of a texel's bytes in a unit direction, at least 0.
fn radiance(kind: CompactKind, bytes: &[u8], direction: Vec3) -> Vec3 {
    sum(kind, bytes, &kind.functions(direction))
}

/// Returns the sum of a texel's coefficients times `functions`, at least 0.
fn sum(kind: CompactKind, bytes: &[u8], functions: &Functions) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (index, value) in functions.iter() {
        sum += coefficient(kind, bytes, index) * value;
    }
    sum.max(Vec3::ZERO)
}

/// Returns a coefficient of a texel.
fn coefficient(kind: CompactKind, bytes: &[u8], index: usize) -> Vec3 {
    if kind.has_halves() {
        let half = |channel: usize| f16::from_le_bytes([bytes[2 * channel], bytes[2 * channel + 1]]).to_f32();
        return Vec3::new(half(3 * index), half(3 * index + 1), half(3 * index + 2));
    }
    let bytes = &bytes[4 * index..];
    from_shared_exponent(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}

/// Place of a texel in [`CompactPages`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactPlace {
    /// Page of the texel.
    pub kind: CompactKind,
    /// Row in the page.
    pub row: u32,
}

/// Compact maps of many texels: one page per kind, with one row per texel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompactPages {
    pages: [Vec<u8>; 4],
    /// Sum of the relative RMS errors of all maps.
    errors: f64,
    /// Number of maps with errors above the tolerance.
    coarse: usize,
}

impl CompactPages {
    /// Adds a map to the page of its kind. The map counts as coarse if its error exceeds `tolerance`.
    pub fn push(&mut self, map: &CompactMap, tolerance: f32) -> CompactPlace {
        let page = &mut self.pages[map.kind as usize];
        let row = (page.len() / map.kind.bytes()) as u32;
        page.extend(&map.bytes);
        self.errors += f64::from(map.error);
        self.coarse += usize::from(map.error > tolerance);
        CompactPlace { kind: map.kind, row }
    }

    /// Bytes of the page of a kind, row by row.
    #[must_use]
    pub fn page(&self, kind: CompactKind) -> &[u8] {
        &self.pages[kind as usize]
    }

    /// Returns the number of texels in the page of a kind.
    #[must_use]
    pub fn rows(&self, kind: CompactKind) -> usize {
        self.page(kind).len() / kind.bytes()
    }

    /// Returns the number of texels in all pages.
    #[must_use]
    pub fn texels(&self) -> usize {
        CompactKind::ALL.into_iter().map(|kind| self.rows(kind)).sum()
    }

    /// Returns the number of texels with errors above their tolerance.
    #[must_use]
    pub fn coarse(&self) -> usize {
        self.coarse
    }

    /// Returns the mean of the texels' relative RMS errors; 0 without texels.
    #[must_use]
    pub fn mean_error(&self) -> f64 {
        self.errors / self.texels().max(1) as f64
    }

    /// Returns the mean number of bytes per texel; 0 without texels.
    #[must_use]
    pub fn bytes_per_texel(&self) -> f64 {
        let bytes: usize = self.pages.iter().map(Vec::len).sum();
        bytes as f64 / self.texels().max(1) as f64
    }

    /// Returns the radiance of a texel in a unit direction, or `None` if the row does not exist \[W·m⁻²·sr⁻¹\].
    #[must_use]
    pub fn radiance(&self, place: CompactPlace, direction: Vec3) -> Option<Vec3> {
        let first = place.row as usize * place.kind.bytes();
        let bytes = self.page(place.kind).get(first..first + place.kind.bytes())?;
        Some(radiance(place.kind, bytes, direction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harmonics::Harmonics;

    /// Returns the directions of a map of 16×16 cells.
    fn directions() -> Vec<Vec3> {
        let map = OctahedralMap { side: 16 };
        (0..map.len()).map(|k| map.direction(k % 16, k / 16)).collect()
    }

    fn fitted(light: impl Fn(Vec3) -> Vec3, normal: Vec3, tolerance: f32) -> CompactMap {
        let directions = directions();
        let light: Vec<Vec3> = directions.iter().map(|&direction| light(direction)).collect();
        CompactFit::new(&directions, normal).map(&light, tolerance)
    }

    const COLOR: Vec3 = Vec3::new(0.5, 2.0, 7.0);

    /// Returns light with all coefficients up to a degree, positive in all directions.
    fn harmonic(degree: usize) -> impl Fn(Vec3) -> Vec3 {
        let mut light = Harmonics::default();
        for k in 0..(degree + 1) * (degree + 1) {
            light.coefficients[k] = COLOR * if k == 0 { 4.0 } else { 0.2 * (1.0 + k as f32 / 9.0) };
        }
        move |direction| light.radiance(direction)
    }

    /// Returns the radiance of an octahedral map with arbitrary cells.
    fn cells(direction: Vec3) -> Vec3 {
        let DirectionCells { cells, weights } = MAP.bilinear(direction);
        let cell = |corner: usize| COLOR * (1.0 + (cells[corner] * 29 % 64) as f32) * weights[corner];
        (0..4).map(cell).sum()
    }

    /// Each kind reproduces the light that it can represent, within the rounding of its coefficients, and no smaller
    /// kind is chosen.
    #[test]
    fn representable_light_is_reproduced_by_the_smallest_kind() {
        let normals = [Vec3::Z, Vec3::NEG_X, Vec3::new(0.6, 0.48, -0.64)];
        for normal in normals {
            let expect = |light: &dyn Fn(Vec3) -> Vec3, kind: CompactKind| {
                let map = fitted(light, normal, 0.003);
                assert_eq!(map.kind(), kind, "error {}", map.error());
                assert!(map.error() <= 0.003 && map.as_bytes().len() == kind.bytes());
                for direction in directions().into_iter().filter(|direction| direction.dot(normal) > 0.0) {
                    let (found, exact) = (map.radiance(direction), light(direction));
                    // Twice the tolerance of the mean: single directions may deviate more.
                    let error = (found - exact).abs().max_element();
                    assert!(error <= 0.006 * exact.length(), "{kind:?} {direction}: {found} for {exact}");
                }
            };
            expect(&|_| COLOR, CompactKind::Constant);
            expect(&harmonic(1), CompactKind::Linear);
            expect(&harmonic(2), CompactKind::Quadratic);
            expect(&cells, CompactKind::Octahedral);
        }
    }

    /// The stated error is the RMS over the directions above the horizon, and a fit that misses the tolerance reports
    /// it.
    #[test]
    fn the_stated_error_is_the_error_above_the_horizon() {
        // A spot narrower than a cell of 8×8, and light below the horizon that must not count.
        let spot = |direction: Vec3| match direction.z {
            z if z < 0.0 => Vec3::splat(1000.0),
            _ => Vec3::ONE + COLOR * 50.0 * f32::from(u8::from(direction.dot(Vec3::new(0.48, 0.6, 0.64)) > 0.99)),
        };
        for tolerance in [0.9, 0.5, 0.1, 1e-6] {
            let map = fitted(spot, Vec3::Z, tolerance);
            let (mut error, mut all) = (0.0, 0.0);
            for direction in directions().into_iter().filter(|direction| direction.z > 0.0) {
                error += (map.radiance(direction) - spot(direction)).length_squared();
                all += spot(direction).length_squared();
            }
            assert!((map.error() / (error / all).sqrt() - 1.0).abs() < 1e-4);
            // Without a kind within the tolerance, the error is the smallest of all kinds.
            assert!(map.error() <= tolerance || map.error() == fitted(spot, Vec3::Z, 0.0).error(), "{tolerance}");
        }
        let mut pages = CompactPages::default();
        pages.push(&fitted(spot, Vec3::Z, 1e-6), 1e-6);
        assert_eq!(pages.coarse(), 1, "no kind has such a small error");
    }

    #[test]
    fn pages_return_the_maps() {
        let maps = [fitted(|_| COLOR, Vec3::Y, 0.01), fitted(harmonic(1), Vec3::Y, 0.01), fitted(cells, Vec3::Y, 0.01)];
        let mut pages = CompactPages::default();
        let places: Vec<CompactPlace> = maps.iter().chain(&maps).map(|map| pages.push(map, 0.01)).collect();
        for (k, (&place, map)) in places.iter().zip(maps.iter().chain(&maps)).enumerate() {
            assert_eq!(place, CompactPlace { kind: map.kind(), row: k as u32 / 3 });
            for direction in directions() {
                assert_eq!(pages.radiance(place, direction), Some(map.radiance(direction)));
            }
        }
        assert_eq!(pages.radiance(CompactPlace { kind: CompactKind::Quadratic, row: 0 }, Vec3::X), None);
        assert_eq!((pages.texels(), pages.coarse()), (6, 0));
        assert_eq!(pages.bytes_per_texel(), (4.0 + 24.0 + 256.0) / 3.0);
        let mean = maps.iter().map(|map| f64::from(map.error())).sum::<f64>() / 3.0;
        assert!((pages.mean_error() - mean).abs() < 1e-9);
    }

    #[test]
    fn black_and_broken_light_is_black() {
        for light in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            let map = fitted(|_| light, Vec3::Z, 0.0);
            assert_eq!((map.kind(), map.error(), map.radiance(Vec3::Z)), (CompactKind::Constant, 0.0, Vec3::ZERO));
        }
        // Fits without directions, or with all directions below the horizon, have no error.
        let none = CompactFit::new(&[], Vec3::Z).map(&[], 0.0);
        assert_eq!((none.kind(), none.radiance(Vec3::X)), (CompactKind::Constant, Vec3::ZERO));
        let below = CompactFit::new(&[Vec3::NEG_Z], Vec3::Z).map(&[Vec3::ONE], 0.0);
        assert_eq!((below.kind(), below.error()), (CompactKind::Constant, 0.0));
    }
}
