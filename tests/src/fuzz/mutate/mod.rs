//! Changes of a scene, each of one aspect that a loader reads.

mod accessors;
mod animations;
mod hierarchy;
mod looks;
mod names;
mod numbers;
mod packed;
mod places;
mod settings;
mod structure;

use super::Draft;
use crate::Random;

/// Named change, which returns `None` if it does not apply.
type Mutation = (&'static str, fn(&mut Draft, &mut Random) -> Option<()>);

/// All changes by subject; subjects are drawn evenly. Subjects that mostly load are listed twice.
const SUBJECTS: [&[Mutation]; 13] = [
    &structure::MUTATIONS,
    &hierarchy::MUTATIONS,
    &accessors::MUTATIONS,
    &numbers::MUTATIONS,
    &animations::MUTATIONS,
    &looks::MUTATIONS,
    &names::MUTATIONS,
    &settings::MUTATIONS,
    &hierarchy::TRANSFORMS,
    &hierarchy::TRANSFORMS,
    &animations::MUTATIONS,
    &looks::MUTATIONS,
    &packed::MUTATIONS,
];

/// Applies one to six changes to the scene, and returns their names.
pub fn mutate(draft: &mut Draft, random: &mut Random) -> Vec<&'static str> {
    let mut names = Vec::new();
    // Prefer few changes, because one of many often leads to a refusal.
    let most = [1, 1, 2, 2, 3, 6][random.below(6)];
    // A change that does not apply is not counted. The bound ends the loop for empty scenes.
    for _ in 0..50 {
        let subject = *random.pick(&SUBJECTS);
        let &(name, change) = random.pick(subject);
        if change(draft, random).is_some() {
            names.push(name);
        }
        if names.len() == most {
            break;
        }
    }
    names
}
