//! Facts on which the plan depends: the contents of the scene, and their motion.

use crate::BAKED_ROUGHNESS;
use crate::settings::RenderSettings;
use render_core::Environment;
use render_core::scene::{Alpha, Instance, Material, Scene};

/// Facts about a scene and its settings.
pub(super) struct Facts<'a> {
    pub settings: &'a RenderSettings,
    pub object_moves: bool,
    pub light_moves: bool,
    /// Whether a light or an emissive surface moves; see [`lamp_moves`].
    pub lamp_moves: bool,
    /// Whether any surface is static.
    pub stands: bool,
    pub camera_moves: bool,
    /// Whether any surface reflects light diffusely.
    pub reflects: bool,
    pub has_sky: bool,
    /// Number of bright sky regions that direct light samples.
    pub sky_lamps: usize,
    /// Number of emissive surfaces.
    pub area_lights: usize,
    /// Number of point lights, spotlights and suns.
    pub punctual_lights: usize,
    /// Number of images in use.
    pub textures: usize,
    /// Number of surfaces with masked or blended opacity.
    pub cut_outs: usize,
    /// Number of deforming surfaces.
    pub deforming: usize,
    /// Number of surfaces that may have a coat.
    pub coats: usize,
    /// Number of surfaces with coats that are not baked: the surface moves, or the coat may be too smooth.
    pub live_coats: usize,
}

impl<'a> Facts<'a> {
    pub fn new(scene: &Scene, settings: &'a RenderSettings) -> Self {
        let (moving, moving_instances) = (scene.moving_nodes(), scene.moving_instances());
        // Use the extremes of the properties of animated materials.
        let materials = scene.extreme_materials();
        let material = |instance: &Instance| &materials[scene.meshes[instance.mesh].material];
        let count = |holds: &dyn Fn(&Instance) -> bool| scene.instances.iter().filter(|one| holds(one)).count();
        let reflects = |instance: &Instance| {
            let material = material(instance);
            !material.unlit && material.base_color.max_element() > 0.0
        };

        // Count the coats to evaluate in every frame: only static, rough coats are baked.
        let mut live_coats = 0;
        for (instance, &moves) in scene.instances.iter().zip(&moving_instances) {
            let material = material(instance);
            if material.may_have_coat() && (moves || may_be_smooth(material)) {
                live_coats += 1;
            }
        }
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
            live_coats,
        }
    }
}

/// A fact about the scene or the settings on which no stage depends.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact {
    /// Subject of the fact.
    pub subject: &'static str,
    /// Statement about the subject.
    pub text: String,
    /// Estimated fraction of a frame's CPU time; `None` for a fact that costs no time.
    pub share: Option<f64>,
}

impl Facts<'_> {
    /// Returns the facts to print. `area_lights` and `punctual_lights` are the fractions of CPU time for their direct
    /// light.
    pub fn list(&self, area_lights: Option<f64>, punctual_lights: Option<f64>) -> Vec<Fact> {
        // Phrase zero, one and many separately: the table is read as text.
        let counted = |count: usize, one: &str, many: &str, none: &str| match count {
            0 => none.to_owned(),
            1 => format!("1 {one}"),
            _ => format!("{count} {many}"),
        };
        let told = |told: bool, yes: &str, no: &str| if told { yes.into() } else { no.into() };
        let fact = |subject, text| Fact { subject, text, share: None };

        // Report how the sky is sampled: bright regions are lamps, the rest is in the light tree.
        let sky = match (self.has_sky, self.sky_lamps) {
            (false, _) => "none in the scene's settings".to_owned(),
            (true, 0) => "dome in the light tree".to_owned(),
            (true, 1) => "dome in the light tree, 1 bright region sampled as a lamp".to_owned(),
            (true, lamps) => format!("dome in the light tree, {lamps} bright regions sampled as lamps"),
        };

        // List the direct light of lamps with its cost, because no stage of the plan contains it.
        vec![
            Fact {
                share: area_lights,
                ..fact(
                    "area lights",
                    counted(self.area_lights, "emissive surface", "emissive surfaces", "no surface emits light"),
                )
            },
            Fact {
                share: punctual_lights,
                ..fact(
                    "punctual lights",
                    counted(self.punctual_lights, "point, spot or sun", "points, spots and suns", "none in the file"),
                )
            },
            // Add facts without a cost of their own.
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
                told(self.settings.motion, "provided by the renderer", "searched by the encoder, as requested"),
            ),
        ]
    }
}

/// Returns whether a coat may be smoother than the limit for baking. Textures can only make coats smoother.
fn may_be_smooth(material: &Material) -> bool {
    material.lobes.is_some() || material.roughness < BAKED_ROUGHNESS || material.metallic_roughness_texture.is_some()
}

/// Returns whether a light or an emissive surface moves or changes.
pub(crate) fn lamp_moves(scene: &Scene) -> bool {
    let nodes = scene.moving_nodes();
    scene.punctual_lights.iter().any(|light| nodes[light.node]) || moving_lamps(scene).contains(&true)
}

/// Returns, for each instance, whether it emits light and moves or changes.
pub(crate) fn moving_lamps(scene: &Scene) -> Vec<bool> {
    let materials = scene.extreme_materials();
    let glows = |one: &Instance| materials[scene.meshes[one.mesh].material].emits();
    scene.instances.iter().zip(scene.moving_instances()).map(|(one, moves)| moves && glows(one)).collect()
}
