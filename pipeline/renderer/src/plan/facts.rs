//! Facts that the plan depends on: contents of a scene, and motion in it.

use crate::BAKED_ROUGHNESS;
use crate::settings::RenderSettings;
use render_core::Environment;
use render_core::scene::{Alpha, Instance, Material, Scene};

/// Facts about a scene and its settings.
pub(super) struct Facts<'a> {
    pub settings: &'a RenderSettings,
    pub object_moves: bool,
    pub light_moves: bool,
    /// See [`lamp_moves`].
    pub lamp_moves: bool,
    /// Whether anything stands still.
    pub stands: bool,
    pub camera_moves: bool,
    /// Whether any surface reflects light diffusely.
    pub reflects: bool,
    pub has_sky: bool,
    /// Bright spots of the sky that direct light samples.
    pub sky_lamps: usize,
    /// Emitting surfaces.
    pub area_lights: usize,
    /// Points, spots and suns.
    pub punctual_lights: usize,
    /// Images in use.
    pub textures: usize,
    /// Surfaces with masked or blended opacity.
    pub cut_outs: usize,
    /// Surfaces that change their shape.
    pub deforming: usize,
    /// Surfaces that may have a coat.
    pub coats: usize,
    /// Coats whose light no bake has: they move, or may be too smooth.
    pub live_coats: usize,
}

impl<'a> Facts<'a> {
    pub fn new(scene: &Scene, settings: &'a RenderSettings) -> Self {
        let (moving, moving_instances) = (scene.moving_nodes(), scene.moving_instances());
        // A material that changes has all properties that it has at any time.
        let materials = scene.extreme_materials();
        let material = |instance: &Instance| &materials[scene.meshes[instance.mesh].material];
        let count = |holds: &dyn Fn(&Instance) -> bool| scene.instances.iter().filter(|one| holds(one)).count();
        let reflects = |instance: &Instance| {
            let material = material(instance);
            !material.unlit && material.base_color.max_element() > 0.0
        };
        Self {
            settings,
            object_moves: moving_instances.contains(&true),
            stands: moving_instances.contains(&false),
            lamp_moves: lamp_moves(scene),
            light_moves: scene.punctual_lights.iter().any(|light| moving[light.node]),
            camera_moves: scene.filming_camera().is_some_and(|camera| moving[camera.node]),
            reflects: scene.instances.iter().any(reflects),
            has_sky: scene.sky.is_some(),
            sky_lamps: scene.sky.as_ref().map_or(0, Environment::lamp_count),
            area_lights: count(&|one| material(one).emits() && !material(one).unlit),
            punctual_lights: scene.punctual_lights.len(),
            textures: scene.textures.len(),
            cut_outs: count(&|one| material(one).alpha != Alpha::Opaque),
            deforming: scene.deforming_instances().iter().filter(|deforms| **deforms).count(),
            coats: count(&|one| material(one).may_have_coat()),
            live_coats: scene
                .instances
                .iter()
                .zip(&moving_instances)
                .filter(|&(one, &moves)| material(one).may_have_coat() && (moves || may_be_smooth(material(one))))
                .count(),
        }
    }
}

/// A fact about the scene or the settings, which no stage depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact {
    /// The subject.
    pub subject: &'static str,
    /// The statement about it.
    pub text: String,
    /// The estimated share of a frame's CPU time, where it has one of its own.
    pub share: Option<f64>,
}

impl Facts<'_> {
    /// Facts to print. `area_lights` and `punctual_lights` are the shares of time of direct light.
    pub fn list(&self, area_lights: Option<f64>, punctual_lights: Option<f64>) -> Vec<Fact> {
        let counted = |count: usize, one: &str, many: &str, none: &str| match count {
            0 => none.to_owned(),
            1 => format!("1 {one}"),
            _ => format!("{count} {many}"),
        };
        let told = |told: bool, yes: &str, no: &str| if told { yes.into() } else { no.into() };
        let fact = |subject, text| Fact { subject, text, share: None };
        let sky = match (self.has_sky, self.sky_lamps) {
            (false, _) => "none in the scene's settings".to_owned(),
            (true, 0) => "its dome is part of the light tree".to_owned(),
            (true, 1) => "its dome is part of the light tree, but for a bright spot: a lamp".to_owned(),
            (true, lamps) => format!("its dome is part of the light tree, but for {lamps} bright spots: lamps"),
        };
        vec![
            Fact {
                share: area_lights,
                ..fact(
                    "area lights",
                    counted(self.area_lights, "glowing surface", "glowing surfaces", "no surface glows"),
                )
            },
            Fact {
                share: punctual_lights,
                ..fact(
                    "punctual lights",
                    counted(self.punctual_lights, "point, spot or sun", "points, spots and suns", "none in the file"),
                )
            },
            fact("sky", sky),
            fact(
                "textures",
                counted(
                    self.textures,
                    "image on visible surfaces",
                    "images on visible surfaces",
                    "no image on a visible surface",
                ),
            ),
            fact(
                "cut-outs",
                counted(
                    self.cut_outs,
                    "surface is masked or blended",
                    "surfaces are masked or blended",
                    "every surface is opaque",
                ),
            ),
            fact(
                "motion for the encoder",
                told(self.settings.motion, "known, no search", "searched for, as requested"),
            ),
        ]
    }
}

/// Whether a coat may be smoother than those whose light is baked: textures make coats smoother.
fn may_be_smooth(material: &Material) -> bool {
    material.roughness < BAKED_ROUGHNESS || material.metallic_roughness_texture.is_some()
}

/// Whether a light or something that glows moves.
pub(crate) fn lamp_moves(scene: &Scene) -> bool {
    let (nodes, instances) = (scene.moving_nodes(), scene.moving_instances());
    let materials = scene.extreme_materials();
    let glows = |one: &Instance| materials[scene.meshes[one.mesh].material].emits();
    scene.punctual_lights.iter().any(|light| nodes[light.node])
        || scene.instances.iter().zip(instances).any(|(one, moves)| moves && glows(one))
}
