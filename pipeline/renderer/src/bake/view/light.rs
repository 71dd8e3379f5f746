//! Baked light of the page: irradiance of the atlas as a picture, and light of coats in compact form.

use super::lamps::{LampVisibility, ViewLamps};
use super::payload::Payload;
use super::picture::HoledPicture;
use crate::texels::BakedTexels;
use glam::Vec3;
use lightfield::{CompactFit, CompactKind, CompactMap, CompactPages, OctahedralMap, shared_exponent};
use rayon::prelude::*;
use render_core::{Atlas, Bsdf, Surfaces};
use serde_json::{Value, json};
use std::f32::consts::FRAC_1_PI;

/// Relative RMS error that compact light of coats may have.
const TOLERANCE: f32 = 0.05;
/// Directions in which the light of a coat is sampled: about 128 above the horizon.
const SAMPLES: OctahedralMap = OctahedralMap { side: 16 };
/// Number of texels that a thread fits one after another. Consecutive texels often have equal normals.
const BLOCK: usize = 256;
/// Number of entries of the table of coat albedos along each axis: roughness, and the square root of the cosine.
const STEPS: usize = 48;

/// Light of all texels, multiplied by the exposure.
pub(super) struct ViewLight {
    width: u32,
    height: u32,
    /// E/π of each texel of the picture, with a shared exponent. Live texels omit direct light.
    irradiance: Vec<u32>,
    /// Place of each texel's coat: 0 for none, otherwise the kind plus 1 in the highest 4 bits, and the row.
    places: Vec<u32>,
    coats: CompactPages,
    /// Mean of E/π over all texels.
    mean: Vec3,
    visibility: LampVisibility,
}

impl ViewLight {
    /// Collects the light of `baked`.
    pub fn new(baked: &BakedTexels, surfaces: &Surfaces, lamps: &ViewLamps, exposure: f32) -> Self {
        let atlas = &baked.atlas;
        let (width, height) = atlas.size();
        let scale = exposure * FRAC_1_PI;
        let at = |texel: usize| {
            let (x, y) = atlas.place(texel);
            (y * width + x) as usize
        };

        // Paint the irradiance of texels in use, then extend it to adjacent unused texels.
        let mut picture = HoledPicture::new(width, height);
        let mut sum = glam::DVec3::ZERO;
        let visibility = lamps.visibility(baked, surfaces);
        for texel in 0..atlas.len() {
            let (direct, indirect) =
                (scale * Vec3::from(baked.direct[texel]), scale * Vec3::from(baked.indirect[texel]));
            let light = if visibility.live[texel] { indirect } else { direct + indirect };
            let (x, y) = atlas.place(texel);
            picture.set(x, y, light);
            sum += (direct + indirect).as_dvec3();
        }
        let mean = (sum / atlas.len().max(1) as f64).as_vec3();
        let irradiance: Vec<u32> = picture.all().map(shared_exponent).collect();

        // Fit the light of coats, and number the fits in the order of the atlas.
        let coated: Vec<usize> =
            (0..atlas.len()).filter(|&texel| baked.coats.mean_radiance(texel, Vec3::Z).is_some()).collect();
        let maps = coated.par_chunks(BLOCK).map(|texels| fitted(baked, surfaces, texels, exposure));
        let (mut places, mut coats) = (Vec::new(), CompactPages::default());
        if !coated.is_empty() {
            places = vec![0; irradiance.len()];
        }
        for (&texel, map) in coated.iter().zip(maps.collect::<Vec<Vec<CompactMap>>>().iter().flatten()) {
            let place = coats.push(map, TOLERANCE);
            places[at(texel)] = (place.kind as u32 + 1) << 28 | place.row;
        }
        Self { width, height, irradiance, places, coats, mean, visibility }
    }

    /// Returns the light of coats.
    pub fn coats(&self) -> &CompactPages {
        &self.coats
    }

    /// Adds the light to the page and returns its description.
    pub fn add_to(&self, payload: &mut Payload) -> Value {
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        payload.add("irradiance", &words(&self.irradiance), 4);
        payload.add("places", &words(&self.places), 4);
        // Store pages by rows, so that equal coefficients of all texels are in one column.
        for (number, kind) in CompactKind::ALL.into_iter().enumerate() {
            payload.add(&format!("page{number}"), self.coats.page(kind), kind.bytes());
        }
        payload.add("albedos", &albedo_table(), 8);
        payload.add("visible", &self.visibility.picture, 1);
        let coefficients = CompactKind::ALL.map(CompactKind::coefficients);
        json!({
            "width": self.width,
            "height": self.height,
            "coefficients": coefficients,
            "mean": self.mean.to_array(),
            "live": self.visibility.live.iter().filter(|&&is_live| is_live).count(),
            "steps": STEPS,
        })
    }
}

