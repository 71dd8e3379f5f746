//! Lamps of the page: points of the light sources that films sample with shadow rays at every pixel.
//!
//! ```text
//! E = V Σ Eₖ        V  visible fraction of a texel      Eₖ  unshadowed irradiance from point k
//! V = E_d / Σ Eₖ    E_d  baked direct irradiance of the texel
//! ```
//! All lamps share one visible fraction per texel, which weights them by their light.
//!
//! Some texels are live: the page computes their direct light at each pixel, from the lamps and the visible fraction. In
//! still pictures, shadow rays replace the fraction. The irradiance of live texels contains only indirect light.

use super::payload::Payload;
use super::picture::HoledPicture;
use crate::prepare::sampled_areas;
use crate::texels::BakedTexels;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use render_core::scene::{Pose, PunctualKind};
use render_core::{Emitters, Surfaces, TexelSite, Units, luminance};
use serde_json::{Value, json};
use std::f32::consts::PI;

/// Number of groups of points. Each group represents all lamps. The four samples of a pixel of a still picture use one
/// group each.
const GROUPS: usize = 4;
/// Number of points of an area lamp in a group. All groups contain the 64 points of a film.
const POINTS: usize = 16;
/// Bound of a point's geometry term, as a fraction of the bound for the point's own disc, as in films.
const BOUND: f32 = 1.0 / 8.0;

/// Flag of a texel with live direct light, in the picture of visible fractions.
const LIVE: u8 = 128;
/// Maximum difference between visible fractions of adjacent texels that are not live.
const SAME_SHADOW: f32 = 0.2;
/// Minimum cosine between the normals of adjacent texels that are not live, about 14°.
const SAME_NORMAL: f32 = 0.97;

/// Directions and falloff of the light from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
enum LampShape {
    /// Lambertian disc of a squared radius \[m²\].
    Disc { radius2: f32 },
    /// Cone with the cosine of its outer angle, and the slope of the falloff. All directions are in the cone of a point.
    Cone { outer: f32, slope: f32 },
    /// Distant disc with an angular radius \[rad\].
    Distant { radius: f32 },
}

/// Point of a lamp.
#[derive(Clone, Copy, Debug)]
struct LampPoint {
    /// Position \[m\], or the unit vector towards a distant lamp.
    place: Vec3A,
    /// Normal of a disc or axis of a cone, a unit vector.
    axis: Vec3A,
    shape: LampShape,
    /// Intensity along the axis \[W·sr⁻¹\], or irradiance of a distant lamp \[W·m⁻²\], times the exposure.
    light: Vec3,
}

/// Lamps of a scene at time 0.
pub(super) struct ViewLamps {
    /// Points of all groups, in order.
    points: Vec<LampPoint>,
    /// Instances with emissive surfaces among the lamps.
    instances: Vec<usize>,
    exposure: f32,
}

/// Visibility of the lamps at the texels.
pub(super) struct LampVisibility {
    /// Visible fraction of each texel of the picture in steps of 1/127, plus [`LIVE`].
    pub picture: Vec<u8>,
    /// Texels with live direct light, for which the page does not use baked direct light.
    pub live: Vec<bool>,
}

/// Lamps at a texel: visible fraction, and the shading normal.
struct TexelLamps {
    fraction: f32,
    normal: Vec3A,
}

/// Returns whether a texel is too coarse for direct light: it may be inside geometry, it has no neighbors along an axis,
/// its neighbors face elsewhere, or the border of a shadow is near.
fn is_live(baked: &BakedTexels, texels: &[TexelLamps], texel: usize) -> bool {
    let own = &texels[texel];
    let around = baked.atlas.neighbors(texel);
    let is_unlike = |&neighbor: &u32| {
        let other = &texels[neighbor as usize];
        (own.fraction - other.fraction).abs() > SAME_SHADOW || own.normal.dot(other.normal) < SAME_NORMAL
    };
    // Neighbors are above, left, right and below, among the diagonal ones.
    let is_narrow = around[3].or(around[4]).is_none() || around[1].or(around[6]).is_none();
    !baked.is_reliable[texel] || is_narrow || around.iter().flatten().any(is_unlike)
}

impl ViewLamps {
    /// Collects the lamps, with light multiplied by `exposure`.
    pub fn new(surfaces: &Surfaces, pose: &Pose, exposure: f32) -> Self {
        let units = Units::of(surfaces.scene());
        let emitters = Emitters::new(surfaces, pose, &units);
        let (mut groups, mut instances) = (vec![Vec::new(); GROUPS], Vec::new());
        for area in sampled_areas(&emitters, surfaces, units.radius) {
            let lamp = &emitters.areas[area];
            instances.push(lamp.instance);
            // Any 16 consecutive points are spread over the whole lamp.
            let samples = lamp.samples(surfaces, GROUPS * POINTS);
            for (group, samples) in groups.iter_mut().zip(samples.chunks(POINTS)) {
                group.extend(samples.iter().map(|sample| LampPoint {
                    place: sample.position - sample.normal * sample.offset,
                    axis: sample.normal,
                    shape: LampShape::Disc { radius2: sample.area * GROUPS as f32 / PI },
                    light: sample.intensity * (exposure * GROUPS as f32),
                }));
            }
        }
        let mut points: Vec<LampPoint> = Vec::new();
        points.extend(emitters.points.iter().map(|point| LampPoint {
            place: point.position,
            axis: point.axis,
            shape: match point.kind {
                PunctualKind::Spot { inner, outer } => {
                    LampShape::Cone { outer: outer.cos(), slope: 1.0 / (inner.cos() - outer.cos()).max(1e-3) }
                }
                _ => LampShape::Cone { outer: -2.0, slope: 1.0 },
            },
            light: point.intensity * exposure,
        }));
        points.extend(emitters.suns.iter().map(|sun| LampPoint {
            place: sun.towards,
            axis: -sun.towards,
            shape: LampShape::Distant { radius: sun.angular_radius },
            light: sun.irradiance * exposure,
        }));
        groups.iter_mut().for_each(|group| group.extend(&points));
        Self { points: groups.concat(), instances, exposure }
    }

