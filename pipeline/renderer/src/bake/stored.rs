//! Sections of baked light in its file.
//!
//! | tag | content |
//! |---|---|
//! | `TEXL` | the atlas and its irradiance |
//! | `NORM` | light of normal-mapped surfaces |
//! | `COAT` | light of coats |
//! | `KEYS` | key times, if there are several |
//! | `T001`, `N001`, `C001`, … | irradiance, light of normal-mapped surfaces and of coats at further key times |

use super::{SectionFile, fingerprint};
use crate::baked_light::BakedLight;
use crate::coat_fields::CoatFields;
use crate::normal_texels::NormalTexels;
use crate::plan::lamp_moves;
use crate::texels::BakedTexels;
use pipeline::error::{Context, Error, Result};
use pipeline::state::{decode, encode};
use render_core::scene::Scene;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

const TEXELS: [u8; 4] = *b"TEXL";
const NORMALS: [u8; 4] = *b"NORM";
const COATS: [u8; 4] = *b"COAT";
const KEYS: [u8; 4] = *b"KEYS";
/// Maximum number of key times: tags have three digits.
const MOST_KEYS: usize = 1000;

/// Irradiance of the texels at a further key time.
#[derive(Serialize, Deserialize)]
struct StoredKey {
    direct: Vec<[f32; 3]>,
    indirect: Vec<[f32; 3]>,
    is_reliable: Vec<bool>,
}

/// Returns the tag of a section of key time `key`.
fn tag_of(kind: u8, key: usize) -> [u8; 4] {
    let digit = |unit: usize| b'0' + (key / unit % 10) as u8;
    [kind, digit(100), digit(10), digit(1)]
}

/// Writes the light of `scene` to a file and returns its length in bytes.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(scene: &Scene, path: &Path, light: &BakedLight) -> Result<u64> {
    let first = &light.keys()[0];
    let mut sections = vec![(TEXELS, encode(&**first)), (NORMALS, first.normals.to_bytes())];
    sections.push((COATS, first.coats.to_bytes()));
    // Store the atlas only once.
    if !light.is_constant() {
        sections.push((KEYS, encode(&light.times().to_vec())));
    }
    for (key, texels) in light.keys().iter().enumerate().skip(1) {
        let BakedTexels { direct, indirect, is_reliable, normals, coats, .. } = (**texels).clone();
        sections.push((tag_of(b'T', key), encode(&StoredKey { direct, indirect, is_reliable })));
        sections.push((tag_of(b'N', key), normals.to_bytes()));
        sections.push((tag_of(b'C', key), coats.to_bytes()));
    }
    SectionFile { fingerprint: fingerprint(scene), sections }.write(path)
}

/// Reads baked light of `scene`.
///
/// # Errors
/// If the file cannot be read, is damaged, or has another version or scene. If a lamp moves, and the file has only one
/// key time.
pub fn read(scene: &Scene, path: &Path) -> Result<BakedLight> {
    // Reject damaged files and files of other scenes before decoding any section.
    let file = SectionFile::read(path)?;
    file.check_scene(path, fingerprint(scene))?;
    let remedy = || format!("{}: bake it again", path.display());
    let invalid = |text: String| Error::content(path, format!(": {text}: bake it again"));
    let times: Vec<f32> = match file.optional(KEYS) {
        Some(bytes) => decode(bytes).context(remedy())?,
        None => vec![0.0],
    };
    if lamp_moves(scene) && times.len() < 2 {
        let text = format!("--lighting baked: a lamp moves in this scene; bake {} with --keys 9", path.display());
        return Err(Error::Options(text));
    }
    if times.is_empty() || times.len() > MOST_KEYS {
        return Err(invalid(format!("it has {} key times", times.len())));
    }

    // Read the first key, and the further keys on the same atlas.
    let first: BakedTexels = decode(file.section(path, TEXELS)?).context(remedy())?;
    if !first.atlas.validate(scene) || first.facing.len() != first.atlas.len() {
        return Err(invalid("its texels are invalid".into()));
    }
    let mut keys = Vec::new();
    for key in 0..times.len() {
        let [normals, coats] = if key == 0 { [NORMALS, COATS] } else { [b'N', b'C'].map(|kind| tag_of(kind, key)) };
        let mut texels = first.clone();
        if key > 0 {
            let stored: StoredKey = decode(file.section(path, tag_of(b'T', key))?).context(remedy())?;
            (texels.direct, texels.indirect) = (stored.direct, stored.indirect);
            texels.is_reliable = stored.is_reliable;
        }
        // Check indices and lengths: a forged file may contain any value.
        let count = texels.atlas.len();
        if [texels.direct.len(), texels.indirect.len(), texels.is_reliable.len()] != [count; 3] {
            return Err(invalid("its texels are invalid".into()));
        }
        let normals = NormalTexels::from_bytes(file.section(path, normals)?, count).map_err(invalid)?;
        let coats = CoatFields::from_bytes(&texels.atlas, file.section(path, coats)?).map_err(invalid)?;
        (texels.normals, texels.coats) = (Arc::new(normals), Arc::new(coats));
        keys.push(Arc::new(texels));
    }
    BakedLight::new(times, keys).ok_or_else(|| invalid("its key times are invalid".into()))
}
