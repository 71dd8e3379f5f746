//! Mattes of all objects or materials: Cryptomatte (Friedman, Jones, *Cryptomatte Specification* 1.2, Psyop).
//!
//! A pixel contains pairs of an id (the hash of a name) and the area fraction of objects with this name, largest first.
//! Two pairs form a layer of four channels: `CryptoObject00.R` is an id, `.G` its fraction, and `.B` and `.A` are the
//! next pair. A manifest in the header lists the name of each id. Objects with the same name share their id, so
//! programs select them together.

use plane::{FrameChannel, HeaderText, SampleDepth};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Number of pairs per pixel. As the specification prescribes, a seventh object in a pixel is dropped.
const RANKS: usize = 6;

/// Id, and the fraction of a pixel's area that objects with this id cover.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RankedId {
    /// Id from [`cryptomatte_id`]; 0 in unused pairs.
    pub id: f32,
    /// Covered fraction of the pixel's area, 0…1.
    pub share: f32,
}

/// Mattes of all objects, or of all materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cryptomatte {
    /// Prefix of the layers, for example `CryptoObject`.
    kind: String,
    /// Id of each object.
    ids: Vec<f32>,
    /// Id of each name.
    manifest: BTreeMap<String, f32>,
}

impl Cryptomatte {
    /// Builds mattes of objects called `names`, one name each. Objects with equal names form one matte. `kind` is the
    /// prefix of the layers, for example `CryptoObject`.
    #[must_use]
    pub fn new(kind: &str, names: &[String]) -> Self {
        let ids = names.iter().map(|name| cryptomatte_id(name)).collect();
        let manifest = names.iter().map(|name| (name.clone(), cryptomatte_id(name))).collect();
        Self { kind: kind.to_owned(), ids, manifest }
    }

    /// Returns texts for the header: layer name, hash, the hash's conversion to a float, and the manifest. The manifest
    /// is an ASCII JSON object that maps names to ids in hexadecimal digits.
    #[must_use]
    pub fn texts(&self) -> Vec<HeaderText> {
        // The key is the first seven hexadecimal digits of the hash of `kind`.
        let key = cryptomatte_id(&self.kind).to_bits() >> 4;
        // Write the manifest as a JSON object.
        let mut manifest = String::from("{");
        for (name, id) in &self.manifest {
            let comma = if manifest.len() > 1 { "," } else { "" };
            let _ = write!(manifest, "{comma}\"{}\":\"{:08x}\"", escaped(name), id.to_bits());
        }
        manifest.push('}');
        let text = |name: &str, text: &str| HeaderText {
            name: format!("cryptomatte/{key:07x}/{name}"),
            text: text.to_owned(),
        };
        vec![
            text("name", &self.kind),
            text("hash", "MurmurHash3_32"),
            text("conversion", "uint32_to_float32"),
            text("manifest", &manifest),
        ]
    }

    /// Returns the pairs of a pixel with these objects, given by index and covered fraction of the area. An unknown
    /// index adds no pair.
    pub fn ranked(&self, things: impl IntoIterator<Item = RankedThing>) -> [RankedId; RANKS] {
        // Sum the fractions per id, since objects with one name share their id.
        let mut sums: Vec<RankedId> = Vec::new();
        for RankedThing { thing, share } in things {
            let Some(&id) = self.ids.get(thing) else { continue };
            match sums.iter_mut().find(|sum| sum.id.to_bits() == id.to_bits()) {
                Some(sum) => sum.share += share,
                None => sums.push(RankedId { id, share }),
            }
        }
        // Equal fractions are sorted by id, so the result does not depend on the order of rays.
        sums.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.id.to_bits().cmp(&b.id.to_bits())));
        // Keep the largest fractions, and fill unused pairs with 0.
        let mut ranked = [RankedId::default(); RANKS];
        ranked.iter_mut().zip(sums).for_each(|(rank, sum)| *rank = sum);
        ranked
    }

    /// Returns the channels of a picture with `pixels` in raster order.
    #[must_use]
    pub fn channels(&self, pixels: &[[RankedId; RANKS]]) -> Vec<FrameChannel> {
        let mut channels = Vec::new();
        for rank in 0..RANKS {
            // Two pairs share a layer: the even pair is in R and G, the odd pair in B and A.
            let names = if rank % 2 == 0 { ["R", "G"] } else { ["B", "A"] };
            let of = |name: &str, value: fn(&RankedId) -> f32| FrameChannel {
                name: format!("{}{:02}.{name}", self.kind, rank / 2),
                samples: pixels.iter().map(|pixel| value(&pixel[rank])).collect(),
                depth: SampleDepth::Float,
            };
            channels.extend([of(names[0], |rank| rank.id), of(names[1], |rank| rank.share)]);
        }
        channels
    }
}

/// Object in a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RankedThing {
    /// Index of the object in the list of names.
    pub thing: usize,
    /// Fraction of the pixel's area, 0…1.
    pub share: f32,
}

/// Returns the id of a name: its hash as the bits of a float. If the float would be denormal, infinite or NaN, one bit
/// of its exponent is flipped (specification, "Hash conversion").
#[must_use]
pub fn cryptomatte_id(name: &str) -> f32 {
    let hash = murmur_hash3(name.as_bytes());
    let exponent = hash >> 23 & 255;
    f32::from_bits(if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash })
}

