//! The arguments of the program.

#[cfg(feature = "bake")]
use super::commands::bake::BakeArguments;
use super::commands::compare::Compare;
use super::commands::join::Join;
use super::commands::plan::Plan;
use super::commands::reference::Reference;
use super::commands::render::Render;
use super::commands::still::StillArguments;
use super::commands::sweep::Sweep;
use super::examples;
use clap::{Arg, Parser, Subcommand};

/// Renders an animated glTF scene with global illumination into an MPEG-2 video.
///
/// Renderer and encoder work for each other: the renderer gives the encoder exact motion vectors, and the encoder
/// gives the renderer, one frame later, the error that each pixel may have before anyone could see it.
#[derive(Parser)]
#[command(
    name = "render2mpeg",
    bin_name = "render2mpeg",
    version,
    override_usage = "render2mpeg <COMMAND>\n       render2mpeg <SCENE>",
    after_help = "A scene alone is rendered: render2mpeg scene.glb is render2mpeg render scene.glb.

Examples:
  render2mpeg render scenes/cornell/cornell.glb             a video and a report, in this folder
  render2mpeg still scene.glb -o picture.png                one picture
  render2mpeg plan scene.glb                                what the scene needs, before any ray
  render2mpeg bake scene.glb                                light once, for many films
  render2mpeg compare film.mpg film.y4m                     what the codec has cost
  render2mpeg sweep scene.glb --qscale 2,16,48              error against run time, as a page

Each command has examples of its own: render2mpeg render --help"
)]
pub struct Arguments {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The command.
#[derive(Subcommand)]
pub enum Command {
    /// Render a scene into a video.
    #[command(args_override_self = true, after_help = examples::RENDER_SHORT, after_long_help = examples::RENDER)]
    Render(Box<Render>),
    /// Render one picture: PNG or JPEG as a display shows it, or OpenEXR.
    #[command(after_help = examples::STILL)]
    Still(Box<StillArguments>),
    /// Compute the light of all that stands still once, for films that look it up: render --lighting baked.
    #[cfg(feature = "bake")]
    #[command(after_help = examples::BAKE)]
    Bake(BakeArguments),
    /// Render one frame as exactly as wanted, by paths, into a linear OpenEXR picture with the noise that is left in it.
    #[command(after_help = examples::REFERENCE)]
    Reference(Reference),
    /// Say how far pictures, sequences or videos are from a reference.
    #[command(after_help = examples::COMPARE)]
    Compare(Compare),
    /// Compare methods: error against run time, before and after decoding, with tables, plots and a page that shows it all.
    #[command(after_help = examples::SWEEP)]
    Sweep(Sweep),
    /// Join parts that render --range made to the film that one machine would make.
    #[command(after_help = examples::JOIN)]
    Join(Join),
    /// Show what a scene needs, what is left out, and why; render nothing.
    #[command(args_override_self = true, mut_args(without_files), after_help = examples::PLAN)]
    Plan(Box<Plan>),
    /// Print what makes a shell complete this program's options.
    #[command(after_help = examples::COMPLETIONS)]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page of the program, or of one of its commands, as roff for man.
    #[command(after_help = examples::MAN)]
    Man {
        /// Such as render
        command: Option<String>,
    },
}

/// Hides the files of a film in the help of a command that writes none. They are accepted, so that a command line of `render` is
/// one of `plan`, too.
fn without_files(option: Arg) -> Arg {
    let is_file = option.get_help_heading() == Some("Output");
    if is_file { option.hide(true) } else { option }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use render_core::scene::Scene;
    use render2mpeg::Options;

    #[test]
    fn the_help_of_plan_has_no_files() {
        let program = Arguments::command();
        let plan = program.get_subcommands().find(|command| command.get_name() == "plan").unwrap();
        let help = plan.clone().render_long_help().to_string();
        assert!(help.contains("--qscale") && !help.contains("--output"), "{help}");
        assert!(Arguments::try_parse_from(["render2mpeg", "plan", "scene.glb", "-o", "film.mpg"]).is_ok());
    }

    /// The help of `render` names the values that [`Options::fill_in`] fills in.
    #[test]
    fn help_states_the_defaults_in_force() {
        let mut options = Options::default();
        options.fill_in("scene.glb".into(), &Scene::default()).unwrap();
        let defaults = toml::Table::try_from(&options).unwrap();
        let program = Arguments::command();
        let render = program.get_subcommands().find(|command| command.get_name() == "render").unwrap();
        let mut stated = 0;
        for option in render.get_arguments() {
            let help = option.get_help().map(ToString::to_string).unwrap_or_default();
            let Some((_, default)) = help.split_once("[default: ") else { continue };
            let Some(value) = option.get_long().and_then(|name| defaults.get(name)) else { continue };
            let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            // Others depend on the scene, and say on what.
            if !default.contains(' ') {
                assert_eq!(default.trim_end_matches(']'), value, "{:?}", option.get_long());
                stated += 1;
            }
        }
        assert!(stated >= 11, "{stated} defaults");
        assert!(defaults["kappa"].to_string() == "1.0" || defaults["kappa"].to_string() == "1", "{defaults}");
    }
}
