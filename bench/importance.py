"""Films with --importance: CPU time and error, against five samples everywhere and the default.

    python3 bench importance [--film SCENE=MAPS …] [--size N] [--frames N] [--sheet FOLDER]

MAPS has the syntax of `render --importance`, such as nave=saliency:1. A scene is a shipped one or a path. The films have
64x64 pixels, 4 frames and default settings otherwise. Each row is printed as soon as it is measured. Rows for which five
minutes are too short are named. The error of a pixel is relative and squared:

    |L − R|² / (|R|² + 0.01 · mean of |R|² over the picture)

R is a film with 16 samples per pixel and another seed, as films with equal seeds have correlated errors. "Inside" covers
pixels with importance above 0.7. CPU seconds per frame are from the report, without the first frame.

With --sheet, a picture of each film is written to the folder: frame, importance, samples, and errors of the three films.
Requires numpy, pillow and OpenEXR from PyPI. --full has 128x128 pixels and 8 frames, as the table of the documentation.
"""

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import presets
import references
import tables
from running import Failure, add_program, need_files, need_program, run

try:
    import numpy as np
    import OpenEXR
    from PIL import Image
except ImportError as missing:
    np = missing.name

# In the order of their times.
FILMS = ["conference=task:1", "atrium=saliency:1", "nave=saliency:1"]
QUICK = {"film": FILMS, "size": 64, "frames": 4}
FULL = {"film": FILMS, "size": 128, "frames": 8}
INSIDE = 0.7
SAMPLES = 5


@dataclass
class Film:
    """A finished film: its report, and the channels of each frame by name."""

    report: dict
    frames: list

    def mean(self, *path):
        """Returns the mean of a figure over all frames but the first."""
        values = []
        for frame in self.report["frames"][1:]:
            for name in path:
                frame = frame[name]
            values.append(frame)
        return sum(values) / len(values)


def add_options(parser):
    """Adds the options of this measurement."""
    text = "a scene and its maps; may be repeated"
    parser.add_argument("--film", action="append", metavar="SCENE=MAPS", help=text)
    parser.add_argument("--size", type=int, help="pixels on a side [default: 64; full: 128]")
    parser.add_argument("--frames", type=int, help="frames of a film, at least 3 [default: 4; full: 8]")
    parser.add_argument("--sheet", type=Path, metavar="FOLDER", help="where pictures of maps and errors go")
    add_program(parser)


def channels(path):
    """Returns the color and the single channels of an OpenEXR file."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        found = {name: channel.pixels.astype(np.float64) for name, channel in file.channels().items()}
    found["color"] = np.stack([found.pop(name) for name in "RGB"], axis=-1)
    return found


def rendered(options, scene, words):
    """Renders a film with these options."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        files = ["-o", folder / "film.m2v", "--report", folder / "report.json", "-q"]
        files += ["--exr", folder / "frames", "--exr-depth", "float"]
        extent = ["--size", f"{options.size}x{options.size}", "--frames", options.frames]
        run([options.program, "render", scene, "--overwrite", *extent, *words, *files])
        frames = [channels(path) for path in sorted((folder / "frames").iterdir())]
        return Film(json.loads((folder / "report.json").read_text()), frames)


def truth(options, scene):
    """Returns frames with 16 samples per pixel, kept between runs."""

    def make(path):
        film = rendered(options, scene, ["--samples", 16, "--seed", 2])
        with open(path, "wb") as file:
            np.save(file, np.stack([frame["color"] for frame in film.frames]))

    details = [f"{options.size}x{options.size}", options.frames, "16-samples"]
    return np.load(references.kept(scene, details, ".npy", make))


def errors(film, true):
    """Returns the relative squared error of each pixel of each frame."""
    square = (true**2).mean(axis=-1)
    floor = 0.01 * square.mean(axis=(1, 2), keepdims=True)
    found = np.stack([frame["color"] for frame in film.frames])
    return ((found - true) ** 2).mean(axis=-1) / (square + floor)


def shown(color):
    """Tone-maps radiance for a display, with its geometric mean at mid-gray."""
    gray = color.mean(axis=-1)
    color = 0.2 * color / np.exp(np.log(gray[gray > 0]).mean())
    return np.clip(1.3 * color / (1 + color), 0, 1) ** (1 / 2.2)


def sheet(films, wrong, index):
    """Draws a row of pictures for a frame."""
    default, five, important = films
    frame = important.frames[index]
    gray = [frame["importance.V"], (frame["importance.N"] - 1) / (SAMPLES - 1)]
    gray += [np.clip(3 * np.sqrt(of[index]), 0, 1) for of in wrong]
    row = [shown(frame["color"]), *[np.repeat(picture[..., None], 3, axis=-1) for picture in gray]]
    return np.concatenate(row, axis=1)


def measured(options, film):
    """Returns the table's row for a film."""
    name, _, maps = film.partition("=")
    scene = presets.shipped(name) if "/" not in name else Path(name)
    need_files([scene])
    importance = ["--importance", maps, "--samples", SAMPLES, "--aov", "importance"]
    films = [rendered(options, scene, words) for words in ([], ["--samples", SAMPLES], importance)]
    true = truth(options, scene)
    wrong = [errors(film, true) for film in films]
    inside = np.stack([frame["importance.V"] for frame in films[2].frames]) > INSIDE
    if options.sheet:
        options.sheet.mkdir(parents=True, exist_ok=True)
        picture = np.round(255 * sheet(films, wrong, options.frames - 3)).astype(np.uint8)
        Image.fromarray(picture).save(options.sheet / f"importance-{scene.stem}.png")

    # Errors of the default and of importance, relative to five samples.
    seconds = [film.mean("seconds", "total") for film in films]
    cells = [f"`{scene.stem}`, {maps}", f"{films[2].mean('samples_mean'):.2f}", f"{films[2].mean('samples_change'):.2f}"]
    cells += [f"{value:.2f}" for value in seconds] + [f"{seconds[2] / seconds[1]:.2f}", f"{inside.mean():.0%}"]
    for where in (inside, ~inside):
        of_default, of_five, of_importance = (error[where].mean() for error in wrong)
        cells += [f"{of_importance / of_five:.2f}", f"{of_default / of_five:.2f}"]
    return cells


def main(options):
    """Prints the table."""
    if isinstance(np, str):
        raise Failure(f"{np} is missing; install it: python3 -m pip install numpy pillow OpenEXR")
    presets.fill_in(options, QUICK, FULL)
    options.program = need_program(options)
    if options.frames < 3:
        raise Failure(f"{options.frames} frames are too few; use 3 or more")
    titles = ["film", "samples", "change", "default s", "five s", "importance s", "of five"]
    titles += ["inside", "error of five inside", "default's", "outside", "default's"]
    print(tables.header(titles), flush=True)
    for film in options.film:
        if "=" not in film:
            raise Failure(f"{film} is no film such as nave=saliency:1")
        print(tables.row(measured(options, film)), flush=True)
