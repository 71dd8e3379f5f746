//! Examples below the options of `--help`: a line to type for each purpose.

pub const RENDER_SHORT: &str = "Examples:
  render2mpeg render scene.glb                                  into scene.mpg, in this folder
  render2mpeg render scene.glb --preset draft -o look.mpg       small and fast
  render2mpeg render scene.glb --preset final -o film.mp4       large, with smooth edges
  render2mpeg render scene.glb -o film.mpg --also film.mp4      H.264 too, by ffmpeg, for browsers

Films are MPEG-2, in .mp4 and .mkv as well. Players that know H.264 alone show what --also makes.
--help has all options: --from, --to, --camera, --set, --bitrate, --threads, --resume, --exr ...";

pub const RENDER: &str = "Examples:
  render2mpeg render scene.glb -o film.mpg --size 1280x720 --frames 50 --qscale 16
  render2mpeg render scene.glb -o film.ts --bitrate 2M --cbr --bframes 2    a constant rate
  render2mpeg render scene.glb -o film.mkv --also film.mp4      H.264 too, by ffmpeg, for any player and browser
  render2mpeg render scene.glb -o - | mpv -                     to another program
  render2mpeg render scene.glb -o film.mpg --resume             go on where the last run ended
  render2mpeg render scene.glb --samples 4                      smooth edges, for final output
  render2mpeg render scene.glb --preset draft --every 4         a fast preview, four times as fast
  render2mpeg render scene.glb --from 100 --to 200              these frames of the scene alone
  render2mpeg render scene.glb --set exposure=1.5               in place of what scene.toml says
  render2mpeg render scene.glb --thresholds fixed:0.02 --shading full   the original Lightcuts
  render2mpeg render --config job.toml --qscale 4               options from a file, overridden
  render2mpeg render scene.glb --frames 30 --chunk 10 --range 10-19     a part, for join

Without options it makes SCENE.mpg of 512x512 pixels, or as many in the camera's shape, as long as the scene's animation, and SCENE.report.json beside it.
Ctrl-C ends with a video that plays, after this frame; a second one ends it at once.
Exit codes: 0 done, 1 failed, 2 wrong arguments; ended early by 130 Ctrl-C, 143 SIGTERM, 129 a closed terminal.";

#[cfg(feature = "bake")]
pub const BAKE: &str = "Examples:
  render2mpeg bake scene.glb                                    into scene.slf, beside the scene
  render2mpeg bake scene.glb --texels 2000000 -o fine.slf       finer, for pictures from nearby
  render2mpeg bake scene.glb --gltf lit.glb                     with the light painted in, for any viewer
  render2mpeg bake scene.glb --gltf lit.glb --baked fine.slf --texture 4096   from light that is baked already

A film looks the light up with render scene.glb --lighting baked, or with --baked fine.slf besides.
Indirect light is baked and direct light is not: shadows stay sharp. Lamps must stand still.
The export has both, in the colors of a film: all that stands still is unlit there, coats and metals look matte,
and what moves waits for a light of the viewer. With lit.glb comes lit.toml, by which a film of it looks like one of the scene.";

pub const STILL: &str = "Examples:
  render2mpeg still scene.glb                                   into scene.png, in this folder
  render2mpeg still scene.glb -o picture.jpg --frame 50 --size 1920x1080 --samples 8
  render2mpeg still scene.glb -o picture.png --frame 0,10,20-25       picture_00.png, picture_10.png ...
  render2mpeg still scene.glb --preset draft --camera 1         fast, by another camera
  render2mpeg still scene.glb -o light.exr                      linear light, for other programs

reference renders the same frame by paths: slower, and without the simplifications of films.";

pub const REFERENCE: &str = "Examples:
  render2mpeg reference scene.glb --frame 10 --spp 256 -o truth.exr
  render2mpeg reference scene.glb --spp 1024 -o picture.png     as a display shows it
  render2mpeg reference scene.glb --method all-lights -o lights.exr    what cuts approximate
  render2mpeg reference scene.glb --frame 10 --center -o truth.exr     to compare with render --antialiasing off --exr DIR";

pub const COMPARE: &str = "Examples:
  render2mpeg compare frames/frame_00010.exr truth.exr          linear light
  render2mpeg compare film.mpg film.y4m --heatmap where.png     what the codec cost, and where
  render2mpeg compare frames others --json                      two folders, for other programs

render -o film.mpg --y4m film.y4m makes a film, and its pictures before they are coded.
Outlines agree where both have the centers of pixels alone: render --antialiasing off --exr frames,
and reference --frame 10 --center -o truth.exr.

SSIMULACRA 2: 90 is hardly told apart, 70 good, 50 fair.";

pub const SWEEP: &str = "Examples:
  render2mpeg sweep scene.glb                                   into scene-sweep/sweep.html
  render2mpeg sweep scene.glb --qscale 2,16,48 --size 320x240
  render2mpeg sweep scene.glb --methods perceptual-cache,paths-16

Films lie in files below the output folder while they are needed: long sweeps take disk, not memory.";

pub const JOIN: &str = "Examples:
  render2mpeg join part_0-9.m2v part_10-19.m2v part_20-29.m2v -o film.mpg
  render2mpeg join part_0-9.m2v part_10-19.m2v part_20-29.m2v -o - | mpv -

Parts are made by render --chunk 10 --range 0-9 and so on, anywhere; beside each is its report, SCENE_0-9.report.json.
Nothing is coded again: the film has the bytes of render --chunk 10 without --range.";

pub const PLAN: &str = "Examples:
  render2mpeg plan scene.glb
  render2mpeg plan scene.glb --cache off --thresholds fixed:0.02    what these leave out

costs, saves: the share of a frame's CPU time that a stage takes, or that leaving it out saves. These, time and memory are
estimates. Options of render are accepted, also those of its files; nothing is written.";

pub const COMPLETIONS: &str = "Examples:
  render2mpeg completions bash > ~/.local/share/bash-completion/completions/render2mpeg
  render2mpeg completions fish > ~/.config/fish/completions/render2mpeg.fish";

pub const MAN: &str = "Examples:
  render2mpeg man render | man -l -
  render2mpeg man > render2mpeg.1";

#[cfg(test)]
mod tests {
    use crate::args::Arguments;
    use clap::{CommandFactory, Parser};

    #[test]
    fn every_example_can_be_typed() {
        let mut program = Arguments::command();
        program.build();
        let (mut all, mut helps) = (0, vec![(String::new(), program.render_long_help().to_string())]);
        for command in program.get_subcommands_mut().filter(|command| command.get_name() != "help") {
            helps.push((command.get_name().to_owned(), command.render_long_help().to_string()));
        }
        for (name, help) in helps {
            let lines: Vec<&str> = help.lines().filter(|line| line.starts_with("  render2mpeg ")).collect();
            assert!(!lines.is_empty(), "{name}: no example");
            for line in lines {
                // After two spaces stands the purpose, and after > or | the shell goes on.
                let typed = line.trim().split("  ").next().unwrap().split(['>', '|']).next().unwrap();
                assert!(typed.starts_with(&format!("render2mpeg {name}")), "{line}");
                if let Err(error) = Arguments::try_parse_from(typed.split_whitespace()) {
                    panic!("{typed}: {error}");
                }
                all += 1;
            }
        }
        assert!(all >= 8, "{all} examples");
    }
}
