"""CPU time and decoded quality of films with default settings, against uncoupled films.

    python3 bench coupling [SCENE.glb …] [--quick|--full] [--size WxH] [--frames N] [--qscale 2,16,48]

Uncoupled: --thresholds fixed:0.02 --shading full --photons N, without any information from the encoder. N is the
number for the finest quantisers, as a renderer without the quantiser needs it. Coupled: the default. Both run
alternately. A third film, per row, has the photons of the row's quantiser and no other coupling.

    ratio       CPU seconds per frame, uncoupled divided by coupled, without frames 0 to 2
    light       the same ratio for the third film: the effect of thresholds and reprojected light alone
    documented  the ratio in docs/data/coupling.csv, which README.md quotes, for the scene at this size and quantiser
    program     CPU seconds of whole programs, uncoupled divided by coupled, including loading and frames 0 to 2
    decoded     luma PSNR of the decoded film against a fine film of the same scene, before coding
    flicker     mean change of luma between frames of decoded films

The fine film has --qscale 1 --thresholds fixed:0.005 --shading full. --full adds two columns for frames before coding:
the difference between the two films, and the fraction of pixels with reprojected light. The measurement requires ffmpeg.
"""

import csv
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

import figures
import pairs
import presets
import references
import tables
from running import ROOT, Failure, add_program, need_files, need_installed, need_program, run

UNCOUPLED = ["--thresholds", "fixed:0.02", "--shading", "full"]
COUPLED = []
# Photons per anchor light of the finest quantisers, as in `pipeline/renderer/src/settings/mod.rs`.
FINE_PHOTONS = 36
FINE = ["--qscale", "1", "--thresholds", "fixed:0.005", "--shading", "full"]
# Ratios that the documents quote.
DOCUMENTED = ROOT / "docs" / "data" / "coupling.csv"
# First frame included in CPU seconds.
FIRST = 3
QUICK = {
    "scenes": [presets.shipped(name) for name in ("cornell", "nave", "conference")],
    "size": "128x128",
    "frames": 8,
    "pairs": 5,
}
FULL = QUICK | {"size": "256x256", "frames": 24, "pairs": 1}


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("scenes", nargs="*", type=Path, help="scenes [default: cornell, nave, conference]")
    parser.add_argument("--size", help="size of the picture [default: 128x128; full: 256x256]")
    parser.add_argument("--frames", type=int, help="frames of a film, at least 4 [default: 8; full: 24]")
    parser.add_argument("--qscale", default="2,16,48", help="quantisers [default: 2,16,48]")
    parser.add_argument("--pairs", type=int, help="most pairs of films of a row [default: 5; full: 1]")
    add_program(parser)


@dataclass
class Film:
    """A rendered film: frames and settings of its report, CPU seconds of the program, its files."""

    frames: list
    settings: dict
    cpu: float
    video: Path
    raw: Path

    def mean(self, value):
        """Returns the mean over the counted frames that have the value."""
        values = [value(frame) for frame in self.frames[FIRST:]]
        values = [one for one in values if one is not None]
        return sum(values) / len(values) if values else None

    @property
    def seconds(self):
        """CPU seconds per frame."""
        return self.mean(lambda frame: frame["seconds"]["total"])

    @property
    def bits(self):
        """Bits of all frames."""
        return sum(frame["bits"] for frame in self.frames)


def render(options, scene, base, words):
    """Renders a film with file names that start with `base`."""
    video, raw, report = (Path(f"{base}{ending}") for ending in (".m2v", ".y4m", ".json"))
    command = [options.program, "render", scene, "--size", options.size, "--frames", options.frames, "--quiet", "--overwrite"]
    finished = run([*command, "-o", video, "--y4m", raw, "--report", report, *words])
    made = json.loads(report.read_text())
    return Film(made["frames"], made["settings"], finished.cpu, video, raw)


def fine_film(options, scene):
    """Returns the frames of the fine film before coding, rendered once."""

    def make(path):
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            render(options, scene, Path(folder) / "fine", FINE).raw.rename(path)

    return references.kept(scene, [options.size, "own-camera", f"{options.frames}-frames", "fine"], ".y4m", make)


