//! The table: each stage, and when it is in which state, and why.

use super::facts::Facts;
use super::stage::{Stage, State};
use crate::settings::{Lighting, PixelShading, Thresholds};

/// One possible decision about a stage.
struct Rule {
    when: When,
    state: State,
    /// After the number, where one is counted.
    reason: &'static str,
}

/// The condition of a rule.
enum When {
    /// If this holds.
    Holds(fn(&Facts<'_>) -> bool),
    /// If there is at least one; the reason begins with the number.
    Any(fn(&Facts<'_>) -> usize),
    /// In all other cases.
    Otherwise,
}

const fn on(condition: fn(&Facts<'_>) -> bool, reason: &'static str) -> Rule {
    Rule { when: When::Holds(condition), state: State::On, reason }
}

const fn off(condition: fn(&Facts<'_>) -> bool, reason: &'static str) -> Rule {
    Rule { when: When::Holds(condition), state: State::Off, reason }
}

const fn any(count: fn(&Facts<'_>) -> usize, reason: &'static str) -> Rule {
    Rule { when: When::Any(count), state: State::On, reason }
}

const fn otherwise(state: State, reason: &'static str) -> Rule {
    Rule { when: When::Otherwise, state, reason }
}

const NO_REFLECTION: &str = "no surface reflects light";
const NO_INDIRECT: &str = "there is no indirect light";
const ONE_REFLECTION: &str = "light is reflected once, as requested";
const LEFT_OUT: &str = "left out, as requested";
const BAKED: &str = "all indirect light is baked";

/// The rules of each stage, in the order of [`Stage::ALL`]. The first rule that applies decides.
const TABLE: [(Stage, &[Rule]); Stage::ALL.len()] = [
    (
        Stage::ObjectPlacing,
        &[on(|f| f.object_moves, "something moves"), otherwise(State::Once, "nothing but the camera moves")],
    ),
    (
        Stage::Photons,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            off(|f| f.reflects_once(), ONE_REFLECTION),
            off(|f| f.looks_all_up(), BAKED),
            on(|f| f.light_changes(), "what moves changes the way of the light"),
            otherwise(State::Once, "nothing that light meets ever moves"),
        ],
    ),
    (
        Stage::TreeUpdate,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            off(|f| f.looks_all_up(), BAKED),
            on(|f| f.light_changes(), "the energies change"),
            otherwise(State::Once, "the energies stay"),
        ],
    ),
    (
        Stage::KeptPhotons,
        &[
            off(|f| f.reflects_once() || f.looks_all_up(), "there are no photons"),
            on(
                |f| f.reflects && f.light_changes() && f.keeps_photons(),
                "their ways are traced once up to where something that moves can meet them",
            ),
            off(
                |f| f.reflects && (f.light_changes() || !f.settings.leave_out),
                "every photon is traced for every frame",
            ),
            otherwise(State::Off, "no photon has to be traced again"),
        ],
    ),
    (
        Stage::DynamicAnchors,
        &[
            off(|f| f.reflects_once(), ONE_REFLECTION),
            on(|f| f.reflects && f.object_moves, "something moves and reflects"),
            otherwise(State::Off, "no moving object"),
        ],
    ),
    (
        Stage::PrimaryRays,
        &[
            on(|f| f.camera_moves, "the camera moves"),
            on(|f| f.object_moves, "objects move"),
            otherwise(State::Once, "nothing moves in the picture"),
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
        Stage::Deformation,
        &[any(|f| f.deforming, "surfaces change their shape"), otherwise(State::Off, "nothing changes its shape")],
    ),
    (
        Stage::Indirect,
        &[
            off(|f| !f.reflects, NO_REFLECTION),
            on(|f| f.looks_up(), "surfaces at rest look it up"),
            on(|f| !f.cuts(), "every light at each pixel, as requested"),
            on(|f| f.settings.cache, "a lightcut for each record"),
            otherwise(State::On, "a lightcut for each pixel"),
        ],
    ),
    (
        Stage::BakedLight,
        &[
            off(|f| !f.reflects, NO_INDIRECT),
            off(|f| f.lamp_moves, "cannot be baked: a lamp moves"),
            off(|f| !f.stands, "cannot be baked: nothing stands still"),
            on(|f| f.looks_all_up(), "every surface looks its light up, as requested"),
            on(|f| f.looks_up(), "what stands still looks its light up, as requested"),
            off(|f| f.object_moves, "not requested; the light of all that stands still can be baked"),
            otherwise(State::Off, "not requested; the light of this scene can be baked"),
        ],
    ),
    (
        Stage::Cache,
        &[
            off(|f| !f.reflects, NO_INDIRECT),
            off(|f| f.looks_up() && !f.object_moves, BAKED),
            on(|f| f.looks_up() && f.settings.cache, "what moves is not baked"),
            off(|f| !f.cuts(), "the reference has none"),
            on(|f| f.settings.cache, "indirect light varies slowly"),
            otherwise(State::Off, LEFT_OUT),
        ],
    ),
    (
        Stage::CarriedLight,
        &[
            off(|f| f.settings.shading == PixelShading::Full, "every pixel of a frame is lit, as requested"),
            off(|f| !f.reflects, NO_REFLECTION),
            off(|f| !f.looks_up() && (!f.cuts() || !f.settings.cache), "every pixel has its own cut"),
            off(|f| f.has_samples_everywhere(), "every pixel has several samples"),
            off(|f| f.settings.tiles.is_some(), "ranks light whole tiles, as requested"),
            off(|f| !f.picture_changes() || f.settings.frames == 1, "no frame differs from the one before"),
            on(|f| !f.light_changes(), "light stays where it is while the camera moves"),
            otherwise(State::On, "direct light stays where nothing moves between it and a lamp"),
        ],
    ),
    (
        Stage::Compensation,
        &[
            off(|f| !f.reflects, NO_INDIRECT),
            off(|f| f.looks_up() && !f.object_moves, BAKED),
            on(|f| f.settings.compensation, "corners would be dark without the light of close lights"),
            otherwise(State::Off, LEFT_OUT),
        ],
    ),
    (
        Stage::Gloss,
        &[
            on(|f| f.looks_up() && f.coats > 0 && f.live_coats == 0, "every coat looks its light up, as requested"),
            on(
                |f| f.looks_up() && f.live_coats > 0,
                "coats that move or may be smoother than 0.35 are live, others look their light up",
            ),
            any(|f| f.coats, "surfaces have a coat"),
            otherwise(State::Off, "every surface is matte"),
        ],
    ),
    (
        Stage::Importance,
        &[
            on(|f| f.settings.importance.is_some(), "samples, thresholds and bits go where people look, as requested"),
            otherwise(State::Off, "not requested"),
        ],
    ),
    (
        Stage::Masking,
        &[
            off(|f| !f.cuts() || f.looks_up() && !f.object_moves, "without cuts nothing stops at them"),
            off(|f| matches!(f.settings.thresholds, Thresholds::Fixed(_)), "thresholds are fixed, as requested"),
            on(
                |f| matches!(f.settings.thresholds, Thresholds::Codec),
                "what the encoder did steers the cuts of the next frame",
            ),
            otherwise(State::On, "they steer the cuts of the next frame"),
        ],
    ),
];

/// A state, and why.
pub(super) struct Decision {
    pub stage: Stage,
    pub state: State,
    pub reason: String,
}

/// One decision for each stage, in the order of [`Stage::ALL`].
pub(super) fn decisions(facts: &Facts<'_>) -> Vec<Decision> {
    let decide = |(stage, rules): &(Stage, &[Rule])| {
        let (state, reason) = rules.iter().find_map(|rule| rule.applied(facts)).expect("the last rule always applies");
        // Leaving out can be switched off: then nothing is kept from the first frame.
        if state == State::Once && !facts.settings.leave_out {
            return Decision {
                stage: *stage,
                state: State::On,
                reason: format!("{reason}; run all the same, as requested"),
            };
        }
        Decision { stage: *stage, state, reason }
    };
    TABLE.iter().map(decide).collect()
}

impl Rule {
    /// State and reason, if the rule applies.
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
    /// Whether light takes other paths from frame to frame.
    fn light_changes(&self) -> bool {
        self.object_moves || self.light_moves
    }

    /// Whether the picture differs from frame to frame.
    fn picture_changes(&self) -> bool {
        self.camera_moves || self.light_changes()
    }

    /// Whether paths of photons may be kept from the first frame for later ones.
    fn keeps_photons(&self) -> bool {
        self.settings.leave_out && self.settings.frames > 1
    }

    /// Whether every pixel has several samples, none of which is shared with the frame before.
    fn has_samples_everywhere(&self) -> bool {
        self.settings.samples > 1 && self.settings.importance.is_none()
    }

    /// Whether light reaches the viewer by its first reflection alone.
    fn reflects_once(&self) -> bool {
        self.settings.bounces == Some(1)
    }

    /// Whether indirect light is found by cuts, where it is not looked up.
    fn cuts(&self) -> bool {
        self.settings.lighting != Lighting::AllLights
    }

    /// Whether surfaces at rest look their indirect light up. Films whose lamps move are refused.
    fn looks_up(&self) -> bool {
        self.settings.lighting.is_baked() && !self.lamp_moves
    }

    /// Whether nothing needs the light of virtual lights: no surface moves, and none reflects a picture of others that is not baked.
    fn looks_all_up(&self) -> bool {
        self.looks_up() && !self.object_moves && self.live_coats == 0
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
