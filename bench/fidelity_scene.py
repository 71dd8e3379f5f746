"""Scenarios of Khronos' glTF-Render-Fidelity-Generator, rendered here: model, orbit camera, sky and tone curve.

A scenario is a dictionary of the generator's config.json, completed by `complete`. `render` returns the picture that the
generator keeps as a golden: 8-bit RGBA, with the tone curve of its scripts for Cycles and V-Ray.
Modules `fidelity` and packaging/fidelity_render2mpeg.py share these functions.
"""

import copy
import json
import math
import os
import struct
import urllib.parse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

from running import run

# Values that scenarios leave out: src/config-reader.ts of the generator.
DEFAULTS = {
    "lighting": "../../../environments/lightroom_14b.hdr",
    "dimensions": {"width": 768, "height": 768},
    "target": {"x": 0, "y": 0, "z": 0},
    "orbit": {"theta": 0, "phi": 90, "radius": 1},
    "verticalFoV": 45,
    "renderSkybox": False,
}
CONSTANT_SKY = "zenith = [{0}, {0}, {0}]\nhorizon = [{0}, {0}, {0}]\nground = [{0}, {0}, {0}]"
CAMERA = "fidelity-camera"
# The middle of the image is at +x, as in three.js and in Cycles after the import of glTF. Ours is at -z.
SKY_ROTATION = -90
# Extensions that make surfaces emit light or transparent. The goldens' alpha counts glass as opaque, as in Cycles.
NOT_IN_HOLD_OUT = (
    "KHR_materials_unlit",
    "KHR_materials_emissive_strength",
    "KHR_materials_transmission",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_volume",
)
# Tone curve of three.js's ACESFilmicToneMapping (docs/REFERENCES.md), with matrices for row vectors.
EXPOSURE = 1 / 0.6
ACES_INPUT = np.array([[0.59719, 0.07600, 0.02840], [0.35458, 0.90834, 0.13383], [0.04823, 0.01566, 0.83777]])
ACES_OUTPUT = np.array([[1.60475, -0.10208, -0.00327], [-0.53108, 1.10813, -0.07276], [-0.07367, -0.00605, 1.07602]])
GAMMA = 2.2


@dataclass
class Quality:
    """Renderer and effort: paths per pixel, a film's renderer instead of the path tracer, OIDN, threads (None: all)."""

    spp: int = 64
    still: bool = False
    denoise: bool = False
    threads: int = None


def complete(scenario):
    """Returns the scenario with the generator's defaults for missing values."""
    whole = copy.deepcopy({**DEFAULTS, **scenario})
    for name in ("dimensions", "target", "orbit"):
        whole[name] = {**DEFAULTS[name], **scenario.get(name, {})}
    return whole


def read_gltf(path):
    """Returns the JSON and the binary chunk of a .gltf or .glb file; the chunk may be None."""
    data = Path(path).read_bytes()
    if data[:4] != b"glTF":
        return json.loads(data), None
    (length,) = struct.unpack_from("<I", data, 12)
    rest = data[20 + length :]
    return json.loads(data[20 : 20 + length]), rest[8:] if rest else None


def write_glb(path, document, chunk):
    """Writes JSON and a binary chunk, which may be None, as a .glb file."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if chunk is not None:
        chunks += struct.pack("<I4s", len(chunk), b"BIN\0") + chunk
    Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def files_of(document):
    """Returns the decoded paths of the files that a glTF document names."""
    items = document.get("buffers", []) + document.get("images", [])
    uris = [item["uri"] for item in items if "uri" in item]
    return [urllib.parse.unquote(uri) for uri in uris if not uri.startswith("data:")]


def camera_matrix(scenario):
    """Returns the camera's world matrix as 16 numbers, column by column. Radius 0 looks outward from the target."""
    orbit, target = scenario["orbit"], scenario["target"]
    theta, phi = math.radians(orbit["theta"]), math.radians(orbit["phi"])
    # The camera looks along -z. θ rotates about y from +z to +x; φ is the angle from +y.
    right = (math.cos(theta), 0.0, -math.sin(theta))
    up = (-math.cos(phi) * math.sin(theta), math.sin(phi), -math.cos(phi) * math.cos(theta))
    back = (math.sin(phi) * math.sin(theta), math.cos(phi), math.sin(phi) * math.cos(theta))
    eye = [target[axis] + orbit["radius"] * back[k] for k, axis in enumerate("xyz")]
    return [*right, 0, *up, 0, *back, 0, *eye, 1]


def staged(document, scenario, model, folder):
    """Returns the glTF document at rest with the scenario's camera, for a file in `folder`."""
    document = copy.deepcopy(document)
    document.pop("animations", None)
    # Named files are in the model's folder.
    for item in document.get("buffers", []) + document.get("images", []):
        if "uri" in item and not item["uri"].startswith("data:"):
            file = Path(model).parent / urllib.parse.unquote(item["uri"])
            item["uri"] = urllib.parse.quote(os.path.relpath(file.resolve(), Path(folder).resolve()))
    # The near plane is closer than any surface.
    size, orbit = scenario["dimensions"], scenario["orbit"]
    lens = {"yfov": math.radians(scenario["verticalFoV"]), "znear": max(orbit["radius"], 1e-2) / 1000}
    lens["aspectRatio"] = size["width"] / size["height"]
    cameras, nodes = document.setdefault("cameras", []), document.setdefault("nodes", [])
    cameras.append({"type": "perspective", "perspective": lens, "name": CAMERA})
    nodes.append({"name": CAMERA, "camera": len(cameras) - 1, "matrix": camera_matrix(scenario)})
    document["scenes"][document.get("scene", 0)].setdefault("nodes", []).append(len(nodes) - 1)
    return document


