//! Compares header values of an elementary stream with the stream.

use super::elementary::{Elementary, Group, Picture, Sequence};

/// Limits of a level of Main Profile (13818-2, Tables 8-10 to 8-14, and 8-8 for f_code).
struct Level {
    indication: u64,
    size: (u64, u64),
    frames_per_second: f64,
    samples_per_second: f64,
    bits_per_second: u64,
    buffer: u64,
    f_code: [u64; 2],
}

#[rustfmt::skip]
const LEVELS: [Level; 4] = [
    Level { indication: 10, size: (352, 288), frames_per_second: 30.0, samples_per_second: 3_041_280.0, bits_per_second: 4_000_000, buffer: 475_136, f_code: [7, 4] },
    Level { indication: 8, size: (720, 576), frames_per_second: 30.0, samples_per_second: 10_368_000.0, bits_per_second: 15_000_000, buffer: 1_835_008, f_code: [8, 5] },
    Level { indication: 6, size: (1440, 1152), frames_per_second: 60.0, samples_per_second: 47_001_600.0, bits_per_second: 60_000_000, buffer: 7_340_032, f_code: [9, 5] },
    Level { indication: 4, size: (1920, 1152), frames_per_second: 60.0, samples_per_second: 62_668_800.0, bits_per_second: 80_000_000, buffer: 9_781_248, f_code: [9, 5] },
];
/// vbv_delay of a variable-rate stream.
const VARIABLE: u64 = 0xffff;

/// Returns the largest bit rate \[bit/s\] and buffer \[bits\] of the stream's level; none for MPEG-1.
pub(super) fn level_bounds(sequence: &Sequence) -> Option<(u64, u64)> {
    let level = LEVELS.iter().find(|level| level.indication == sequence.profile_and_level & 15)?;
    sequence.is_mpeg2.then_some((level.bits_per_second, level.buffer))
}

/// Returns the wrong header values of the stream.
pub(super) fn faults(stream: &Elementary) -> Vec<String> {
    let Some(sequence) = stream.sequences.first() else { return vec!["no sequence header".into()] };
    let mut faults = Vec::new();
    // Require equal sequence headers, and an I picture at the start of each group.
    if stream.sequences.iter().any(|other| other != sequence) {
        faults.push("sequence headers differ".into());
    }
    if stream.pictures.iter().any(|picture| picture.group.is_some() != (picture.kind == 1)) {
        faults.push("groups do not begin with I pictures".into());
    }
    faults.extend(level_faults(stream, sequence));
    faults.extend(buffer_faults(&stream.pictures, sequence));
    faults.extend(order_faults(stream, sequence));
    faults.extend(field_faults(stream, sequence));
    faults.extend(stream.pictures.iter().filter_map(|picture| row_fault(picture, sequence)));
    faults
}

/// Returns the frame rate \[Hz\].
pub(super) fn fps(sequence: &Sequence) -> f64 {
    sequence.frame_rate.0 as f64 / sequence.frame_rate.1 as f64
}

fn level_faults(stream: &Elementary, sequence: &Sequence) -> Vec<String> {
    let mut faults = Vec::new();
    // MPEG-1 has no levels.
    if !sequence.is_mpeg2 {
        if sequence.constrained {
            faults.push("constrained_parameters_flag is set".into());
        }
        return faults;
    }

    // Check profile and level.
    let (profile, level) = (sequence.profile_and_level >> 4, sequence.profile_and_level & 15);
    let Some(level) = LEVELS.iter().find(|known| known.indication == level) else {
        return vec![format!("level {level} does not exist")];
    };
    if !matches!(profile, 4 | 1) {
        faults.push(format!("profile {profile} is neither Main nor High"));
    }
    // Compare size and rates with the level.
    let ((width, height), fps) = (sequence.size, fps(sequence));
    let exceeds = |level: &Level| {
        let samples = (width * height) as f64 * fps;
        width > level.size.0
            || height > level.size.1
            || fps > level.frames_per_second
            || samples > level.samples_per_second
    };
    // Above the limits of High Level, the header must contain High Level.
    if exceeds(&LEVELS[3]) {
        if level.indication != 4 {
            faults.push("not even High Level is stated".into());
        }
    } else if exceeds(level) {
        faults.push(format!("{width}x{height} at {fps} exceeds level {}", level.indication));
    } else {
        let bit_rate = sequence.bit_rate.unwrap_or(0);
        if bit_rate > level.bits_per_second || sequence.buffer > level.buffer {
            faults.push(format!(
                "{bit_rate} bit/s and a buffer of {} exceed level {}",
                sequence.buffer, level.indication
            ));
        }
        let is_far = |f_code: &u64, most: &u64| *f_code != 15 && f_code > most;
        let mut f_codes = stream.pictures.iter().flat_map(|picture| picture.f_code);
        if f_codes.any(|f_code| f_code.iter().zip(&level.f_code).any(|(f_code, most)| is_far(f_code, most))) {
            faults.push("f_code exceeds the level".into());
        }
    }
    // With low_delay, pictures may not be reordered.
    if sequence.low_delay && stream.pictures.iter().any(|picture| picture.kind == 3) {
        faults.push("low_delay with B pictures".into());
    }
    faults
}

