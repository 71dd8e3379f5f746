"""A small glTF room with coated surfaces, for `bits`. No shipped scene has coats.

A glossy floor, a metal ball, a lacquered ball and a half-transparent screen, below one lamp.
The camera moves, and optionally the lacquered ball.
"""

import base64
import json
import math
import struct

# Rotations that turn the quad's front from +z to another axis.
H = math.sqrt(0.5)
UP, DOWN, RIGHT, LEFT, FRONT = (-H, 0, 0, H), (H, 0, 0, H), (0, H, 0, H), (0, -H, 0, H), (0, 0, 0, 1)
# Name: base color, metalness, roughness, emission, opacity.
MATERIALS = {
    "plaster": ((0.7, 0.7, 0.7), 0, 1, 0, 1),
    "red": ((0.6, 0.1, 0.1), 0, 1, 0, 1),
    "tiles": ((0.3, 0.35, 0.4), 0, 0.3, 0, 1),
    "gold": ((0.9, 0.7, 0.3), 1, 0.25, 0, 1),
    "lacquer": ((0.1, 0.3, 0.2), 0, 0.1, 0, 1),
    "gauze": ((0.8, 0.8, 0.6), 0, 1, 0, 0.5),
    "lamp": ((0, 0, 0), 0, 1, 12, 1),
}
# Shape, material, position, scale, rotation.
OBJECTS = [
    ("quad", "tiles", (0, 0, 0), 2, UP),
    ("quad", "plaster", (0, 2, 0), 2, DOWN),
    ("quad", "red", (-1, 1, 0), 2, RIGHT),
    ("quad", "plaster", (1, 1, 0), 2, LEFT),
    ("quad", "plaster", (0, 1, -1), 2, FRONT),
    ("quad", "lamp", (0, 1.99, 0), 0.6, DOWN),
    ("quad", "gauze", (0.5, 0.4, 0.5), 0.7, FRONT),
    ("ball", "gold", (-0.4, 0.4, -0.3), 0.4, FRONT),
    ("ball", "lacquer", (0.4, 0.3, 0), 0.3, FRONT),
]
SHAPES = ["quad", "ball"]
MOVING_BALL, CAMERA = len(OBJECTS) - 1, len(OBJECTS)
# Start of each moving node, and its displacement in one second [m].
BEGIN = {MOVING_BALL: (0.4, 0.3, 0), CAMERA: (0, 1, 3.2)}
WAY = {MOVING_BALL: (0, 0.4, 0.2), CAMERA: (0.3, 0.1, -0.2)}
FLOATS, SHORTS = 5126, 5123


def quad():
    """Returns positions, normals and triangles of a square of side 1 that faces +z."""
    positions = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]
    return positions, [(0, 0, 1)] * 4, [(0, 1, 2), (0, 2, 3)]


def ball(rings=16, sectors=32):
    """Returns positions, normals and triangles of a ball of radius 1."""
    points = []
    for ring in range(rings + 1):
        polar = math.pi * ring / rings
        for sector in range(sectors + 1):
            around = 2 * math.pi * sector / sectors
            x, z = math.sin(polar) * math.cos(around), math.sin(polar) * math.sin(around)
            points.append((x, math.cos(polar), z))
    triangles = []
    for ring in range(rings):
        for sector in range(sectors):
            here = ring * (sectors + 1) + sector
            below = here + sectors + 1
            # At a pole, one of the two triangles has no area.
            triangles += [(here, here + 1, below)] * (ring > 0)
            triangles += [(here + 1, below + 1, below)] * (ring < rings - 1)
    return points, points, triangles


class Buffer:
    """The binary chunk of a glTF file, with its views and accessors."""

    def __init__(self):
        self.data, self.views, self.accessors = b"", [], []

    def add(self, rows, kind, component):
        """Appends rows of numbers, and returns the index of their accessor."""
        bounds = {}
        if component == FLOATS:
            # Bounds must be computed from the stored numbers.
            rows = [struct.unpack(f"<{len(row)}f", struct.pack(f"<{len(row)}f", *row)) for row in rows]
            bounds = {"min": list(map(min, zip(*rows))), "max": list(map(max, zip(*rows)))}
        letter = "f" if component == FLOATS else "H"
        packed = b"".join(struct.pack(f"<{len(row)}{letter}", *row) for row in rows)
        count = sum(map(len, rows)) if kind == "SCALAR" else len(rows)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(packed)})
        self.data += packed + b"\0" * (-len(packed) % 4)
        self.accessors.append(
            {"bufferView": len(self.views) - 1, "componentType": component, "count": count, "type": kind, **bounds}
        )
        return len(self.accessors) - 1


def material(name):
    """Returns a material of the file."""
    color, metallic, roughness, emission, opacity = MATERIALS[name]
    surface = {"baseColorFactor": [*color, opacity], "metallicFactor": metallic, "roughnessFactor": roughness}
    made = {"name": name, "pbrMetallicRoughness": surface}
    if emission:
        made["emissiveFactor"] = [1, 1, 1]
        made["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": emission}}
    if opacity < 1:
        made.update(alphaMode="BLEND", doubleSided=True)
    return made


def animation(buffer, moving):
    """Returns straight paths of one second for the moving nodes."""
    times = buffer.add([(0,), (1,)], "SCALAR", FLOATS)
    samplers, channels = [], []
    for node in moving:
        end = [begin + way for begin, way in zip(BEGIN[node], WAY[node])]
        samplers.append({"input": times, "output": buffer.add([BEGIN[node], end], "VEC3", FLOATS)})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": "translation"}})
    return {"name": "walk", "samplers": samplers, "channels": channels}


def primitives(buffer):
    """Returns the common properties of meshes, by shape."""
    for name, (positions, normals, triangles) in zip(SHAPES, (quad(), ball())):
        attributes = {"POSITION": buffer.add(positions, "VEC3", FLOATS), "NORMAL": buffer.add(normals, "VEC3", FLOATS)}
        yield name, {"attributes": attributes, "indices": buffer.add(triangles, "SCALAR", SHORTS)}


def write(path, ball_moves):
    """Writes the room as a self-contained .gltf file."""
    buffer = Buffer()
    shapes, names = dict(primitives(buffer)), list(MATERIALS)
    meshes, nodes = [], []
    for shape, surface, place, scale, rotation in OBJECTS:
        meshes.append({"primitives": [{**shapes[shape], "material": names.index(surface)}]})
        node = {"name": surface, "mesh": len(meshes) - 1, "translation": place}
        nodes.append({**node, "scale": [scale] * 3, "rotation": rotation})
    nodes.append({"name": "camera", "camera": 0, "translation": BEGIN[CAMERA]})
    walk = animation(buffer, [MOVING_BALL, CAMERA] if ball_moves else [CAMERA])
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer.data).decode()
    room = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [material(name) for name in names],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "animations": [walk],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data), "uri": uri}],
    }
    path.write_text(json.dumps(room))
