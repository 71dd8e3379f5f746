//! Changes of a scene, each in one way that matters to who reads it.

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

/// A change, by name. One that finds nothing to change does nothing.
type Mutation = (&'static str, fn(&mut Draft, &mut Random) -> Option<()>);

/// All changes, by subject: subjects are drawn evenly. What mostly loads stands here twice.
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

/// Changes the scene one to six times; the names of the changes.
pub fn mutate(draft: &mut Draft, random: &mut Random) -> Vec<&'static str> {
    let mut names = Vec::new();
    // Few changes mostly: many are refused for the first of them.
    let most = [1, 1, 2, 2, 3, 6][random.below(6)];
    // A change that does not apply is none. The bound is for scenes in which nothing is left.
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
