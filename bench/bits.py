"""Bit-exactness: hashes of videos and EXR frames prove that two programs make the same films.

    python3 bench bits [--film NAME …] [--before PROGRAM | --against FILE.json] [--keep FILE.json] [--full]

Each film has two SHA-256 values:

    video     the video file
    frames    all EXR files, as `sha256sum *.exr | sha256sum` in their folder prints it

With --before, the other program renders each film first. With --against, the hashes of an earlier --keep are used instead.
Keep and compare on one machine, with programs of the same version: frame headers contain the version.
Each film is reported as the same or as DIFFERENT, with the first frame that differs. The command fails if any film differs.

--list prints the names of the films. They show each shipped scene, and a room with coats (coated_room.py) with a static or moving ball.
The other films show cornell, with a moving camera and moving blocks, and with other options. Some must equal another film:
with one thread, with every stage run, and killed in the middle and resumed. The last requires a system with signals.

Films have 128x128 pixels and 8 frames. The slow ones are smaller: 64x64 without the cache, with 4 frames in the room, and
48x48 with 2 frames for all lights. --full doubles width and height.
"""

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import coated_room
import presets
import references
import tables
from running import Failure, add_program, need_files, need_program, run

SHIPPED = ["cornell", "cornell-box", "atrium", "conference", "nave"]
# Names of generated rooms, and whether the lacquered ball moves.
ROOMS = {"room": False, "room-moving": True}
LAYERS = "direct,indirect,albedo,normal,depth,motion,cut-size,threshold,cache,shading"
AHEAD = "--bframes 2 --cbr --bitrate 150k --stopping calibrated"


@dataclass(frozen=True)
class Film:
    """A film: scene, options, side [pixels], number of frames, and name of the video file."""

    name: str
    scene: str
    options: str = ""
    side: int = 128
    frames: int = 8
    video: str = "film.m2v"
    # Name of the film that this film must equal.
    like: str = ""
    # Number of reported frames after which the program is killed and the film resumed; 0 for uninterrupted films.
    killed_after: int = 0

    def words(self, full):
        """Returns the options of the program that affect its bits."""
        side = self.side * (2 if full else 1)
        return ["--size", f"{side}x{side}", "--frames", str(self.frames), *self.options.split()]


FILMS = [
    *[Film(name, name) for name in SHIPPED],
    Film("coats", "room"),
    Film("coats-moving", "room-moving"),
    Film("coats-cache-off", "room-moving", "--cache off", side=64, frames=4),
    Film("cache-off", "cornell", "--cache off", side=64),
    Film("shading-full", "cornell", "--shading full"),
    Film("all-lights", "cornell", "--lighting all-lights", side=48, frames=2),
    Film("calibrated", "cornell", "--stopping calibrated"),
    Film("fixed", "cornell", "--thresholds fixed:0.02"),
    Film("perceptual", "cornell", "--thresholds perceptual"),
    Film("fine", "cornell", "--qscale 2"),
    Film("coarse", "cornell", "--qscale 48"),
    Film("b-pictures", "cornell", "--bframes 2 --gop 6"),
    Film("bit-rate", "cornell", "--bitrate 60k"),
    Film("constant-rate", "cornell", AHEAD, video="film.ts"),
    Film("mpeg1", "cornell", "--mpeg1", video="film.mpg"),
    Film("no-motion", "cornell", "--no-motion"),
    Film("samples", "cornell", "--samples 4"),
    Film("no-antialiasing", "cornell", "--antialiasing off"),
    Film("no-compensation", "cornell", "--compensation off"),
    Film("one-bounce", "cornell", "--bounces 1"),
    Film("importance", "conference", "--importance saliency:1,task:0.5"),
    Film("masked-quantiser", "cornell", "--aq masking"),
    Film("layers", "cornell", f"--aov {LAYERS}"),
    Film("one-thread", "cornell", "--threads 1", like="cornell"),
    Film("importance-one-thread", "conference", "--importance saliency:1,task:0.5 --threads 1", like="importance"),
    Film("run-everything", "cornell", "--run-everything", like="cornell"),
    Film("resumed", "cornell", like="cornell", killed_after=4),
    Film("resumed-rate", "cornell", AHEAD, video="film.ts", like="constant-rate", killed_after=4),
    Film("resumed-importance", "conference", "--importance saliency:1,task:0.5", like="importance", killed_after=4),
    Film("resumed-coats", "room", like="coats", killed_after=4),
]


def add_options(parser):
    """Adds the options of this measurement."""
    names = [film.name for film in FILMS]
    parser.add_argument("--film", action="append", choices=names, metavar="NAME", help="only this film; may be repeated")
    parser.add_argument("--list", action="store_true", help="name the films and end")
    earlier = parser.add_mutually_exclusive_group()
    earlier.add_argument("--before", type=Path, metavar="PROGRAM", help="the program to compare with")
    earlier.add_argument("--against", type=Path, metavar="FILE.json", help="the hashes to compare with")
    parser.add_argument("--keep", type=Path, metavar="FILE.json", help="where hashes are written for --against")
    add_program(parser)


def chosen(names):
    """Returns the films that the user names, or all, and the films that they must equal."""
    names = set(names or [film.name for film in FILMS])
    names |= {film.like for film in FILMS if film.name in names}
    return [film for film in FILMS if film.name in names]


def scenes(films, program, folder):
    """Returns the scene files of films by name. Rooms are written into the folder."""
    found = {}
    for name in {film.scene for film in films}:
        if name in ROOMS:
            found[name] = folder / f"{name}.gltf"
            coated_room.write(found[name], ROOMS[name])
            need_coats(program, found[name])
        else:
            found[name] = presets.shipped(name)
    need_files(found.values())
    return found