/// Fits the coats of `texels`.
fn fitted(baked: &BakedTexels, surfaces: &Surfaces, texels: &[usize], exposure: f32) -> Vec<CompactMap> {
    let directions: Vec<Vec3> =
        (0..SAMPLES.len()).map(|k| SAMPLES.direction(k % SAMPLES.side, k / SAMPLES.side)).collect();
    let mut prepared: Option<(Vec3, CompactFit)> = None;
    let mut maps = Vec::with_capacity(texels.len());
    for &texel in texels {
        // Reuse the fit of the previous texel if both have the same normal.
        let normal = normal(&baked.atlas, texel, surfaces);
        let fit = match prepared.take().filter(|(known, _)| *known == normal) {
            Some((_, fit)) => fit,
            None => CompactFit::new(&directions, normal),
        };

        // Baked light of coats does not contain the direct light of lamps, which the page computes.
        let radiance = |&direction: &Vec3| exposure * baked.coats.mean_radiance(texel, direction).unwrap_or(Vec3::ZERO);
        let light: Vec<Vec3> = directions.iter().map(radiance).collect();
        maps.push(fit.map(&light, TOLERANCE));
        prepared = Some((normal, fit));
    }
    maps
}

/// Returns the shading normal of a texel.
fn normal(atlas: &Atlas, texel: usize, surfaces: &Surfaces) -> Vec3 {
    atlas.sites(texel, surfaces).first().map_or(Vec3::Z, |site| site.shading_normal.into())
}

/// Returns the albedos of coats: for each roughness a row, with the albedo for a Fresnel term of 1 and for the grazing
/// term, by the square root of the cosine. The last row contains the cosine-weighted means of all rows.
fn albedo_table() -> Vec<u8> {
    let step = |k: usize| k as f32 / (STEPS - 1) as f32;
    let mut bytes = Vec::with_capacity(8 * STEPS * (STEPS + 1));
    let mut means = Vec::with_capacity(STEPS);
    for row in 0..STEPS {
        // Separate the two terms by color: red has a reflectance of 1, green of 0.
        let bsdf = Bsdf::new(Vec3::ZERO, Vec3::X, step(row));
        let entries: Vec<Vec3> = (0..STEPS).map(|column| bsdf.coat_albedo(step(column).powi(2))).collect();
        entries.iter().for_each(|entry| push(&mut bytes, *entry));
        means.push(mean(&entries));
    }
    means.iter().for_each(|mean| push(&mut bytes, *mean));
    bytes
}

fn push(bytes: &mut Vec<u8>, entry: Vec3) {
    bytes.extend(entry.x.to_le_bytes());
    bytes.extend(entry.y.to_le_bytes());
}

/// Returns 2 ∫ albedo(μ) μ dμ of a row that is linear in s = √μ, in closed form.
///
/// ```text
/// 4 ∫ albedo s³ ds, from p at a to q at b:  4 (p (b m₃ − m₄) + q (m₄ − a m₃)) / (b − a)
///   m₃ = (b⁴ − a⁴)/4     m₄ = (b⁵ − a⁵)/5
/// ```
fn mean(row: &[Vec3]) -> Vec3 {
    let place = |k: usize| k as f64 / (STEPS - 1) as f64;
    let mut sum = glam::DVec3::ZERO;
    for (k, ends) in row.windows(2).enumerate() {
        let (a, b) = (place(k), place(k + 1));
        let (m3, m4) = ((b.powi(4) - a.powi(4)) / 4.0, (b.powi(5) - a.powi(5)) / 5.0);
        let weights = (4.0 * (b * m3 - m4) / (b - a), 4.0 * (m4 - a * m3) / (b - a));
        sum += ends[0].as_dvec3() * weights.0 + ends[1].as_dvec3() * weights.1;
    }
    sum.as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The last row contains the integrals of the other rows.
    #[test]
    fn means_are_the_integrals() {
        let table: Vec<f32> =
            albedo_table().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(table.len(), 2 * STEPS * (STEPS + 1));
        for row in [0, 10, 47] {
            let bsdf = Bsdf::new(Vec3::ZERO, Vec3::X, row as f32 / 47.0);
            let mut sum = Vec3::ZERO;
            for k in 0..20_000 {
                let cosine = (k as f32 + 0.5) / 20_000.0;
                sum += bsdf.coat_albedo(cosine) * (2.0 * cosine / 20_000.0);
            }
            let found = [table[2 * (STEPS * STEPS + row)], table[2 * (STEPS * STEPS + row) + 1]];
            assert!((found[0] - sum.x).abs() < 1e-4 && (found[1] - sum.y).abs() < 1e-4, "{found:?} for {sum}");
        }
    }
}
