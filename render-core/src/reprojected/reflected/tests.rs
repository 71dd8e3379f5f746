//! Comparison of reprojected reflections with reflections in closed form.

use super::*;

const SIDE: usize = 48;
/// Width of a pixel on the floor \[m\].
const PIXEL: f32 = 0.01;
/// Heights of the viewer and of the reflected ceiling \[m\].
const EYE: f32 = 1.0;
const CEILING: f32 = 2.0;

/// Returns the coats of the floor y = 0, seen from above by a pinhole camera at `steps` pixels to the right.
fn floor(steps: f32) -> Plane<Option<CoatView>> {
    let eye = Vec3A::new(steps * PIXEL, EYE, 0.0);
    let center = (SIDE / 2) as f32;
    Plane::from_fn(SIDE, SIDE, |x, y| {
        let position =
            Vec3A::new(x as f32 - center + steps, 0.0, y as f32 - center) * PIXEL * Vec3A::new(1.0, 0.0, 1.0);
        let view = position - eye;
        let mirrored = (view * Vec3A::new(1.0, -1.0, 1.0)).normalize();
        Some(CoatView { position, normal: Vec3A::Y, mirrored, alpha: 0.2, depth: view.length(), pixel_width: PIXEL })
    })
}

/// Returns the light of a coat that reflects the pattern `field` of the ceiling.
fn reflected(coat: &CoatView, field: impl Fn(Vec3A) -> f32) -> LobeLight {
    let distance = CEILING / coat.mirrored.y;
    let whole = [field(coat.position + coat.mirrored * distance); 3];
    LobeLight { whole, traced: whole, nearness: distance.recip(), ..LobeLight::default() }
}

/// Last picture of a walk along the floor.
struct Walked {
    coats: Plane<Option<CoatView>>,
    light: Plane<Option<LobeLight>>,
    missing: Plane<bool>,
    audits: AuditCounts,
}

/// Walks along the floor by `step` pixels per frame. Errors may be 2 % of the light.
fn walk(field: impl Fn(Vec3A) -> f32, frames: usize, step: f32, reuse: Reuse) -> Walked {
    let mut light = ReflectedLight::default();
    let mut walked = None;
    for frame in 0..=frames {
        let coats = floor(frame as f32 * step);
        let known = Correspondence::from_motion(Plane::filled(SIDE, SIDE, [step, 0.0]));
        let to = CoatsInView { coats: &coats, known: (frame > 0).then_some(&known), allowed: 0.25, most: None };
        // Audit a sixteenth of reused pixels.
        let is_audited = |x: usize, y: usize| (x / 4 + 3 * (y / 4) + frame).is_multiple_of(16);
        let of_pixel = |x: usize, y: usize| {
            if is_audited(x, y) && reuse == Reuse::Allowed && step > 0.0 { Reuse::Audited } else { reuse }
        };
        let reprojected = light.carry(to, |x, y, _| of_pixel(x, y), |_, _, luminance| 0.02 * luminance).value;
        let (found, missing) = (reprojected.light.clone(), reprojected.missing.clone());
        let lit = Plane::from_fn(SIDE, SIDE, |x, y| {
            coats.get(x, y).filter(|_| missing.get(x, y)).map(|coat| reflected(&coat, &field))
        });
        let audits = reprojected.complete(&lit, &coats, &mut light);
        walked = Some(Walked { coats, light: found, missing, audits });
    }
    walked.expect("there is a first frame")
}

impl Walked {
    /// Returns the largest error of reprojected light, and the fraction of pixels with reprojected light, away from the
    /// border.
    fn error_and_share(&self, field: impl Fn(Vec3A) -> f32) -> (f32, f32) {
        let (mut most, mut reused) = (0f32, 0);
        let inner = 12..SIDE - 12;
        for (x, y) in inner.clone().flat_map(|y| inner.clone().map(move |x| (x, y))) {
            let truth = reflected(&self.coats.get(x, y).expect("a coat"), &field).whole[1];
            if let Some(light) = self.light.get(x, y) {
                most = most.max((light.whole[1] - truth).abs() / truth);
                reused += 1;
            }
        }
        (most, reused as f32 / (inner.len() * inner.len()) as f32)
    }
}

/// The image of a ceiling with waves of 2 m slides over the floor by two thirds of the viewer's way. After twelve frames of
/// the fastest walk, light that stayed on the floor would have errors above 10 %.
#[test]
fn the_image_follows_the_viewer() {
    let field = |hit: Vec3A| 2.0 + (hit.x * std::f32::consts::PI).sin();
    for step in [0.37, 1.0, 2.3] {
        let (error, share) = walk(field, 12, step, Reuse::Allowed).error_and_share(field);
        assert!(error < 0.03 && share > 0.5, "step {step}: error {error}, share {share}");
    }
}

#[test]
fn a_still_picture_keeps_its_light_to_the_last_bit() {
    let field = |hit: Vec3A| 2.0 + hit.x;
    let walked = walk(field, 5, 0.0, Reuse::Allowed);
    for (coat, light) in walked.coats.samples().iter().zip(walked.light.samples()) {
        assert_eq!(*light, Some(reflected(&coat.expect("a coat"), field)));
    }
}

#[test]
fn audits_compare_and_forbidden_light_is_lit_again() {
    let field = |hit: Vec3A| 2.0 + hit.x;
    let audited = walk(field, 4, 0.37, Reuse::Audited);
    assert!(audited.missing.samples().iter().all(|&missing| missing));
    let AuditCounts { within, all } = audited.audits;
    assert!(within == all && all > SIDE * SIDE * 9 / 10, "{within} of {all}");
    let forbidden = walk(field, 4, 0.37, Reuse::Forbidden);
    assert!(forbidden.missing.samples().iter().all(|&missing| missing));
    assert_eq!(forbidden.audits, AuditCounts::default());
}

/// Checks that noise alone does not lead to new light: bright samples would be replaced more often than dark ones.
#[test]
fn noise_is_no_error() {
    let mut light = ReflectedLight::default();
    let coats = floor(0.0);
    let noisy = |x: usize, y: usize| 1.0 + 0.5 * ((x * 7 + y * 13) % 5) as f32 / 4.0;
    let first = light.carry(
        CoatsInView { coats: &coats, known: None, allowed: 0.25, most: None },
        |_, _, _| Reuse::Allowed,
        |_, _, _| 0.02,
    );
    let lit = Plane::from_fn(SIDE, SIDE, |x, y| {
        let whole = [noisy(x, y); 3];
        Some(LobeLight { whole, traced: whole, noise: 0.5, nearness: 0.5, ..LobeLight::default() })
    });
    let _ = first.value.complete(&lit, &coats, &mut light);
    let (coats, known) = (floor(0.4), Correspondence::from_motion(Plane::filled(SIDE, SIDE, [0.4, 0.0])));
    let to = CoatsInView { coats: &coats, known: Some(&known), allowed: 0.25, most: None };
    let next = light.carry(to, |_, _, _| Reuse::Allowed, |_, _, _| 0.02).value;
    let missing = |margin: usize| {
        let inner = margin..SIDE - margin;
        inner.clone().flat_map(|y| inner.clone().map(move |x| (x, y))).filter(|&(x, y)| next.missing.get(x, y)).count()
    };
    assert_eq!(missing(4), 0);
}
