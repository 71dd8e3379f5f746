//! Changes of the binary chunk: numbers of accessors, and bytes.

use super::places::float;
use super::{Draft, Mutation};
use crate::Random;

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 5] =
    [("numbers", numbers), ("numbers", numbers), ("all numbers", all_numbers), ("bytes", bytes), ("cut", cut)];

/// Changes a few numbers of one accessor.
fn numbers(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let accessor = random.below(draft.count("accessors").max(1));
    let span = draft.span(accessor).filter(|span| span.count > 0)?;
    for _ in 0..=random.below(3) {
        let (element, component) = (random.below(span.count), random.below(span.components));
        let integer = random.pick(&[0u32, 1, 2, 3, 127, 128, 255, 65_535, 1 << 31, u32::MAX]).to_le_bytes();
        let float = float(random).to_le_bytes();
        let place = draft.component(&span, element, component)?;
        let size = place.len();
        let bytes = if span.component_type == 5126 { float } else { integer };
        place.copy_from_slice(&bytes[..size]);
    }
    Some(())
}

/// Sets or multiplies one component of every element.
fn all_numbers(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let accessor = random.below(draft.count("accessors").max(1));
    let span = draft.span(accessor).filter(|span| span.component_type == 5126)?;
    let (component, value, multiplies) = (random.below(span.components), float(random), random.one_in(2));
    for element in 0..span.count.min(100_000) {
        let place: &mut [u8; 4] = draft.component(&span, element, component)?.try_into().ok()?;
        let number = if multiplies { f32::from_le_bytes(*place) * value } else { value };
        *place = number.to_le_bytes();
    }
    Some(())
}

/// Changes bytes anywhere: indices, images, keys.
fn bytes(draft: &mut Draft, random: &mut Random) -> Option<()> {
    if draft.bin.is_empty() {
        return None;
    }
    for _ in 0..=random.below(8) {
        let place = random.below(draft.bin.len());
        draft.bin[place] = random.below(256) as u8;
    }
    Some(())
}

/// Truncates the binary chunk without a change of the document.
fn cut(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let length = random.below(draft.bin.len().max(1));
    draft.bin.truncate(length);
    Some(())
}
