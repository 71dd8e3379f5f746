//! Settings serialized as one flat table, with the keys of `report.json` in order.

use super::{CodingSettings, FileSettings, Settings};
use renderer::settings::RenderSettings;
use serde::ser::{Serialize, SerializeMap, Serializer};

impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // Name every field, so that the compiler reports a new setting that is not listed.
        let Self { scene, output, range, aspect, render, coding, files } = self;
        let CodingSettings { aq, gop, bitrate, cbr, effort, mpeg1 } = coding;
        let FileSettings { baked, light, png, exr, exr_depth, y4m, y4m_is_coded: _ } = files;
        #[rustfmt::skip]
        let RenderSettings {
            frames, end: _, chunk, fps, rate: _, from, every, size, pixel_aspect: _, importance, importance_gain, tiles,
            tone_map, auto_exposure, samples, antialiasing, lighting, cache, shading, compensation, bounces, vpls,
            moving_vpls, photons, seed, thresholds, kappa, stopping, within, qscale, motion, bframes, leave_out, aov,
        } = render;

        // Serialize one flat table, so that reports do not depend on the nesting of the settings.
        let mut table = serializer.serialize_map(None)?;

        // List a key unless its condition fails.
        macro_rules! list {
            ($($key:ident $(if $listed:expr)?),* $(,)?) => {
                $(if true $(&& $listed)? {
                    table.serialize_entry(stringify!($key), $key)?;
                })*
            };
        }
        list! {
            scene,
            output,
            frames,
            from if *from > 0,
            every if *every > 1,
            chunk if chunk.is_some(),
            range if range.is_some(),
            fps,
            size,
            aspect if !aspect.is_square(),
            qscale,
            aq,
            gop,
            bitrate,
            cbr,
            bframes,
            effort,
            mpeg1,
            thresholds,
            kappa,
            stopping,
            within,
            shading,
            importance if importance.is_some(),
            importance_gain if importance.is_some(),
            tiles if tiles.is_some(),
            samples,
            antialiasing,
            bounces,
            lighting,
            baked if baked.is_some(),
            cache,
            compensation,
            vpls,
            moving_vpls,
            photons,
            seed,
            leave_out,
            motion,
            tone_map,
            auto_exposure,
            light if light.is_some(),
            png if png.is_some(),
            exr,
            exr_depth if exr_depth.is_some(),
            aov,
            y4m,
        }
        table.end()
    }
}
