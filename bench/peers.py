"""CPU seconds and memory of stills of glTF models, compared with Cycles at equal FLIP, F3D and three.js.

Each program renders each model at --size, with the same camera. Files with lamps are listed without figures.
Ours and Cycles have the same studio, tone curve and unlimited bounces, but glass and filters of pixels differ. Each of the two
is therefore compared with its own converged picture:

    ours     default still; reference: `render2mpeg reference --spp PATHS` and OIDN
    Cycles   N paths per pixel and OIDN, N the smallest power of two whose FLIP is at most ours; reference: PATHS and OIDN

F3D and three.js are rasterizers without global illumination, by OSMesa and SwiftShader. They have no FLIP.

    CPU s    user and system time of the whole process from its start: median of --rounds, in alternation
    MB       peak memory; of Chromium the peak of its processes' proportional set sizes, without node

Requires bpy, f3d, numpy, pillow, OpenEXR, flip-evaluator and pyoidn from PyPI, node with three and playwright-core, and Chromium, on Linux.
"""

import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import models
from fidelity import flip
from gltf import camera_of
from running import ROOT, Failure, add_program, need_installed, need_program
from tables import header, row

# Python modules, and their packages on PyPI.
PACKAGES = {
    "bpy": "bpy",
    "f3d": "f3d",
    "numpy": "numpy",
    "PIL": "pillow",
    "OpenEXR": "OpenEXR",
    "flip_evaluator": "flip-evaluator",
    "pyoidn": "pyoidn",
}
HERE = ROOT / "bench"
# Paths per pixel of Cycles at equal FLIP.
CYCLES_PATHS = [1, 2, 4, 8, 16, 32, 64, 128]
# Frame with our albedo.
ALBEDO = "frame_00000.exr"
# Interval between two looks at Chromium's processes [s].
INTERVAL = 0.02
# Small program that runs another. Linux counts the memory of the starting process in the peak of a started one.
MEASURE = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss)
sys.exit(code)
"""


def add_options(command):
    """Adds the options of this measurement."""
    command.add_argument("models", nargs="+", type=Path, metavar="FILE|FOLDER", help="glTF files, or folders of them")
    command.add_argument("--size", default="512x512", help="size of the pictures, 512x512 by default")
    command.add_argument("--rounds", type=int, default=3, help="runs of each program, 3 by default")
    command.add_argument("--paths", type=int, default=256, help="paths per pixel of references, 256 by default")
    command.add_argument("--output", type=Path, default=ROOT / "out" / "bench-peers", help="folder of pictures and references")
    command.add_argument("--modules", type=Path, default=Path("node_modules"), help="folder of the packages of node")
    command.add_argument("--chromium", type=Path, default=Path("/usr/bin/chromium"), help="the browser")
    add_program(command)


def main(options):
    """Compares the programs, model by model."""
    missing = [package for module, package in PACKAGES.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise Failure(f"{', '.join(missing)} missing; install: python3 -m pip install {' '.join(missing)}")
    need_installed("node")
    options.program = need_program(options)
    options.output.mkdir(parents=True, exist_ok=True)
    files = sorted(file for path in options.models for file in models.scenes_in(path))
    both = ["CPU s", "MB"]
    print(header(["Model", *both, "FLIP", "Cycles paths", *both, "FLIP", "F3D " + both[0], "MB", "three.js " + both[0], "MB"]))
    for name, file in zip(models.names(files), files):
        try:
            print(row([name, *compared(options, name, file.resolve())]), flush=True)
        except Failure as failure:
            print(f"{name}: {failure}", flush=True)


def compared(options, name, file):
    """Returns the cells of a model's row."""
    folder = options.output / name
    folder.mkdir(exist_ok=True)
    job = {"file": str(file), **view_of(options, file, folder)}
    reference, cycles_reference = references(options, job, folder)

    ours = measured_still(options, file, folder / "ours.png")
    own_error = flip(reference, picture(folder / "ours.png"))[1]
    for paths in CYCLES_PATHS:
        cycles = measured_cycles(job, paths, folder / "cycles.exr")
        cycles_error = flip(cycles_reference, displayed(linear(folder / "cycles.exr"), folder / "cycles.exr"))[1]
        if cycles_error <= own_error:
            break
    f3d, three = measured_f3d(job, folder / "f3d.png"), measured_three(options, job, folder / "three.png")

    runs = [[ours, cycles, f3d, three]]
    for _ in range(1, options.rounds):
        runs.append([measured_still(options, file, folder / "ours.png"), measured_cycles(job, paths, folder / "cycles.exr")])
        runs[-1] += [measured_f3d(job, folder / "f3d.png"), measured_three(options, job, folder / "three.png")]
    medians = [[statistics.median(figures) for figures in zip(*of_program)] for of_program in zip(*runs)]
    ours, cycles, f3d, three = ([f"{cpu:.1f}", f"{memory:.0f}"] for cpu, memory in medians)
    reached = str(paths) if cycles_error <= own_error else f"over {paths}"
    return [*ours, f"{own_error:.4f}", reached, *cycles, f"{cycles_error:.4f}", *f3d, *three]


def view_of(options, file, folder):
    """Returns the size and the camera of our still, in three.js's format. A coarse frame with albedo has the same camera."""
    import OpenEXR

    words = [options.program, "render", file, "-o", folder / "view.m2v", "--size", options.size, "--overwrite", "--frames", "1"]
    words += ["--exr", folder, "--aov", "albedo", "--samples", "4", "--vpls", "100"]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Failure((done.stderr.strip() or f"exit code {done.returncode}").splitlines()[-1])
    if "a studio lights it" not in done.stderr:
        raise Failure("the file has lamps")
    with OpenEXR.File(str(folder / ALBEDO)) as frame:
        camera_from_world, projection = camera_of(frame.header())
    width, height = map(int, options.size.split("x"))
    return {"width": width, "height": height, "camera_from_world": camera_from_world, "projection": projection}


