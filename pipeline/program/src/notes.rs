//! Notes on a scene and its film: what users may not expect, and nothing refuses.

use mpeg2enc::Level;
use perceptual::luminance_plane;
use plane::Plane;
use render_core::luminance;
use render_core::scene::{PunctualKind, Scene};
use render2mpeg::report::Report;
use render2mpeg::settings::{CodedRate, Settings};
use renderer::settings::Size;
use std::f32::consts::PI;

/// Luma of a picture that counts as black, at most: eight codes above the black of video, which hardly any display shows.
const BLACK: u8 = 24;

/// A picture is dim below this share of the light outdoors: ten stops less, as a cellar has.
const DIM: f32 = 1e-3;

/// Notes before work begins: warnings of the scene, and frames beyond its end.
pub(super) fn before(scene: &Scene, settings: &Settings) -> Vec<String> {
    let mut notes = scene.warnings.clone();
    notes.extend(beyond_the_end(scene, settings));
    notes.extend(beyond_levels(settings));
    notes
}

/// A note that no level is right for size and rate, if none is.
fn beyond_levels(settings: &Settings) -> Option<String> {
    let (Size { width, height }, rate) = (settings.render.size, CodedRate::of(settings.render.fps).ok()?.rate);
    if settings.coding.mpeg1 || Level::lowest(width, height, rate.fps()).is_some() {
        return None;
    }
    let fps = rate.fps();
    Some(format!(
        "no level of MPEG-2 holds {width}x{height} at {fps:.2} pictures a second: the film states High Level, which is too low"
    ))
}

/// A note on frames that were coded coarser than at the quantiser of the settings, so that the level holds them.
pub(super) fn on_level(report: &Report) -> Option<String> {
    let settings = &report.settings;
    if settings.coding.bitrate.is_some() {
        return None;
    }
    let coarser = report.frames.iter().filter(|frame| frame.qscale > settings.render.qscale).count();
    (coarser > 0).then(|| {
        let qscale = settings.render.qscale;
        format!(
            "{coarser} frames are coded coarser than at --qscale {qscale}, to keep to the bit rate that the film states"
        )
    })
}

/// Says that frames are beyond the end of what moves, if any are.
fn beyond_the_end(scene: &Scene, settings: &Settings) -> Option<String> {
    let (renderer, duration) = (settings.render.clone(), f64::from(scene.duration()));
    let last = settings.frame_range().end.checked_sub(1)?;
    let late = f64::from(renderer.time(last)) - duration;
    if duration == 0.0 || late * settings.render.fps <= 1.0 {
        return None;
    }
    let end = (duration * settings.render.fps).round();
    Some(format!("the animation ends after {duration:.2} s, before frame {end}: later frames stand still"))
}

/// The code that one pixel in a hundred exceeds at most: a lamp alone makes no picture bright.
pub(super) fn bright_code(codes: impl Iterator<Item = u8>) -> u8 {
    let (mut counts, mut all) = ([0usize; 256], 0);
    for code in codes {
        counts[usize::from(code)] += 1;
        all += 1;
    }
    let mut above = 0;
    for code in (1..=255).rev() {
        above += counts[code];
        if above > all / 100 {
            return code as u8;
        }
    }
    0
}

/// Says that all pictures are black, if the largest [`bright_code`] of their luma is.
pub(super) fn on_darkness(brightest: Option<u8>, settings: &Settings) -> Option<String> {
    if brightest? > BLACK {
        return None;
    }
    let exposure = match settings.render.auto_exposure {
        true => String::new(),
        false => format!("the exposure is {}, --set exposure=… changes it; ", settings.render.tone_map.exposure),
    };
    let scene = settings.scene.display();
    Some(format!(
        "99 of 100 pixels are black, or nearly: {exposure}render2mpeg plan {scene} lists lamps and sky; the camera may look elsewhere"
    ))
}

/// Mean luminance of a picture.
pub(super) fn mean_luminance(radiance: &Plane<[f32; 3]>) -> f32 {
    let luminances = luminance_plane(radiance);
    luminances.samples().iter().sum::<f32>() / luminances.samples().len().max(1) as f32
}

/// Reports pictures that hardly any light of sky and suns gets to, where there is no other; the largest of their
/// [mean luminances](mean_luminance) is `brightest`.
pub(super) fn on_dimness(brightest: f32, scene: &Scene) -> Option<String> {
    // Lamps light what is around them, however bright it is outdoors.
    let has_lamps = scene.punctual_lights.iter().any(|light| light.kind != PunctualKind::Directional)
        || scene.extreme_materials().iter().any(|material| material.emits());
    let share = brightest / luminance_outdoors(scene);
    (!has_lamps && share > 0.0 && share < DIM).then(|| {
        format!(
            "the pictures get 1/{:.0} of the light of sky and sun: noise of the photons shows; lamps or wider openings help",
            1.0 / share
        )
    })
}

/// Luminance of a white surface that faces all light of the sky, on average, and every sun: E/π, with E = Φ/4 for a fluence Φ.
fn luminance_outdoors(scene: &Scene) -> f32 {
    let mut irradiance = scene.sky.as_ref().map_or(0.0, |sky| luminance(sky.fluence()) / 4.0);
    for light in &scene.punctual_lights {
        if light.kind == PunctualKind::Directional {
            irradiance += luminance(light.color);
        }
    }
    irradiance / PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::Environment;
    use render_core::glam::Vec3;
    use render_core::scene::{Gradient, Material, PunctualLight};

    #[test]
    fn pictures_in_the_dark_of_a_bright_day_are_dim() {
        // A sky of radiance 1 on all sides lights a white surface to a luminance of 1: E = 4π / 4.
        let white = Gradient { zenith: [1.0; 3], horizon: [1.0; 3], ground: [1.0; 3] };
        let mut scene = Scene { sky: Environment::gradient(white), ..Scene::default() };
        let is_dim = |scene: &Scene, brightest: f32| on_dimness(brightest, scene).is_some();
        assert!((luminance_outdoors(&scene) - 1.0).abs() < 0.02, "{}", luminance_outdoors(&scene));
        assert_eq!(
            [0.0, 9e-4, 1.1e-3, f32::NAN].map(|brightest| is_dim(&scene, brightest)),
            [false, true, false, false]
        );

        // A sun of π brings as much again; a lamp of any power is light of the room's own.
        let sun = PunctualLight { node: 0, color: Vec3::splat(PI), kind: PunctualKind::Directional };
        scene.punctual_lights.push(sun);
        assert!(is_dim(&scene, 1.9e-3) && !is_dim(&scene, 2.1e-3));
        scene.materials.push(Material { emission: Vec3::splat(1e-6), ..Material::default() });
        assert!(!is_dim(&scene, 1e-6));
        assert!(!is_dim(&Scene::default(), 1e-6), "there is no light at all");
    }

    #[test]
    fn a_lamp_alone_makes_no_picture_bright() {
        let picture = |lamp: usize| (0..1000).map(move |pixel| if pixel < lamp { 200 } else { 17 });
        assert_eq!([0, 10, 11, 1000].map(|lamp| bright_code(picture(lamp))), [17, 17, 200, 200]);
        assert_eq!(bright_code(std::iter::empty()), 0);
    }
}
