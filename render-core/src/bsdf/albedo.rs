//! Directional albedo of the coat by angle and roughness, the basis of energy conservation.

#[cfg(test)]
use super::ggx::Ggx;
use super::quadrature::tabulated_mean;
#[cfg(test)]
use crate::sampling::hammersley;
use glam::Vec3;
use std::sync::LazyLock;

/// Returns (1 − cos θ)⁵, the weight of the grazing reflectance in F = F₀ + (F₉₀ − F₀)(1 − cos θ)⁵ \[Schlick94\].
pub(super) fn grazing_share(cos: f32) -> f32 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Directional albedo of single scattering, split along Schlick's Fresnel term:
/// albedo(F₀) = F₀·facing + (1 − F₀)·grazing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Albedo {
    /// Albedo with a Fresnel term of 1: E of \[Kulla17\].
    pub(super) facing: f32,
    /// Albedo with a Fresnel term of (1 − cos θ_h)⁵.
    pub(super) grazing: f32,
}

impl Albedo {
    /// Returns the albedo for a reflectance of `f0` at normal incidence and `f90` at grazing incidence.
    pub(super) fn with(self, f0: Vec3, f90: f32) -> Vec3 {
        f0 * (self.facing - self.grazing) + Vec3::splat(f90 * self.grazing)
    }

    fn lerp(self, other: Self, t: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * t;
        Self { facing: mix(self.facing, other.facing), grazing: mix(self.grazing, other.grazing) }
    }
}

/// Number of steps along each axis of the table. The axes are roughness and the square root of the cosine, since all abrupt
/// changes occur at grazing angles. With 48 steps, interpolation is within 0.5 % of the integral.
const STEPS: usize = 48;
/// Number of directions in the integral of each table entry.
#[cfg(test)]
const DIRECTIONS: usize = 1024;

/// Table of directional albedos: one row per roughness, one entry per square root of a cosine.
struct Table {
    rows: [[Albedo; STEPS]; STEPS],
    means: [Albedo; STEPS],
}

/// Table of albedos. The entries are stored, because their integrals take 0.3 CPU s.
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let rows = stored(include_bytes!("albedo.bin"));
    let means = rows.map(|row| mean(&row));
    Table { rows, means }
});

/// Reads the entries of the table: for each one, `facing` and `grazing` as little-endian numbers.
fn stored(bytes: &[u8; 8 * STEPS * STEPS]) -> [[Albedo; STEPS]; STEPS] {
    let number = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let at = 8 * (row * STEPS + column);
            Albedo { facing: number(at), grazing: number(at + 4) }
        })
    })
}

/// Computes the entries of the table.
#[cfg(test)]
fn computed() -> Vec<[Albedo; STEPS]> {
    let step = |i: usize| i as f32 / (STEPS - 1) as f32;
    let row = |row: usize| {
        let ggx = Ggx::from_roughness(step(row));
        std::array::from_fn(|column| integrate(ggx, step(column).powi(2)))
    };
    (0..STEPS).map(row).collect()
}

/// Integrates over visible microfacets. Each facet contributes its Fresnel term times G₂/G₁.
#[cfg(test)]
fn integrate(ggx: Ggx, cos: f32) -> Albedo {
    // Exactly at grazing incidence no facet is visible, so use the limit.
    let cos = cos.max(1e-3);
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    // Average the weights over quasi-random microfacets. Directions below the surface have weight 0.
    let (mut facing, mut grazing) = (0.0, 0.0);
    for i in 0..DIRECTIONS {
        let wi = ggx.sample(wo, hammersley(i, DIRECTIONS));
        if wi.z > 0.0 {
            let weight = ggx.masking_ratio(wo, wi);
            facing += f64::from(weight);
            grazing += f64::from(weight * grazing_share(wo.dot((wo + wi).normalize())));
        }
    }
    let share = |sum: f64| (sum / DIRECTIONS as f64) as f32;
    Albedo { facing: share(facing), grazing: share(grazing) }
}

/// Returns the cosine-weighted mean over the interpolated row, exactly, so that lobes normalized with the result conserve
/// energy.
fn mean(row: &[Albedo; STEPS]) -> Albedo {
    Albedo {
        facing: tabulated_mean(&row.map(|albedo| albedo.facing)),
        grazing: tabulated_mean(&row.map(|albedo| albedo.grazing)),
    }
}

/// Row of the table at one roughness: the albedos of a surface for all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AlbedoRow {
    row: usize,
    blend: f32,
}

impl AlbedoRow {
    pub(super) fn new(roughness: f32) -> Self {
        let place = roughness.clamp(0.0, 1.0) * (STEPS - 1) as f32;
        let row = (place as usize).min(STEPS - 2);
        Self { row, blend: place - row as f32 }
    }

    /// Returns the albedo towards a direction, given the cosine between direction and normal.
    pub(super) fn at(self, cos: f32) -> Albedo {
        let place = cos.clamp(0.0, 1.0).sqrt() * (STEPS - 1) as f32;
        let column = (place as usize).min(STEPS - 2);
        // Interpolate along the cosine in both rows, then along the roughness.
        let along = |row: &[Albedo; STEPS]| row[column].lerp(row[column + 1], place - column as f32);
        along(&TABLE.rows[self.row]).lerp(along(&TABLE.rows[self.row + 1]), self.blend)
    }

    /// Returns the cosine-weighted mean over the hemisphere: E_avg of \[Kulla17\].
    pub(super) fn mean(self) -> Albedo {
        TABLE.means[self.row].lerp(TABLE.means[self.row + 1], self.blend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The stored entries are the integrals, within the rounding of another machine's functions.
    #[test]
    fn stored_entries_are_the_integrals() {
        let computed = computed();
        if std::env::var_os("WRITE_ALBEDO").is_some() {
            let numbers = computed.iter().flatten().flat_map(|entry| [entry.facing, entry.grazing]);
            let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/albedo.bin"), bytes).unwrap();
            return;
        }
        for (stored, computed) in TABLE.rows.iter().flatten().zip(computed.iter().flatten()) {
            let error = (stored.facing - computed.facing).abs().max((stored.grazing - computed.grazing).abs());
            assert!(error < 1e-5, "{stored:?} instead of {computed:?}");
        }
    }

    #[test]
    fn interpolation_is_close_to_the_integral() {
        let mut worst = 0.0f32;
        for i in 0..40 {
            for j in 0..40 {
                let (roughness, cos) = ((i as f32 + 0.5) / 40.0, (j as f32 + 0.5) / 40.0);
                let (table, integral) =
                    (AlbedoRow::new(roughness).at(cos), integrate(Ggx::from_roughness(roughness), cos));
                worst = worst.max((table.facing - integral.facing).abs()).max((table.grazing - integral.grazing).abs());
            }
        }
        assert!(worst < 5e-3, "off by {worst}");
    }

    /// Seen from above, a rough white coat loses about a tenth of the light in single scattering. A smooth coat loses
    /// none.
    #[test]
    fn mirrors_lose_nothing_and_rough_coats_do() {
        assert!(AlbedoRow::new(0.0).at(0.5).facing > 0.999);
        assert!(AlbedoRow::new(0.0).mean().facing > 0.999);
        let rough = AlbedoRow::new(1.0).mean().facing;
        assert!((0.4..0.9).contains(&rough), "{rough}");
    }
}
