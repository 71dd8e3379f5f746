"""Renders a glTF model in our soft studio with Blender's Cycles, as linear OpenEXR; run by `peers`.

    python3 bench/cycles_still.py JOB

JOB is a JSON object, as in gltf_views.mjs, with paths (per pixel) and seed. OIDN has Blender's default settings.
Light and ground are from render-core/src/scene/studio.rs. Requires bpy from PyPI.
"""

import json
import math
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

# Azimuth and elevation [degrees], radiance and sharpness of the soft lamps.
LAMPS = [
    ((-48, 46), (3.4, 3.3, 3.15), 6),
    ((70, 20), (0.55, 0.58, 0.64), 6),
    ((155, 38), (3.0, 3.0, 3.1), 12),
]
ZENITH, HORIZON, BACKGROUND = (0.38, 0.39, 0.42), (0.24, 0.24, 0.25), (0.62, 0.63, 0.65)
# Azimuth of the default camera [degrees].
AZIMUTH = 25
COLUMNS = 256
# Side of the ground, and its distance below the model, in radii of the model.
GROUND, GAP = 16, 3e-5
# Maximum number of bounces. More change no picture.
BOUNCES = 32


def sky():
    """Returns the studio's light as an equirectangular image for Blender, and the albedo of the ground."""
    around = -2 * np.pi * ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5)
    above = np.pi * ((np.arange(COLUMNS // 2) + 0.5) / (COLUMNS // 2) - 0.5)
    above, around = np.meshgrid(above, around, indexing="ij")
    direction = np.stack([np.cos(above) * np.cos(around), np.cos(above) * np.sin(around), np.sin(above)], axis=-1)
    height = np.maximum(direction[..., 2:], 0)
    light = (1 - height) * np.array(HORIZON) + height * np.array(ZENITH)
    for (azimuth, elevation), radiance, sharpness in LAMPS:
        azimuth, elevation = math.radians(AZIMUTH + azimuth), math.radians(elevation)
        # Azimuth 0 is glTF's +z, which is Blender's −y.
        towards = (math.cos(elevation) * math.sin(azimuth), -math.cos(elevation) * math.cos(azimuth), math.sin(elevation))
        light += np.array(radiance) * np.exp(sharpness * (direction @ np.array(towards) - 1))[..., None]
    solid_angle = (2 * np.pi / COLUMNS) ** 2 * np.cos(above)[..., None]
    irradiance = (light * height * solid_angle).sum(axis=(0, 1))
    albedo = np.array(BACKGROUND) * np.pi / irradiance
    light[direction[..., 2] < 0] = BACKGROUND
    return light, albedo


def add_sky(light):
    """Sets the world's light. Cameras see the background's color."""
    image = bpy.data.images.new("sky", COLUMNS, COLUMNS // 2, float_buffer=True)
    texels = np.ones((COLUMNS // 2, COLUMNS, 4), np.float32)
    texels[..., :3] = light
    image.pixels.foreach_set(texels.ravel())
    world = bpy.context.scene.world = bpy.data.worlds.new("studio")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    texture, path, mix = (nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "LightPath", "MixShader"))
    texture.image = image
    seen, lit = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeBackground")
    seen.inputs["Color"].default_value = (*BACKGROUND, 1)
    links.new(texture.outputs["Color"], lit.inputs["Color"])
    links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    links.new(lit.outputs[0], mix.inputs[1])
    links.new(seen.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], nodes.new("ShaderNodeOutputWorld").inputs["Surface"])


def bounds():
    """Returns the lowest and highest coordinates of all evaluated meshes."""
    graph = bpy.context.evaluated_depsgraph_get()
    corners = []
    for item in graph.object_instances:
        if item.object.type == "MESH":
            corners += [item.matrix_world @ Vector(corner) for corner in item.object.bound_box]
    corners = np.array(corners)
    return corners.min(axis=0), corners.max(axis=0)


def add_ground(albedo):
    """Adds the ground below the model."""
    low, high = bounds()
    radius = float(np.linalg.norm(high - low)) / 2
    middle = (low + high) / 2
    bpy.ops.mesh.primitive_plane_add(size=GROUND * radius, location=(middle[0], middle[1], low[2] - GAP * radius))
    material = bpy.data.materials.new("ground")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    matte = nodes.new("ShaderNodeBsdfDiffuse")
    matte.inputs["Color"].default_value = (*albedo, 1)
    material.node_tree.links.new(matte.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    bpy.context.object.data.materials.append(material)


def add_camera(job):
    """Adds the camera. Blender's axes x, y, z are glTF's x, −z, y."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle = "HORIZONTAL", 2 * math.atan(1 / job["projection"][0])
    data.clip_start, data.clip_end = 1e-6, 1e9
    camera = bpy.data.objects.new("camera", data)
    camera_from_world = Matrix([job["camera_from_world"][line::4] for line in range(4)])
    camera.matrix_world = Matrix.Rotation(math.pi / 2, 4, "X") @ camera_from_world.inverted()
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def main():
    """Loads, furnishes and renders the model."""
    job = json.loads(sys.argv[1])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=job["file"])
    scene, render = bpy.context.scene, bpy.context.scene.render
    scene.frame_set(0)
    light, albedo = sky()
    add_sky(light)
    add_ground(albedo)
    add_camera(job)

    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = job["width"], job["height"]
    settings = scene.cycles
    settings.samples, settings.use_adaptive_sampling = job["paths"], False
    settings.use_denoising, settings.seed = True, job["seed"]
    for kind in ("max", "diffuse", "glossy", "transmission", "transparent_max"):
        setattr(settings, f"{kind}_bounces", BOUNCES)
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath = job["output"]
    bpy.ops.render.render(write_still=True)


main()
