//! Notes on a scene and its film: surprising results that are not errors.

use mpeg2enc::Level;
use perceptual::luminance_plane;
use plane::Plane;
use render_core::luminance;
use render_core::scene::{PunctualKind, Scene};
use render2mpeg::report::Report;
use render2mpeg::settings::{CodedRate, Settings};
use renderer::settings::Size;
use std::f32::consts::PI;

/// Maximum luma of a black picture: eight codes above video black, which is hardly visible on any display.
const BLACK: u8 = 24;

/// Maximum ratio of a dim picture's luminance to the luminance outdoors: ten stops less, as in a cellar.
const DIM: f32 = 1e-3;

/// Returns notes to print before rendering: warnings of the scene, and limits that the film exceeds.
pub(super) fn before(scene: &Scene, settings: &Settings) -> Vec<String> {
    let mut notes = scene.warnings.clone();
    notes.extend(beyond_the_end(scene, settings));
    notes.extend(beyond_levels(settings));
    notes
}

/// Returns a note if the picture size and rate exceed every level.
fn beyond_levels(settings: &Settings) -> Option<String> {
    let (Size { width, height }, rate) = (settings.render.size, CodedRate::of(settings.render.fps).ok()?.rate);
    if settings.coding.mpeg1 || Level::lowest(width, height, rate.fps()).is_some() {
        return None;
    }
    let fps = rate.fps();
    Some(format!(
        "{width}x{height} at {fps:.2} pictures per second exceeds every MPEG-2 level: the film states High Level"
    ))
}

/// Returns a note if frames were quantised coarser than the settings to stay within the level.
pub(super) fn on_level(report: &Report) -> Option<String> {
    let settings = &report.settings;
    // At a given bit rate, rate control chooses the quantisers.
    if settings.coding.bitrate.is_some() {
        return None;
    }
    let coarser = report.frames.iter().filter(|frame| frame.qscale > settings.render.qscale).count();
    (coarser > 0).then(|| {
        let qscale = settings.render.qscale;
        format!(
            "{coarser} frames are coded coarser than --qscale {qscale}, to stay within the bit rate of the film's level"
        )
    })
}

/// Returns a note if the film continues after the end of the animation.
fn beyond_the_end(scene: &Scene, settings: &Settings) -> Option<String> {
    let (renderer, duration) = (settings.render.clone(), f64::from(scene.duration()));
    let last = settings.frame_range().end.checked_sub(1)?;
    let late = f64::from(renderer.time(last)) - duration;
    // Ignore static scenes, and films that exceed the animation by at most one frame.
    if duration == 0.0 || late * settings.render.fps <= 1.0 {
        return None;
    }
    let end = (duration * settings.render.fps).round();
    Some(format!("the animation ends after {duration:.2} s, before frame {end}: later frames are static"))
}

/// Returns the code that at most 1 % of the pixels exceed. A small lamp therefore does not make a picture bright.
pub(super) fn bright_code(codes: impl Iterator<Item = u8>) -> u8 {
    // Count the pixels of each code.
    let (mut counts, mut all) = ([0usize; 256], 0);
    for code in codes {
        counts[usize::from(code)] += 1;
        all += 1;
    }

    // Find the largest code that more than 1 % of the pixels reach or exceed.
    let mut above = 0;
    for code in (1..=255).rev() {
        above += counts[code];
        if above > all / 100 {
            return code as u8;
        }
    }
    0
}

/// Returns a note if all pictures are black: `brightest`, the largest [`bright_code`] of their luma, is at most
/// [`BLACK`].
pub(super) fn on_darkness(brightest: Option<u8>, settings: &Settings) -> Option<String> {
    if brightest? > BLACK {
        return None;
    }
    // Mention only an exposure that is not automatic.
    let exposure = match settings.render.auto_exposure {
        true => String::new(),
        false => format!("the exposure is {}, adjustable with --set exposure=…; ", settings.render.tone_map.exposure),
    };
    let scene = settings.scene.display();
    Some(format!(
        "99 % of pixels are black or nearly so: {exposure}render2mpeg plan {scene} lists lamps and sky; check the camera"
    ))
}

/// Fraction of black pixels above which a picture counts as unlit.
const MOST_BLACK: f32 = 0.4;

