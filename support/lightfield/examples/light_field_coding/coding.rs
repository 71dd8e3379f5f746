//! Sizes and errors of one object, or of all objects of a scene, with every coding.

use crate::light::DIRECTIONS;
use crate::scene::Object;
use crate::segments::{SegmentRule, Segmented};
use lightfield::{Field, FieldError, LookUp, NearLossless, Samples, Slot};
use rayon::prelude::*;

/// Names of the codings, in table order.
const NAMES: [&str; 10] =
    ["T=0", "T=6", "T=9", "T=6, line", "T=9, line", "`zstd -19`", "ours δ=0", "ours δ=1", "ours δ=2", "ours δ=3"];

/// Errors of decoded codes \[codes\].
#[derive(Clone, Copy, Default)]
struct Errors {
    /// Sum over all codes of the mean error of the three channels.
    sum: f64,
    /// Largest error in one channel.
    channel: f32,
    /// Largest mean error of the three channels.
    mean: f32,
}

/// Size and errors of one coding of one object.
#[derive(Clone, Copy, Default)]
struct Coded {
    bytes: usize,
    errors: Errors,
}

/// Results of all codings of an object.
pub struct Row {
    name: &'static str,
    raw: usize,
    coded: [Coded; 10],
}

impl Errors {
    /// Combines two sets of errors.
    fn and(self, other: Self) -> Self {
        Self { sum: self.sum + other.sum, channel: self.channel.max(other.channel), mean: self.mean.max(other.mean) }
    }

    /// Returns the errors of all codes of a texel.
    fn of_texel(field: &Field, stored: &impl LookUp, slot: Slot) -> Self {
        let mut errors = Self::default();
        for direction in 0..DIRECTIONS {
            let (Some(exact), Some(found)) = (field.codes(slot, direction), stored.codes(slot, direction)) else {
                continue;
            };
            let three = [0, 1, 2].map(|c| (exact[c] - found[c]).abs());
            let mean = three.iter().sum::<f32>() / 3.0;
            let channel = three.into_iter().fold(0.0, f32::max);
            errors = errors.and(Self { sum: mean.into(), channel, mean });
        }
        errors
    }

    /// Returns the errors of all codes of a field. The texels' sums are added in order.
    fn of_field(field: &Field, stored: &(impl LookUp + Sync)) -> Self {
        let slots: Vec<Slot> = field.tiles().slots().collect();
        let texels: Vec<Self> = slots.par_iter().map(|&slot| Self::of_texel(field, stored, slot)).collect();
        texels.into_iter().fold(Self::default(), Self::and)
    }
}

/// Encodes a field with the thesis's coding.
fn segments(field: &Field, threshold: u16, rule: SegmentRule) -> Coded {
    let stored = Segmented::encode(field, threshold, rule);
    Coded { bytes: stored.size(), errors: Errors::of_field(field, &stored.bisection()) }
}

/// Encodes a field with this crate's coding.
fn near_lossless(field: &Field, delta: u16) -> Result<Coded, FieldError> {
    let stored = NearLossless::encode(field, delta)?;
    Ok(Coded { bytes: stored.as_bytes().len(), errors: Errors::of_field(field, &stored) })
}

/// Compresses the raw bytes of a field as one Zstandard frame.
fn zstandard(field: &Field) -> Coded {
    let Samples::Bytes(codes) = field.samples() else { unreachable!("the example makes bytes") };
    let frame = zstd::bulk::compress(codes, 19).expect("memory for a frame");
    Coded { bytes: frame.len(), errors: Errors::default() }
}

impl Row {
    /// Encodes a field with all codings. Zstandard is single-threaded and runs in parallel with the other codings.
    pub fn of(name: &'static str, field: &Field) -> Result<Self, FieldError> {
        let others = || {
            Ok([
                segments(field, 0, SegmentRule::Checked),
                segments(field, 6, SegmentRule::Checked),
                segments(field, 9, SegmentRule::Checked),
                segments(field, 6, SegmentRule::FirstDifference),
                segments(field, 9, SegmentRule::FirstDifference),
                near_lossless(field, 0)?,
                near_lossless(field, 1)?,
                near_lossless(field, 2)?,
                near_lossless(field, 3)?,
            ])
        };
        let (others, plain) = rayon::join(others, || zstandard(field));
        let [a, b, c, d, e, f, g, h, i] = others?;
        Ok(Self { name, raw: field.samples().len(), coded: [a, b, c, d, e, plain, f, g, h, i] })
    }

    /// Sums the codings of all objects.
    pub fn total(rows: &[Self]) -> Self {
        let mut total = Self { name: "all", raw: 0, coded: [Coded::default(); 10] };
        for row in rows {
            total.raw += row.raw;
            for (sum, coded) in total.coded.iter_mut().zip(row.coded) {
                *sum = Coded { bytes: sum.bytes + coded.bytes, errors: sum.errors.and(coded.errors) };
            }
        }
        total
    }
}

/// Formats bytes in millions, with three significant digits.
fn megabytes(bytes: usize) -> String {
    let megabytes = bytes as f64 / 1e6;
    let decimals = if megabytes < 1.0 {
        3
    } else if megabytes < 100.0 {
        2
    } else {
        1
    };
    format!("{megabytes:.decimals$}")
}

/// Prints the sizes. For all objects together, also prints the ratio of raw to stored bytes.
pub fn print_sizes(rows: &[Row], objects: &[Object]) {
    println!("| MB | raw | {} | thesis printed, T=0 / 6 / 9 at scale 1 |", NAMES.join(" | "));
    println!("|---{}|", "|---".repeat(NAMES.len() + 2));
    for (k, row) in rows.iter().enumerate() {
        let sizes = row.coded.map(|coded| megabytes(coded.bytes)).join(" | ");
        let printed = objects.get(k).and_then(|object| object.printed);
        // The thesis counts 1024 bytes per kilobyte.
        let printed = printed.map_or_else(String::new, |three| {
            three.map(|kilobytes| format!("{:.1}", f64::from(kilobytes) * 1024e-6)).join(" / ")
        });
        println!("| {} | {} | {sizes} | {printed} |", row.name, megabytes(row.raw));
    }
    let Some(all) = rows.last() else { return };
    let ratios = all.coded.map(|coded| format!("{:.1}", all.raw as f64 / coded.bytes as f64)).join(" | ");
    println!("| raw / stored | | {ratios} | |");
}

/// Prints the errors in codes: the mean over all channels, the largest error of one channel, and the largest mean error
/// of the three channels.
pub fn print_errors(rows: &[Row]) {
    println!("Errors in codes: mean, largest of one channel, largest of the mean of three\n");
    let lossy = [1, 2, 3, 4, 7, 8, 9];
    println!("| | {} |", lossy.map(|k| NAMES[k]).join(" | "));
    println!("|---{}|", "|---".repeat(lossy.len()));
    for row in rows {
        let errors = lossy.map(|k| {
            let Errors { sum, channel, mean } = row.coded[k].errors;
            format!("{:.2}, {channel:.2}, {mean:.2}", sum / (row.raw / 3) as f64)
        });
        println!("| {} | {} |", row.name, errors.join(" | "));
    }
}
