//! Facts that the plan depends on: contents of a scene, and motion in it.

use crate::settings::RenderSettings;
use render_core::scene::{Alpha, Instance, Scene};

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
}

impl<'a> Facts<'a> {
    pub fn new(scene: &Scene, settings: &'a RenderSettings) -> Self {
        let (moving, moving_instances) = (scene.moving_nodes(), scene.moving_instances());
        let material = |instance: &Instance| &scene.materials[scene.meshes[instance.mesh].material];
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
            area_lights: count(&|one| material(one).emits() && !material(one).unlit),
            punctual_lights: scene.punctual_lights.len(),
            textures: scene.textures.len(),
            cut_outs: count(&|one| material(one).alpha != Alpha::Opaque),
            deforming: scene.deforming_instances().iter().filter(|deforms| **deforms).count(),
            coats: count(&|one| material(one).may_have_coat()),
        }
    }
}

/// Whether a light or something that glows moves.
pub(crate) fn lamp_moves(scene: &Scene) -> bool {
    let (nodes, instances) = (scene.moving_nodes(), scene.moving_instances());
    let glows = |one: &Instance| scene.materials[scene.meshes[one.mesh].material].emits();
    scene.punctual_lights.iter().any(|light| nodes[light.node])
        || scene.instances.iter().zip(instances).any(|(one, moves)| moves && glows(one))
}
