"""Error against CPU time: our films and Mitsuba 3, a path tracer, with and without the denoiser OIDN.

    python3 bench error SCENES [OUT] [--quick|--full] [--only NAME …] [--ours KIND …] [--size N] [--frame K]

SCENES is a folder with the scenes below, which do not ship. All surfaces are made matte (mitsuba_scene.py), so only light
transport, filters and sampling differ. Mitsuba renders the reference with a box filter over the pixel and the same
camera. References are kept in out/bench-references. OUT receives pictures, table.md and plot.png.
Quick: two of the scenes, 128x128, the first frame only, 192 paths per pixel for the reference.

    set-up    CPU seconds (user and system) before the first picture: loading, for Mitsuba also compiling; for ours, all but frames
    frame     CPU seconds of the picture; in our films the mean after the first frame
    relMSE    mean of (x - a)(x - b) / (r² + 0.01 mean(r)²); a and b are halves of the reference r, so its noise cancels
    trimmed   relMSE without the worst 0.1 % of the pixels
    FLIP      mean, of tone-mapped pictures
    mean      mean luminance relative to the reference

A second table compares CPU seconds: ours, and Mitsuba + OIDN's at the same error, with their ratio. Mitsuba's are
interpolated log-log between sample counts; a dash marks errors outside their range.

Requires numpy, pillow, OpenEXR, mitsuba, pyoidn, flip-evaluator and matplotlib from PyPI.
"""

import importlib.util
import json
import math
import os
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pairs
import presets
import tables
from running import ROOT, Failure, add_program, need_program, own_cpu, run

# Python modules, and their packages on PyPI.
PACKAGES = {
    "numpy": "numpy",
    "PIL": "pillow",
    "OpenEXR": "OpenEXR",
    "mitsuba": "mitsuba",
    "pyoidn": "pyoidn",
    "flip_evaluator": "flip-evaluator",
    "matplotlib": "matplotlib",
}
# Renders a picture with Mitsuba, and first prints the LLVM library in use where the system lists it.
PROBE = """
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
scene = mi.load_dict(mi.cornell_box())
try:
    print(*{line.split()[-1] for line in open("/proc/self/maps") if "libLLVM" in line}, flush=True)
except OSError:
    pass
mi.render(scene, spp=1).numpy()
"""
FPS = 25
# File in the folder SCENES, and the camera of our films.
SCENES = {
    "sponza-crytek": ("sponza-crytek/sponza.glb", "added_camera"),
    "conference": ("conference/conference.glb", "added_camera_walk"),
    "office": ("radiance-office/office.glb", "source_view_norm"),
    "sibenik": ("sibenik/sibenik.glb", "added_camera_walk"),
    "sponza-dabrovic": ("sponza-dabrovic/sponza.glb", "added_camera_walk"),
}
OURS = {
    "default": "",
    "good": "--samples 4",
    "final": "--samples 4 --vpls 80000 --qscale 2",
}
PATHS = [4, 16, 64]
FIRST, LATER = "first frame", "in a film"
QUICK = {"only": ["office", "sibenik"], "ours": ["default"], "size": 128, "frame": 0, "spp": 96, "passes": 1, "pairs": 5}
FULL = {"only": list(SCENES), "ours": list(OURS), "size": 256, "frame": 12, "spp": 128, "passes": 3, "pairs": 1}
# Mitsuba's suns are points in the sky.
SETTINGS = "[sun]\nangular_diameter = 0.0\n"

