"""Plots for docs/sweep, and a page of tables next to the sweeps: error against run time of the shipped scenes and Sponza."""

import json
import shutil
import sys
from pathlib import Path

import presets
import tables
from running import ROOT, run

DOCS = ROOT / "docs" / "sweep"
# Folder of the sweeps; existing ones are reused.
SWEPT = ROOT / "out" / "sweeps"
SPONZA = [ROOT.parent / "shared" / "scenes" / name for name in ("sponza-dabrovic", "sponza-crytek")]
SMALL = "--size 96x96 --frames 4 --vpls 1000 --methods paper,codec"
LARGE = (
    "--size 160x160 --frames 5 --methods "
    "paper,perceptual,codec,calibrated,perceptual-cache,codec-cache,calibrated-cache,paths-4,paths-16,paths-64"
)
# Name of the scene, additional options, description.
SCENES = [
    ("cornell", LARGE, "a box with moving blocks: matte surfaces, one lamp, light that changes slowly"),
    ("atrium", SMALL, "a courtyard under sun and sky, with fine detail"),
    ("nave", SMALL, "a church that is lit through stained glass; only the camera moves"),
    ("conference", SMALL, "a room of many parts below six lamps"),
    ("sponza", SMALL, "an atrium of columns and arches, through which only the camera moves"),
]
PLOTS = [("decoded_psnr", "after decoding"), ("rendered_error", "before compression")]
TITLES = ["Method", "CPU s a frame", "relative MSE, rendered", "PSNR, decoded", "bits against 2 %", "indirect light"]

HEAD = """# Error against run time

Made by `python3 bench sweep --full`, which runs `render2mpeg sweep` for each scene below. Every method renders the same
frames, which go through the encoder at several quantisers. Errors are those against every light at every pixel.
Solid lines take light from the irradiance cache, dashed ones make a cut for every pixel. Along a line the quantiser changes.

| Method | thresholds |
|---|---|
| 2 % | fixed, as in the original Lightcuts |
| κ = 1 | those of the paper |
| κ = 0.25 | the same with κ = 0.25 |
| codec | from what the encoder really did |
| calibrated | those of κ = 0.25; cuts end where measured errors say |
| paths | none: paths know nothing of virtual lights |

A speed-up counts only at equal decoded quality or better: PSNR at most 0.1 dB less, bits at most 1 % and flicker at most
10 % more than with 2 % at the same quantiser. Where that is not so, or no time is saved, the words below the plots say it.

- CPU seconds vary by some percent from run to run. Cut sizes and counts of rays do not.
- Bits of a few small pictures vary by a percent or two. Equality is often missed by them alone.
- Where time falls more than cuts do, the rest does not come from masking. Thresholds that are known before a cut begins
  need no queue, and neighbors share cuts and rays.
- All scenes but the first are swept in small pictures with few lights, and without the cache.
- Lights in the tree are anchor lights (`--vpls`), the sky, and glowing surfaces where there are many.

"""


def scene_file(name, sponza):
    """Returns the scene's path, or nothing if it is missing."""
    if name != "sponza":
        return presets.shipped(name)
    for place in [sponza] if sponza else SPONZA:
        files = [place] if place.is_file() else sorted([*place.glob("*.glb"), *place.glob("*.gltf")])
        if files:
            return files[0]
    return None


def rows(swept, quantiser):
    """Returns every method at a quantiser, as rows of the table."""
    for one in swept["runs"]:
        if one["qscale"] != quantiser:
            continue
        beside = one["against_baseline"]
        speed = "–"
        if one["kappa"] is not None and beside:
            speed = f"×{beside['speedup_indirect']:.2f}" if beside["equal_quality"] else "not equal"
        psnr = one["decoded"]["psnr_y"]
        yield [
            one["label"],
            f"{one['seconds']['total']:.3f}",
            f"{one['rendered']['relative_mse']:.1e}",
            "equal" if psnr is None else tables.decibels(psnr),
            tables.change(beside["bits_ratio"]) if beside else "–",
            speed,
        ]


def section(swept, name, command, about):
    """Returns a scene's section of the page."""
    size, frames = swept["settings"]["size"], swept["settings"]["frames"]
    quantisers = sorted({one["qscale"] for one in swept["runs"]})
    middle = quantisers[len(quantisers) // 2]
    text = f"{about[0].upper()}{about[1:]}. `render2mpeg {command}`: {size['width']}×{size['height']}, {frames} frames, "
    lines = [f"## {name}", "", f"{text}{swept['lights']} lights in the tree.", ""]
    lines += [f'<img src="{name}_{plot}.svg" width="49%" alt="{name}, {when}">' for plot, when in PLOTS]
    lines += ["", f"At quantiser {middle}:", "", tables.table(TITLES, rows(swept, middle)), ""]
    lines += [f"- **{finding['label']}**: {finding['text']}" for finding in swept["findings"]]
    return "\n".join(lines) + "\n"


def sweep(options, name, words, about):
    """Sweeps a scene unless it has been swept, and returns its section of the page."""
    path = scene_file(name, options.sponza)
    if path is None:
        return f"## {name}\n\nNot made: the scene was not there.\n"
    folder = SWEPT / name
    if not (folder / "sweep.json").exists():
        if options.page_only:
            return f"## {name}\n\nNot swept yet.\n"
        run([options.program, "sweep", path, *words.split(), "--quiet", "--overwrite", "-o", folder], capture=False)
    swept = json.loads((folder / "sweep.json").read_text())
    print(f"{name}: {swept['wall_seconds']:.0f} s", file=sys.stderr)
    for plot, _ in PLOTS:
        shutil.copy(folder / "plots" / f"{plot}.svg", DOCS / f"{name}_{plot}.svg")
    shown = "SPONZA.glb" if name == "sponza" else path.relative_to(ROOT)
    return section(swept, name, f"sweep {shown} {words}", about)


def make(options):
    """Writes the page and its plots."""
    for folder in (DOCS, SWEPT):
        folder.mkdir(parents=True, exist_ok=True)
    page = HEAD + "\n".join(sweep(options, *scene) for scene in SCENES)
    Path(SWEPT / "README.md").write_text(page)
