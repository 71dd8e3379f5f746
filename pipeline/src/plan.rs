//! What a scene needs, and what is left out of it, and why: decided before the first frame.
//!
//! Leaving out never changes a bit of the output: what is left out would have computed the same again.

mod estimate;

use crate::settings::{Lighting, Settings, Thresholds};
use estimate::Costs;
use render_core::scene::{Alpha, Scene};
use serde::Serialize;

/// How often a stage runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Every frame.
    On,
    /// For the first frame; its result is kept.
    Once,
    /// Never.
    Off,
}

/// A line of the plan.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// Name of the stage.
    pub stage: &'static str,
    /// How often it runs.
    pub state: State,
    /// Why.
    pub reason: String,
    /// Share of a frame's CPU time, after the first, that leaving it out saves: an estimate, by the work there is and what a
    /// unit of it cost where it was measured. None of stages that run, and where nothing is there that could cost time.
    pub saves: Option<f64>,
}

/// How often each stage runs for a scene.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Placing what moves, and the top level of the ray tree.
    pub placing: State,
    /// Photons and the energies of the anchor lights.
    pub photons: State,
    /// Photons that nothing that moves can meet, apart from the others: traced once.
    pub photons_apart: State,
    /// New energies into the light tree.
    pub tree_update: State,
    /// Primary rays.
    pub primary_rays: State,
    /// Anchor lights on moving things.
    pub moving_anchors: State,
    /// Any anchor lights at all.
    pub indirect: State,
    /// Indirect light is cached on surfaces.
    pub cache: State,
    /// The light that softened virtual lights lose is given back.
    pub compensation: State,
    /// Light that coats reflect.
    pub gloss: State,
    /// The masking model and the way back.
    pub masking: State,
    steps: Vec<Step>,
    /// See [`Plan::share_of`].
    shares: Vec<Option<f64>>,
}

