#!/usr/bin/env python3
"""Whole-frame CPU time of the uncoupled film over that of the film as people render it, as a Markdown table.

    python3 tests/coupling_speed.py SCENE.glb … [--size 256x256] [--frames 24] [--qscale 2,16,48] [--program PATH]

Uncoupled: --thresholds fixed:0.02 --shading full, else the same settings. Both run in turns, so that their ratio is trusted
more than their seconds. Frames 0 to 2 do not count. "difference" is the PSNR between the two films before coding.
"""

import argparse
import json
import math
import subprocess
import tempfile
from pathlib import Path

UNCOUPLED = ["--thresholds", "fixed:0.02", "--shading", "full"]
FIRST = 3


def film(program, scene, folder, arguments):
    """Frames of the report, and luma of the frames before coding."""
    video, raw, report = (folder / name for name in ("film.m2v", "film.y4m", "film.json"))
    command = [program, "render", scene, "-o", video, "--y4m", raw, "--report", report, "--quiet", *arguments]
    subprocess.run(command, check=True)
    return json.loads(report.read_text())["frames"], raw.read_bytes()


def lumas(raw, width, height):
    """Luma planes of a 4:2:0 YUV4MPEG2 file."""
    at = raw.index(b"\n") + 1
    while at < len(raw):
        start = raw.index(b"\n", at) + 1
        yield raw[start : start + width * height]
        at = start + width * height + 2 * ((width + 1) // 2) * ((height + 1) // 2)


def psnr(a, b):
    squares = sum((x - y) ** 2 for x, y in zip(a, b))
    return 10 * math.log10(255**2 * len(a) / squares) if squares else math.inf


def flicker(planes):
    """Mean change of luma from frame to frame."""
    changes = [sum(abs(x - y) for x, y in zip(a, b)) / len(a) for a, b in zip(planes, planes[1:])]
    return sum(changes) / len(changes)


def mean(frames, figure):
    values = [figure(frame) for frame in frames[FIRST:]]
    values = [value for value in values if value is not None]
    return sum(values) / len(values) if values else float("nan")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--qscale", default="2,16,48")
    parser.add_argument("--program", default="target/release/render2mpeg")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    ratios = {}
    print("| scene | quantiser | uncoupled, CPU s | coupled | ratio | bits | PSNR of coding | difference | flicker | carried | audits within |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for scene in options.scenes:
        for qscale in options.qscale.split(","):
            common = ["--size", options.size, "--frames", str(options.frames), "--qscale", qscale]
            with tempfile.TemporaryDirectory() as folder:
                runs = [film(options.program, scene, Path(folder), common + more) for more in (UNCOUPLED, [])]
            (alone, coupled) = (frames for frames, _ in runs)
            planes = [list(lumas(raw, width, height)) for _, raw in runs]
            seconds = [mean(frames, lambda frame: frame["seconds"]["total"]) for frames in (alone, coupled)]
            bits = [sum(frame["bits"] for frame in frames) for frames in (alone, coupled)]
            coding = [mean(frames, lambda frame: frame["psnr_y"]) for frames in (alone, coupled)]
            flickers = [flicker(film) for film in planes]
            apart = psnr(b"".join(planes[0]), b"".join(planes[1]))
            ratios.setdefault(qscale, []).append(seconds[0] / seconds[1])
            print(
                f"| {Path(scene).stem} | {qscale} | {seconds[0]:.3f} | {seconds[1]:.3f} | {seconds[0] / seconds[1]:.2f} "
                f"| {100 * (bits[1] / bits[0] - 1):+.1f} % | {coding[1] - coding[0]:+.2f} dB | {apart:.1f} dB "
                f"| {100 * (flickers[1] / flickers[0] - 1):+.1f} % | {100 * mean(coupled, lambda f: f['carried_share']):.0f} % "
                f"| {100 * mean(coupled, lambda f: f['audit_carried_within']):.0f} % |",
                flush=True,
            )
    for qscale, all_ratios in ratios.items():
        product = math.prod(all_ratios)
        print(f"\nGeometric mean at quantiser {qscale}: {product ** (1 / len(all_ratios)):.2f}")


if __name__ == "__main__":
    main()
