//! Custom layers of light, made outside the renderer, that replace its own.

use glam::Vec3;
use pipeline::Result;
use pipeline::stage::{LastThresholds, LuminanceThresholds, Prepare, Shade};
use plane::Plane;
use render_core::scene::Scene;
use render2mpeg::Options;
use render2mpeg::settings::Switch;
use renderer::plan::Plan;
use renderer::settings::{Aov, RenderSettings};
use renderer::{Frame, Layer, Lit, Preparation, Shading, Tolerance, Visible};
use std::f32::consts::PI;
use std::sync::Arc;
use tests::{cornell, load};

const SIDE: usize = 32;
const DELTA: f32 = 0.25;

/// Uniform irradiance.
struct Constant(f32);

impl Layer for Constant {
    fn light(&mut self, visible: &Visible<'_>, _: Option<&Plane<bool>>, _: &Tolerance<'_>) -> Lit {
        let pixels = &visible.matte.pixels;
        Lit::of_irradiance(Plane::filled(pixels.width(), pixels.height(), [self.0; 3]))
    }
}

/// Returns the tolerated error of each pixel as its light, and counts the frames.
#[derive(Default)]
struct Errors {
    frames: u8,
}

impl Layer for Errors {
    fn light(&mut self, visible: &Visible<'_>, _: Option<&Plane<bool>>, tolerance: &Tolerance<'_>) -> Lit {
        self.frames += 1;
        let error = |x, y| tolerance.at_pixel(x, y, visible.radiance.get(x, y)).threshold_at(0.0);
        Lit { radiance: Some(Plane::from_fn(SIDE, SIDE, |x, y| Vec3::splat(error(x, y)))), ..Lit::default() }
    }

    fn channel(&self, aov: Aov, _: &Frame<'_>) -> Option<Vec<f32>> {
        (aov == Aov::Cache).then(|| vec![f32::from(self.frames); SIDE * SIDE])
    }

    fn state(&self) -> Vec<u8> {
        vec![self.frames]
    }

    fn restore(&mut self, state: &[u8], _: &Frame<'_>) -> Result<()> {
        self.frames = state[0];
        Ok(())
    }
}

/// A scene sampled at one point per pixel, without antialiasing.
fn scene() -> (Scene, RenderSettings) {
    let options = Options {
        size: format!("{SIDE}x{SIDE}").parse().ok(),
        vpls: Some(100),
        photons: Some(2000),
        frames: Some(3),
        antialiasing: Some(Switch::Off),
        aov: vec![Aov::Cache, Aov::Indirect],
        exr: Some("frames".into()),
        ..Options::default()
    };
    let (scene, settings) = load(&cornell(), options);
    (scene, settings.render.clone())
}

/// L = L_direct + ρ E / π at every pixel if a constant E is the only indirect light.
#[test]
fn a_constant_layer_takes_the_place_of_indirect_light() {
    let (scene, settings) = scene();
    let plan = Plan::new(&scene, &settings);
    let mut preparation = Preparation::new(&scene, &settings, &plan);
    let with = |irradiance| Shading::new(&settings, &plan).with_indirect(Box::new(Constant(irradiance)));
    let mut shadings = [with(0.0), with(3.0)];
    for index in 0..2 {
        let prepared = preparation.step(index).expect("three frames");
        let [dark, lit] = shadings.each_mut().map(|shading| shading.step(&prepared, LastThresholds::none()));
        assert_eq!(lit.figures.cache_new, 0, "no record is made");
        for (place, pixel) in prepared.frame.seen.pixels.samples().iter().enumerate() {
            let reflected = Vec3::from(pixel.albedo) * 3.0 / PI;
            let expected = Vec3::from(dark.radiance.samples()[place]) + reflected;
            let found = Vec3::from(lit.radiance.samples()[place]);
            assert!((found - expected).abs().max_element() <= 1e-5 * expected.max_element(), "{found}, {expected}");
        }
    }
}

#[test]
fn a_layer_gets_the_thresholds_of_the_frame_before() {
    let (scene, settings) = scene();
    let plan = Plan::new(&scene, &settings);
    let mut preparation = Preparation::new(&scene, &settings, &plan);
    let mut shading = Shading::new(&settings, &plan).with_indirect(Box::new(Errors::default()));
    let first = preparation.step(0).expect("three frames");
    shading.step(&first, LastThresholds::none());
    let second = preparation.step(1).expect("three frames");
    let plane = |value| Arc::new(Plane::filled(SIDE, SIDE, value));
    let thresholds = LuminanceThresholds { of: 0, delta: plane(DELTA), luminance: plane(1.0) };
    let known = second.correspondence.as_deref().expect("motion from the first frame");
    let shaded = shading.step(&second, LastThresholds::new(1, Some(&thresholds), Some(known)));
    let (_, indirect) = shaded.channels.iter().find(|(name, _)| name == "indirect.G").expect("it is wanted");
    let mut matched = 0;
    for (place, &error) in indirect.iter().enumerate() {
        if known.match_of(place % SIDE, place / SIDE).is_some() {
            assert_eq!(error, DELTA);
            matched += 1;
        }
    }
    assert!(matched > SIDE * SIDE / 2, "{matched} pixels were seen before");
}

#[test]
fn channels_and_state_of_a_layer_are_those_of_its_frame() {
    let (scene, settings) = scene();
    let plan = Plan::new(&scene, &settings);
    let mut preparation = Preparation::new(&scene, &settings, &plan);
    let new = || Shading::new(&settings, &plan).with_indirect(Box::new(Errors::default()));
    let frames_of = |channels: &[(String, Vec<f32>)]| {
        channels.iter().find(|(name, _)| name == "cache.records").map(|(_, values)| values[0])
    };
    let mut shading = new();
    let first = preparation.step(0).expect("three frames");
    let shaded = shading.step(&first, LastThresholds::none());
    assert_eq!(frames_of(&shaded.channels), Some(1.0));
    // Another instance continues from its state.
    let mut resumed = new();
    resumed.restore(&shading.state(), &first).expect("its own state");
    let second = preparation.step(1).expect("three frames");
    let shaded = resumed.step(&second, LastThresholds::none());
    assert_eq!(frames_of(&shaded.channels), Some(2.0));
    // The state of other layers is refused.
    let mut own = Shading::new(&settings, &plan);
    assert!(own.restore(&shading.state(), &first).is_err());
}
