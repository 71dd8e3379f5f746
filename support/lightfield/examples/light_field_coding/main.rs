//! Sizes, errors and read times of light fields with several codings. The scenes resemble the scenes in chapter 8 of
//! the thesis.
//!
//! `cargo run --release -p render2mpeg-lightfield --example light_field_coding -- [--scale F] [--scene N] [--sheet FILE.png]`
//!
//! `--scale` multiplies the number of texels; 1 is the thesis's number. `--scene` is 1, 2, or 3 (noisy light).

mod coding;
mod light;
mod scene;
mod segments;
mod sheet;
mod timing;

use coding::Row;
use scene::Scene;
use std::time::Instant;

/// Number of texels relative to the thesis. With this number, all scenes take less than four minutes on two cores.
const SCALE: f32 = 0.1;
/// Fraction of the texels that is coded if the light is noisy, because all codings store noise slowly and poorly.
const NOISY_SHARE: f32 = 0.25;

/// Command-line options.
struct Choices {
    scale: f32,
    scene: Option<usize>,
    sheet: Option<String>,
}

/// Parses the arguments.
fn choices() -> Result<Choices, String> {
    let mut choices = Choices { scale: SCALE, scene: None, sheet: None };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{name} needs a value"))?;
        match name.as_str() {
            "--scale" => {
                let scale = value.parse().ok().filter(|scale| *scale > 0.0 && *scale <= 4.0);
                choices.scale = scale.ok_or_else(|| format!("--scale {value}: expected a number up to 4"))?;
            }
            "--scene" => {
                let scene = value.parse().ok().filter(|scene| (1..=3).contains(scene));
                choices.scene = Some(scene.ok_or_else(|| format!("--scene {value}: expected 1, 2 or 3"))?);
            }
            "--sheet" => choices.sheet = Some(value),
            _ => return Err(format!("{name} is unknown: --scale, --scene and --sheet are there")),
        }
    }
    Ok(choices)
}

/// Encodes each object of a scene with all codings and prints the tables.
fn report(scene: &Scene, noisy: bool, thesis: &[&str]) -> Result<(), lightfield::FieldError> {
    let start = Instant::now();
    let mut rows = Vec::new();
    for object in &scene.objects {
        let field = light::field(scene, object, noisy)?;
        rows.push(Row::of(object.name, &field)?);
    }
    let total = Row::total(&rows);
    rows.push(total);
    let noise = if noisy { ", 16 random picks among 64 light points for each direction" } else { "" };
    println!("\n## {}{noise}\n", scene.name);
    coding::print_sizes(&rows, &scene.objects);
    thesis.iter().for_each(|line| println!("{line}"));
    println!();
    coding::print_errors(&rows);
    println!("\n{:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}

/// Runs the selected scenes.
fn run(choices: &Choices) -> Result<(), Box<dyn std::error::Error>> {
    let Choices { scale, scene, sheet } = choices;
    println!("texels: {scale} of the thesis's; 1 MB = 10^6 bytes");
    let wanted = |number: usize| scene.is_none_or(|scene| scene == number);
    let simple = scene::simple(*scale);
    if wanted(1) {
        let printed = ["", "Thesis, all six objects at scale 1, MB: T=0 115.7, T=6 84.7, T=9 77.9, of 612 raw."];
        report(&simple, false, &printed)?;
        let printed = "Thesis, errors of the mean of three: T=6 mean 0.96 to 1.24, largest 1.99; T=9 largest 2.90.";
        println!("{printed}");
        timing::print(&light::field(&simple, &simple.objects[2], false)?)?;
    }
    if wanted(2) {
        let printed = [
            "",
            "Thesis at scale 1, MB: T=6 255, T=9 204; errors 1.1 and 1.62, largest 1.98 and 2.90.",
            "It prints 1290 MB raw. Its 710 000 texels, 400 directions and 3 bytes make 852 MB.",
        ];
        report(&scene::complex(*scale), false, &printed)?;
    }
    if wanted(3) {
        let fewer = scene::simple(scale * NOISY_SHARE);
        println!("\ntexels of noisy light: {} of the thesis's", scale * NOISY_SHARE);
        report(&fewer, true, &[])?;
    }
    if let Some(path) = sheet {
        // Read times are measured at full size, independent of the scale.
        let simple = scene::simple(1.0);
        sheet::write(path, &simple, &simple.objects[2])?;
    }
    Ok(())
}

fn main() {
    let done = choices().and_then(|choices| run(&choices).map_err(|error| error.to_string()));
    if let Err(error) = done {
        eprintln!("light_field_coding: {error}");
        std::process::exit(1);
    }
}
