//! Renders a scene under a lamp at the camera, without light transport, to check that it was loaded correctly.
//!
//! ```text
//! cargo run --release -p render2mpeg-render-core --example preview -- scene.glb picture.png [seconds] [pixels]
//! ```

use glam::{Vec3, Vec3A};
use render_core::{GBuffer, Geometry, NOTHING, PosedScene, Surfaces, scene};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, rest @ ..] = &arguments[..] else {
        return Err("usage: preview SCENE PICTURE.png [SECONDS] [PIXELS]".into());
    };
    let time: f32 = rest.first().map_or(Ok(0.0), |text| text.parse())?;
    let size: usize = rest.get(1).map_or(Ok(256), |text| text.parse())?;

    // Trace the scene at the requested time.
    let scene = scene::load(Path::new(input))?;
    scene.warnings.iter().for_each(|warning| eprintln!("{warning}"));
    let pose = scene.pose(time);
    let view = scene.view(&pose, size, size);
    let accelerator = Geometry::new(&scene).place(&pose);
    let surfaces = Surfaces::new(&scene, &pose);
    let seen = GBuffer::trace(PosedScene::new(&accelerator, &surfaces), &view, (size, size)).value;

    // Shade each surface by its angle to the camera.
    let bytes: Vec<u8> = seen
        .pixels
        .samples()
        .iter()
        .flat_map(|pixel| {
            let position = Vec3A::from(pixel.position);
            let towards = (view.position() - position).normalize_or_zero();
            let cos = Vec3A::from(pixel.shading_normal).dot(towards).max(0.0);
            let reflectance = Vec3::from(pixel.albedo) + Vec3::from(pixel.specular);
            let lit = if pixel.instance == NOTHING { Vec3::ZERO } else { reflectance * cos };
            let color = (lit + Vec3::from(pixel.emission)).clamp(Vec3::ZERO, Vec3::ONE);
            (color.powf(1.0 / 2.2) * 255.0 + 0.5).to_array().map(|c| c as u8)
        })
        .collect();
    image::save_buffer(output, &bytes, size as u32, size as u32, image::ColorType::Rgb8)?;
    Ok(())
}
