#!/usr/bin/env python3
"""Compares a reference picture of ours with Mitsuba 3, a renderer that shares no code with it.

    render2mpeg reference SCENE.glb --size 128x128 --spp 512 -o ours.exr
    python3 tests/compare_mitsuba.py SCENE.glb ours.exr

Found that way: largest |z| 3.11, rms 0.95 for scenes/cornell/cornell.glb (with --block 8 --spp 4); largest |z| 2.81, rms 1.18 for McGuire's
CornellBox-Original. There the lamp hangs a centimetre below the ceiling and shines up, too: what escapes through the gap are rare
bright paths, whose variance a few groups of samples underestimate; blocks of 8x8 pixels (--block 8) are too small for them to even out.

SCENE is a .glb of Lambert surfaces and area lights, shown at time 0. Mitsuba renders it `--seeds` times with `--spp` paths a
pixel and a box filter. Both pictures are averaged over blocks of 16x16 pixels; standard errors follow from Mitsuba's seeds and from
the variance channels of ours. Printed is the largest |difference| / standard error of all blocks and channels, and the root mean
square of all of them, which should be about 1. The exit code is 1 when a block is off by more than `--limit` standard errors.

Needs numpy, pillow and mitsuba. Exit code 77: one of them is missing.
"""

import argparse
import io
import json
import struct
import sys

try:
    import mitsuba as mi
    import numpy as np
    from PIL import Image

    # The vectorised variants need an LLVM that not every machine has.
    mi.set_variant("scalar_rgb")
except ImportError as error:
    print(f"left out: {error}")
    sys.exit(77)

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """A glTF 2.0 binary file, as far as these scenes use it."""

    def __init__(self, path):
        data = open(path, "rb").read()
        (length,) = struct.unpack_from("<I", data, 12)
        self.json = json.loads(data[20 : 20 + length])
        self.bin = data[20 + length + 8 :]

    def view(self, index):
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.bin[start : start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        a = self.json["accessors"][index]
        data, stride = self.view(a["bufferView"])
        kind, width = np.dtype(COMPONENTS[a["componentType"]]), WIDTHS[a["type"]]
        stride = stride or kind.itemsize * width
        rows = np.ndarray((a["count"], width), kind, data, a.get("byteOffset", 0), (stride, kind.itemsize))
        return rows.copy()

    def matrices(self):
        """World from local of each node, at the first key of the animation."""
        nodes = self.json["nodes"]
        for channel in self.json.get("animations", [{"channels": []}])[0]["channels"]:
            sampler = self.json["animations"][0]["samplers"][channel["sampler"]]
            keys = self.accessor(sampler["output"])
            first = keys[1 if sampler.get("interpolation") == "CUBICSPLINE" else 0]
            nodes[channel["target"]["node"]][channel["target"]["path"]] = first.tolist()
        world = {}
        stack = [(n, np.eye(4)) for n in self.json["scenes"][self.json.get("scene", 0)]["nodes"]]
        while stack:
            index, parent = stack.pop()
            world[index] = parent @ local_matrix(nodes[index])
            stack += [(child, world[index]) for child in nodes[index].get("children", [])]
        return world


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), float)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", [1, 1, 1]), float)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def reflectance(glb, material):
    """A bitmap in linear light for a texture, as bilinear as ours; else a colour."""
    pbr = material.get("pbrMetallicRoughness", {})
    assert pbr.get("metallicFactor", 1) == 0 and pbr.get("roughnessFactor", 1) == 1, f"not Lambert: {material}"
    factor = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
    texture = pbr.get("baseColorTexture")
    if texture is None:
        return {"type": "rgb", "value": factor}
    assert factor == [1, 1, 1], "a factor on a texture"
    image = glb.json["images"][glb.json["textures"][texture["index"]]["source"]]
    picture = Image.open(io.BytesIO(glb.view(image["bufferView"])[0])).convert("RGB")
    code = np.asarray(picture, np.float32) / 255
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(linear), "raw": True, "filter_type": "bilinear", "wrap_mode": "repeat"}