/// Returns the hash MurmurHash3_x86_32 by Austin Appleby, with seed 0.
#[must_use]
pub fn murmur_hash3(bytes: &[u8]) -> u32 {
    let scrambled = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let mut hash = 0u32;
    // Split the input into little-endian words and a tail of at most three bytes.
    let words = bytes.chunks_exact(4);
    let mut tail = [0; 4];
    tail[..words.remainder().len()].copy_from_slice(words.remainder());
    for word in words {
        let word = word.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
        hash = (hash ^ scrambled(word)).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    // Zero bytes scramble to zero, so an empty tail has no effect.
    hash ^= scrambled(u32::from_le_bytes(tail));
    // Mix in the length, and spread each bit over the whole hash.
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// Escapes the contents of a JSON string, in ASCII (RFC 8259, section 7).
fn escaped(name: &str) -> String {
    let mut text = String::new();
    for unit in name.encode_utf16() {
        // Escape quotes, backslashes, control characters and everything outside ASCII.
        match u8::try_from(unit).map(char::from) {
            Ok(character @ ('"' | '\\')) => text.extend(['\\', character]),
            Ok(character @ ' '..='~') => text.push(character),
            _ => {
                let _ = write!(text, "\\u{unit:04x}");
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_the_published_ones() {
        // Compare with common test vectors of MurmurHash3_x86_32 with seed 0.
        for (text, hash) in [
            ("", 0),
            ("test", 0xba6b_d213),
            ("Hello, world!", 0xc036_3e43),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur_hash3(text.as_bytes()), hash, "{text}");
        }
    }

    #[test]
    fn ids_are_those_of_other_programs() {
        // Compare with the test data of Psyop's plug-in for Nuke.
        for (name, id) in [
            ("hello", 6.070_563e-17),
            ("cube", -4.084_619e15),
            ("sphere", 2.790_186e15),
            ("plane", 3.665_576_2e-11),
            ("равнина", -1.319_263_1e-25),
            ("mädchen", 6.236_13e25),
        ] {
            assert_eq!(cryptomatte_id(name), id, "{name}");
        }
        // Compare with manifests in Psyop's sample pictures, written by Arnold. JSON escapes the last two names.
        for (name, id) in [
            ("bunny", 0x1385_1a76),
            ("bush", 0xf763_d090),
            ("flowerA.flowerA_petal1.:1126", 0x05e7_bd28),
            ("name containing a \"quote\"  ", 0xaf8b_fa09),
            ("name_containing/slash", 0xb0a0_4231),
        ] {
            assert_eq!(cryptomatte_id(name).to_bits(), id, "{name}");
        }
    }

    #[test]
    fn ids_are_always_normal_numbers() {
        let mut flipped = 0;
        for index in 0..20_000 {
            let name = format!("node_{index}");
            assert!(cryptomatte_id(&name).is_normal(), "{name}");
            flipped += usize::from(cryptomatte_id(&name).to_bits() != murmur_hash3(name.as_bytes()));
        }
        // Two of 256 exponents are flipped.
        assert!((100..220).contains(&flipped), "{flipped}");
    }

    #[test]
    fn the_header_names_the_kind_and_all_names_once() {
        let names = ["b\"ox\\", "ball", "mädchen 🎲\n", "ball"].map(str::to_owned);
        let texts = Cryptomatte::new("special_chars", &names).texts();
        let known = |name: &str| &texts.iter().find(|text| text.name.ends_with(name)).unwrap().text;
        // Compare with the key in Psyop's sample picture that has this layer name.
        assert!(texts.iter().all(|text| text.name.starts_with("cryptomatte/fbb35e3/")), "{texts:?}");
        assert_eq!((known("/hash").as_str(), known("/conversion").as_str()), ("MurmurHash3_32", "uint32_to_float32"));
        let manifest = known("/manifest");
        assert!(manifest.is_ascii());
        let manifest: BTreeMap<String, String> = serde_json::from_str(manifest).unwrap();
        assert_eq!(manifest.len(), 3);
        for name in names {
            assert_eq!(manifest[&name], format!("{:08x}", cryptomatte_id(&name).to_bits()));
        }
    }

    #[test]
    fn pairs_are_sorted_by_share_and_things_of_one_name_are_one() {
        let names = ["a", "b", "a", "c", "d", "e", "f", "g"].map(str::to_owned);
        let mattes = Cryptomatte::new("CryptoObject", &names);
        let thing = |thing, share| RankedThing { thing, share };
        let [first, second, rest @ ..] =
            mattes.ranked([thing(0, 0.25), thing(1, 0.375), thing(2, 0.25), thing(99, 0.125)]);
        assert_eq!(first, RankedId { id: cryptomatte_id("a"), share: 0.5 });
        assert_eq!(second, RankedId { id: cryptomatte_id("b"), share: 0.375 });
        assert_eq!(rest, [RankedId::default(); 4]);
        let pixels = [mattes.ranked((1..8).map(|index| thing(index, 1.0 / 8.0))); 2];
        let channels = mattes.channels(&pixels);
        assert_eq!(channels.len(), 12);
        let names: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(
            names[..5],
            ["CryptoObject00.R", "CryptoObject00.G", "CryptoObject00.B", "CryptoObject00.A", "CryptoObject01.R"]
        );
        let sum: f32 = (0..6).map(|rank| channels[2 * rank + 1].samples[1]).sum();
        assert_eq!(sum, 0.75, "six of seven things");
    }
}
