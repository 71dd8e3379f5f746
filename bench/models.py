"""CPU seconds and memory of stills of glTF models, and a page that shows all pictures.

Renders each model with the default options of `render2mpeg still`, at --size, and prints a row for each. Models that cannot be
read are listed with the program's message. --output DIR keeps the pictures and writes DIR/index.html.
"""

import html
import os
import statistics
import subprocess
import tempfile
from pathlib import Path

from running import RELEASE, Failure, waited
from tables import row, header


def add_options(command):
    """Adds the options of this measurement."""
    command.add_argument("models", nargs="+", type=Path, metavar="FILE|FOLDER", help="glTF files, or folders of them")
    command.add_argument("--program", type=Path, default=RELEASE / "render2mpeg", help="the program render2mpeg")
    command.add_argument("--size", default="512x512", help="size of the pictures, 512x512 by default")
    command.add_argument("--output", type=Path, metavar="DIR", help="folder of the pictures and their page")
    command.add_argument("--also", default="", metavar="OPTIONS", help="further options of render2mpeg still")


def main(options):
    """Renders all models."""
    files = sorted(file for path in options.models for file in scenes_in(path))
    if not files:
        raise Failure("the folders contain no .glb or .gltf files")
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.output or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        print(header(["Model", "CPU s", "MB"]))
        pictures, refused = [], []
        for name, file in zip(names(files), files):
            picture = folder / f"{name}.png"
            found = still(options, file, picture)
            if isinstance(found, str):
                refused.append((name, found))
                continue
            pictures.append((name, *found))
            print(row([name, f"{found[0]:.2f}", f"{found[1]:.0f}"]), flush=True)
        if pictures:
            seconds, megabytes = ([picture[column] for picture in pictures] for column in (1, 2))
            print(row(["median", f"{statistics.median(seconds):.2f}", f"{statistics.median(megabytes):.0f}"]))
        for name, message in refused:
            print(f"{name}: {message}")
        if options.output:
            (folder / "index.html").write_text(page(pictures), encoding="utf-8")
            print(folder / "index.html")


def scenes_in(path):
    """Returns the glTF files at a path; one for each folder, because folders often have a model in several forms."""
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise Failure(f"{path} is neither a file nor a folder")
    by_folder = {}
    for file in sorted(path.rglob("*.gl*")):
        if file.suffix in (".glb", ".gltf"):
            by_folder.setdefault(file.parent, file)
    return list(by_folder.values())


def names(files):
    """Returns a different name for each file."""
    used, result = set(), []
    for file in files:
        name = file.stem
        while name in used:
            name += "_"
        used.add(name)
        result.append(name)
    return result


def still(options, file, picture):
    """Renders a still. Returns its CPU seconds and peak memory (MB), or the message of a failure."""
    words = [options.program, "still", file, "-o", picture, "--size", options.size, "--overwrite", "--quiet"]
    with tempfile.TemporaryFile() as errors:
        settings = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": errors}
        code, usage = waited([str(word) for word in words] + options.also.split(), **settings)
        errors.seek(0)
        message = errors.read().decode(errors="replace").strip()
    if code != 0:
        return message or f"exit code {code}"
    # Linux counts memory in KiB, macOS in bytes.
    unit = 1 if os.uname().sysname == "Darwin" else 1024
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * unit / 1e6


def page(pictures):
    """Returns a page with all pictures."""
    figures = []
    for name, seconds, megabytes in pictures:
        text = html.escape(name)
        caption = f"{text}, {seconds:.1f} CPU s, {megabytes:.0f} MB"
        figures.append(f'<figure><img src="{text}.png" alt="{text}" width="256"><figcaption>{caption}</figcaption></figure>')
    style = "body{font:14px sans-serif;display:flex;flex-wrap:wrap;gap:12px}figure{margin:0;width:256px}"
    return f'<!doctype html><meta charset="utf-8"><title>Models</title><style>{style}</style>\n' + "\n".join(figures) + "\n"
