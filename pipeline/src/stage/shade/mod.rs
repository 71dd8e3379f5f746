//! Light for every pixel: direct light, and indirect light by cuts through the light tree that stop at thresholds.
//! The one place where rays and light tree meet.

mod cache;
mod cuts;
mod direct;
mod macroblock;
mod pixels;

use crate::message::{LuminanceThresholds, Prepared, Shaded};
use crate::plan::{Plan, State};
use crate::settings::Settings;
use cache::Cache;
use crossbeam_channel::{Receiver, Sender};
use cuts::LightTransport;
use glam::Vec3;
use perceptual::ThresholdMap;
use plane::Plane;
use render_core::{Busy, NOTHING, luminance};

/// Share of the luminance that a pixel without a threshold may be wrong by \[Walter05\], \[Herzog08, 5.3\].
const WITHOUT_THRESHOLD: f32 = 0.02;
/// Pixels darker than this share of the picture's mean do not count in the mean relative threshold: 0/0 says nothing.
const DARK: f64 = 1e-4;

/// Lights frame after frame. With masking on, frame n waits for the thresholds of frame n−1, and for no others.
pub fn run(
    settings: &Settings,
    plan: &Plan,
    frames: &Receiver<Prepared>,
    thresholds: &Receiver<LuminanceThresholds>,
    out: &Sender<Shaded>,
) {
    let mut cache = (plan.cache == State::On).then(Cache::default);
    for prepared in frames {
        let map = match (plan.masking, &prepared.correspondence) {
            (State::On, Some(correspondence)) => {
                let Ok(LuminanceThresholds { of, delta }) = thresholds.recv() else { return };
                assert_eq!(of + 1, prepared.frame, "thresholds out of step");
                perceptual::carry(&delta, &correspondence.matches)
            }
            _ => ThresholdMap::relative(settings.size.width, settings.size.height),
        };
        if out.send(shade(settings, plan, prepared, &map, cache.as_mut())).is_err() {
            return;
        }
    }
}

fn shade(
    settings: &Settings,
    plan: &Plan,
    mut prepared: Prepared,
    map: &ThresholdMap,
    cache: Option<&mut Cache>,
) -> Shaded {
    let mut figures = std::mem::take(&mut prepared.figures);
    let busy = Busy::default();
    let (direct, direct_rays) = direct::light(&prepared, &prepared.seen, &busy);
    figures.direct = busy.seconds();

    let busy = Busy::default();
    let transport = LightTransport::new(settings, &prepared, map, &direct, plan.compensation == State::On);
    let indirect = match (plan.indirect, cache) {
        (State::Off, _) => Plane::filled(direct.width(), direct.height(), Vec3::ZERO),
        (_, Some(cache)) => cache.light(&transport, &busy, &mut figures),
        (_, None) => pixels::light(&transport, &busy),
    };
    figures.shadow_rays = direct_rays;
    transport.figures.put_into(&mut figures);
    let radiance =
        Plane::from_fn(direct.width(), direct.height(), |x, y| (direct.get(x, y) + indirect.get(x, y)).to_array());
    figures.indirect = busy.seconds();
    figures.threshold_mean_relative = transport.mean_relative_threshold(&radiance);
    Shaded { frame: prepared.frame, radiance, correspondence: prepared.correspondence, figures }
}

impl LightTransport<'_> {
    /// Mean of threshold by luminance over the pixels that are lit indirectly.
    fn mean_relative_threshold(&self, radiance: &Plane<[f32; 3]>) -> f64 {
        let share = self.relative_threshold();
        let pixels = self.prepared.seen.pixels.samples().iter().zip(radiance.samples());
        let (width, seen) = (radiance.width(), |albedo: [f32; 3], instance| instance != NOTHING && albedo != [0.0; 3]);
        let places = (0..).zip(pixels).filter(|(_, (pixel, _))| seen(pixel.albedo, pixel.instance));
        let lit: Vec<(f32, f32)> = places
            .map(|(index, (_, &radiance))| {
                let y = luminance(radiance.into());
                (self.threshold(index % width, index / width).unwrap_or(share * y), y)
            })
            .collect();
        let mean = lit.iter().map(|&(_, y)| f64::from(y)).sum::<f64>() / lit.len().max(1) as f64;
        let relative: Vec<f64> = lit
            .iter()
            .filter(|&&(_, y)| f64::from(y) > DARK * mean)
            .map(|&(t, y)| f64::from(t) / f64::from(y))
            .collect();
        relative.iter().sum::<f64>() / relative.len().max(1) as f64
    }
}