def hold_out(document):
    """Returns the glTF document without emitted light and with opaque glass, to find the pixels that show the sky."""
    document = copy.deepcopy(document)
    for material in document.get("materials", []):
        for key in ("emissiveFactor", "emissiveTexture"):
            material.pop(key, None)
        for extension in NOT_IN_HOLD_OUT:
            material.get("extensions", {}).pop(extension, None)
    return document


def unlit(document):
    """Returns the glTF document with emitted light equal to the base color, for the denoiser."""
    document = hold_out(document)
    for material in document.get("materials", []):
        material.setdefault("extensions", {})["KHR_materials_unlit"] = {}
    document["extensionsUsed"] = sorted({*document.get("extensionsUsed", []), "KHR_materials_unlit"})
    return document


def usable_sky(path, folder):
    """Returns a sky image that our renderer reads: the file itself, or a linear OpenEXR copy of an sRGB picture."""
    path = Path(path)
    if path.suffix.lower() in (".hdr", ".exr"):
        return path
    coded = np.asarray(Image.open(path).convert("RGB"), np.float32) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4).astype(np.float32)
    copied = Path(folder) / f"{path.stem}.exr"
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": linear}).write(str(copied))
    return copied


def read_radiance(path):
    """Returns the radiance of an OpenEXR picture."""
    channels = OpenEXR.File(str(path)).channels()
    picture = channels["RGB"].pixels if "RGB" in channels else channels["RGBA"].pixels[..., :3]
    return picture.astype(np.float64)


def rendered(program, command, folder, name, sky, scenario, options):
    """Renders `folder`/`name`.glb under the sky of a TOML table by `still` or `reference`, and returns the radiance."""
    size = scenario["dimensions"]
    scene, picture = folder / f"{name}.glb", folder / f"{name}.exr"
    scene.with_suffix(".toml").write_text(f"[sky]\n{sky}\n")
    words = [program, command, scene, "-o", picture, "--camera", CAMERA, "--size", f"{size['width']}x{size['height']}"]
    run([*words, "--allow-outside", "--overwrite", "--quiet", *options])
    return read_radiance(picture)


def render(program, scenario, model, lighting, folder, quality):
    """Renders a completed scenario, and returns the golden: an array of 8-bit RGBA pixels.

    `model` and `lighting` are paths. `folder` receives intermediate files.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    document, chunk = read_gltf(model)
    document = staged(document, scenario, model, folder)
    image = os.path.relpath(usable_sky(lighting, folder).resolve(), folder.resolve())
    sky = f"image = {json.dumps(image)}\nrotation = {SKY_ROTATION}"
    threads = ["--threads", str(quality.threads)] if quality.threads else []
    paths = [*threads, "--spp", str(quality.spp)]
    first_hits = [*paths, "--bounces", "0"]

    def picture_of(name, changed, sky, options, command="reference"):
        write_glb(folder / f"{name}.glb", changed, chunk)
        return rendered(program, command, folder, name, sky, scenario, options)

    if quality.still:
        picture = picture_of("scene", document, sky, threads, "still")
    else:
        picture = picture_of("scene", document, sky, paths)
    alpha = None
    if not scenario["renderSkybox"]:
        # Subtract the visible sky. A white sky behind black surfaces shows the fraction of each pixel that is not covered.
        picture = picture - picture_of("sky", hold_out(document), sky, first_hits)
        alpha = 1 - picture_of("alpha", hold_out(document), CONSTANT_SKY.format(1), first_hits)[..., 1]
    if quality.denoise:
        picture = denoised(picture, picture_of("albedo", unlit(document), CONSTANT_SKY.format(0), first_hits))
    return coded(picture, alpha)


def denoised(picture, albedo):
    """Returns the picture after OIDN, which Cycles applies to its goldens."""
    import pyoidn

    color, albedo = (np.ascontiguousarray(np.maximum(x, 0), np.float32) for x in (picture, np.minimum(albedo, 1)))
    return pyoidn.denoise(color, albedo=albedo, hdr=True).astype(np.float64)


def coded(radiance, alpha):
    """Returns 8-bit RGBA after the goldens' exposure, tone curve and gamma. As in the goldens, colors contain alpha."""
    light = np.maximum(radiance, 0) * EXPOSURE @ ACES_INPUT
    light = (light * (light + 0.0245786) - 0.000090537) / (light * (0.983729 * light + 0.4329510) + 0.238081)
    colors = np.clip(light @ ACES_OUTPUT, 0, 0.9999) ** (1 / GAMMA)
    alpha = np.ones(colors.shape[:2]) if alpha is None else np.clip(alpha, 0, 1)
    # The generator truncates.
    return (np.dstack([colors, alpha]) * 255).astype(np.uint8)
