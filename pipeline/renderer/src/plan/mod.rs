//! The plan of a film: stages that run, stages that are skipped, and the reasons. It is made before the first frame.
//!
//! Skipping a stage never changes a bit of the output: the skipped work would only repeat an earlier result.

mod estimate;
mod facts;
mod rules;
mod stage;

pub use facts::Fact;
pub(crate) use facts::lamp_moves;
#[cfg(feature = "bake")]
pub(crate) use facts::moving_lamps;
pub use stage::{Stage, State};

use crate::settings::RenderSettings;
use estimate::Costs;
use facts::Facts;
use render_core::scene::Scene;
use rules::{Decision, decisions};
use serde::Serialize;

/// A line of the plan.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Step {
    /// Stage that this line describes.
    #[schemars(with = "String")]
    pub stage: Stage,
    /// How often the stage runs.
    pub state: State,
    /// Reason why the stage runs or is skipped.
    pub reason: String,
    /// Estimated fraction of a frame's CPU time saved by skipping the stage, in frames after the first: the amount of work
    /// times its measured unit price. `None` if the stage runs or has no estimate.
    pub saves: Option<f64>,
}

/// Stages with their states and estimated costs, for one scene and its settings.
#[derive(Clone, Debug)]
pub struct Plan {
    /// One line per stage, in the order of [`Stage::ALL`].
    steps: Vec<Step>,
    /// Fraction of a frame's CPU time for each stage; see [`Plan::share_of`].
    shares: Vec<Option<f64>>,
    /// Estimated CPU time of a frame in which every stage runs \[s\].
    whole: f64,
    facts: Vec<Fact>,
}

impl Plan {
    /// Plans `scene` with `settings`.
    #[must_use]
    pub fn new(scene: &Scene, settings: &RenderSettings) -> Self {
        Self::of_facts(scene, settings, Facts::new(scene, settings))
    }

    /// Plans `scene` with `settings` for a camera that may move at any time, even if the scene's camera is static.
    #[must_use]
    pub fn with_free_camera(scene: &Scene, settings: &RenderSettings) -> Self {
        Self::of_facts(scene, settings, Facts { camera_moves: true, ..Facts::new(scene, settings) })
    }

    fn of_facts(scene: &Scene, settings: &RenderSettings, facts: Facts) -> Self {
        let costs = Costs::of(scene, settings, facts.area_lights);
        let (shares, whole) = shares(&costs);

        // Express the cost of direct light as a fraction of the frame, like the costs of stages.
        let share = |seconds: Option<f64>| seconds.map(|seconds| seconds / whole);
        let list = facts.list(share(costs.of_area_lights()), share(costs.of_punctual_lights()));

        // Report savings only for stages that do not run in every frame.
        let mut steps = Vec::new();
        for (decision, &share) in decisions(&facts).into_iter().zip(&shares) {
            let Decision { stage, state, reason } = decision;
            let saves = if state == State::On { None } else { share };
            steps.push(Step { stage, state, reason, saves });
        }
        Self { steps, shares, whole, facts: list }
    }

    /// Returns how often `stage` runs.
    #[must_use]
    pub fn state(&self, stage: Stage) -> State {
        self.steps[stage as usize].state
    }

    /// Returns whether `stage` runs for every frame.
    #[must_use]
    pub fn is_on(&self, stage: Stage) -> bool {
        self.state(stage) == State::On
    }

    /// Returns whether `stage` never runs.
    #[must_use]
    pub fn is_off(&self, stage: Stage) -> bool {
        self.state(stage) == State::Off
    }

    /// Returns whether `stage` runs for frame `n`.
    #[must_use]
    pub fn runs(&self, stage: Stage, n: u32) -> bool {
        self.state(stage).runs(n)
    }

    /// Returns the plan with `state` as the state of `stage`.
    #[cfg(test)]
    pub(crate) fn with(mut self, stage: Stage, state: State) -> Self {
        self.steps[stage as usize].state = state;
        self
    }

    /// Returns the estimated fraction of CPU time for `stage`, in a frame in which every stage runs.
    #[must_use]
    pub fn share_of(&self, stage: Stage) -> Option<f64> {
        self.shares[stage as usize]
    }

    /// Returns the estimated CPU time of a frame after the first \[s\], at the prices of the reference processor. In
    /// the tested scenes, measured times are 0.5 to 2 times the estimate.
    #[must_use]
    pub fn seconds_a_frame(&self) -> f64 {
        let saved: f64 = self.steps.iter().filter_map(|step| step.saves).sum();
        self.whole * (1.0 - saved).max(0.0)
    }

    /// Returns the lines of the plan, one per stage.
    #[must_use]
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Returns the facts about the scene on which no stage depends.
    #[must_use]
    pub fn facts(&self) -> &[Fact] {
        &self.facts
    }

    /// Returns the plan as a table for the terminal: stages, then facts.
    #[must_use]
    pub fn table(&self) -> String {
        // Make the first column as wide as the longest name of a stage or fact.
        let mut width = 0;
        for step in &self.steps {
            width = width.max(step.stage.name().len());
        }
        for fact in &self.facts {
            width = width.max(fact.subject.len());
        }

        // List the costs of stages that run in every frame, and the savings of all others.
        let mut table = format!("{:width$}  state  costs  saves  reason\n", "stage");
        let percent = |share: Option<f64>| match share {
            None => String::new(),
            Some(share) if share < 0.01 => "< 1 %".into(),
            Some(share) => format!("{:.0} %", 100.0 * share),
        };
        for Step { stage, state, reason, saves } in &self.steps {
            let costs = if *state == State::On { percent(self.share_of(*stage)) } else { String::new() };
            let (stage, state, saves) = (stage.name(), state.name(), percent(*saves));
            table.push_str(&format!("{stage:width$}  {state:5}  {costs:>5}  {saves:>5}  {reason}\n"));
        }

        // List the facts below the stages, in the same columns.
        table.push_str(&format!("\n{:width$}         costs\n", "scene"));
        for Fact { subject, text, share } in &self.facts {
            let costs = percent(*share);
            table.push_str(&format!("{subject:width$}         {costs:>5}         {text}\n"));
        }
        table
    }
}

/// Returns the fraction of CPU time for each stage in a frame in which all stages run, `None` without an estimate. Also
/// returns the CPU time of that frame \[s\].
fn shares(costs: &Costs) -> (Vec<Option<f64>>, f64) {
    let seconds = Stage::ALL.map(|stage| costs.of_stage(stage));
    let whole = seconds.iter().flatten().sum::<f64>() + costs.of_the_rest();
    (seconds.into_iter().map(|seconds| Some(seconds? / whole)).collect(), whole)
}
