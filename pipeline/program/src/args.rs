//! Command-line arguments of the program.

#[cfg(feature = "bake")]
use super::commands::bake::BakeArguments;
use super::commands::compare::Compare;
use super::commands::join::Join;
use super::commands::plan::Plan;
use super::commands::reference::Reference;
use super::commands::render::RenderArguments;
#[cfg(feature = "serve")]
use super::commands::serve::ServeArguments;
use super::commands::still::StillArguments;
use super::commands::sweep::Sweep;
use super::commands::views::ViewsArguments;
use super::examples;
use clap::{Arg, Parser, Subcommand};

/// Renders an animated glTF scene with global illumination into an MPEG-2 video.
///
/// Renderer and encoder assist each other: the renderer passes exact motion vectors to the encoder. One frame later
/// the encoder returns the error that each pixel may have without being visible.
#[derive(Parser)]
#[command(
    name = "render2mpeg",
    bin_name = "render2mpeg",
    version,
    override_usage = "render2mpeg <COMMAND>\n       render2mpeg <SCENE>",
    after_help = "A scene without a command is rendered: render2mpeg scene.glb is render2mpeg render scene.glb.

Examples:
  render2mpeg render scenes/cornell/cornell.glb             a video and a report in the current folder
  render2mpeg still scene.glb -o picture.png                a single frame
  render2mpeg turntable scene.glb -o turn.mp4               the scene from all sides
  render2mpeg serve scene.glb --open                        a walk through the scene, in a browser
  render2mpeg plan scene.glb                                what a film would run and cost
  render2mpeg bake scene.glb                                precomputed light for many films
  render2mpeg compare film.mpg film.y4m                     coding loss
  render2mpeg sweep scene.glb --qscale 2,16,48              error against run time, as an HTML page

Each command lists examples of its own, such as render2mpeg render --help"
)]
pub struct Arguments {
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// Command of the program.
#[derive(Subcommand)]
pub enum Command {
    /// Render a scene into a video
    #[command(args_override_self = true, after_help = examples::RENDER_SHORT, after_long_help = examples::RENDER)]
    Render(Box<RenderArguments>),
    /// Render single frames, as PNG, WebP or JPEG tone mapped for display, or as OpenEXR
    #[command(after_help = examples::STILL)]
    Still(Box<StillArguments>),
    /// Render a film in which the camera turns once around the scene
    #[command(args_override_self = true, after_help = examples::TURNTABLE)]
    Turntable(Box<RenderArguments>),
    /// Render pictures from many sides, with their cameras, depths and normals, for 3D reconstruction
    #[command(after_help = examples::VIEWS)]
    Views(Box<ViewsArguments>),
    /// Walk through a lit scene in a browser
    #[cfg(feature = "serve")]
    #[command(after_help = examples::SERVE)]
    Serve(Box<ServeArguments>),
    /// Precompute the light of static geometry, for films with render --lighting baked
    #[cfg(feature = "bake")]
    #[command(after_help = examples::BAKE)]
    Bake(BakeArguments),
    /// Render a reference frame by path tracing, as linear OpenEXR with its variance
    #[command(after_help = examples::REFERENCE)]
    Reference(Reference),
    /// Measure the error of a picture, sequence or video against a reference
    #[command(after_help = examples::COMPARE)]
    Compare(Compare),
    /// Compare methods by error and run time, before and after decoding, with tables, plots and an HTML page
    #[command(after_help = examples::SWEEP)]
    Sweep(Sweep),
    /// Join the parts written by render --range into the film that one machine would write
    #[command(after_help = examples::JOIN)]
    Join(Join),
    /// Show the stages that a scene needs, those left out and why; render nothing
    #[command(args_override_self = true, mut_args(without_files), after_help = examples::PLAN)]
    Plan(Box<Plan>),
    /// Print a shell's completion script
    #[command(after_help = examples::COMPLETIONS)]
    Completions {
        /// Shell to complete for
        shell: clap_complete::Shell,
    },
    /// Print the manual page of the program or of one command, as roff for man
    #[command(after_help = examples::MAN)]
    Man {
        /// Command, such as render
        command: Option<String>,
    },
}

impl Command {
    /// Returns whether the processes of a run share the work of the command.
    pub fn is_shared(&self) -> bool {
        match self {
            Self::Render(_) | Self::Turntable(_) => true,
            #[cfg(feature = "bake")]
            Self::Bake(_) => true,
            _ => false,
        }
    }
}

/// Hides the output files of a film in the help of a command that writes no files. The options are still accepted, so
/// that a command line of `render` also works for `plan`.
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

    /// Checks that the help of `render` contains the defaults that [`Options::fill_in`] fills in.
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
            // Skip defaults that depend on the scene, which are descriptions of several words.
            if !default.contains(' ') {
                assert_eq!(default.trim_end_matches(']'), value, "{:?}", option.get_long());
                stated += 1;
            }
        }
        assert!(stated >= 11, "{stated} defaults");
        assert!(defaults["kappa"].to_string() == "1.0" || defaults["kappa"].to_string() == "1", "{defaults}");
    }
}
