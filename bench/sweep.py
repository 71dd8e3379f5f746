"""Error and run time with thresholds from the encoder, compared with lightcuts of 2 %, by `render2mpeg sweep`.

    python3 bench sweep [SCENE.glb …] [--quick] [--size WxH] [--frames N] [--qscale 2,16,48]
    python3 bench sweep --full [--page-only] [--sponza SPONZA.glb]

Quick: a sweep renders both methods frame by frame, and is repeated within five minutes. The table has

    light, frame    CPU seconds of indirect light and of a frame: films at 2 %, divided by films with the encoder's thresholds
    decoded         luma PSNR of decoded 2 % frames against all lights at every pixel, and the other method's difference
    bits, flicker   changes against 2 %; flicker is the change of the decoded film in excess of the reference's change
    equal           whether PSNR is at most 0.1 dB less, bits at most 1 % and flicker at most 10 % more

Full writes the plots of docs/sweep and the tables in out/sweeps/README.md. Existing sweeps in out/sweeps are reused: remove
this folder to measure a new build. With --page-only, no sweep is made, and the page shows the existing sweeps.
Sponza does not ship: without --sponza, or a copy next to the repository, the page reports it as missing.
"""

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pairs
import presets
import sweep_page
import tables
from running import Failure, add_program, need_files, need_program, run

QUICK = {"size": "128x128", "frames": 8, "qscale": "2,16,48", "repeats": 5}
SCENES = [presets.shipped(name) for name in ("cornell", "conference")]
BASELINE, METHOD = "lightcuts", "codec"
TITLES = ["scene", "quantiser", "sweeps", "light", "frame", "decoded, 2 %", "difference", "bits", "flicker", "equal"]


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("scenes", nargs="*", type=Path, help="scenes of the quick table [default: cornell, conference]")
    parser.add_argument("--size", help="quick: size of the picture [default: 128x128]")
    parser.add_argument("--frames", type=int, help="quick: frames of a film [default: 8]")
    parser.add_argument("--qscale", help="quick: quantisers [default: 2,16,48]")
    parser.add_argument("--repeats", type=int, help="quick: most sweeps of a scene [default: 5]")
    parser.add_argument("--page-only", action="store_true", help="full: make no sweeps, only the page")
    parser.add_argument("--sponza", type=Path, help="full: the scene file of Sponza, or its folder")
    add_program(parser)


@dataclass
class Row:
    """A quantiser: figures of the baseline, and the method's figures in each sweep."""

    qscale: int
    baseline: dict
    beside: list

    def cells(self, scene):
        """Returns the cells of the table."""
        first = self.beside[0]
        ratio = lambda name: pairs.Spread([one[name] for one in self.beside])  # noqa: E731
        return [
            scene.stem,
            self.qscale,
            len(self.beside),
            ratio("speedup_indirect"),
            ratio("speedup_total"),
            tables.decibels(self.baseline["decoded"]["psnr_y"]),
            tables.decibels(first["psnr_difference"], "+.2f"),
            tables.change(first["bits_ratio"]),
            tables.change(first["flicker_ratio"]),
            "yes" if first["equal_quality"] else "no",
        ]


def swept(options, scene):
    """Returns the figures of a sweep: runs by method and quantiser."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["--size", options.size, "--frames", options.frames, "--qscale", options.qscale]
        words += ["--vpls", 1000, "--methods", METHOD, "--quiet", "-o", folder]
        run([options.program, "sweep", scene, *words])
        runs = json.loads((Path(folder) / "sweep.json").read_text())["runs"]
    return {(one["method"], one["qscale"]): one for one in runs}


def quick(options):
    """Prints the table of each scene's sweeps."""
    scenes = options.scenes or SCENES
    need_files(scenes)
    print(tables.header(TITLES))
    budget = pairs.Budget(options)
    for scene, share in budget.shares(scenes):
        # Baseline and method alternate within each sweep, frame by frame.
        turns = budget.in_turns(lambda: swept(options, scene), lambda: None, options.repeats, share)
        found = [both for both, _ in turns]
        for qscale in presets.numbers(options.qscale):
            beside = [one[METHOD, qscale]["against_baseline"] for one in found]
            print(tables.row(Row(qscale, found[0][BASELINE, qscale], beside).cells(scene)), flush=True)
    pairs.print_trust(options)


def main(options):
    """Prints the quick table, or makes the page."""
    given = [name for name in QUICK if getattr(options, name) is not None]
    if options.full and (options.scenes or given):
        raise Failure("the page of --full has scenes and settings of its own; scenes and their settings are for --quick")
    presets.fill_in(options, QUICK, {})
    if not options.page_only:
        options.program = need_program(options)
    if options.full:
        sweep_page.make(options)
    else:
        quick(options)
