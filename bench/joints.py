"""Flicker at chunk borders, against the flicker within chunks and in a film without chunks.

    python3 bench joints [--film SCENE …] [--chunk N] [-- OPTIONS]

A scene is a shipped one or a path. Films have 128x128 pixels, 12 frames, default settings and the additional OPTIONS. The
flicker of a frame is the root mean square of its change along the motion in excess of a reference's change [code values]:

    (Y_t(x) − Y_{t−1}(x')) − (R_t(x) − R_{t−1}(x'))        over the pixels x that were visible at x' in the previous frame

R is a film with a lightcut per pixel and thresholds of 1 % of the luminance. Such films are kept. Borders are the first frames
of all chunks except the first. Luma is measured before coding, and after decoding by ffmpeg.
Requires numpy and OpenEXR from PyPI.
"""

import json
import subprocess
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
except ImportError as missing:
    np = missing.name

FILMS = ["conference", "nave"]
FRAMES = 12
REFERENCE = ["--cache", "off", "--thresholds", "fixed:0.01", "--shading", "full"]


@dataclass
class Film:
    """Luma of a film's frames before and after coding, and its CPU seconds and bits."""

    shown: object
    decoded: object
    seconds: float
    bits: int


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("--film", action="append", metavar="SCENE", help="a scene; may be repeated")
    parser.add_argument("--chunk", type=int, default=4, metavar="N", help="frames of a chunk")
    parser.add_argument("options", nargs="*", metavar="OPTIONS", help="of render2mpeg render, for the films in chunks")
    add_program(parser)


def luma_of(frames, side):
    """Returns the luma planes of raw 4:2:0 frames."""
    bytes_of_frame = side * side * 3 // 2
    planes = np.frombuffer(frames, np.uint8).reshape(-1, bytes_of_frame)[:, : side * side]
    return planes.reshape(-1, side, side).astype(np.float64)


def shown_luma(path, side):
    """Returns the luma of a YUV4MPEG2 file without frame parameters."""
    frames = path.read_bytes().partition(b"\n")[2]
    header, size = len(b"FRAME\n"), side * side * 3 // 2
    step = header + size
    return luma_of(b"".join(frames[at + header : at + step] for at in range(0, len(frames), step)), side)


def decoded_luma(path, side):
    """Returns the luma decoded by ffmpeg."""
    command = ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "yuv420p", "-"]
    return luma_of(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout, side)


def rendered(program, scene, side, words):
    """Renders a film with these options."""
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film.m2v"
        files = ["-o", film, "--y4m", film.with_suffix(".y4m"), "-q"]
        run([program, "render", scene, "--overwrite", "--size", f"{side}x{side}", "--frames", FRAMES, *words, *files])
        summary = json.loads(film.with_suffix(".report.json").read_text())["summary"]
        shown, decoded = shown_luma(film.with_suffix(".y4m"), side), decoded_luma(film, side)
        return Film(shown, decoded, summary["cpu_seconds"], summary["bits_total"])


def motion_of(path):
    """Returns the position of each pixel in the previous frame, as an index; −1 for disoccluded pixels."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        dx, dy, seen = (file.channels()[f"motion.{name}"].pixels for name in "XYA")
    height, width = seen.shape
    y, x = np.mgrid[:height, :width]
    x, y = np.rint(x + dx).astype(int), np.rint(y + dy).astype(int)
    inside = (seen > 0.5) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return np.where(inside, y * width + x, -1)


def reference(program, scene, side):
    """Returns luma and motion of the reference film."""

    def make(path):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            files = ["-o", folder / "film.m2v", "--y4m", folder / "film.y4m", "--exr", folder / "frames", "-q"]
            size = ["--size", f"{side}x{side}", "--frames", FRAMES, "--aov", "motion"]
            run([program, "render", scene, "--overwrite", *size, *REFERENCE, *files])
            motion = np.stack([motion_of(frame) for frame in sorted((folder / "frames").iterdir())])
            with open(path, "wb") as file:
                np.savez(file, luma=shown_luma(folder / "film.y4m", side), motion=motion)

    kept = np.load(references.kept(scene, [f"{side}x{side}", FRAMES, "cuts-1-percent"], ".npz", make))
    return kept["luma"], kept["motion"]


def flicker(luma, true, motion):
    """Returns the root mean square for each frame after the first."""
    wrong = luma - true
    found = []
    for t in range(1, len(wrong)):
        seen = motion[t] >= 0
        before = wrong[t - 1].ravel()[motion[t][seen]]
        found.append(np.sqrt(((wrong[t][seen] - before) ** 2).mean()))
    return np.array(found)


def measured(program, name, side, options):
    """Returns the table's rows for a scene."""
    scene = presets.shipped(name) if "/" not in name else Path(name)
    need_files([scene])
    true, motion = reference(program, scene, side)
    border = np.array([t % options.chunk == 0 for t in range(1, FRAMES)])
    films = [("one", rendered(program, scene, side, options.options))]
    chunks = ["--chunk", options.chunk, *options.options]
    films.append((f"in chunks of {options.chunk}", rendered(program, scene, side, chunks)))
    for title, film in films:
        cells = [f"`{scene.stem}`", title]
        for luma in (film.shown, film.decoded):
            found = flicker(luma, true, motion)
            cells += [f"{found[~border].mean():.2f}", f"{found[border].mean():.2f}"]
        error = np.sqrt(((film.shown - true) ** 2).mean(axis=(1, 2)))
        cells += [f"{error[1:].mean():.2f}", f"{film.seconds:.1f}", f"{film.bits / 1000:.0f}"]
        yield cells


def main(options):
    """Prints the table."""
    if isinstance(np, str):
        raise Failure(f"{np} is missing; install it: python3 -m pip install numpy OpenEXR")
    if not 0 < options.chunk < FRAMES:
        raise Failure(f"--chunk {options.chunk}: films have {FRAMES} frames, and chunks fewer")
    program, side = need_program(options), 256 if options.full else 128
    titles = ["scene", "film", "inside, shown", "at borders", "inside, decoded", "at borders"]
    titles += ["rms error, shown", "CPU s", "kbit"]
    print(tables.header(titles), flush=True)
    for name in options.film or FILMS:
        for cells in measured(program, name, side, options):
            print(tables.row(cells), flush=True)
    sys.stdout.flush()
