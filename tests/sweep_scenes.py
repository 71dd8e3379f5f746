#!/usr/bin/env python3
"""Error against run time for the shipped scenes and, where it is there, Sponza: makes all that lies in docs/sweep.

Run from the repository's root: tests/sweep_scenes.py [--page-only] [SPONZA.gltf]

Sweeps stay in out/sweeps, and one that is there is not made again: remove the folder for figures of a new build. With
--page-only none is made, and the page shows those that are there. Sponza does not ship: the first of these that exists is
taken, and without any the page says that it is missing.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

DOCS = Path("docs/sweep")
# Where the sweeps lie; what is there is not swept again.
SWEPT = Path("out/sweeps")
# What is run: this workspace's own build, unless another is named.
PROGRAM = os.environ.get("RENDER2MPEG", "cargo run --release --quiet --").split()
SPONZA = ["../shared/scenes/sponza-dabrovic", "../shared/scenes/sponza-crytek"]
SMALL = "--size 96x96 --frames 4 --vpls 1000 --methods paper,codec"
LARGE = (
    "--size 160x160 --frames 5 --methods "
    "paper,perceptual,codec,calibrated,perceptual-cache,codec-cache,calibrated-cache,paths-4,paths-16,paths-64"
)
# Name, options beside the defaults, what is to be seen.
SCENES = [
    ("cornell", LARGE, "a box with moving blocks: matte surfaces, one lamp, light that changes slowly"),
    ("atrium", SMALL, "a courtyard under sun and sky, with fine detail"),
    ("nave", SMALL, "a church that is lit through stained glass; only the camera moves"),
    ("conference", SMALL, "a room of many parts below six lamps"),
    ("sponza", SMALL, "an atrium of columns and arches, through which only the camera moves"),
]
PLOTS = [("decoded_psnr", "after decoding"), ("rendered_error", "before compression")]


def scene_file(name):
    """The scene, or nothing where it is not there."""
    if name != "sponza":
        return Path(f"scenes/{name}/{name}.glb")
    named = [word for word in sys.argv[1:] if not word.startswith("--")]
    for folder in map(Path, named or SPONZA):
        files = [folder] if folder.is_file() else sorted([*folder.glob("*.glb"), *folder.glob("*.gltf")])
        if files:
            return files[0]
    return None


def section(name, options, about):
    """Sweeps a scene; its part of the page."""
    path = scene_file(name)
    if path is None:
        return f"## {name}\n\nNot made: the scene was not there.\n"
    shown = path if name != "sponza" else "SPONZA.glb"
    words = f"sweep {shown} {options}".split()
    folder = SWEPT / name
    if not (folder / "sweep.json").exists():
        if "--page-only" in sys.argv:
            return f"## {name}\n\nNot swept yet.\n"
        subprocess.run([*PROGRAM, "sweep", str(path), *options.split(), "--quiet", "-o", str(folder)], check=True)
    swept = json.loads((folder / "sweep.json").read_text())
    for plot, _ in PLOTS:
        shutil.copy(folder / "plots" / f"{plot}.svg", DOCS / f"{name}_{plot}.svg")
    settings = swept["settings"]
    size = settings["size"]
    print(f"{name}: {swept['wall_seconds']:.0f} s", file=sys.stderr)
    lines = [f"## {name}", "", f"{about[0].upper()}{about[1:]}. `render2mpeg {' '.join(words)}`: "
             f"{size['width']}×{size['height']}, {settings['frames']} frames, {swept['lights']} lights in the tree.", ""]
    lines += [f'<img src="{name}_{plot}.svg" width="49%" alt="{name}, {when}">' for plot, when in PLOTS]
    lines += ["", *rows(swept), ""]
    lines += [f"- **{finding['label']}**: {finding['text']}" for finding in swept["findings"]]
    return "\n".join(lines) + "\n"


def rows(swept):
    """Every method at the middle quantiser, as a table."""
    quantisers = sorted({run["qscale"] for run in swept["runs"]})
    middle = quantisers[len(quantisers) // 2]
    yield f"At quantiser {middle}:"
    yield ""
    yield "| Method | CPU s a frame | relative MSE, rendered | PSNR, decoded | bits against 2 % | indirect light |"
    yield "|---|---|---|---|---|---|"
    for run in swept["runs"]:
        if run["qscale"] != middle:
            continue
        beside = run["against_baseline"] or {}
        bits = f"{100 * (beside['bits_ratio'] - 1):+.1f} %" if beside else "–"
        speed = "–"
        if run["kappa"] is not None and beside:
            speed = f"×{beside['speedup_indirect']:.2f}" if beside["equal_quality"] else "not equal"
        psnr = run["decoded"]["psnr_y"]
        psnr = "equal" if psnr is None else f"{psnr:.2f} dB"
        error = f"{run['rendered']['relative_mse']:.1e}"
        yield f"| {run['label']} | {run['seconds']['total']:.3f} | {error} | {psnr} | {bits} | {speed} |"


HEAD = """# Error against run time

Made by `tests/sweep_scenes.py`, which runs `render2mpeg sweep` for each scene below. Every method renders the same frames,
which go through the encoder at several quantisers; errors are those against every light at every pixel. Solid lines take
light from the irradiance cache, dashed ones make a cut for every pixel; along a line the quantiser changes. Methods: fixed
thresholds of 2 % (the original Lightcuts), the paper's thresholds (κ = 1), the same with κ = 0.25, thresholds from what
the encoder really did (codec), and cuts that end where measured errors say (calibrated); paths know nothing of virtual lights.

A speed-up counts only at equal decoded quality or better: PSNR at most 0.1 dB less, bits at most 1 % and flicker at most
10 % more than 2 % gives at the same quantiser. Where that is not so, or no time is saved, the words below the plots say it. CPU seconds swing by some
percent from run to run; cut sizes and counts of rays do not. Where time falls more than cuts do, the rest is not masking's:
thresholds that are known before a cut begins need no queue, and neighbours share cuts and rays. Bits of a few small pictures do, too, by a percent or two: equality is often missed
by them alone. All scenes but the first are swept in small pictures with few lights, and without the cache, to be quick.

"""


def main():
    DOCS.mkdir(parents=True, exist_ok=True)
    SWEPT.mkdir(parents=True, exist_ok=True)
    page = HEAD + "\n".join(section(*scene) for scene in SCENES)
    (DOCS / "README.md").write_text(page)


if __name__ == "__main__":
    main()