def references(options, job, folder):
    """Returns the converged pictures of ours and of Cycles. Those of an earlier run are kept."""
    from fidelity_scene import denoised

    ours, cycles = folder / f"reference-{options.paths}.exr", folder / f"cycles-reference-{options.paths}.exr"
    if not ours.is_file():
        words = ["reference", job["file"], "-o", ours, "--size", options.size, "--spp", options.paths, "--seed", 2, "--quiet"]
        finished([options.program, *words])
    if not cycles.is_file():
        # The seed differs from the seed of the pictures that are compared with it.
        measured_cycles({**job, "seed": 1}, options.paths, cycles)
    noisy, albedo = linear(ours), linear(folder / ALBEDO, "albedo.")
    return displayed(denoised(noisy, albedo), ours), displayed(linear(cycles), cycles)


def measured_still(options, file, path):
    """Renders our still. Returns CPU seconds and peak memory [MB]."""
    return finished([options.program, "still", file, "-o", path, "--size", options.size, "--overwrite", "--quiet"])


def measured_cycles(job, paths, path):
    """Renders with Cycles, as linear OpenEXR. Returns CPU seconds and peak memory [MB]."""
    settings = {"seed": 0, **job, "paths": paths, "output": str(path.resolve())}
    return finished([sys.executable, HERE / "cycles_still.py", json.dumps(settings)])


def measured_f3d(job, path):
    """Renders with F3D. Returns CPU seconds and peak memory [MB]."""
    return finished([sys.executable, HERE / "f3d_still.py", json.dumps({**job, "output": str(path.resolve())})])


def measured_three(options, job, path):
    """Renders with three.js. Returns CPU seconds of Chromium's processes and their peak memory [MB]."""
    jobs = path.with_suffix(".json")
    jobs.write_text(json.dumps([{**job, "room": True, "output": str(path.resolve())}]), encoding="utf-8")
    environment = {**os.environ, "MODULES": str(options.modules.resolve()), "CHROMIUM": str(options.chromium)}
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(["node", HERE / "gltf_views.mjs", jobs], stdout=output, env=environment)
        found = watched(process)
        output.seek(0)
        results = output.read().decode().splitlines()
    if process.returncode != 0 or not results:
        raise Failure("three.js ended with an error; see above")
    if failure := json.loads(results[0]).get("failure"):
        raise Failure(f"three.js: {failure}")
    return found


def watched(process):
    """Waits for the end of a process. Returns CPU seconds of its descendants and their peak memory [MB]."""
    ticks, largest = {}, 0
    while process.poll() is None:
        alive = descendants(process.pid)
        ticks.update({pid: fields[11] + fields[12] for pid, fields in alive.items()})
        largest = max(largest, sum(proportional_set(pid) for pid in alive))
        time.sleep(INTERVAL)
    return sum(ticks.values()) / os.sysconf("SC_CLK_TCK"), largest / 1e6


def descendants(ancestor):
    """Returns the numbers in /proc/PID/stat, from the parent's id, of all processes below a process."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                # The name in parentheses can contain spaces.
                found[int(entry.name)] = [0, *map(int, (entry / "stat").read_text().rpartition(")")[2].split()[1:])]
            except OSError:
                continue
    below, size = {ancestor}, 0
    while len(below) > size:
        size = len(below)
        below |= {pid for pid, fields in found.items() if fields[1] in below}
    return {pid: found[pid] for pid in below - {ancestor} if pid in found}


def proportional_set(pid):
    """Returns the memory of a process in bytes, in which shared pages are divided among their processes."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def finished(words):
    """Runs a program. Returns its CPU seconds and peak memory [MB]; a failure contains the last line of its messages."""
    with tempfile.TemporaryFile("w+") as errors:
        settings = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": errors, "text": True, "check": False}
        done = subprocess.run([sys.executable, "-S", "-c", MEASURE, *map(str, words)], **settings)
        errors.seek(0)
        message = errors.read().strip().splitlines()
    if done.returncode != 0:
        raise Failure(f"{Path(words[1]).name} failed: {(message or [f'exit code {done.returncode}'])[-1]}")
    cpu, memory = map(float, done.stdout.split())
    # Linux counts memory in KiB.
    return cpu, memory * 1024 / 1e6


def picture(path):
    """Returns a picture as an array of values 0…1."""
    import numpy as np
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB"), np.float32) / 255


def linear(path, layer=""):
    """Returns the red, green and blue channels of an OpenEXR picture."""
    import numpy as np
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.stack([file.channels()[layer + name].pixels for name in "RGB"], axis=-1).astype(np.float64)


def displayed(radiance, path):
    """Returns a linear picture with our tone curve and, like our stills, eight bits; keeps it as PNG next to the path."""
    import numpy as np
    from PIL import Image

    Image.fromarray(np.round(255 * filmic(radiance)).astype(np.uint8)).save(path.with_suffix(".png"))
    return picture(path.with_suffix(".png"))


def filmic(radiance):
    """Returns display values of our default tone curve, perceptual/src/tonemap.rs, and of the transfer curve of sRGB."""
    import numpy as np

    def unscaled(x):
        return (x * (0.15 * x + 0.05) + 0.2 * 0.024) / (x * (0.15 * x + 0.5) + 0.2 * 0.3) - 0.024 / 0.3

    value = np.clip(unscaled(3.1606977517308 * np.maximum(radiance, 0)) / unscaled(11.2), 0, 1)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
