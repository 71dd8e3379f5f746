"""Clips that encoders are measured with: YUV4MPEG2 files, with exact motion beside them where it is known."""

import os
import shutil
import sys
from pathlib import Path

from running import RELEASE, ROOT, need_built, run

FOLDER = ROOT / "out" / "bench-clips"
# Clips of --generator, in the order of the tables.
GENERATED = ["fly", "static", "orbit", "pan", "cut", "plain"]
# Bytes before each frame: "FRAME" and the end of the line.
FRAME_HEADER = 6


class Clip:
    """NAME.y4m; NAME.mvp and NAME.mvn hold the motion to the frame before and after, where they are there."""

    def __init__(self, path):
        self.path = Path(path)
        with open(path, "rb") as file:
            header = file.readline()
        tags = {word[:1]: word[1:] for word in header.decode().split()[1:]}
        width, height = int(tags["W"]), int(tags["H"])
        numerator, denominator = tags["F"].split(":")
        self.fps = int(numerator) / int(denominator)
        frame = width * height + 2 * ((width + 1) // 2) * ((height + 1) // 2)
        self.frames = (self.path.stat().st_size - len(header)) // (frame + FRAME_HEADER)

    @property
    def name(self):
        """As in tables."""
        return self.path.stem

    def motion(self, ending):
        """The file of the motion to the frame before (.mvp) or after (.mvn), or nothing."""
        path = self.path.with_suffix(ending)
        return path if path.exists() else None

    def repeated(self, least, folder):
        """The clip and its motion again and again, to at least so many frames."""
        times = -(-least // self.frames)
        target = Path(folder) / self.path.name
        with open(self.path, "rb") as file, open(target, "wb") as out:
            out.write(file.readline())
            write_often(file, out, times)
        for path in filter(None, map(self.motion, (".mvp", ".mvn"))):
            with open(path, "rb") as file, open(Path(folder) / path.name, "wb") as out:
                write_often(file, out, times)
        return Clip(target)


def write_often(file, out, times):
    """Copies what is left of a file, again and again."""
    begin = file.tell()
    for _ in range(times):
        file.seek(begin)
        shutil.copyfileobj(file, out)


def example(package, name, may_build):
    """An example program in release, built first where that is allowed."""
    command = ["cargo", "build", "--release", "--package", package, "--example", name]
    if may_build:
        run(command, capture=False, folder=ROOT)
    return need_built(RELEASE / "examples" / name, " ".join(command))


def shipped(size, frames, may_build):
    """Clips of three scenes that ship, rendered once."""
    folder = FOLDER / f"shipped-{size}-{frames}"
    if not folder.exists():
        program = example("tests", "clips", may_build)
        print(f"rendering clips, once, beside the time of the measurement: {folder}", file=sys.stderr, flush=True)
        unfinished = FOLDER / f"unfinished-{os.getpid()}-{folder.name}"
        try:
            unfinished.mkdir(parents=True)
            run([program, unfinished, size, frames])
            unfinished.rename(folder)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    return in_folder(folder)


def generated(program, frames):
    """Clips of another program, called as PROGRAM FOLDER CLIP --frames N; those that are there are taken as they are."""
    folder = FOLDER / f"rendered-{frames}"
    folder.mkdir(parents=True, exist_ok=True)
    for name in GENERATED:
        if not (folder / f"{name}.y4m").exists():
            run([sys.executable, program, folder, name, "--frames", frames])
    return in_folder(folder)


def in_folder(folder):
    """The clips of a folder, those of the generator in its order."""
    order = lambda path: (GENERATED.index(path.stem) if path.stem in GENERATED else len(GENERATED), path)  # noqa: E731
    return [Clip(path) for path in sorted(folder.glob("*.y4m"), key=order)]