impl Plan {
    /// Looks at `scene` and `settings`.
    pub fn new(scene: &Scene, settings: &Settings) -> Self {
        let moving = scene.moving_nodes();
        let thing_moves = scene.moving_instances().contains(&true);
        let light_moves = scene.punctual_lights.iter().any(|light| moving[light.node]);
        let camera_moves = scene.filming_camera().is_some_and(|camera| moving[camera.node]);
        let material = |instance: &render_core::scene::Instance| &scene.materials[scene.meshes[instance.mesh].material];
        let reflects = scene.instances.iter().any(|instance| {
            let material = material(instance);
            !material.unlit && material.base_color.max_element() > 0.0
        });
        let area_lights = scene.instances.iter().filter(|i| material(i).emits() && !material(i).unlit).count();
        let cells = |wanted: State| if settings.leave_out || wanted != State::Once { wanted } else { State::On };
        let mut steps = Vec::new();
        let mut step = |stage, state, reason: &str| -> State {
            let wanted = cells(state);
            let reason =
                if wanted == state { reason.to_owned() } else { format!("{reason}; run all the same, as asked") };
            steps.push(Step { stage, state: wanted, reason, saves: None });
            wanted
        };

        let placing = if thing_moves {
            step("placing of objects", State::On, "something moves")
        } else {
            step("placing of objects", State::Once, "nothing but the camera moves")
        };
        let (photons, tree_update) = match (reflects, thing_moves || light_moves) {
            (false, _) => (
                step("photons", State::Off, "no surface reflects light"),
                step("light tree update", State::Off, "no surface reflects light"),
            ),
            (true, true) => (
                step("photons", State::On, "what moves changes the way of the light"),
                step("light tree update", State::On, "the energies change"),
            ),
            (true, false) => (
                step("photons", State::Once, "nothing that light meets ever moves"),
                step("light tree update", State::Once, "the energies stay"),
            ),
        };
        let photons_apart = match (photons, settings.leave_out && settings.frames > 1) {
            (State::On, true) => step(
                "photons that stay",
                State::On,
                "their ways are traced once up to where something that moves can meet them",
            ),
            (State::On, false) => step("photons that stay", State::Off, "every photon is traced for every frame"),
            _ => step("photons that stay", State::Off, "no photon has to be traced again"),
        };
        let moving_anchors = match (reflects, thing_moves) {
            (true, true) => step("anchor lights on moving objects", State::On, "something moves and reflects"),
            _ => step("anchor lights on moving objects", State::Off, "no moving object"),
        };
        let primary_rays = if thing_moves || camera_moves {
            step("primary rays and motion", State::On, if camera_moves { "the camera moves" } else { "objects move" })
        } else {
            step("primary rays and motion", State::Once, "nothing moves in the picture")
        };
        let on = |present: bool| if present { State::On } else { State::Off };
        let area_reason = format!("{area_lights} glowing surfaces");
        step("area lights", on(area_lights > 0), if area_lights > 0 { &area_reason } else { "no surface glows" });
        let punctual = scene.punctual_lights.len();
        let punctual_reason = format!("{punctual} in the file");
        step("punctual lights", on(punctual > 0), if punctual > 0 { &punctual_reason } else { "none in the file" });
        let sky = scene.sky.is_some();
        step("sky", on(sky), if sky { "its dome is part of the light tree" } else { "no sky in the scene's settings" });
        let textures = scene.textures.len();
        let texture_reason = format!("{textures} images on visible surfaces");
        step(
            "textures",
            on(textures > 0),
            if textures > 0 { &texture_reason } else { "no image on a visible surface" },
        );
        let holes = scene.instances.iter().filter(|i| material(i).alpha != Alpha::Opaque).count();
        let holes_reason = format!("{holes} surfaces are masked or blended");
        step("cut-outs", on(holes > 0), if holes > 0 { &holes_reason } else { "every surface is opaque" });
        let bent = scene.deforming_instances().iter().filter(|deforms| **deforms).count();
        let bent_reason = format!("{bent} surfaces change their shape");
        step(
            "skins and morph targets",
            on(bent > 0),
            if bent > 0 { &bent_reason } else { "nothing changes its shape" },
        );
        let indirect = match settings.lighting {
            _ if !reflects => step("indirect light", State::Off, "no surface reflects light"),
            Lighting::Lightcuts if settings.cache => step("indirect light", State::On, "a lightcut for each record"),
            Lighting::Lightcuts => step("indirect light", State::On, "a lightcut for each pixel"),
            Lighting::AllLights => step("indirect light", State::On, "every light at each pixel, as asked"),
        };
        let cache = match settings.lighting {
            _ if indirect == State::Off => step("irradiance cache", State::Off, "there is no indirect light"),
            Lighting::AllLights => step("irradiance cache", State::Off, "the reference has none"),
            Lighting::Lightcuts if settings.cache => {
                step("irradiance cache", State::On, "indirect light varies slowly")
            }
            Lighting::Lightcuts => step("irradiance cache", State::Off, "left out, as asked"),
        };
        let compensation = match settings.compensation {
            _ if indirect == State::Off => step("compensation", State::Off, "there is no indirect light"),
            true => step("compensation", State::On, "corners would be dark without the light of close lights"),
            false => step("compensation", State::Off, "left out, as asked"),
        };
        let coats = scene.instances.iter().filter(|i| material(i).may_have_coat()).count();
        let coats_reason = format!("{coats} surfaces have a coat");
        let gloss =
            step("glossy surfaces", on(coats > 0), if coats > 0 { &coats_reason } else { "every surface is matte" });
        let masking = match (settings.lighting, settings.thresholds) {
            (Lighting::AllLights, _) => step("masking thresholds", State::Off, "without cuts nothing stops at them"),
            (_, Thresholds::Fixed(_)) => step("masking thresholds", State::Off, "thresholds are fixed, as asked"),
            (_, Thresholds::Codec) => {
                step("masking thresholds", State::On, "what the encoder did steers the cuts of the next frame")
            }
            _ => step("masking thresholds", State::On, "they steer the cuts of the next frame"),
        };
        step(
            "motion for the encoder",
            on(settings.motion && primary_rays != State::Off),
            if settings.motion { "vectors are known, no search" } else { "left out, as asked" },
        );
        let shares = shares(&steps, &Costs::of(scene, settings, area_lights));
        for (step, &share) in steps.iter_mut().zip(&shares).filter(|(step, _)| step.state != State::On) {
            step.saves = share;
        }
        Self {
            placing,
            photons,
            photons_apart,
            tree_update,
            primary_rays,
            moving_anchors,
            indirect,
            cache,
            compensation,
            gloss,
            masking,
            steps,
            shares,
        }
    }

    /// The estimated share of CPU time of `stage`, named as in [`Plan::steps`], of a frame in which everything runs.
    pub fn share_of(&self, stage: &str) -> Option<f64> {
        self.steps.iter().zip(&self.shares).find(|(step, _)| step.stage == stage).and_then(|(_, &share)| share)
    }

    /// The plan line by line.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The plan as a table for the terminal.
    pub fn table(&self) -> String {
        let width = self.steps.iter().map(|step| step.stage.len()).max().unwrap_or(0);
        let mut table = format!("{:width$}  state  saves  reason\n", "stage");
        for Step { stage, state, reason, saves } in &self.steps {
            let state = match state {
                State::On => "on",
                State::Once => "once",
                State::Off => "off",
            };
            let saves = match saves {
                None => String::new(),
                Some(share) if *share < 0.01 => "< 1 %".into(),
                Some(share) => format!("{:.0} %", 100.0 * share),
            };
            table.push_str(&format!("{stage:width$}  {state:5}  {saves:>5}  {reason}\n"));
        }
        table
    }
}

/// The share of each stage of a frame in which they all run; none where that cannot be said.
fn shares(steps: &[Step], costs: &Costs) -> Vec<Option<f64>> {
    let seconds: Vec<Option<f64>> = steps.iter().map(|step| costs.of_stage(step.stage)).collect();
    let whole = seconds.iter().flatten().sum::<f64>() + costs.of_the_rest();
    seconds.into_iter().map(|seconds| Some(seconds? / whole)).collect()
}

impl State {
    /// Whether the stage has work to do for frame `n`.
    pub fn runs(self, n: u32) -> bool {
        match self {
            State::On => true,
            State::Once => n == 0,
            State::Off => false,
        }
    }
}
