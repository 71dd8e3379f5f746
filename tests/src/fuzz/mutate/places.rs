//! Positions in a document, and values for them.

use crate::Random;
use serde_json::{Value, json};

/// Returns the pointer of a random walk from the root, which may end at each step.
pub(super) fn any_place(document: &Value, random: &mut Random) -> Option<String> {
    let (mut pointer, mut value) = (String::new(), document);
    loop {
        // Step to a random member or entry.
        let (step, next) = match value {
            Value::Object(map) if !map.is_empty() => {
                let (key, next) = map.iter().nth(random.below(map.len()))?;
                (key.replace('~', "~0").replace('/', "~1"), next)
            }
            Value::Array(list) if !list.is_empty() => {
                let index = random.below(list.len());
                (index.to_string(), &list[index])
            }
            _ => break,
        };
        pointer = format!("{pointer}/{step}");
        value = next;
        // End early with a probability of 1/5.
        if random.one_in(5) {
            break;
        }
    }
    (!pointer.is_empty()).then_some(pointer)
}

/// Returns the pointers of all values, also those in lists, under one of these keys.
pub(super) fn places_under(document: &Value, keys: &[&str]) -> Vec<String> {
    let (mut found, mut open) = (Vec::new(), vec![(String::new(), document, false)]);
    // Search the document depth first; entries of lists inherit the key.
    while let Some((pointer, value, wanted)) = open.pop() {
        match value {
            Value::Object(map) => open.extend(map.iter().map(|(key, value)| {
                let step = key.replace('~', "~0").replace('/', "~1");
                (format!("{pointer}/{step}"), value, keys.contains(&key.as_str()))
            })),
            Value::Array(list) => {
                let entries = list.iter().enumerate();
                open.extend(entries.map(|(index, value)| (format!("{pointer}/{index}"), value, wanted)));
            }
            _ if wanted => found.push(pointer),
            _ => {}
        }
    }
    found.sort();
    found
}

/// Removes the value at a pointer.
pub(super) fn remove(document: &mut Value, pointer: &str) -> Option<Value> {
    let (parent, key) = pointer.rsplit_once('/')?;
    match document.pointer_mut(parent)? {
        Value::Object(map) => map.remove(&key.replace("~1", "/").replace("~0", "~")),
        Value::Array(list) => key.parse().ok().filter(|&index: &usize| index < list.len()).map(|i| list.remove(i)),
        _ => None,
    }
}

/// Inserts a value into an object.
pub(super) fn put(object: &mut Value, key: &str, value: Value) -> Option<()> {
    object.as_object_mut()?.insert(key.into(), value);
    Some(())
}

/// Returns an object's member, created as an empty object if missing.
pub(super) fn member<'a>(object: &'a mut Value, key: &str) -> Option<&'a mut Value> {
    Some(object.as_object_mut()?.entry(key).or_insert_with(|| json!({})))
}

/// Returns a number at the limits of types or of scenes.
pub(super) fn extreme(random: &mut Random) -> Value {
    if random.one_in(2) {
        return json!(random.pick(&[0i64, 1, -1, 2, 3, 255, 256, 65_535, 65_536, 1 << 24, i64::MAX, i64::MIN]));
    }
    if random.one_in(3) {
        return json!(random.pick(&[i32::MAX as u64, 1 << 31, u64::from(u32::MAX), 1 << 32, 1 << 53, u64::MAX]));
    }
    let least = [-0.0, 0.5, 1e-3, 1e-7, 1e-20, 1e-38, 1e-45, 5e-324, -1e-45, 0.999_999_9, 1.000_000_1];
    let most = [10.0, 1e4, 1e7, 9.9e8, 1.1e9, 1.1e15, 1e18, 1e19, 2e19, 1e30, 3.4e38, 3.5e38, 1e300];
    match random.below(3) {
        0 => json!(random.pick(&least)),
        1 => json!(random.pick(&most)),
        _ => json!(-random.pick(&most)),
    }
}

/// Returns a float: not finite, at the limits, or an ordinary one.
pub(super) fn float(random: &mut Random) -> f32 {
    let special = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, f32::MIN_POSITIVE, 1e-45, -1e-45];
    let large = [1e7, 9.9e8, 1e9, 1e10, 1e15, 1e18, 2e19, 1e30, -1e10, -1e15, -1e19, -1e30];
    let plain = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-3, 1e-10, 1e-20, 100.0, -100.0, 1e4];
    match random.below(4) {
        0 => *random.pick(&special),
        1 => *random.pick(&large),
        2 => *random.pick(&plain),
        _ => random.below(2_000_001) as f32 / 1e6 - 1.0,
    }
}
