//! Gradients of the irradiance from one light over position and normal.
//!
//! Irradiance gradients of a lightcut need no sampling: they are sums over the lights of the lightcut \[Krivanek08\].

use glam::Vec3;

use crate::light::{Emission, Light, SMALLEST_DISTANCE2};

/// Irradiance from a light per unit of the light's intensity, without visibility, and its derivatives at fixed
/// visibility.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IrradianceTerm {
    /// cos θ · G \[m⁻²\]. It is zero if the light is behind the surface or faces away.
    pub value: f32,
    /// Derivative with respect to the normal \[m⁻²\]. For a rotated normal n′ with the light above its horizon, `value`
    /// is n′ · `by_normal`.
    pub by_normal: Vec3,
    /// Derivative with respect to the position \[m⁻³\].
    pub by_position: Vec3,
}

/// Returns the irradiance term of a light at `position` with the unit `normal`.
///
/// ```text
/// E / I = a b / (r² (r² + s²))        d  vector to the light, r its length
///   a = n · d     b = −axis · d for Cosine, r for Omni       E / I = a for Directional, d = unit vector to the light
/// ```
#[inline]
#[must_use]
pub fn irradiance_term(position: Vec3, normal: Vec3, light: &Light, geometry_term_bound: f32) -> IrradianceTerm {
    // Directional light does not depend on the position.
    if let Emission::Directional(travel) = light.emission {
        let value = -normal.dot(travel);
        return if value > 0.0 {
            IrradianceTerm { value, by_normal: -travel, by_position: Vec3::ZERO }
        } else {
            IrradianceTerm::default()
        };
    }
    // Reject lights behind the surface and lights too close for a finite derivative.
    let d = light.position - position;
    let r2 = d.length_squared();
    let a = normal.dot(d);
    if r2 < SMALLEST_DISTANCE2 || a <= 0.0 {
        return IrradianceTerm::default();
    }
    let soft = r2 + geometry_term_bound;
    // Compute b and its derivative with respect to the position. Moving the receiver by x changes d by −x.
    let (b, b_by_position) = match light.emission {
        Emission::Cosine(axis) => (-axis.dot(d), axis),
        Emission::Omni | Emission::Directional(_) => (r2.sqrt(), -d / r2.sqrt()),
    };
    if b <= 0.0 {
        return IrradianceTerm::default();
    }
    // Differentiate a b / (r² (r² + s²)) by the product rule.
    let inverse = 1.0 / (r2 * soft);
    let falloff = d * (2.0 * (r2 + soft) * inverse);
    IrradianceTerm {
        value: a * b * inverse,
        by_normal: d * (b * inverse),
        by_position: (b_by_position * a - normal * b + falloff * (a * b)) * inverse,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::light::unshadowed_by;
    use crate::receiver::Lambert;
    use crate::testing;

    proptest! {
        /// The value equals the value in lightcuts. The derivatives agree with finite differences in `f32`, within a
        /// tolerance.
        /// tolerance.
        #[test]
        fn derivatives_agree_with_differences(scene in testing::scene(1..2)) {
            let (light, s2) = (scene.lights[0].accepted().0, scene.geometry_term_bound);
            let Lambert { position, normal, .. } = scene.receiver;
            let term = irradiance_term(position, normal, &light, s2);
            let white = Lambert { position, normal, reflectance: Vec3::splat(std::f32::consts::PI) };
            let expected = unshadowed_by(&white, &light, s2).x;
            // Near a horizon the cosine is mostly rounding error, so the tolerance includes the light's value face to
            // face.
            let far = matches!(light.emission, Emission::Directional(_));
            let face_to_face = if far { 1.0 } else { 1.0 / ((light.position - position).length_squared() + s2) };
            let rounding = 1e-5 * expected + 1e-6 * face_to_face;
            prop_assert!((term.value - expected).abs() <= rounding, "{} {}", term.value, expected);
            prop_assert!((term.by_normal.dot(normal) - term.value).abs() <= 1e-5 * term.by_normal.length());

            let way = light.position - position;
            let r = way.length();
            // Skip horizons, where the term is not differentiable.
            let shines = match light.emission {
                Emission::Cosine(axis) => -axis.dot(way) > 0.05 * r,
                Emission::Omni => true,
                // Directional light is independent of position.
                Emission::Directional(_) => {
                    prop_assert_eq!(term.by_position, Vec3::ZERO);
                    false
                }
            };
            if term.value == 0.0 || normal.dot(way) <= 0.05 * r || !shines {
                return Ok(());
            }
            let step = 2e-3 * r;
            for axis in Vec3::AXES {
                let at = |sign: f32| f64::from(irradiance_term(position + axis * step * sign, normal, &light, s2).value);
                let difference = (at(1.0) - at(-1.0)) / (2.0 * f64::from(step));
                let scale = term.value / r + term.by_position.length();
                prop_assert!(
                    (difference - f64::from(term.by_position.dot(axis))).abs() <= 3e-3 * f64::from(scale),
                    "{difference} {} {light:?}", term.by_position
                );
            }
        }
    }
}