# A picture of a renderer: position in the film, CPU seconds of set-up and frame, and its errors.
Entry = namedtuple("Entry", "renderer place setup seconds errors")


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("scenes", type=Path, help="folder of the scenes")
    parser.add_argument("out", type=Path, nargs="?", default=ROOT / "out" / "bench-error", help="[default: out/bench-error]")
    parser.add_argument("--only", nargs="+", choices=SCENES, help="scenes [default: office, sibenik; full: all]")
    parser.add_argument("--ours", nargs="+", choices=OURS, help="settings of ours [default: default; full: all]")
    parser.add_argument("--size", type=int, help="pixels on a side [default: 128; full: 256]")
    parser.add_argument("--frame", type=int, help="the frame compared inside a film, 0 for none [default: 0; full: 12]")
    parser.add_argument("--spp", type=int, help="paths a pixel of a pass of the reference [default: 96; full: 128]")
    parser.add_argument("--passes", type=int, help="passes of each half of the reference [default: 1; full: 3]")
    parser.add_argument("--pairs", type=int, help="most turns of ours and Mitsuba [default: 5; full: 1]")
    add_program(parser)


def need_packages():
    """Checks that all packages are installed."""
    missing = [package for module, package in PACKAGES.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise Failure(f"{', '.join(missing)} missing; install: python3 -m pip install {' '.join(missing)}")


def need_llvm():
    """Checks that Mitsuba renders with the LLVM library that it finds, in another process: an old library would abort this one."""
    probe = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True)
    if probe.returncode == 0:
        return
    library = probe.stdout.strip() or os.environ.get("DRJIT_LIBLLVM_PATH") or "no LLVM library"
    lines = probe.stderr.strip().splitlines() or [f"exit code {probe.returncode}"]
    reason = next((line for line in lines if "LLVM" in line), lines[-1])[:100]
    remedy = "install a newer one, such as libllvm19, and set DRJIT_LIBLLVM_PATH to its libLLVM file"
    raise Failure(f"Mitsuba cannot render with {library} ({reason}); {remedy}")


def ours(options, scene, folder, kind):
    """Renders our film into the folder, and returns CPU seconds of set-up and frame by position."""
    words = [options.program, "render", scene, "--size", f"{options.size}x{options.size}", "--fps", FPS, "--quiet", "--overwrite"]
    words += ["--frames", options.frame + 1, "--exr", folder, "--exr-depth", "float", "-o", f"{folder}.m2v", "--report", f"{folder}.json"]
    whole = run([*words, *OURS[kind].split()]).cpu
    frames = [frame["seconds"]["total"] for frame in json.loads(Path(f"{folder}.json").read_text())["frames"]]
    later = frames[1:] and sum(frames[1:]) / len(frames[1:])
    return whole - sum(frames), {FIRST: frames[0], LATER: later}


def theirs(tracers):
    """Returns Mitsuba's pictures and CPU seconds, with and without the denoiser, by position and renderer."""
    found = {}
    for place, (tracer, _) in tracers.items():
        pictures = found[place] = []
        for spp in PATHS:
            picture, seconds = own_cpu(lambda: tracer.paths(spp, 1000))
            denoised, more = own_cpu(lambda: tracer.denoised(picture, spp))
            pictures.append((f"Mitsuba, {spp} paths", picture, seconds))
            pictures.append((f"Mitsuba, {spp} paths + OIDN", denoised, seconds + more))
    return found


def entries(options, folder, places, tracers, truth, turn):
    """Returns the entries of one round: our films by kind, and Mitsuba's pictures."""
    import path_tracer

    films, pictures = turn
    for place, frame in places.items():
        for renderer, picture, seconds in pictures[place]:
            yield Entry(renderer, place, tracers[place][1], seconds, truth[place].errors(picture))
        for kind in options.ours:
            picture = path_tracer.read_exr(folder / kind / f"frame_{frame:05}.exr")
            setup, seconds = films[kind]
            yield Entry(f"ours, {kind}", place, setup, seconds[place], truth[place].errors(picture))


def measured(name, options, budget, limit):
    """Returns the entries of a scene, a list for each round."""
    folder, scene, tracers, truth = options.prepared[name]
    places = {FIRST: 0} | ({LATER: options.frame} if options.frame else {})
    films = lambda: {kind: ours(options, scene, folder / kind, kind) for kind in options.ours}  # noqa: E731
    turns = budget.in_turns(films, lambda: theirs(tracers), options.pairs, limit)
    return [list(entries(options, folder, places, tracers, truth, turn)) for turn in turns]


