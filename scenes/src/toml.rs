//! The settings file of a scene.

use glam::Vec3;

/// Sky radiance and angular diameter of the sun, for scenes under the open sky.
#[derive(Clone, Copy, Debug)]
pub struct Sky {
    /// Radiance at the zenith \[W·m⁻²·sr⁻¹\].
    pub zenith: Vec3,
    /// Radiance at the horizon \[W·m⁻²·sr⁻¹\].
    pub horizon: Vec3,
    /// Radiance below the horizon \[W·m⁻²·sr⁻¹\].
    pub ground: Vec3,
    /// Angular diameter of the sun \[°\].
    pub sun_diameter: f32,
}

/// Contents of a scene's settings file.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Factor applied to radiance before the tone curve.
    pub exposure: f32,
    /// Sky of the scene, or `None` for indoor scenes.
    pub sky: Option<Sky>,
    /// Names of the nodes that viewers watch, possibly none.
    pub watched: &'static [&'static str],
    /// Number of frames of the whole animation at 25 frames per second.
    pub frames: u32,
}

impl Settings {
    /// Returns the text of the settings file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut s = format!("[tone_mapping]\noperator = \"filmic\"\nexposure = {:?}\n", self.exposure);
        // Indoor scenes have neither sky nor sun.
        if let Some(sky) = self.sky {
            let rgb = |c: Vec3| format!("[{:?}, {:?}, {:?}]", c.x, c.y, c.z);
            s += "\n# Radiance in W/(m² sr), linear Rec.709.\n[sky]\n";
            s += &format!(
                "zenith = {}\nhorizon = {}\nground = {}\n",
                rgb(sky.zenith),
                rgb(sky.horizon),
                rgb(sky.ground)
            );
            s += &format!("\n# Degrees across.\n[sun]\nangular_diameter = {:?}\n", sky.sun_diameter);
        }
        // Importance requires the viewer's distance and the screen width.
        if !self.watched.is_empty() {
            s += &format!("\n# From half a meter, the picture is as wide.\n[importance]\nnodes = {:?}\n", self.watched);
            s += "viewing_distance = 0.5\nscreen_width = 0.5\n";
        }
        s += "\n[camera]\nname = \"camera\"\n";
        s += &format!("\n[video]\nframes = {}\nfps = 25\n", self.frames);
        s
    }
}
