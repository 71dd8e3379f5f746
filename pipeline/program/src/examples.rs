//! Examples for `--help`: one command line per purpose.

pub const RENDER_SHORT: &str = "Examples:
  render2mpeg render scene.glb                                  writes scene.mpg to the current folder
  render2mpeg render scene.glb --preset draft -o look.mpg       small and fast
  render2mpeg render scene.glb --preset final -o film.mp4       large, with smooth edges
  render2mpeg render scene.glb -o film.mpg --also film.mp4      H.264 too, with ffmpeg, for browsers

Films are MPEG-2, also in .mp4 and .mkv. Players that support only H.264 need --also.
--help lists all options: --from, --to, --camera, --set, --bitrate, --threads, --resume, --exr ...";

pub const RENDER: &str = "Examples:
  render2mpeg render scene.glb -o film.mpg --size 1280x720 --frames 50 --qscale 16
  render2mpeg render scene.glb -o film.ts --bitrate 2M --cbr --bframes 2    constant bit rate
  render2mpeg render scene.glb -o film.mkv --also film.mp4      H.264 too, with ffmpeg, for any player and browser
  render2mpeg render scene.glb -o - | mpv -                     into another program
  render2mpeg render scene.glb -o film.mpg --resume             continue an interrupted run
  render2mpeg render scene.glb --samples 4                      smooth textures, for final output
  render2mpeg render scene.glb --preset draft --every 4         a preview that plays four times as fast
  render2mpeg render scene.glb --from 100 --to 200              only these frames of the scene
  render2mpeg render scene.glb --set exposure=1.5               overrides scene.toml
  render2mpeg render scene.glb --thresholds fixed:0.02 --shading full   the original Lightcuts
  render2mpeg render --config job.toml --qscale 4               options from a file, overridden
  render2mpeg render scene.glb --frames 30 --chunk 10 --range 10-19     a part, for join

Without options it writes SCENE.mpg and SCENE.report.json: 512x512 pixels in the camera's shape, as long as the scene's animation.
Ctrl-C finishes the current frame and leaves a playable video; a second Ctrl-C ends at once.
Exit codes: 0 success, 1 failure, 2 wrong arguments; ended early: 130 Ctrl-C, 143 SIGTERM, 129 closed terminal.";

#[cfg(feature = "bake")]
pub const BAKE: &str = "Examples:
  render2mpeg bake scene.glb                                    writes scene.slf next to the scene
  render2mpeg bake scene.glb --texels 2000000 -o fine.slf       finer, for close-ups
  render2mpeg bake scene.glb --gltf lit.glb                     with the light in textures, for any viewer
  render2mpeg bake scene.glb --gltf lit.glb --baked fine.slf --texture 4096   from existing baked light

To use the light: render scene.glb --lighting baked, with --baked fine.slf for another file.
Only indirect light is baked, so shadows stay sharp. Lamps must be static.
The export has direct and indirect light, tone mapped as in a film. Its static geometry is unlit, with matte coats and metals;
dynamic geometry needs a light of the viewer. With lit.toml, next to lit.glb, films of lit.glb look like films of the scene.";

pub const STILL: &str = "Examples:
  render2mpeg still scene.glb                                   writes scene.png to the current folder
  render2mpeg still scene.glb -o picture.jpg --frame 50 --size 1920x1080 --samples 8
  render2mpeg still scene.glb -o picture.png --frame 0,10,20-25       picture_00.png, picture_10.png ...
  render2mpeg still scene.glb --preset draft --camera 1         fast, from another camera
  render2mpeg still scene.glb -o light.exr                      linear light, for other programs
  render2mpeg still scene.glb --orbit 30,70 --background transparent    a model for a web page

reference renders the same frame by path tracing: slower, without the approximations of films.";

pub const TURNTABLE: &str = "Examples:
  render2mpeg turntable scene.glb                               writes scene.mpg: one turn in 6 s, without a seam
  render2mpeg turntable scene.glb -o turn.mp4 --seconds 4 --orbit 0,60
  render2mpeg turntable scene.glb --also turn.webm,turn.gif --background white

All options of render apply.";

pub const VIEWS: &str = "Examples:
  render2mpeg views scene.glb --count 24 --output views         views/000.png ... and views/transforms.json
  render2mpeg views scene.glb --output views --aov depth,normal   also views/000.exr with these channels
  render2mpeg views scene.glb --output views --background white   without transparency

transforms.json lists size, focal length and camera-to-world matrix of each picture, as NeRF programs read it.";

#[cfg(feature = "serve")]
pub const SERVE: &str = "Examples:
  render2mpeg serve scene.glb --open                            opens the scene in a browser
  render2mpeg serve scene.glb --size 640x360 --bitrate 2M       larger pictures on a known line
  render2mpeg serve scene.glb --listen 0.0.0.0                  for other machines, by a link with a token
  render2mpeg serve scene.glb --record walk.mpg                 keeps all pictures as a video

The first page controls the camera; up to --viewers pages watch. Keys, mouse and touch are listed in the page.
Pictures are not encrypted: in untrusted networks, forward the port through ssh.
Ctrl-C ends; exit codes are those of render.";

pub const REFERENCE: &str = "Examples:
  render2mpeg reference scene.glb --frame 10 --spp 256 -o truth.exr
  render2mpeg reference scene.glb --spp 1024 -o picture.png     tone mapped for display
  render2mpeg reference scene.glb --method all-lights -o lights.exr    the light that lightcuts approximate
  render2mpeg reference scene.glb --frame 10 --center -o truth.exr     to compare with render --antialiasing off --exr DIR";

pub const COMPARE: &str = "Examples:
  render2mpeg compare frames/frame_00010.exr truth.exr          linear light
  render2mpeg compare film.mpg film.y4m --heatmap where.png     coding loss, and where it is
  render2mpeg compare frames others --json                      two folders, for other programs

render -o film.mpg --y4m film.y4m writes a film and its uncompressed frames.
To compare outlines, sample pixel centers in both: render --antialiasing off --exr frames,
and reference --frame 10 --center -o truth.exr.

SSIMULACRA 2 scores: 90 hardly distinguishable, 70 good, 50 fair.";

pub const SWEEP: &str = "Examples:
  render2mpeg sweep scene.glb                                   writes scene-sweep/sweep.html
  render2mpeg sweep scene.glb --qscale 2,16,48 --size 320x240
  render2mpeg sweep scene.glb --methods perceptual-cache,paths-16

Films are stored below the output folder while needed: long sweeps need disk space, not memory.";

pub const JOIN: &str = "Examples:
  render2mpeg join part_0-9.m2v part_10-19.m2v part_20-29.m2v -o film.mpg
  render2mpeg join part_0-9.m2v part_10-19.m2v part_20-29.m2v -o - | mpv -

Parts come from render --chunk 10 --range 0-9 etc., on any machine; each needs its report, SCENE_0-9.report.json, next to it.
Nothing is recoded: the film has the same bytes as with render --chunk 10 and no --range.";

pub const PLAN: &str = "Examples:
  render2mpeg plan scene.glb
  render2mpeg plan scene.glb --cache off --thresholds fixed:0.02    stages that these options leave out

costs, saves: fraction of a frame's CPU time that a stage takes, or that leaving it out saves. These, time and memory are
estimates. All options of render are accepted; nothing is written.";

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
                // Keep the words before two spaces, which end the command line, and before > or |, which the shell
                // handles.
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
