//! Decision table with the state of each stage and the reason for it.

use super::facts::Facts;
use super::stage::{Stage, State};
use crate::settings::{Lighting, PixelShading, SampleCount, Thresholds};

/// A possible decision about a stage, with its condition.
struct Rule {
    when: When,
    state: State,
    /// Reason for the state; with [`When::Any`], the count precedes it.
    reason: &'static str,
}

/// Condition of a rule.
enum When {
    /// The predicate is true.
    Holds(fn(&Facts<'_>) -> bool),
    /// The count is positive; the reason then begins with the count.
    Any(fn(&Facts<'_>) -> usize),
    /// No earlier rule of the stage applies.
    Otherwise,
}

const fn on(condition: fn(&Facts<'_>) -> bool, reason: &'static str) -> Rule {
    Rule { when: When::Holds(condition), state: State::On, reason }
}

const fn off(condition: fn(&Facts<'_>) -> bool, reason: &'static str) -> Rule {
    Rule { when: When::Holds(condition), state: State::Off, reason }
}

const fn once(condition: fn(&Facts<'_>) -> bool, reason: &'static str) -> Rule {
    Rule { when: When::Holds(condition), state: State::Once, reason }
}

const fn any(count: fn(&Facts<'_>) -> usize, reason: &'static str) -> Rule {
    Rule { when: When::Any(count), state: State::On, reason }
}

const fn otherwise(state: State, reason: &'static str) -> Rule {
    Rule { when: When::Otherwise, state, reason }
}

const NO_REFLECTION: &str = "no surface reflects light";
const NO_INDIRECT: &str = "the scene has no indirect light";
const ONE_REFLECTION: &str = "light is reflected once, as requested";
const LEFT_OUT: &str = "disabled, as requested";
const BAKED: &str = "all indirect light is baked";

/// Rules of each stage, in the order of [`Stage::ALL`]. The first rule that applies decides.
const TABLE: [(Stage, &[Rule]); Stage::ALL.len()] = [
    (
        Stage::Anchors,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            off(|f| f.reflects_once(), ONE_REFLECTION),
            off(|f| f.looks_up(), BAKED),
            otherwise(State::Once, "anchors keep their positions in all frames"),
        ],
    ),
    (Stage::ObjectPlacing, &[on(|f| f.object_moves, "objects move"), otherwise(State::Once, "no object moves")]),
    (
        Stage::Photons,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            off(|f| f.reflects_once(), ONE_REFLECTION),
            off(|f| f.looks_up(), BAKED),
            on(|f| f.light_changes(), "moving objects or lights change light paths"),
            otherwise(State::Once, "all light paths are static"),
        ],
    ),
    (
        Stage::TreeUpdate,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            on(|f| f.looks_up() && f.lamp_moves, "lamps move; only light of several reflections is baked"),
            once(|f| f.looks_up(), "only the sky and area lights are in the tree; other light is baked"),
            on(|f| f.light_changes(), "the flux of the lights changes"),
            otherwise(State::Once, "the flux of the lights is constant"),
        ],
    ),
    // Keep photon paths only if light changes: otherwise photons are traced only once anyway.
    (
        Stage::KeptPhotons,
        &[
            off(|f| f.reflects_once() || f.looks_up(), "no photons are traced"),
            on(
                |f| f.reflects && f.light_changes() && f.keeps_photons(),
                "paths are traced once, up to the space that moving objects sweep",
            ),
            off(
                |f| f.reflects && (f.light_changes() || !f.settings.leave_out),
                "every photon is traced for every frame",
            ),
            otherwise(State::Off, "no photon path changes"),
        ],
    ),
    (
        Stage::DynamicAnchors,
        &[
            off(|f| f.reflects_once(), ONE_REFLECTION),
            off(|f| f.looks_up(), BAKED),
            on(|f| f.reflects && f.object_moves, "moving objects may reflect light"),
            otherwise(State::Off, "no moving object reflects light"),
        ],
    ),
    (
        Stage::PrimaryRays,
        &[
            on(|f| f.camera_moves, "the camera moves"),
            on(|f| f.object_moves, "objects move"),
            otherwise(State::Once, "neither camera nor objects move"),
        ],
    ),
    (
        Stage::Antialiasing,
        &[
            off(|f| f.has_samples_everywhere(), "every pixel has several samples"),
            off(|f| !f.settings.antialiasing, LEFT_OUT),
            otherwise(State::On, "outlines cross pixels"),
        ],
    ),
    (
        Stage::FineSamples,
        &[
            off(|f| f.has_samples_everywhere(), "every pixel has several samples"),
            on(|f| f.settings.samples == SampleCount::Auto, "light may change within a pixel"),
            otherwise(State::Off, LEFT_OUT),
        ],
    ),
    (Stage::Deformation, &[any(|f| f.deforming, "deforming surfaces"), otherwise(State::Off, "no surface deforms")]),
    (
        Stage::Indirect,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            on(|f| f.looks_up(), "static surfaces sample baked light"),
            on(|f| !f.cuts(), "all lights at every pixel, as requested"),
            on(|f| f.settings.cache, "a lightcut for each record"),
            otherwise(State::On, "a lightcut for each pixel"),
        ],
    ),
    // Explain why light cannot be baked, even if baking was not requested.
    (
        Stage::BakedLight,
        &[
            off(|f| !f.reflects, NO_INDIRECT),
            off(|f| !f.stands, "cannot be baked: every surface moves"),
            on(|f| f.looks_up() && !f.object_moves, "all surfaces sample baked light, as requested"),
            on(|f| f.looks_up(), "static surfaces sample baked light, as requested"),
            off(|f| f.lamp_moves, "not requested; a lamp moves, so the light can be baked at key times"),
            off(|f| f.object_moves, "not requested; the light of static surfaces can be baked"),
            otherwise(State::Off, "not requested; all light of this scene can be baked"),
        ],
    ),
    (
        Stage::Cache,
        &[
            off(|f| !f.reflects, NO_INDIRECT),
            on(|f| f.looks_up() && f.object_moves, "moving surfaces gather light from the texels"),
            on(|f| f.looks_up(), "surfaces without valid texels gather light from the others"),
            off(|f| !f.cuts(), "the reference does not use a cache"),
            on(|f| f.settings.cache, "indirect light varies slowly"),
            otherwise(State::Off, LEFT_OUT),
        ],
    ),
    (
        Stage::ReprojectedLight,
        &[
            off(|f| f.settings.shading == PixelShading::Full, "every pixel is shaded, as requested"),
            off(|f| !f.reflects, NO_REFLECTION),
            off(|f| !f.looks_up() && (!f.cuts() || !f.settings.cache), "every pixel has its own lightcut"),
            off(|f| f.has_samples_everywhere(), "every pixel has several samples"),
            off(|f| f.settings.tiles.is_some(), "ranks shade whole tiles, as requested"),
            off(|f| !f.picture_changes() || f.settings.frames == 1, "all frames are equal"),
            on(|f| !f.light_changes(), "only the camera moves"),
            otherwise(State::On, "direct light is kept where nothing moves between surface and lamp"),
        ],
    ),
    (
        Stage::Compensation,
        &[
            off(|f| !f.reflects, NO_INDIRECT),
            off(|f| f.looks_up(), BAKED),
            on(|f| f.settings.compensation, "clamped nearby virtual lights would darken corners"),
            otherwise(State::Off, LEFT_OUT),
        ],
    ),
    // Distinguish baked coats from coats that are evaluated in every frame.
    (
        Stage::Gloss,
        &[
            on(|f| f.looks_up() && f.coats > 0 && f.live_coats == 0, "all coats sample baked light, as requested"),
            on(
                |f| f.looks_up() && f.live_coats > 0,
                "coats that move or may be smoother than 0.35 are live, others sample baked light",
            ),
            any(|f| f.coats, "surfaces have a coat"),
            otherwise(State::Off, "every surface is matte"),
        ],
    ),
    (
        Stage::Importance,
        &[
            on(|f| f.settings.importance.is_some(), "samples, thresholds and bits follow importance, as requested"),
            otherwise(State::Off, "not requested"),
        ],
    ),
    (
        Stage::Masking,
        &[
            off(|f| !f.cuts() || f.looks_up() && !f.object_moves, "no lightcuts use them"),
            off(|f| matches!(f.settings.thresholds, Thresholds::Fixed(_)), "thresholds are fixed, as requested"),
            on(
                |f| matches!(f.settings.thresholds, Thresholds::Codec),
                "coding errors steer the lightcuts of the next frame",
            ),
            otherwise(State::On, "they steer the lightcuts of the next frame"),
        ],
    ),
];

/// State of a stage, and the reason for it.
pub(super) struct Decision {
    pub stage: Stage,
    pub state: State,
    pub reason: String,
}

/// Returns one decision per stage, in the order of [`Stage::ALL`].
pub(super) fn decisions(facts: &Facts<'_>) -> Vec<Decision> {
    let decide = |(stage, rules): &(Stage, &[Rule])| {
        let (state, reason) = rules.iter().find_map(|rule| rule.applied(facts)).expect("the last rule always applies");
        // Let the stage run for every frame if skipping is disabled: no result of the first frame is kept.
        if state == State::Once && *stage != Stage::Anchors && !facts.settings.leave_out {
            return Decision {
                stage: *stage,
                state: State::On,
                reason: format!("{reason}; runs anyway, as requested"),
            };
        }
        Decision { stage: *stage, state, reason }
    };
    TABLE.iter().map(decide).collect()
}

impl Rule {
    /// Returns the state and the reason of the rule if it applies.
    fn applied(&self, facts: &Facts<'_>) -> Option<(State, String)> {
        let reason = match self.when {
            When::Holds(condition) => condition(facts).then(|| self.reason.to_owned())?,
            When::Any(count) => {
                let count = count(facts);
                (count > 0).then(|| format!("{count} {}", self.reason))?
            }
            When::Otherwise => self.reason.to_owned(),
        };
        Some((self.state, reason))
    }
}

impl Facts<'_> {
    /// Returns whether light paths change between frames.
    fn light_changes(&self) -> bool {
        self.object_moves || self.light_moves
    }

    /// Returns whether frames can differ from each other.
    fn picture_changes(&self) -> bool {
        self.camera_moves || self.light_changes()
    }

    /// Returns whether photon paths of the first frame may be kept for later frames.
    fn keeps_photons(&self) -> bool {
        self.settings.leave_out && self.settings.frames > 1
    }

    /// Returns whether every pixel has several samples. Frames do not share those samples.
    fn has_samples_everywhere(&self) -> bool {
        self.settings.samples.most() > 1 && self.settings.importance.is_none()
    }

    /// Returns whether light is reflected at most once on its way to the viewer.
    fn reflects_once(&self) -> bool {
        self.settings.bounces == Some(1)
    }

    /// Returns whether indirect light that is not baked is computed by lightcuts.
    fn cuts(&self) -> bool {
        self.settings.lighting != Lighting::AllLights
    }

    /// Returns whether static surfaces sample baked indirect light. Light of moving lamps has key times.
    fn looks_up(&self) -> bool {
        self.settings.lighting.is_baked()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stage_has_a_row_that_ends_in_a_rule_for_all_other_cases() {
        for ((stage, rules), expected) in TABLE.iter().zip(Stage::ALL) {
            assert_eq!(*stage, expected);
            let [before @ .., last] = rules else { panic!("{stage:?} has no rule") };
            assert!(matches!(last.when, When::Otherwise), "{stage:?}");
            assert!(!before.iter().any(|rule| matches!(rule.when, When::Otherwise)), "{stage:?}");
        }
    }
}