def mesh(glb, primitive, world, number):
    material = glb.json["materials"][primitive["material"]]
    positions = glb.accessor(primitive["attributes"]["POSITION"]) @ world[:3, :3].T + world[:3, 3]
    faces = glb.accessor(primitive["indices"]).reshape(-1, 3)
    if np.linalg.det(world[:3, :3]) < 0:
        faces = faces[:, ::-1]
    bsdf = {"type": "diffuse", "reflectance": reflectance(glb, material)}
    emission = np.array(material.get("emissiveFactor", [0, 0, 0]), float)
    emission *= material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    uvs = primitive["attributes"].get("TEXCOORD_0")
    sides = [faces]
    if emission.any() and material.get("doubleSided"):
        # Mitsuba's lights shine from one side: the other is a second mesh, turned round, behind the first.
        sides.append(faces[:, ::-1])
    meshes = []
    for side, triangles in enumerate(sides):
        props = mi.Properties()
        # Flat, as these scenes are: normals are those of the triangles.
        props["face_normals"] = True
        one_sided = bsdf if emission.any() or not material.get("doubleSided") else {"type": "twosided", "bsdf": bsdf}
        props["bsdf"] = mi.load_dict(one_sided)
        if emission.any():
            props["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": emission.tolist()}})
        shape = mi.Mesh(f"mesh {number}.{side}", len(positions), len(triangles), props, has_vertex_texcoords=uvs is not None)
        shift = np.zeros(3)
        if len(sides) > 1:
            a, b, c = positions[triangles[0]]
            normal = np.cross(b - a, c - a)
            shift = normal / np.linalg.norm(normal) * 1e-5 * np.abs(positions).max()
        parameters = mi.traverse(shape)
        parameters["vertex_positions"] = (positions + shift).astype(np.float32).ravel()
        parameters["faces"] = triangles.astype(np.uint32).ravel()
        if uvs is not None:
            # Both count v from the top of the picture.
            parameters["vertex_texcoords"] = glb.accessor(uvs).astype(np.float32).ravel()
        parameters.update()
        meshes.append(shape)
    return meshes


def load(glb, width, height):
    world = glb.matrices()
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": -1, "rr_depth": 12}}
    for index, matrix in world.items():
        node = glb.json["nodes"][index]
        for number, primitive in enumerate(glb.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []):
            for side, shape in enumerate(mesh(glb, primitive, matrix, f"{index}.{number}")):
                scene[f"shape_{index}_{number}_{side}"] = shape
        if "camera" in node and "sensor" not in scene:
            lens = glb.json["cameras"][node["camera"]]["perspective"]
            # Mitsuba looks along +z with +x to the left.
            turn = np.diag([-1.0, 1.0, -1.0, 1.0])
            rigid = matrix.copy()
            rigid[:3, :3] /= np.linalg.norm(rigid[:3, :3], axis=0)
            scene["sensor"] = {
                "type": "perspective",
                "fov_axis": "y",
                "fov": float(np.degrees(lens["yfov"])),
                "near_clip": 1e-3,
                "far_clip": 1e4,
                "to_world": mi.ScalarTransform4f(rigid @ turn),
                "film": {
                    "type": "hdrfilm",
                    "width": width,
                    "height": height,
                    "pixel_format": "rgb",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "independent"},
            }
    return mi.load_dict(scene)


def channels(path):
    """Named channels of an EXR file."""
    bitmap = mi.Bitmap(path)
    data = np.array(bitmap, np.float64)
    names = [field.name for field in bitmap.struct_()]
    return {name: data[:, :, i] for i, name in enumerate(names)}


def blocks(picture, side):
    """Means over blocks of side x side pixels; what is left over at the borders is not used."""
    rows, columns = picture.shape[0] // side, picture.shape[1] // side
    return picture[: rows * side, : columns * side].reshape(rows, side, columns, side, -1).mean(axis=(1, 3))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("ours")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=64)
    parser.add_argument("--block", type=int, default=16)
    parser.add_argument("--limit", type=float, default=4.0)
    parser.add_argument("--write", metavar="EXR", help="also write Mitsuba's picture")
    arguments = parser.parse_args()

    named = channels(arguments.ours)
    ours = np.stack([named[c] for c in "RGB"], axis=-1)
    variance = np.stack([named[f"variance.{c}"] for c in "RGB"], axis=-1)
    height, width = ours.shape[:2]
    scene = load(Glb(arguments.scene), width, height)
    runs, total = [], 0
    for seed in range(arguments.seeds):
        picture = np.array(mi.render(scene, spp=arguments.spp, seed=1000 + seed), np.float64)
        total = total + picture
        runs.append(blocks(picture, arguments.block))
    if arguments.write:
        mi.Bitmap((total / arguments.seeds).astype(np.float32)).write(arguments.write)

    runs = np.array(runs)
    theirs, their_variance = runs.mean(axis=0), runs.var(axis=0, ddof=1) / arguments.seeds
    our_blocks = blocks(ours, arguments.block)
    our_variance = blocks(variance, arguments.block) / arguments.block**2
    error = np.sqrt(their_variance + our_variance)
    z = (our_blocks - theirs) / np.maximum(error, 1e-6 * theirs.mean())
    worst = np.unravel_index(np.abs(z).argmax(), z.shape)
    relative = error.mean() / theirs.mean()
    print(
        f"{z.size} block means of {arguments.block}x{arguments.block} pixels: largest |z| {np.abs(z[worst]):.2f} "
        f"(block {worst[1]},{worst[0]} channel {'RGB'[worst[2]]}: {our_blocks[worst]:.6g} and {theirs[worst]:.6g}), "
        f"rms z {np.sqrt((z**2).mean()):.3f}, mean ratio {our_blocks.mean() / theirs.mean():.5f}, "
        f"standard error {relative:.2%} of the mean"
    )
    sys.exit(0 if np.abs(z).max() <= arguments.limit else 1)


if __name__ == "__main__":
    main()