def need_coats(program, scene):
    """Checks that the program renders the scene's coats."""
    plan = run([program, "plan", scene]).output.splitlines()
    if not any(line.split()[:3] == ["glossy", "surfaces", "on"] for line in plan):
        raise Failure(f"{program} finds no glossy surfaces in {scene.name}")


def render_and_kill(command, checkpoint, after):
    """Renders until `after` checkpoints were written, then kills the program."""
    seen = set()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while len(seen) < after and process.poll() is None:
            with contextlib.suppress(FileNotFoundError):
                seen.add(os.stat(checkpoint).st_mtime_ns)
            time.sleep(0.0005)
    finally:
        process.kill()
        code = process.wait()
    if code != -signal.SIGKILL:
        raise Failure(f"the film that was to be killed ended with code {code}")


def render_and_resume(command, film, video):
    """Renders with a checkpoint after each frame, kills the program, and resumes the film."""
    if os.name != "posix":
        raise Failure("films that are killed and resumed need a system with signals; name others with --film")
    command = [*map(str, command), "--checkpoint", "0", "--progress", "json"]
    render_and_kill(command, video.with_name(video.name + ".checkpoint"), film.killed_after)
    begin = json.loads(run([*command, "--resume"]).output.splitlines()[0])
    if not 0 < begin["first_frame"] < film.frames:
        raise Failure(f"{film.name} was not resumed in the middle but at frame {begin['first_frame']}")


def sha256(path):
    """Returns the hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def hashes(program, film, scene, full):
    """Renders a film, and returns its options with the hashes of its video and of each frame."""
    words = film.words(full)
    with tempfile.TemporaryDirectory() as folder:
        video, frames = Path(folder) / film.video, Path(folder) / "frames"
        command = [program, "render", scene, "--overwrite", *words, "-o", video, "--quiet"]
        # Half floats would hide smaller differences.
        command += ["--exr", frames, "--exr-depth", "float"]
        render_and_resume(command, film, video) if film.killed_after else run(command)
        return {
            "scene": references.content_hash(scene),
            "options": words,
            "video": sha256(video),
            "frames": {frame.name: sha256(frame) for frame in sorted(frames.iterdir())},
        }


def together(frames):
    """Returns one hash of all frames."""
    lines = "".join(f"{value}  {name}\n" for name, value in frames.items())
    return hashlib.sha256(lines.encode()).hexdigest()


def difference(old, new, same_options=True):
    """Returns a description of the difference between two films; empty if they are equal."""
    if old is None:
        return "it is missing there"
    if old["scene"] != new["scene"]:
        return "it was another scene"
    if same_options and old["options"] != new["options"]:
        return "it had other options: " + " ".join(old["options"])
    names = sorted(old["frames"].keys() | new["frames"].keys())
    differ = [name for name in names if old["frames"].get(name) != new["frames"].get(name)]
    found = [f"{len(differ)} of {len(names)} frames, the first is {differ[0]}"] if differ else []
    return "; ".join(found + ["the video"] * (old["video"] != new["video"]))


def verdict(name, found):
    """Formats the result of a film's comparison."""
    return f"DIFFERENT from {name}: {found}" if found else f"same as {name}"


def read_kept(path):
    """Reads the hashes of an earlier run."""
    need_files([path])
    try:
        return json.loads(path.read_text())
    except ValueError as error:
        raise Failure(f"{path} is not what --keep writes: {error}") from None


def compared(options, films):
    """Renders all films, and prints a row for each. Returns their hashes, and the names of the films that differ."""
    kept = read_kept(options.against) if options.against else {}
    found, differ = {}, []
    with tempfile.TemporaryDirectory() as folder:
        files = scenes(films, options.program, Path(folder))
        print(tables.header(["film", "seconds", "video", "frames", "verdict"]))
        for film in films:
            if options.before:
                kept[film.name] = hashes(options.before, film, files[film.scene], options.full)
            begin = time.monotonic()
            new = found[film.name] = hashes(options.program, film, files[film.scene], options.full)
            seconds = time.monotonic() - begin
            beside = {}
            if options.before or options.against:
                beside["before"] = difference(kept.get(film.name), new)
            if film.like:
                beside[film.like] = difference(found[film.like], new, same_options=False)
            text = "; ".join(verdict(*one) for one in beside.items())
            print(tables.row([film.name, f"{seconds:.1f}", new["video"], together(new["frames"]), text]), flush=True)
            differ += [film.name] * any(beside.values())
    return found, differ


def main(options):
    """Prints the table, keeps the hashes, and fails if a film differs."""
    films = chosen(options.film)
    if options.list:
        rows = [[film.name, film.scene, " ".join(film.words(options.full)), film.like] for film in films]
        print(tables.table(["film", "scene", "options", "equal to"], rows))
        return
    options.program = need_program(options)
    if options.before:
        need_files([options.before])
        options.before = options.before.resolve()
    if options.keep and not options.keep.resolve().parent.is_dir():
        raise Failure(f"the folder of {options.keep} is missing")
    begin = time.monotonic()
    found, differ = compared(options, films)
    print(f"\n{len(films)} films in {time.monotonic() - begin:.0f} seconds.")
    if options.keep:
        options.keep.write_text(json.dumps(found, indent=1) + "\n")
    if differ:
        raise Failure(f"{len(differ)} of {len(films)} films differ: {', '.join(differ)}")
