"""Bits at equal quality and speed of our encoder, against the installed MPEG-2 encoders.

    python3 bench encoders [CLIP.y4m …]                      bits and speed of a few encoders
    python3 bench encoders --full                            every table of mpeg2enc/README.md
    python3 bench encoders --full CLIP.y4m … [--metric ssim | --rate | --tools | --speed]     one of them

Without CLIPs, three shipped scenes are rendered once, into out/bench-clips: 12 frames of 256x256, or 30 and 60 of 352x288.
--generator PROGRAM adds six clips to --full, by `python3 PROGRAM FOLDER CLIP --frames N`. A clip is YUV4MPEG2, 4:2:0.
NAME.mvp and NAME.mvn, optional files next to NAME.y4m, contain exact motion to the previous and next frame:
pairs of little-endian i16 in 1/64 pixel.

Bits: BD-rate against ffmpeg with two B pictures (`-g 15 -bf 2`), of constant rates against its default, of tools against
the encoder with all tools. A negative value means fewer bits. Quality is luma PSNR or SSIM by `render2mpeg compare`.
Speed: CPU seconds of whole programs on one thread, alternating with ffmpeg's default, with clips repeated to 300 frames, at
quantiser_scale 16.

The row "y262, published" has figures of rwillenbacher/y262 f60850e (`-quality 50 -noaq`) from another machine: five points
over 60 frames of clips with these names.

The measurement requires ffmpeg. Missing programs of this project are built first; --full also updates the examples mpeg2enc
and clips. mjpegtools is optional.
"""

import concurrent.futures
import math
import sys
import tempfile
from pathlib import Path

import bd_rate
import clips
import encoder_commands as commands
import figures
import pairs
import presets
import tables
from running import Failure, add_program, built_program, need_built, need_files, need_installed, run

QUICK = {"points": [1, 8, 24], "rates": [500, 2000, 8000], "size": "256x256", "frames": [12], "pairs": 5}
FULL = {"points": [2, 4, 8, 16, 31], "rates": [500, 1000, 2000, 4000, 8000], "size": "352x288", "frames": [30, 60], "pairs": 3}
QUICK_ENCODERS = ["ffmpeg, slowest", "ours, fast", "ours, fast, searched", "ours, balanced", "ours, best"]
SPEED_POINT, SPEED_FRAMES = commands.Point(8), 300


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("clips", nargs="*", metavar="CLIP", help="clips; rendered if there are none")
    parser.add_argument("--encoder", type=Path, help="our encoder [default: target/release/examples/mpeg2enc]")
    parser.add_argument("--only", default="", help="encoders whose name has this in it, and the anchor")
    parser.add_argument("--metric", choices=["psnr", "ssim"], default="psnr", help="quality [default: psnr]")
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--rate", action="store_true", help="constant rates of 0.5 to 8 Mbit/s")
    kind.add_argument("--tools", action="store_true", help="ours at its best, without one tool after the other")
    kind.add_argument("--speed", action="store_true", help="CPU seconds of the first clip instead of bits")
    parser.add_argument("--generator", help="full: a program that renders six more clips")
    parser.add_argument("--pairs", type=int, help="most pairs for the speed of an encoder [default: 5; full: 3]")
    parser.add_argument("--jobs", type=int, default=2, help="streams coded at once, but for speed [default: 2]")
    add_program(parser)


def encode(encoder, clip, point, out):
    """Encodes a clip, and returns the CPU seconds of all its programs."""
    return sum(run(step.words, stdin=step.stdin).cpu for step in encoder.steps(clip, point, out))


