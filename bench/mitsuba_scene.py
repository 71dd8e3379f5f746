"""glTF scenes for Mitsuba 3: meshes, base colors, glass, area lights, punctual lights, cameras, at any time of an animation.

All other surfaces are matte (see `matte`), so the comparison covers light transport, filters, sampling and refraction, not models
of coats.
A Mitsuba variant must be set before this module is imported. `load` rejects unsupported content.
"""

import copy
import io
import json
import struct
from pathlib import Path

import mitsuba as mi
import numpy as np
from PIL import Image

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# Largest albedo of a surface, so that paths end sooner.
LARGEST_ALBEDO = 0.9


class Glb:
    """A glTF 2.0 binary file."""

    def __init__(self, path):
        data = Path(path).read_bytes()
        (length,) = struct.unpack_from("<I", data, 12)
        self.json = json.loads(data[20 : 20 + length])
        self.bin = data[20 + length + 8 :]

    def write(self, path):
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self.bin), b"BIN\0") + self.bin
        Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)

    def view(self, index):
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.bin[start : start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        a = self.json["accessors"][index]
        data, stride = self.view(a["bufferView"])
        kind, width = np.dtype(COMPONENTS[a["componentType"]]), WIDTHS[a["type"]]
        rows = np.ndarray((a["count"], width), kind, data, a.get("byteOffset", 0), (stride or kind.itemsize * width, kind.itemsize))
        return rows / np.iinfo(kind).max if a.get("normalized") else rows.copy()

    def matrices(self, time):
        """Returns the world-from-local matrix of each node of the scene, with the first animation at `time` [s]."""
        nodes = copy.deepcopy(self.json["nodes"])
        for animation in self.json.get("animations", [])[:1]:
            for channel in animation["channels"]:
                target = channel["target"]
                if target["path"] == "weights" or "node" not in target:
                    continue
                nodes[target["node"]][target["path"]] = self.sample(animation["samplers"][channel["sampler"]], target["path"], time)
        world = {}
        stack = [(n, np.eye(4)) for n in self.json["scenes"][self.json.get("scene", 0)]["nodes"]]
        while stack:
            index, parent = stack.pop()
            world[index] = parent @ local_matrix(nodes[index])
            stack += [(child, world[index]) for child in nodes[index].get("children", [])]
        return world

    def sample(self, sampler, path, time):
        """Returns the value of an animation's sampler."""
        times = self.accessor(sampler["input"]).ravel().astype(float)
        keys = self.accessor(sampler["output"]).astype(float)
        kind = sampler.get("interpolation", "LINEAR")
        value = (lambda k: keys[3 * k + 1]) if kind == "CUBICSPLINE" else (lambda k: keys[k])
        k = int(np.searchsorted(times, time, side="right")) - 1
        if k < 0 or k >= len(times) - 1 or kind == "STEP":
            found = value(min(max(k, 0), len(times) - 1))
        else:
            span = times[k + 1] - times[k]
            u = (time - times[k]) / span
            a, b = value(k), value(k + 1)
            if kind == "CUBICSPLINE":
                out, into = keys[3 * k + 2] * span, keys[3 * (k + 1)] * span
                found = (2 * u**3 - 3 * u**2 + 1) * a + (u**3 - 2 * u**2 + u) * out
                found = found + (3 * u**2 - 2 * u**3) * b + (u**3 - u**2) * into
            elif path == "rotation":
                found = slerp(a, b, u)
            else:
                found = a + (b - a) * u
        return (found / np.linalg.norm(found) if path == "rotation" else found).tolist()


def slerp(a, b, u):
    cosine = a @ b
    if cosine < 0:
        b, cosine = -b, -cosine
    if cosine > 0.9999:
        return a + (b - a) * u
    angle = np.arccos(cosine)
    return (np.sin((1 - u) * angle) * a + np.sin(u * angle) * b) / np.sin(angle)


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


def matte(source, target):
    """Writes the scene with matte, opaque surfaces; non-emissive surfaces reflect on both sides."""
    glb = Glb(source)
    for material in glb.json.get("materials", []):
        pbr = material.setdefault("pbrMetallicRoughness", {})
        pbr.pop("metallicRoughnessTexture", None)
        color = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
        pbr |= {"metallicFactor": 0, "roughnessFactor": 1, "baseColorFactor": [min(c, LARGEST_ALBEDO) for c in color] + [1]}
        for name in ["normalTexture", "occlusionTexture", "alphaMode", "alphaCutoff"]:
            material.pop(name, None)
        kept = "KHR_materials_emissive_strength"
        material["extensions"] = {k: v for k, v in material.get("extensions", {}).items() if k == kept}
        material["doubleSided"] = material.get("doubleSided", False) or not any(material.get("emissiveFactor", []))
    known = ["KHR_materials_emissive_strength", "KHR_lights_punctual"]
    glb.json["extensionsUsed"] = [name for name in glb.json.get("extensionsUsed", []) if name in known]
    glb.write(target)


def reflectance(glb, material):
    """Returns a bilinear bitmap in linear light for a texture, else a color."""
    pbr = material.get("pbrMetallicRoughness", {})
    if pbr.get("metallicFactor", 1) != 0 or pbr.get("roughnessFactor", 1) != 1:
        raise ValueError(f"{material.get('name')} is not matte")
    factor = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
    texture = pbr.get("baseColorTexture")
    if texture is None:
        return {"type": "rgb", "value": factor}
    image = glb.json["images"][glb.json["textures"][texture["index"]]["source"]]
    code = np.asarray(Image.open(io.BytesIO(glb.view(image["bufferView"])[0])).convert("RGB"), np.float32) / 255
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4) * np.float32(factor)
    bitmap = mi.Bitmap(linear.astype(np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "repeat"}


def glass(material):
    """Returns the BSDF of a transparent volume; None for other materials."""
    extensions = material.get("extensions", {})
    factor = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0)
    if not factor:
        return None
    volume, pbr = extensions.get("KHR_materials_volume", {}), material.get("pbrMetallicRoughness", {})
    # Mitsuba's thin walls reflect repeatedly between both sides, and its surfaces do not attenuate inside.
    if factor != 1 or pbr.get("metallicFactor", 1) != 0 or not volume.get("thicknessFactor") or "attenuationDistance" in volume:
        raise ValueError(f"{material.get('name')} is not clear glass with a volume")
    # Each surface has the root of the base color.
    tint = np.sqrt(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]).tolist()
    bsdf = {"int_ior": extensions.get("KHR_materials_ior", {}).get("ior", 1.5), "ext_ior": 1.0}
    bsdf["specular_transmittance"] = {"type": "rgb", "value": tint}
    roughness = pbr.get("roughnessFactor", 1)
    if roughness == 0:
        return {"type": "dielectric"} | bsdf
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": roughness**2} | bsdf


