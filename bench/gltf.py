"""glTF files rendered here and by three.js with the same camera, and the agreement of their silhouettes.

    python3 bench gltf FOLDER … [--output DIR] [--modules DIR] [--chromium PROGRAM]

Each .gltf and .glb file of the folders is rendered at 256x256 with its film's camera, and shown by three.js in headless
Chromium. The camera is read from an OpenEXR frame's header, so both show the same view at time 0.

    silhouette  here: pixels of finite depth; three.js: pixels of any opacity before a transparent background
    IoU         pixels in both silhouettes, divided by pixels in either

The output is pages of picture pairs (sheet-01.png, index.html) and results.json. A refused file must end in one line.
The command fails if any file ends in another way, such as by a panic or by exceeding its time.
Requires node with the packages three and playwright-core, Chromium, and numpy, pillow and OpenEXR from PyPI.
"""

import html
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from running import Failure, ROOT, add_program, need_installed, need_program

try:
    import numpy as np
    import OpenEXR
    from PIL import Image, ImageDraw
except ImportError as missing:
    np = missing.name

SIDE = 256
# Larger files are skipped [bytes].
LARGEST = 10_000_000
# Time limit for one file [s].
PATIENCE = 120
# Minimum agreement of silhouettes.
WANTED = 0.97


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="folders of .gltf and .glb files, or such files")
    parser.add_argument("--output", type=Path, default=Path("out/bench-gltf"), help="folder of the pages, out/bench-gltf")
    parser.add_argument("--modules", type=Path, default=Path("node_modules"), help="folder of the packages of node")
    parser.add_argument("--chromium", type=Path, default=Path("/usr/bin/chromium"), help="the browser")
    add_program(parser)


def files_of(folders):
    """Returns all glTF files below the folders, in order of their paths."""
    found = set()
    for folder in folders:
        if not folder.exists():
            raise Failure(f"{folder} is missing")
        inside = [folder] if folder.is_file() else folder.rglob("*")
        found.update(path for path in inside if path.suffix.lower() in (".gltf", ".glb") and path.is_file())
    return sorted(path.resolve() for path in found if path.stat().st_size <= LARGEST)