/// Returns a note if much of a still is black because the scene's lamps are its only light.
pub(super) fn on_lamps_alone(shown: &Plane<[u8; 3]>, scene: &Scene) -> Option<String> {
    let black = shown.samples().iter().filter(|codes| codes.iter().all(|&code| code < 4)).count();
    let share = black as f32 / shown.samples().len().max(1) as f32;
    (scene.sky.is_none() && share > MOST_BLACK).then(|| {
        format!(
            "{:.0} % of the picture is black: only the scene's own lamps light it; --studio soft adds a studio",
            100.0 * share
        )
    })
}

/// Returns the mean luminance of a picture.
pub(super) fn mean_luminance(radiance: &Plane<[f32; 3]>) -> f32 {
    let luminances = luminance_plane(radiance);
    luminances.samples().iter().sum::<f32>() / luminances.samples().len().max(1) as f32
}

/// Returns a note if hardly any light from sky and suns reaches the pictures, and the scene has no other light. The
/// largest [mean luminance](mean_luminance) of all pictures is `brightest`.
pub(super) fn on_dimness(brightest: f32, scene: &Scene) -> Option<String> {
    // Lamps light their surroundings regardless of the brightness outdoors.
    let has_lamps = scene.punctual_lights.iter().any(|light| light.kind != PunctualKind::Directional)
        || scene.extreme_materials().iter().any(|material| material.emits());
    let share = brightest / luminance_outdoors(scene);
    (!has_lamps && share > 0.0 && share < DIM).then(|| {
        format!(
            "the pictures receive 1/{:.0} of the light of sky and sun, so photon noise is visible; add lamps or widen openings",
            1.0 / share
        )
    })
}

/// Returns the mean luminance of a white surface lit by the whole sky and every sun: E / π, with irradiance E = Φ / 4
/// for a fluence Φ.
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
        // A sky of radiance 1 lights a white surface to luminance E / π = 1, with E = 4π / 4.
        let white = Gradient { zenith: [1.0; 3], horizon: [1.0; 3], ground: [1.0; 3] };
        let mut scene = Scene { sky: Environment::gradient(white), ..Scene::default() };
        let is_dim = |scene: &Scene, brightest: f32| on_dimness(brightest, scene).is_some();
        assert!((luminance_outdoors(&scene) - 1.0).abs() < 0.02, "{}", luminance_outdoors(&scene));
        assert_eq!(
            [0.0, 9e-4, 1.1e-3, f32::NAN].map(|brightest| is_dim(&scene, brightest)),
            [false, true, false, false]
        );

        // A sun of irradiance π doubles the light. A lamp of any power lights the room itself.
        let sun = PunctualLight { node: 0, color: Vec3::splat(PI), kind: PunctualKind::Directional };
        scene.punctual_lights.push(sun);
        assert!(is_dim(&scene, 1.9e-3) && !is_dim(&scene, 2.1e-3));
        scene.materials.push(Material { emission: Vec3::splat(1e-6), ..Material::default() });
        assert!(!is_dim(&scene, 1e-6));
        assert!(!is_dim(&Scene::default(), 1e-6), "the scene has no light");
    }

    #[test]
    fn black_surroundings_are_explained_unless_there_is_a_sky() {
        let picture = |black: usize| Plane::from_fn(100, 1, |x, _| if x < black { [1, 0, 3] } else { [0, 0, 90] });
        let dark = Scene::default();
        let lit = Scene { sky: Environment::gradient(Gradient::constant([1.0; 3])), ..Scene::default() };
        let noted = |black: usize, scene: &Scene| on_lamps_alone(&picture(black), scene).is_some();
        assert_eq!(
            [(40, &dark), (41, &dark), (41, &lit)].map(|(black, scene)| noted(black, scene)),
            [false, true, false]
        );
    }

    #[test]
    fn a_lamp_alone_makes_no_picture_bright() {
        let picture = |lamp: usize| (0..1000).map(move |pixel| if pixel < lamp { 200 } else { 17 });
        assert_eq!([0, 10, 11, 1000].map(|lamp| bright_code(picture(lamp))), [17, 17, 200, 200]);
        assert_eq!(bright_code(std::iter::empty()), 0);
    }
}