def emission(material):
    if "emissiveTexture" in material:
        raise ValueError(f"the texture of {material.get('name')} glows")
    strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    return strength * np.array(material.get("emissiveFactor", [0, 0, 0]), float)


def shapes(name, glb, primitive, world, material, bsdf):
    """Returns the mesh of a primitive; two if it emits on both sides."""
    radiance = emission(material)
    # Mitsuba's area lights have one side: the other is a second, reversed mesh behind the first.
    backs = [False, True] if radiance.any() and material.get("doubleSided") else [False]
    return {f"{name}_{back}": shape(f"{name}_{back}", glb, primitive, world, bsdf, radiance, back) for back in backs}


def shape(name, glb, primitive, world, bsdf, radiance, is_back):
    attributes = primitive["attributes"]
    positions = glb.accessor(attributes["POSITION"]) @ world[:3, :3].T + world[:3, 3]
    faces = glb.accessor(primitive["indices"]) if "indices" in primitive else np.arange(len(positions))
    faces = faces.reshape(-1, 3)
    if np.linalg.det(world[:3, :3]) < 0:
        faces = faces[:, ::-1]
    if is_back:
        faces = faces[:, ::-1]
        a, b, c = positions[faces[0]]
        normal = np.cross(b - a, c - a)
        positions = positions + normal / np.linalg.norm(normal) * 1e-5 * np.abs(positions).max()
    props = mi.Properties()
    props["bsdf"] = bsdf
    props["face_normals"] = "NORMAL" not in attributes
    if radiance.any():
        props["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": radiance.tolist()}})
    has = {"has_vertex_normals": "NORMAL" in attributes, "has_vertex_texcoords": "TEXCOORD_0" in attributes}
    mesh = mi.Mesh(name, len(positions), len(faces), props, **has)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = positions.astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    if "NORMAL" in attributes:
        normals = glb.accessor(attributes["NORMAL"]) @ np.linalg.inv(world[:3, :3]) * (-1 if is_back else 1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
        parameters["vertex_normals"] = normals.astype(np.float32).ravel()
    if "TEXCOORD_0" in attributes:
        parameters["vertex_texcoords"] = glb.accessor(attributes["TEXCOORD_0"]).astype(np.float32).ravel()
    parameters.update()
    return mesh


def lamp(light, world):
    value = {"type": "rgb", "value": (np.array(light.get("color", [1, 1, 1]), float) * light.get("intensity", 1)).tolist()}
    if light["type"] == "point":
        return {"type": "point", "position": world[:3, 3].tolist(), "intensity": value}
    if light["type"] == "directional":
        return {"type": "directional", "direction": (-world[:3, 2]).tolist(), "irradiance": value}
    raise ValueError(f"a light of type {light['type']}")


def sensor(glb, node, world, width, height, sampler):
    lens = glb.json["cameras"][node["camera"]]["perspective"]
    rigid = world.copy()
    rigid[:3, :3] /= np.linalg.norm(rigid[:3, :3], axis=0)
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32"}
    return {
        "type": "perspective",
        "fov_axis": "y",
        "fov": float(np.degrees(lens["yfov"])),
        "near_clip": 1e-3,
        "far_clip": 1e5,
        # Mitsuba looks along +z with +x to the left.
        "to_world": mi.ScalarTransform4f(rigid @ np.diag([-1.0, 1.0, -1.0, 1.0])),
        "film": film | {"rfilter": {"type": "box"}},
        "sampler": {"type": sampler},
    }


def load(path, size, camera=None, time=0.0, roulette=5, sampler="multijitter"):
    """Returns the scene at `time` [s] as a picture of `size`, seen by the camera node of this name or by the first camera.

    Russian roulette starts after `roulette` reflections.
    """
    glb = Glb(path)
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": -1, "rr_depth": roulette}}
    bsdfs = {}
    for index, matrix in glb.matrices(time).items():
        node = glb.json["nodes"][index]
        for number, primitive in enumerate(glb.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []):
            chosen = primitive.get("material")
            material = glb.json["materials"][chosen] if chosen is not None else {}
            if chosen not in bsdfs:
                transparent = glass(material)
                bsdf = transparent or {"type": "diffuse", "reflectance": reflectance(glb, material)}
                both = material.get("doubleSided") and not transparent and not emission(material).any()
                bsdfs[chosen] = mi.load_dict({"type": "twosided", "bsdf": bsdf} if both else bsdf)
            scene |= shapes(f"shape_{index}_{number}", glb, primitive, matrix, material, bsdfs[chosen])
        light = node.get("extensions", {}).get("KHR_lights_punctual")
        if light is not None:
            scene[f"lamp_{index}"] = lamp(glb.json["extensions"]["KHR_lights_punctual"]["lights"][light["light"]], matrix)
        if "camera" in node and "sensor" not in scene and camera in (None, node.get("name")):
            scene["sensor"] = sensor(glb, node, matrix, *size, sampler)
    return mi.load_dict(scene)