def prepared(name, options):
    """Prepares a scene: matte, compiled for Mitsuba at each position, with references."""
    import mitsuba_scene
    import path_tracer

    file, camera = SCENES[name]
    folder = options.out / name
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "matte.glb"
    if not (options.scenes / file).is_file():
        raise Failure(f"{options.scenes / file} is missing; SCENES is a folder that holds {file}")
    mitsuba_scene.matte(options.scenes / file, scene)
    scene.with_suffix(".toml").write_text(SETTINGS)
    tracers, truth = {}, {}
    for place, frame in [(FIRST, 0), (LATER, options.frame)][: 2 if options.frame else 1]:
        tracers[place] = own_cpu(lambda: path_tracer.Mitsuba(scene, options.size, camera, frame / FPS))
        truth[place] = path_tracer.reference(tracers[place][0], name, scene, (camera, frame), options)
    return folder, scene, tracers, truth


def same_error(points, error):
    """Interpolates CPU seconds for an error log-log between points (seconds, error); nothing outside their range."""
    points = sorted(points)
    for (t, e), (u, f) in zip(points, points[1:]):
        if min(e, f) <= error <= max(e, f) and e != f:
            return t * (u / t) ** (math.log(e / error) / math.log(e / f))
    return None


def beside_ours(name, turns, place):
    """Returns rows for FLIP and trimmed relMSE: our seconds, Mitsuba + OIDN's at the same error, and their ratio over the rounds."""
    for entry in (entry for entry in turns[0] if entry.renderer.startswith("ours") and entry.place == place):
        cells = [name, place, entry.renderer, len(turns), f"{entry.seconds:.2f}"]
        for which in (2, 1):
            found = []
            for turn in turns:
                own = next(one for one in turn if (one.renderer, one.place) == (entry.renderer, place))
                points = [(one.seconds, one.errors[which]) for one in turn if one.place == place and "OIDN" in one.renderer]
                found.append((same_error(points, own.errors[which]), own.seconds))
            found = [(their, own) for their, own in found if their is not None]
            ratio = pairs.Spread([their / own for their, own in found]) if found else "–"
            cells += [tables.figure(found[0][0] if found else None, ".2f"), ratio]
        yield cells


def table(found):
    """Formats entries as a Markdown table."""
    titles = ["renderer", "set-up [CPU s]", "frame [CPU s]", "relMSE", "trimmed", "FLIP", "mean"]
    forms = [".2e", ".2e", ".4f", ".4f"]
    rows = [
        [one.renderer, f"{one.setup:.2f}", f"{one.seconds:.2f}", *map(tables.figure, one.errors, forms)] for one in found
    ]
    return tables.table(titles, rows)


def main(options):
    """Prints tables of each scene, and the summary against Mitsuba + OIDN."""
    presets.fill_in(options, QUICK, FULL)
    options.program = need_program(options)
    need_packages()
    need_llvm()
    import error_plot

    options.prepared = {} if options.full else {name: prepared(name, options) for name in options.only}
    found, text, summary, budget = {}, [], [], pairs.Budget(options)
    for name, share in budget.shares(options.only):
        if options.full:
            options.prepared = {name: prepared(name, options)}
        turns = measured(name, options, budget, share)
        found[name] = turns[0]
        for place in dict.fromkeys(entry.place for entry in turns[0]):
            text.append(f"### {name}, {place}\n\n{table([one for one in turns[0] if one.place == place])}\n")
            print(text[-1], flush=True)
            summary += beside_ours(name, turns, place)
        (options.out / "table.md").write_text("\n".join(text))
    titles = ["scene", "place", "renderer", "pairs", "frame [CPU s]", "same FLIP", "ratio", "same relMSE", "ratio"]
    print(tables.table(titles, summary))
    error_plot.write(found, options.out / "plot.png")
    pairs.print_trust(options)
