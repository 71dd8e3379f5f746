"""Clips for the comparison of encoders: YUV4MPEG2 files, with exact motion if available."""

import os
import shutil
import sys
from pathlib import Path

from running import RELEASE, ROOT, built, run

FOLDER = ROOT / "out" / "bench-clips"
# Clips of --generator, in the order of the tables.
GENERATED = ["fly", "static", "orbit", "pan", "cut", "plain"]
# Bytes before each frame: "FRAME" and the end of the line.
FRAME_HEADER = 6


class Clip:
    """A clip NAME.y4m; NAME.mvp and NAME.mvn contain the motion to the previous and next frame, if present."""

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
        """Name in tables."""
        return self.path.stem

    def motion(self, ending):
        """Returns the file of the motion to the previous (.mvp) or next (.mvn) frame, or nothing."""
        path = self.path.with_suffix(ending)
        return path if path.exists() else None

    def repeated(self, least, folder):
        """Returns the clip and its motion, repeated to at least `least` frames."""
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
    """Copies the rest of a file repeatedly."""
    begin = file.tell()
    for _ in range(times):
        file.seek(begin)
        shutil.copyfileobj(file, out)


def example(package, name, update):
    """Returns the path of an example program in release, built if it is missing or if `update` requests its current version."""
    command = f"cargo build --release --package {package} --example {name}"
    if update:
        run(command.split(), capture=False, folder=ROOT)
    return built(RELEASE / "examples" / name, command)


def shipped(size, frames, update):
    """Returns clips of three shipped scenes, rendered once."""
    folder = FOLDER / f"shipped-{size}-{frames}"
    if not folder.exists():
        program = example("tests", "clips", update)
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
    """Returns the clips of another program, called as PROGRAM FOLDER CLIP --frames N. Existing clips are reused."""
    folder = FOLDER / f"rendered-{frames}"
    folder.mkdir(parents=True, exist_ok=True)
    for name in GENERATED:
        if not (folder / f"{name}.y4m").exists():
            run([sys.executable, program, folder, name, "--frames", frames])
    return in_folder(folder)


def in_folder(folder):
    """Returns the clips of a folder, with the generator's clips in its order."""
    order = lambda path: (GENERATED.index(path.stem) if path.stem in GENERATED else len(GENERATED), path)  # noqa: E731
    return [Clip(path) for path in sorted(folder.glob("*.y4m"), key=order)]