def rate_and_quality(options, encoder, clip, point):
    """Returns rate [kbit/s] and qualities of a stream; nothing if it cannot be made."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.m2v"
        try:
            encode(encoder, clip, point, out)
        except Failure as failure:
            print(f"left out: {failure}", file=sys.stderr)
            return None
        likeness = figures.compare(options.program, out, clip.path)
        quality = {"psnr": likeness.psnr, "ssim": -10 * math.log10(max(1 - likeness.ssim, 1e-9))}
        return out.stat().st_size * 8 * clip.fps / clip.frames / 1000, quality


def chosen(options, found):
    """Returns the anchor, and the requested encoders including it."""
    anchor, encoders = found
    quick = not options.full and not options.only and anchor == commands.TWO_B
    wanted = lambda name: name in QUICK_ENCODERS if quick else options.only in name  # noqa: E731
    return anchor, {name: encoder for name, encoder in encoders.items() if name == anchor or wanted(name)}


def curves(options, encoders, clip, points, pool):
    """Returns the points (rate, qualities) of a clip, by encoder."""
    jobs = [(options, encoder, clip, point) for encoder in encoders.values() for point in points]
    found = list(pool.map(lambda job: rate_and_quality(*job), jobs))
    parts = [found[i : i + len(points)] for i in range(0, len(found), len(points))]
    return {name: [point for point in part if point] for name, part in zip(encoders, parts)}


def bits(options, some, metrics, rate=False, tools=False):
    """Prints the BD-rates of all encoders, a table for each metric."""
    values = options.rates if rate else options.points
    points = [commands.Point(value, rate) for value in values]
    found = commands.all_tools(options.encoder) if tools else commands.all_encoders(options.encoder, rate)
    anchor, encoders = chosen(options, found)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        measured = [curves(options, encoders, clip, points, pool) for clip in some]
    for metric in metrics:
        rows = []
        for name in encoders:
            of = lambda one, which: [(rate, quality[metric]) for rate, quality in one[which]]  # noqa: E731
            differences = [bd_rate.bd_rate(of(one, anchor), of(one, name)) for one in measured]
            cells = [*differences, sum(differences) / len(differences)]
            rows.append([name, *(tables.figure(cell, "+.1f") for cell in cells)])
        if options.full and metric == "psnr" and not rate and not tools:
            rows += published([clip.name for clip in some])
        print(f"\nBD-rate ({metric}) against {anchor}, percent\n")
        print(tables.table(["encoder", *(clip.name for clip in some), "mean"], rows), flush=True)


def published(names):
    """Returns the rows of encoders that are not run here, if their figures for all of these clips are known."""
    for name, known in commands.PUBLISHED.items():
        if all(clip in known for clip in names):
            cells = [known[clip] for clip in names]
            yield [name, *(tables.figure(cell, "+.1f") for cell in [*cells, sum(cells) / len(cells)])]


def speed(options, clip, budget):
    """Prints frames per CPU second, and the ratio to ffmpeg's default, measured alternately."""
    _, encoders = chosen(options, commands.all_encoders(options.encoder, False))
    base = commands.Ffmpeg("")
    with tempfile.TemporaryDirectory() as folder:
        long, out = clip.repeated(SPEED_FRAMES, folder), Path(folder) / "out.m2v"
        work = lambda encoder: lambda: encode(encoder, long, SPEED_POINT, out)  # noqa: E731
        print(f"\nFrames a CPU second, {long.frames} frames of {clip.name}, and times those of {commands.DEFAULT}\n")
        print(tables.header(["encoder", "pairs", "frames/s", "times ffmpeg"]))
        for (name, encoder), share in budget.shares(encoders.items()):
            found = budget.in_turns(work(base), work(encoder), options.pairs, share)
            ratio = pairs.Spread([theirs / own for theirs, own in found])
            rate = long.frames / pairs.Spread([own for _, own in found]).median
            print(tables.row([name, len(found), f"{rate:.0f}", ratio]), flush=True)


def made_clips(options, frames):
    """Returns sets of clips: the generator's, if any, and the shipped scenes'."""
    made = [clips.generated(options.generator, frames)] if options.full and options.generator else []
    return [*made, clips.shipped(options.size, frames, options.full)]


def everything(options):
    """Makes the clips, and prints every table."""
    short, long = (made_clips(options, frames) for frames in options.frames)
    for some in short:
        print(f"\n## {len(some)} clips of {some[0].frames} frames", flush=True)
        bits(options, some, ["psnr", "ssim"])
        bits(options, some, ["psnr"], rate=True)
        bits(options, some, ["psnr"], tools=True)
    for some in long:
        print(f"\n## {len(some)} clips of {some[0].frames} frames: groups of 60", flush=True)
        options.only = "N=60"
        bits(options, some, ["psnr"])
    options.only = ""
    speed(options, short[0][0], pairs.Budget(options))


def main(options):
    """Prints one table, the quick tables, or all."""
    presets.fill_in(options, QUICK, FULL)
    need_installed("ffmpeg")
    need_files(options.clips)
    options.program = built_program(options)
    if options.encoder:
        need_built(options.encoder, "cargo build --release --package mpeg2enc --example mpeg2enc")
    else:
        options.encoder = clips.example("mpeg2enc", "mpeg2enc", options.full)
    single = options.clips or options.rate or options.tools or options.speed or options.metric != "psnr"
    if options.full and not single:
        return everything(options)
    some = [clips.Clip(path) for path in options.clips] or made_clips(options, options.frames[0])[0]
    budget = pairs.Budget(options)
    if not options.speed:
        bits(options, some, [options.metric], options.rate, options.tools)
    if options.speed or not options.full and not (options.rate or options.tools):
        speed(options, some[0], budget)
    pairs.print_trust(options)