/// Returns the time from the removal of each picture to the removal of the next \[s\] (Annex C).
fn removals(pictures: &[Picture], sequence: &Sequence) -> Vec<f64> {
    let period = 1.0 / fps(sequence);
    let repeats = |picture: &Picture| picture.repeat_first_field && !sequence.progressive;
    let has_b = !sequence.low_delay;
    // With reordering, an I or P picture remains as long as the previous anchor, which precedes it in display order. No
    // picture is displayed while the first is decoded, so its removal continues the cadence backwards.
    let mut anchor = pictures.first().is_some_and(|first| !sequence.progressive && !first.repeat_first_field);
    let mut times = Vec::new();
    for picture in pictures {
        let of = match (has_b, picture.kind) {
            (true, 1 | 2) => std::mem::replace(&mut anchor, repeats(picture)),
            _ => repeats(picture),
        };
        times.push(if of { 1.5 * period } else { period });
    }
    times
}

/// Simulates the video buffering verifier (13818-2, Annex C; 11172-2, Annex C).
fn buffer_faults(pictures: &[Picture], sequence: &Sequence) -> Vec<String> {
    let mut faults = Vec::new();
    let size = sequence.buffer as f64;
    // At a variable rate in MPEG-1, each picture must fit into the buffer.
    let Some(bit_rate) = sequence.bit_rate else {
        let large = pictures.iter().position(|picture| picture.bits() as f64 > size);
        return large.map(|at| format!("picture {at} does not fit into the buffer")).into_iter().collect();
    };
    let (rate, Some(first)) = (bit_rate as f64, pictures.first()) else { return vec!["no picture".into()] };
    let is_variable = first.vbv_delay == VARIABLE;
    if pictures.iter().any(|picture| (picture.vbv_delay == VARIABLE) != is_variable) {
        faults.push("vbv_delay of variable and of constant rate".into());
    }
    // vbv_delay refers to the picture_start_code, so preceding headers are in the buffer too.
    let ahead = |picture: &Picture| 8.0 * (picture.header - picture.begin) as f64;
    let mut fullness = if is_variable { size } else { first.vbv_delay as f64 * rate / 90_000.0 + ahead(first) };
    // Fill and empty the buffer, picture by picture.
    for (at, (picture, seconds)) in pictures.iter().zip(removals(pictures, sequence)).enumerate() {
        let bits = picture.bits() as f64;
        if !is_variable {
            // The tolerance is one unit of vbv_delay, in bits.
            let stated = picture.vbv_delay as f64 * rate / 90_000.0;
            if (stated - (fullness - ahead(picture))).abs() > rate / 90_000.0 + 1.0 {
                faults.push(format!("vbv_delay of picture {at}: {stated} bits, not {}", fullness - ahead(picture)));
            }
            if fullness > size + rate / 90_000.0 + 1.0 {
                faults.push(format!("the buffer overflows before picture {at}"));
            }
        }
        if bits > fullness + 1.0 {
            faults.push(format!("picture {at} of {bits} bits arrives late: the buffer has {fullness}"));
        }
        fullness += rate * seconds - bits;
        if is_variable {
            fullness = fullness.min(size);
        }
    }
    faults.truncate(5);
    faults
}

/// Checks temporal references and time codes.
fn order_faults(stream: &Elementary, sequence: &Sequence) -> Vec<String> {
    let mut faults = Vec::new();
    // The display indices must be complete.
    let mut seen = stream.display_indices();
    seen.sort_unstable();
    if seen.iter().enumerate().any(|(at, &index)| index != at as u64) {
        faults.push("temporal references leave pictures out, or repeat them".into());
        return faults;
    }

    // Time codes count displayed frames.
    let per_second = fps(sequence).round() as u64;
    let number =
        |[hours, minutes, seconds, pictures]: [u64; 4]| ((hours * 60 + minutes) * 60 + seconds) * per_second + pictures;
    let fields = stream.fields();
    let mut first = None;
    for (index, picture) in stream.display_indices().into_iter().zip(&stream.pictures) {
        let Some(Group { time_code, closed }) = picture.group else { continue };
        let shown: u64 = fields[..(index - picture.temporal_reference) as usize].iter().sum();
        let begin = *first.get_or_insert(number(time_code));
        if time_code[3] >= per_second || number(time_code) != begin + shown / 2 {
            faults.push(format!("time code {time_code:?} after {shown} fields"));
        }
        if closed && picture.temporal_reference > 0 {
            faults.push("closed_gop with pictures in front of the I picture".into());
        }
    }
    faults
}

/// Checks the field flags: a frame starts with the field of opposite parity to the last field before it (13818-2, 7.12).
fn field_faults(stream: &Elementary, sequence: &Sequence) -> Vec<String> {
    // Compare the fields of pictures that are consecutive in display order.
    let mut shown: Vec<(u64, &Picture)> = stream.display_indices().into_iter().zip(&stream.pictures).collect();
    shown.sort_by_key(|&(index, _)| index);
    let is_wrong = |pair: &[(u64, &Picture)]| {
        let (before, after) = (pair[0].1, pair[1].1);
        after.top_field_first != before.top_field_first ^ before.repeat_first_field
    };
    let flags = shown.iter().any(|(_, picture)| picture.top_field_first || picture.repeat_first_field);
    match sequence.progressive {
        true if flags => vec!["flags of fields in a progressive sequence".into()],
        false if shown.windows(2).any(is_wrong) => vec!["top_field_first does not follow the fields before".into()],
        _ => Vec::new(),
    }
}

/// Checks that slices cover all macroblock rows in order.
fn row_fault(picture: &Picture, sequence: &Sequence) -> Option<String> {
    let rows = match sequence.progressive {
        true => sequence.size.1.div_ceil(16),
        false => 2 * sequence.size.1.div_ceil(32),
    };
    let covered = picture.rows.iter().copied().eq(0..rows);
    (!covered).then(|| format!("slices of rows {:?}…, not of {rows}", &picture.rows[..picture.rows.len().min(3)]))
}