    /// Returns whether any surface of a material is a lamp.
    pub fn has_material(&self, surfaces: &Surfaces, material: usize) -> bool {
        let scene = surfaces.scene();
        self.instances.iter().any(|&instance| scene.meshes[scene.instances[instance].mesh].material == material)
    }

    /// Returns the visibility of the lamps at all texels. It is empty without lamps.
    pub fn visibility(&self, baked: &BakedTexels, surfaces: &Surfaces) -> LampVisibility {
        if self.points.is_empty() {
            return LampVisibility { picture: Vec::new(), live: vec![false; baked.atlas.len()] };
        }
        let at = |texel: usize| {
            let site = baked.atlas.sites(texel, surfaces).first().copied();
            let direct = luminance(Vec3::from(baked.direct[texel]) * self.exposure);
            let unshadowed = site.map_or(0.0, |site| luminance(self.unshadowed(&site)));
            let fraction = (direct / unshadowed.max(f32::MIN_POSITIVE)).min(1.0);
            TexelLamps { fraction, normal: site.map_or(Vec3A::Z, |site| site.shading_normal) }
        };
        let texels: Vec<TexelLamps> = (0..baked.atlas.len()).into_par_iter().map(at).collect();
        let live: Vec<bool> = (0..texels.len()).map(|texel| is_live(baked, &texels, texel)).collect();

        // Paint the picture. Unused texels have the mean of adjacent texels.
        let (width, height) = baked.atlas.size();
        let mut picture = HoledPicture::new(width, height);
        for (texel, (lamps, &live)) in texels.iter().zip(&live).enumerate() {
            let is_live = f32::from(u8::from(live));
            let (x, y) = baked.atlas.place(texel);
            picture.set(x, y, Vec3::new(lamps.fraction, is_live, 0.0));
        }
        let code = |texel: Vec3| (texel.x * 127.0).round() as u8 + if texel.y > 0.5 { LIVE } else { 0 };
        LampVisibility { picture: picture.all().map(code).collect(), live }
    }

    /// Returns the unshadowed irradiance at a texel, times the exposure \[W·m⁻²\].
    fn unshadowed(&self, site: &TexelSite) -> Vec3 {
        self.points.iter().map(|point| point.irradiance(site)).sum::<Vec3>() / GROUPS as f32
    }

    /// Adds the points to the page, group by group, and returns the number of points of a group.
    pub fn add_to(&self, payload: &mut Payload) -> Value {
        let mut bytes = Vec::with_capacity(48 * self.points.len());
        for point in &self.points {
            let ([a, b, c], [d, e, f], [r, g, b_]) =
                (point.place.to_array(), point.axis.to_array(), point.light.to_array());
            let (kind, extent, slope) = match point.shape {
                LampShape::Disc { radius2 } => (0.0, radius2, 0.0),
                LampShape::Cone { outer, slope } => (1.0, outer, slope),
                LampShape::Distant { radius } => (2.0, radius, 0.0),
            };
            for number in [a, b, c, kind, d, e, f, extent, r, g, b_, slope] {
                bytes.extend(f32::to_le_bytes(number));
            }
        }
        payload.add("lamps", &bytes, 48);
        json!(self.points.len() / GROUPS)
    }
}

impl LampPoint {
    /// Returns the unshadowed irradiance at a texel, times the exposure \[W·m⁻²\].
    fn irradiance(&self, site: &TexelSite) -> Vec3 {
        // No light arrives from below the surface.
        let way = match self.shape {
            LampShape::Distant { .. } => self.place,
            _ => self.place - site.position,
        };
        let (r2, cosine) = (way.length_squared().max(f32::MIN_POSITIVE), way.dot(site.shading_normal));
        if cosine <= 0.0 || way.dot(site.geometric_normal) <= 0.0 {
            return Vec3::ZERO;
        }
        let r = r2.sqrt();
        let along_axis = -way.dot(self.axis) / r;
        self.light
            * match self.shape {
                LampShape::Disc { radius2 } => cosine / r * along_axis.max(0.0) / (r2 + BOUND * radius2),
                LampShape::Cone { outer, slope } => {
                    let falloff = ((along_axis - outer) * slope).clamp(0.0, 1.0);
                    cosine / r * falloff * falloff / r2
                }
                LampShape::Distant { .. } => cosine,
            }
    }
}