def run_once(command):
    """Returns the exit code, and the lines of standard error."""
    try:
        done = subprocess.run([str(word) for word in command], capture_output=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return None, [f"no end after {PATIENCE} s"]
    return done.returncode, [line for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]


def camera_of(header):
    """Returns the right-handed view and projection matrices in three.js's format: 16 numbers, column by column."""
    # The attribute's rows are the images of the axes: columns of a matrix. It is left-handed, with z along the view.
    camera = np.array(header["worldToCamera"], np.float64)
    picture = np.array(header["worldToNDC"], np.float64)
    # From camera space to picture space, x and y in 0…1 from the upper left.
    own = np.linalg.inv(camera) @ picture
    flip = np.diag([1.0, 1.0, -1.0, 1.0])
    right_handed = camera @ flip
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 * own[0, 0], -2 * own[1, 1]
    perspective = abs(own[2, 3]) > 1e-6
    projection[2, 3], projection[3, 3] = (-1.0, 0.0) if perspective else (0.0, 1.0)
    return right_handed.flatten().tolist(), projection.flatten().tolist()


def rendered(program, path, folder):
    """Renders a file here. Returns picture, silhouette and camera, or the final error line."""
    picture, frames = folder / "here.png", folder / "frames"
    # The ground of a studio would hide the silhouettes.
    common = ["--size", f"{SIDE}x{SIDE}", "--overwrite", "--studio", "off"]
    code, lines = run_once([program, "still", path, "-o", picture, "--samples", "1", *common])
    result = {"file": str(path), "code": code, "lines": lines}
    if code != 0:
        return result
    layers = ["--frames", "1", "--exr", frames, "--aov", "depth", "-q"]
    code, lines = run_once([program, "render", path, "-o", folder / "film.m2v", *layers, *common])
    if code != 0:
        return {**result, "code": code, "lines": lines}
    with OpenEXR.File(str(frames / "frame_00000.exr")) as frame:
        np.save(folder / "here.npy", np.isfinite(frame.channels()["depth.Z"].pixels))
        camera_from_world, projection = camera_of(frame.header())
    return {**result, "camera_from_world": camera_from_world, "projection": projection}


def shown_by_three(results, folders, options):
    """Adds three.js's picture of each rendered file."""
    jobs = []
    for result, folder in zip(results, folders):
        if "projection" in result:
            jobs.append({**result, "output": str(folder / "three.png"), "width": SIDE, "height": SIDE})
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(jobs, file)
        file.flush()
        environment = {**os.environ, "MODULES": str(options.modules), "CHROMIUM": str(options.chromium)}
        script = ROOT / "bench" / "gltf_views.mjs"
        done = subprocess.run(["node", script, file.name], stdout=subprocess.PIPE, env=environment, check=False)
    if done.returncode != 0:
        raise Failure("three.js ended with an error; see above")
    by_file = {shown["file"]: shown for shown in map(json.loads, done.stdout.decode().splitlines())}
    for result, folder in zip(results, folders):
        shown = by_file.get(result["file"])
        if shown is None:
            continue
        if shown.get("failure"):
            result["three"] = shown["failure"]
            continue
        theirs = np.array(Image.open(folder / "three.png").convert("RGBA"))[:, :, 3] > 0
        ours = np.load(folder / "here.npy")
        either = np.count_nonzero(ours | theirs)
        result["iou"] = np.count_nonzero(ours & theirs) / either if either else 1.0


def sheets(results, folders, output):
    """Writes pages of picture pairs, 5 across and 6 down: ours on the left, three.js on the right."""
    across, down, side, head = 5, 6, 160, 26
    rows = [(result, folder) for result, folder in zip(results, folders) if (folder / "here.png").is_file()]
    for page, first in enumerate(range(0, len(rows), across * down)):
        sheet = Image.new("RGB", (across * (2 * side + 6), down * (side + head)), "white")
        draw = ImageDraw.Draw(sheet)
        for k, (result, folder) in enumerate(rows[first : first + across * down]):
            x, y = k % across * (2 * side + 6), k // across * (side + head)
            for place, name in enumerate(("here.png", "three.png")):
                if (folder / name).is_file():
                    image = Image.open(folder / name).convert("RGBA").resize((side, side))
                    backdrop = Image.new("RGBA", image.size, (90, 90, 110, 255))
                    sheet.paste(Image.alpha_composite(backdrop, image), (x + place * side, y + head))
            iou = f"{result['iou']:.3f}" if "iou" in result else "three.js: " + result.get("three", "")[:30]
            draw.text((x + 2, y + 1), f"{first + k} {Path(result['file']).name[:44]}", "black")
            draw.text((x + 2, y + 12), iou, "black" if result.get("iou", 0) >= WANTED else "red")
        sheet.save(output / f"sheet-{page + 1:02}.png")


def page_of(results, folders, output):
    """Writes index.html: both pictures of each file, agreement, and notes or the final error line."""
    parts = ["<!DOCTYPE html><meta charset=utf-8><title>glTF here and in three.js</title><table>"]
    for result, folder in zip(results, folders):
        images = "".join(
            f"<td><img src='{folder.name}/{name}' alt=''>" if (folder / name).is_file() else "<td>"
            for name in ("here.png", "three.png")
        )
        agreement = f"{result['iou']:.3f}" if "iou" in result else ""
        lines = html.escape("\n".join(result["lines"]))
        three = html.escape(result.get("three", ""))
        parts.append(f"<tr><td>{html.escape(result['file'])}<td>{agreement}{images}<td><pre>{lines}</pre>{three}")
    (output / "index.html").write_text("\n".join(parts), encoding="utf-8")


def is_true_end(result):
    """Returns whether a file is rendered, or refused in one line with the exit code of failures."""
    return result["code"] == 0 or (result["code"] == 1 and len(result["lines"]) == 1)


def main(options):
    """Renders, compares and prints."""
    if isinstance(np, str):
        raise Failure(f"the package {np} is missing; install it: pip install numpy pillow OpenEXR")
    need_installed("node")
    program = need_program(options)
    files = files_of(options.folders)
    if not files:
        raise Failure("there is no .gltf or .glb file")
    folders = [options.output / f"{number:04}" for number in range(len(files))]
    results = []
    for number, (path, folder) in enumerate(zip(files, folders)):
        folder.mkdir(parents=True, exist_ok=True)
        for stale in ("here.png", "three.png", "here.npy"):
            (folder / stale).unlink(missing_ok=True)
        results.append(rendered(program, path, folder))
        print(f"\r{number + 1} of {len(files)}", end="", file=sys.stderr)
    print(file=sys.stderr)
    shown_by_three(results, folders, options)
    sheets(results, folders, options.output)
    page_of(results, folders, options.output)
    (options.output / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")

    drawn = [result for result in results if result["code"] == 0]
    compared = [result for result in drawn if "iou" in result]
    low = [result for result in compared if result["iou"] < WANTED]
    wrong = [result for result in results if not is_true_end(result)]
    for result in low:
        print(f"{result['iou']:.3f}  {result['file']}")
    for result in wrong:
        print(f"WRONG END  {result['file']}: {' / '.join(result['lines'])}")
    print(f"{len(files)} files: {len(drawn)} drawn, {len(files) - len(drawn)} refused, of these {len(wrong)} not in one line")
    print(f"{len(compared)} shown by three.js too: IoU {WANTED} or more in {len(compared) - len(low)}")
    print(f"pages: {options.output}/index.html, sheet-*.png")
    if wrong:
        raise Failure(f"{len(wrong)} files neither drawn nor refused in one line")
