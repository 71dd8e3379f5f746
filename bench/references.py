"""Reference films and pictures: made once, kept in out/bench-references, and named by all of their inputs."""

import hashlib
import json
import os
import sys
from pathlib import Path

from running import ROOT

FOLDER = ROOT / "out" / "bench-references"


def scene_files(scene):
    """Yields the files of a scene: the scene, its settings, and the files that a .gltf file refers to."""
    scene = Path(scene)
    yield scene
    settings = scene.with_suffix(".toml")
    if settings.is_file():
        yield settings
    if scene.suffix == ".gltf":
        parts = json.loads(scene.read_text())
        for part in parts.get("buffers", []) + parts.get("images", []):
            uri = part.get("uri", "data:")
            # Embedded data is covered by the hash of the scene file.
            if not uri.startswith("data:") and (scene.parent / uri).is_file():
                yield scene.parent / uri


def content_hash(scene):
    """Returns a hash of a scene's content: twelve digits."""
    digest = hashlib.sha256()
    for file in scene_files(scene):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:12]


def kept(scene, details, ending, make):
    """Returns the reference of a scene with these details (size, camera, frames or paths); `make(path)` writes a missing one."""
    name = "-".join([Path(scene).stem, content_hash(scene), *map(str, details)])
    path = FOLDER / f"{name}{ending}"
    if not path.exists():
        FOLDER.mkdir(parents=True, exist_ok=True)
        print(f"making a reference, once, beside the time of the measurement: {path}", file=sys.stderr, flush=True)
        # The file has another name until it is complete.
        unfinished = FOLDER / f"unfinished-{os.getpid()}-{path.name}"
        try:
            make(unfinished)
            unfinished.rename(path)
        finally:
            unfinished.unlink(missing_ok=True)
    return path
