#!/usr/bin/env python3
"""Error against CPU time: films of ours beside Mitsuba 3, a path tracer, with and without Intel's denoiser OIDN.

    python3 tests/error_over_time.py SCENES OUT [--only NAME …] [--ours KIND …] [--size 256] [--frame 12]

SCENES is a folder with the scenes below, which do not ship. All surfaces are made matte (mitsuba_scene.py), so only light
transport, filters and sampling differ. The reference is Mitsuba's with as many paths as --spp and --passes say, through the
same camera and a box filter over the pixel. OUT gets pictures, references (kept, and not made again), table.md and plot.png.

For each renderer the table has:

    set-up    CPU seconds (user and system) before the first picture: loading, and for Mitsuba compiling; for ours all but frames
    frame     CPU seconds of the picture; of a film of ours the mean after its first frame
    relMSE    mean of (x - a)(x - b) / (r² + 0.01 mean(r)²); a and b are halves of the reference r, so its noise drops out
    trimmed   the same without the worst 0.1 % of the pixels
    FLIP      mean, of tone-mapped pictures
    mean      mean luminance over that of the reference

Needs numpy, pillow, OpenEXR, mitsuba, pyoidn, flip-evaluator and matplotlib from PyPI, and ours: `cargo build --release`,
or the program that RENDER2MPEG names.
"""

import argparse
import json
import os
import resource
import subprocess
from pathlib import Path

import flip_evaluator
import matplotlib
import mitsuba as mi
import numpy as np
import OpenEXR
import pyoidn

mi.set_variant("llvm_ad_rgb")
import mitsuba_scene  # noqa: E402  needs the variant

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import NullFormatter  # noqa: E402

PROGRAM = os.environ.get("RENDER2MPEG", "target/release/render2mpeg")
FPS = 25
# File below SCENES, and the camera that ours takes.
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
# Mitsuba's suns are points in the sky.
SETTINGS = "[sun]\nangular_diameter = 0.0\n"
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def timed(work, who=resource.RUSAGE_SELF):
    """What `work` returns, and the CPU seconds that it takes."""
    cpu = lambda: sum(resource.getrusage(who)[:2])  # noqa: E731
    begin = cpu()
    value = work()
    return value, cpu() - begin


class Mitsuba:
    """A scene of Mitsuba at one time, compiled."""

    def __init__(self, path, size, camera, time):
        self.scene = mitsuba_scene.load(path, (size, size), camera, time)
        # Albedo and normals, as OIDN wants them.
        self.guides = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
        self.denoised(self.paths(4, 1), 4)

    def paths(self, spp, seed):
        return np.array(mi.render(self.scene, spp=spp, seed=seed), np.float32)[..., :3]

    def denoised(self, picture, spp):
        guides = np.array(mi.render(self.scene, integrator=self.guides, spp=min(spp, 16), seed=77), np.float32)[..., -6:]
        color, albedo, normal = (np.ascontiguousarray(x) for x in (picture, guides[..., :3], guides[..., 3:]))
        return pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True)