@dataclass
class Measured:
    """Uncoupled and coupled films of a scene at one quantiser, and their figures."""

    scene: Path
    qscale: int
    films: list
    third: Film
    decoded: list
    flickers: list
    before_coding: dict
    documented: str

    def ratio(self, value):
        """Returns the ratio of a value, uncoupled by coupled, over all pairs."""
        return pairs.Spread([value(alone) / value(coupled) for alone, coupled in self.films])

    def cells(self):
        """Returns the cells of the table."""
        alone, coupled = self.films[0]
        seconds = [pairs.Spread([pair[i].seconds for pair in self.films]).median for i in (0, 1)]
        psnr = [likeness.psnr for likeness in self.decoded]
        return {
            "scene": self.scene.stem,
            "quantiser": self.qscale,
            "pairs": len(self.films),
            "uncoupled, CPU s": f"{seconds[0]:.3f}",
            "coupled, CPU s": f"{seconds[1]:.3f}",
            "ratio": self.ratio(lambda film: film.seconds),
            "light": f"{self.third.seconds / seconds[1]:.2f}",
            "documented": self.documented,
            "program": self.ratio(lambda film: film.cpu),
            "decoded, uncoupled": tables.decibels(psnr[0]),
            "decoded, coupled": tables.decibels(psnr[1]),
            "difference": tables.decibels(psnr[1] - psnr[0], "+.2f"),
            "bits": tables.change(coupled.bits / alone.bits),
            "flicker": tables.change(self.flickers[1] / self.flickers[0]),
            **self.before_coding,
        }


def frames_before_coding(options, alone, coupled):
    """Returns the cells of the full table about frames before coding."""
    coding = [film.mean(lambda frame: frame["psnr_y"]) for film in (alone, coupled)]
    flickers = [figures.flicker(film.raw) for film in (alone, coupled)]
    apart = figures.compare(options.program, coupled.raw, alone.raw)
    return {
        "PSNR of coding": tables.decibels(coding[1] - coding[0], "+.2f"),
        "apart before coding": tables.decibels(apart.psnr, ".1f"),
        "flicker before coding": tables.change(flickers[1] / flickers[0]),
        "carried": tables.share(coupled.mean(lambda frame: frame["reprojected_share"])),
        "audits within": tables.share(coupled.mean(lambda frame: frame["audit_reprojected_within"])),
    }


def documented(scene, size, frames, qscale):
    """Returns the documented ratio of a row; a dash if the documents do not have it."""
    with open(DOCUMENTED, newline="") as file:
        for row in csv.DictReader(file):
            if (row["scene"], row["size"], row["frames"], row["quantiser"]) == (scene.stem, size, str(frames), str(qscale)):
                return row["ratio"]
    return "–"


def measure(options, scene, qscale, budget, limit):
    """Measures a row: alternating films, then figures of their pictures, which are equal in each pair."""
    with tempfile.TemporaryDirectory() as folder:
        quantiser = ["--qscale", qscale]

        def work(name, words):
            return lambda: render(options, scene, Path(folder) / name, quantiser + words)

        third = work("third", UNCOUPLED)()
        photons = ["--photons", third.settings["vpls"] * FINE_PHOTONS]
        films = budget.in_turns(work("uncoupled", UNCOUPLED + photons), work("coupled", COUPLED), options.pairs, limit)
        fine = fine_film(options, scene)
        shown = [figures.decode(film.video, Path(f"{film.video}.y4m")) for film in films[0]]
        likenesses = [figures.compare(options.program, film, fine) for film in shown]
        flickers = [figures.flicker(film) for film in shown]
        before = frames_before_coding(options, *films[0]) if options.full else {}
        known = documented(scene, options.size, options.frames, qscale)
        return Measured(scene, qscale, films, third, likenesses, flickers, before, known)


def main(options):
    """Prints the table, row by row, and geometric means."""
    presets.fill_in(options, QUICK, FULL)
    options.scenes = options.scenes or (FULL if options.full else QUICK)["scenes"]
    if options.frames <= FIRST:
        raise Failure(f"--frames {options.frames}: frames 0 to {FIRST - 1} do not count, so at least {FIRST + 1} are needed")
    options.program = need_program(options)
    need_installed("ffmpeg")
    need_files(options.scenes)
    for scene in options.scenes:
        fine_film(options, scene)
    rows = [(scene, qscale) for scene in options.scenes for qscale in presets.numbers(options.qscale)]
    budget, ratios = pairs.Budget(options), {}
    for (scene, qscale), share in budget.shares(rows):
        measured = measure(options, scene, qscale, budget, share)
        cells = measured.cells()
        if not ratios:
            print(tables.header(cells))
        print(tables.row(cells.values()), flush=True)
        ratios.setdefault(qscale, []).append(measured.ratio(lambda film: film.seconds).median)
    for qscale, found in ratios.items():
        print(f"\nGeometric mean of {len(found)} ratios at quantiser {qscale}: {pairs.geometric_mean(found):.2f}")
    pairs.print_trust(options)
