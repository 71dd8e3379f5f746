#!/usr/bin/env python3
"""Submit a film to OpenCue: layers light, render (one frame per chunk) and join.

    pip install opencue_pyoutline
    python3 packaging/opencue_render2mpeg.py scene.glb film.mpg --frames 250 --chunk 10 --options='--size 1280x720'

Scene, film and program need paths that are the same on all hosts.
"""

import argparse
import os
import shlex

import outline
import outline.cuerun
from outline.modules.shell import Shell


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=os.path.abspath, help="scene, .glb or .gltf")
    parser.add_argument("film", type=os.path.abspath, help="video, .mpg, .mp4, .mkv, .ts, .vob or .m2v")
    parser.add_argument("--frames", type=int, required=True, help="number of frames")
    parser.add_argument("--chunk", type=int, default=10, help="frames per chunk [default: 10]")
    parser.add_argument("--options", type=shlex.split, default=[], help="film options, separated by spaces")
    parser.add_argument("--program", default="render2mpeg", help="path of the program, or its name in PATH")
    parser.add_argument("--print", action="store_true", help="print the job specification; submit nothing")
    return parser.parse_args()


def film_outline(job):
    """Outline of a film. Cuebot replaces #IFRAME# by the frame number, which is the chunk index."""
    parts = f"{job.film}.parts"
    chunks = -(-job.frames // job.chunk)
    files = [f"{parts}/part_{chunk}.m2v" for chunk in range(chunks)]
    film_options = [job.scene, "--frames", str(job.frames), "--light", f"{parts}/film.light", *job.options]
    os.makedirs(parts, exist_ok=True)

    film = outline.Outline(os.path.splitext(os.path.basename(job.film))[0], name_unique=True)
    light = layer("light", "0", [job.program, "plan", *film_options])
    render = layer("render", f"0-{chunks - 1}", [
        job.program, "render", *film_options, "--chunk", str(job.chunk), "--chunk-index", "#IFRAME#",
        "-o", f"{parts}/part_#IFRAME#.m2v", "-q", "--resume", "--overwrite",
    ])
    join = layer("join", "0", [job.program, "join", *files, "-o", job.film, "--overwrite"])
    render.depend_all(light)
    join.depend_all(render)
    for stage in (light, render, join):
        film.add_layer(stage)
    return film


def layer(name, frames, command):
    """Layer of one command. Without pycuerun, hosts run it in a shell and need no PyOutline."""
    return Shell(name, command=[shlex.quote(word) for word in command], range=frames, threadable=True)


def main():
    job = arguments()
    film = film_outline(job)
    if job.print:
        print(outline.cuerun.OutlineLauncher(film).serialize(use_pycuerun=False))
    else:
        outline.cuerun.launch(film, use_pycuerun=False)


if __name__ == "__main__":
    main()