class Reference:
    """Two independent halves of a converged picture."""

    def __init__(self, halves):
        self.halves = [half.astype(float) for half in halves]
        self.whole = sum(self.halves) / 2
        self.mean = (self.whole @ LUMINANCE).mean()

    def tone_mapped(self, picture):
        exposure = 0.18 / np.exp(np.log(self.whole @ LUMINANCE + 1e-6).mean())
        light = np.clip(picture * exposure, 0, None)
        light = np.clip(1.6 * light / (1 + light), 0, 1)
        return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)

    def errors(self, picture):
        """relMSE, the same trimmed, FLIP, ratio of means."""
        a, b = self.halves
        squares = ((picture - a) * (picture - b) / (self.whole**2 + 0.01 * self.mean**2)).mean(axis=-1)
        sorted_squares = np.sort(squares.ravel())
        trimmed = sorted_squares[: -max(1, sorted_squares.size // 1000)].mean()
        flip = flip_evaluator.evaluate(self.tone_mapped(self.whole), self.tone_mapped(picture), "LDR")[1]
        return squares.mean(), trimmed, flip, (picture @ LUMINANCE).mean() / self.mean


def read_exr(path):
    channels = OpenEXR.File(str(path)).channels()
    picture = channels["RGB"].pixels if "RGB" in channels else channels["RGBA"].pixels[..., :3]
    return picture.astype(float)


def reference(mitsuba, path, arguments):
    if not path.exists():
        halves = [0, 0]
        for k in range(2 * arguments.passes):
            halves[k % 2] = halves[k % 2] + mitsuba.paths(arguments.spp, 1 + k) / arguments.passes
        np.save(path, np.array(halves, np.float32))
    return Reference(np.load(path))


def ours(scene, folder, options, arguments):
    """Set-up, then first frame and, in a film, frame --frame: picture and CPU seconds of each."""
    words = [PROGRAM, "render", str(scene), "--size", f"{arguments.size}x{arguments.size}", "--fps", str(FPS), "--quiet"]
    words += ["--frames", str(arguments.frame + 1), "--exr", str(folder), "-o", f"{folder}.m2v", "--report", f"{folder}.json"]
    _, whole = timed(lambda: subprocess.run([*words, *options.split()], check=True), resource.RUSAGE_CHILDREN)
    frames = json.loads(Path(f"{folder}.json").read_text())["frames"]
    seconds = [frame["seconds"]["total"] for frame in frames]
    picture = lambda n: read_exr(folder / f"frame_{n:05}.exr")  # noqa: E731
    return whole - sum(seconds), (picture(0), seconds[0]), (picture(arguments.frame), float(np.mean(seconds[1:])))


def measured(name, arguments):
    """Rows (renderer, place, CPU seconds of set-up and frame, errors) of a scene."""
    file, camera = SCENES[name]
    folder = arguments.out / name
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "matte.glb"
    mitsuba_scene.matte(arguments.scenes / file, scene)
    (folder / "matte.toml").write_text(SETTINGS)
    truth, rows = {}, []
    for place, frame in [("first frame", 0), ("in a film", arguments.frame)]:
        mitsuba, setup = timed(lambda: Mitsuba(scene, arguments.size, camera, frame / FPS))
        truth[place] = reference(mitsuba, folder / f"reference_{arguments.size}_{frame}.npy", arguments)
        for spp in PATHS:
            picture, seconds = timed(lambda: mitsuba.paths(spp, 1000))
            rows.append((f"Mitsuba, {spp} paths", place, (setup, seconds), truth[place].errors(picture.astype(float))))
            denoised, more = timed(lambda: mitsuba.denoised(picture, spp))
            errors = truth[place].errors(denoised.astype(float))
            rows.append((f"Mitsuba, {spp} paths + OIDN", place, (setup, seconds + more), errors))
    for kind in arguments.ours:
        setup, *frames = ours(scene, folder / kind, OURS[kind], arguments)
        for place, (picture, seconds) in zip(truth, frames):
            rows.append((f"ours, {kind}", place, (setup, seconds), truth[place].errors(picture)))
    return rows


def table(rows):
    lines = ["| renderer | set-up [CPU s] | frame [CPU s] | relMSE | trimmed | FLIP | mean |", "| --- |" + " ---: |" * 6]
    for renderer, _, (setup, seconds), (relative, trimmed, flip, mean) in rows:
        times = f"{setup:.2f} | {seconds:.2f}"
        lines.append(f"| {renderer} | {times} | {relative:.2e} | {trimmed:.2e} | {flip:.4f} | {mean:.4f} |")
    return "\n".join(lines)


def plot(found, path):
    figure, axes = plt.subplots(2, len(found), figsize=(4 * len(found), 7), squeeze=False, sharey=True)
    for column, (name, rows) in enumerate(found.items()):
        for row, place in enumerate(["first frame", "in a film"]):
            at = axes[row][column]
            for label, belongs in [
                ("Mitsuba", lambda r: r.startswith("Mitsuba") and "OIDN" not in r),
                ("Mitsuba + OIDN", lambda r: "OIDN" in r),
                ("ours", lambda r: r.startswith("ours")),
            ]:
                points = [(max(time[1], 0.01), e[2]) for renderer, p, time, e in rows if p == place and belongs(renderer)]
                at.loglog(*zip(*points), "o-", label=label)
            at.set(title=f"{name}, {place}", xlabel="CPU s", ylabel="FLIP")
            at.grid(True, which="both", alpha=0.3)
            at.xaxis.set_minor_formatter(NullFormatter())
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--ours", nargs="+", choices=OURS, default=list(OURS))
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--frame", type=int, default=12, help="the frame that is compared inside a film")
    parser.add_argument("--spp", type=int, default=128, help="paths a pixel of each pass of the reference")
    parser.add_argument("--passes", type=int, default=3, help="passes of each half of the reference")
    arguments = parser.parse_args()
    found, text = {}, []
    for name in arguments.only:
        rows = found[name] = measured(name, arguments)
        for place in ["first frame", "in a film"]:
            text.append(f"### {name}, {place}\n\n{table([row for row in rows if row[1] == place])}\n")
        (arguments.out / "table.md").write_text("\n".join(text))
        print("\n".join(text[-2:]), flush=True)
    plot(found, arguments.out / "plot.png")


if __name__ == "__main__":
    main()
