//! Settings serialized as one flat table, with the keys of `report.json` in order.

use super::{CodingSettings, FileSettings, Settings};
use renderer::settings::RenderSettings;
use serde::ser::{Serialize, SerializeStruct, Serializer};

/// Number of keys if every setting is listed.
const MOST_KEYS: usize = 46;

impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { scene, output, range, aspect, render, coding, files } = self;
        let CodingSettings { aq, gop, bitrate, cbr, effort, mpeg1 } = coding;
        // The user does not choose the matrix of the YUV4MPEG2 file, so do not list it.
        let FileSettings { baked, png, exr, exr_depth, y4m, y4m_is_coded: _ } = files;
        // Do not list derived values.
        let RenderSettings { end: _, rate: _, pixel_aspect: _, .. } = render;
        let r = render;

        let mut table = serializer.serialize_struct("Settings", MOST_KEYS)?;
        // List a key unless its condition fails.
        macro_rules! list {
            ($($key:ident $(if ($listed:expr))?: $value:expr),* $(,)?) => {
                $(if true $(&& $listed)? {
                    table.serialize_field(stringify!($key), $value)?;
                })*
            };
        }
        list! {
            scene: scene,
            output: output,
            frames: &r.frames,
            from if (r.from > 0): &r.from,
            every if (r.every > 1): &r.every,
            chunk if (r.chunk.is_some()): &r.chunk,
            range if (range.is_some()): range,
            fps: &r.fps,
            size: &r.size,
            aspect if (!aspect.is_square()): aspect,
            qscale: &r.qscale,
            aq: aq,
            gop: gop,
            bitrate: bitrate,
            cbr: cbr,
            bframes: &r.bframes,
            effort: effort,
            mpeg1: mpeg1,
            thresholds: &r.thresholds,
            kappa: &r.kappa,
            stopping: &r.stopping,
            within: &r.within,
            shading: &r.shading,
            importance if (r.importance.is_some()): &r.importance,
            importance_gain if (r.importance.is_some()): &r.importance_gain,
            tiles if (r.tiles.is_some()): &r.tiles,
            samples: &r.samples,
            antialiasing: &r.antialiasing,
            bounces: &r.bounces,
            lighting: &r.lighting,
            baked if (baked.is_some()): baked,
            cache: &r.cache,
            compensation: &r.compensation,
            vpls: &r.vpls,
            moving_vpls: &r.moving_vpls,
            photons: &r.photons,
            seed: &r.seed,
            leave_out: &r.leave_out,
            motion: &r.motion,
            tone_map: &r.tone_map,
            auto_exposure: &r.auto_exposure,
            png if (png.is_some()): png,
            exr: exr,
            exr_depth if (exr_depth.is_some()): exr_depth,
            aov: &r.aov,
            y4m: y4m,
        }
        table.end()
    }
}
